"""Motion records as equations, and their noise."""
