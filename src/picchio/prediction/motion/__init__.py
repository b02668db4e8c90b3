"""What drives and encoders should have read while the robot moved."""
