"""What is said of the causes found."""
