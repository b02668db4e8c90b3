"""Robots: URDF, annotation, sidecar, poses and inverse kinematics -> `FlexibleRobot`."""
