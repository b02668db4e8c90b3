"""Poses beyond the joints' limits: allowed, but told."""

from __future__ import annotations

import warnings
from collections.abc import Iterable

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import PicchioWarning
from picchio.robot import FlexibleRobot

# More than three turns either way is rather a pose in degrees.
_TURNS = 3.0


def warn_beyond_limits(robot: FlexibleRobot, poses: Iterable[FloatArray], what: str) -> None:
    """Warn of every joint that stands beyond its limits, and of what looks like degrees.

    Args:
        robot: whose limits count.
        poses: (nv,) each, rad or m.
        what: how to name them.
    """
    every = list(poses)
    beyond: dict[str, int] = {}
    for pose in every:
        for name in robot.limit_violations(pose):
            beyond[name] = beyond.get(name, 0) + 1
    far = max((float(np.abs(pose).max()) for pose in every if pose.size), default=0.0)
    hint = "; angles are in radians" if far > 2.0 * np.pi * _TURNS else ""
    for name, count in beyond.items():
        of = "" if len(every) == 1 else f" in {count} of {len(every)} poses"
        warnings.warn(
            f"{what}: {name} is beyond its limits{of}{hint}", PicchioWarning, stacklevel=3
        )
