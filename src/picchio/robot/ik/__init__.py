"""Inverse kinematics: every branch of poses that put the tool on a point."""
