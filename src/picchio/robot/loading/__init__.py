"""From what a user calls a robot to a `FlexibleRobot`."""
