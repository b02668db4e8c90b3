"""The search for causes: candidates, selection, alternatives."""
