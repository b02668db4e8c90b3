"""What is never exact: how it moves every record, and likelihoods with it integrated out."""
