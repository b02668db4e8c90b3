"""When something may be said: equivalence, and every record held out."""
