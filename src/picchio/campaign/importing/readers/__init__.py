"""Readers of foreign files: one a kind of file."""
