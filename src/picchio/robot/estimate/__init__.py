"""What nobody gave of a robot, estimated: as a sidecar in memory, and as a file to edit."""
