"""Measured records in and out: campaigns, their channels and units, imports."""
