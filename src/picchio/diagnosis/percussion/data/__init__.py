"""Measured records beside their prediction, in units of their noise."""
