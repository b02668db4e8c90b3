"""Effects on the blows: when, how hard, how long, which way."""
