"""The search for causes: candidates, scores, ripple orders, selection."""
