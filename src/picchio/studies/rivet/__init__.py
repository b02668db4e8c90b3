"""What one rivet does to the joints: at a pose, at many poses, varied many times."""
