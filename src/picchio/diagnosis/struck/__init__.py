"""Percussion records as a likelihood."""
