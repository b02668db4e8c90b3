"""Commands about the life of a robot, and what it depends on."""
