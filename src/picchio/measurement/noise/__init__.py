"""The noise of every channel, estimated without a model of the robot."""
