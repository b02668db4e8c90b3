"""Effects on what a sensor reads of the motion."""
