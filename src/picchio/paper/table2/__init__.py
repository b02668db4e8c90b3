"""Table 2: what its numbers follow from."""
