"""When something may be said: noise, equivalence, identifiability, consistency between poses."""
