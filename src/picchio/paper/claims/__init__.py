"""The paper's claims, by subject. To add one: its sentence in `data/paper.toml`, its test here."""
