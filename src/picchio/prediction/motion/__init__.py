"""What drives and encoders should have read while the robot moved."""

from __future__ import annotations

from picchio.prediction.motion.filters import Band, choose_cutoff
from picchio.prediction.motion.log import MotionLog, read_log, read_logs
from picchio.prediction.motion.readings import Around, Predictor, Readings
from picchio.prediction.motion.rigid import rigid_motion

__all__ = [
    "Around",
    "Band",
    "MotionLog",
    "Predictor",
    "Readings",
    "choose_cutoff",
    "read_log",
    "read_logs",
    "rigid_motion",
]
