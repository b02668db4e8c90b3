"""Weighted least squares of motion records."""
