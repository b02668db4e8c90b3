"""Commands that print what picchio knows: robots, effects, file formats, the paper."""
