"""Diagnosis of percussion records: the robot stands, the tool hits, sensors read."""
