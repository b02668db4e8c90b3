"""Effects that make the response no longer proportional to the force."""
