"""When a cause may be claimed: score on stretches left out, necessity, every record held out."""
