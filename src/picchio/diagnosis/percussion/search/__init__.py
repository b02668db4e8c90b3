"""The search for causes: candidates, screening, trials, selection."""
