"""The robot as a vibrating system: what the solver gets."""
