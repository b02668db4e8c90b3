"""Fitting a hypothesis to records: unknowns, slopes, least squares."""
