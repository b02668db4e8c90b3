"""What every stage needs: errors, files, strict TOML, provenance."""
