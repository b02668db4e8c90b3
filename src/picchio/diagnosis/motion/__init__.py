"""Diagnosis of motion records."""
