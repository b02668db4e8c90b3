"""What is said of the causes found: values, gain on held-out records, verdict."""
