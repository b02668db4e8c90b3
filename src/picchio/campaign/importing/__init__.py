"""Records from other formats: UFF 58, MCAP, MATLAB, CSV, each with a mapping."""
