"""Drives: what a reducer's catalogue says of it."""
