"""The likelihood of percussion records, and its slopes."""
