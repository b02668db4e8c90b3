"""Search among sets of causes, by their evidence."""
