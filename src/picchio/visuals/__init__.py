"""What people look at: plots, the report, the 3-D scene. Nothing here computes a result."""
