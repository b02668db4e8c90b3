"""Where to put the work so that the robot lasts longest."""
