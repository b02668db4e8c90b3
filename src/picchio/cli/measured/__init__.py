"""Commands about measured data, and what a simulation gets wrong."""
