"""Rigid-body dynamics at a pose, by Pinocchio."""
