"""Diagnosis of motion records."""

from __future__ import annotations

from picchio.diagnosis.motion.diagnose import diagnose_motion

__all__ = ["diagnose_motion"]
