"""Load a robot by name or path as a `FlexibleRobot`."""
