"""Effects on the robot's equations of motion: masses, springs, dampers."""
