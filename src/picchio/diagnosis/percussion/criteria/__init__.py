"""When a cause may be claimed: whiteness, equivalence, identifiability, pose consistency."""
