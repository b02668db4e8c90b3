"""Fitting a state to motion records: weighted least squares, ripple orders."""
