"""What a URDF does not say: springs, shafts, tool; from a sidecar, annotations and other tags."""
