"""Effects that show while the robot moves: friction, ripple, delays."""
