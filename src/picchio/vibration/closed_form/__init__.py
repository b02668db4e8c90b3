"""Exact responses of linear systems, as sums of exponentials."""
