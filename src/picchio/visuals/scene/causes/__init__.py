"""A diagnosis in the scene: every cause drawn where it sits."""
