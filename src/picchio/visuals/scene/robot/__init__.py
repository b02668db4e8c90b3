"""The robot to draw: its meshes or a skeleton, and how its joints bend."""
