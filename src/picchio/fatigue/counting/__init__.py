"""Counting stress cycles by rainflow."""
