"""Measured against simulated: two ghosts of the robot that play the two deflection histories."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.excitation.excitation import Excitation
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.visuals.plots.style import BLUE, VERMILION
from picchio.visuals.scene.build import build_scene
from picchio.visuals.scene.motion import exaggeration
from picchio.visuals.scene.scene import Scene

_MOST_SAMPLES = 4000

Histories = Mapping[str, ArrayLike] | ArrayLike


def compare_scene(
    robot: FlexibleRobot,
    pose: ArrayLike,
    excitation: Excitation,
    time: ArrayLike,
    simulated: Histories,
    measured: Histories,
    **options: Any,
) -> Scene:
    """The scene with a blue ghost that moves as simulated and an orange one that moves as measured.

    Args:
        robot: the robot.
        pose: (nv,) rad or m.
        excitation: the blows, for the envelopes.
        time: (k,) s, ascending.
        simulated: deflections (n, k) of the flexible joints, rad or m, or {joint: (k,)}; joints
            left out and samples that are NaN stand still.
        measured: likewise.
        **options: of `build_scene`: hits, direction, joint, ...

    Raises:
        InputError: as `build_scene`; times or histories that do not fit, an unknown joint.
    """
    moments = np.asarray(time, dtype=float)
    if moments.ndim != 1 or len(moments) < 2 or not (np.diff(moments) > 0.0).all():
        raise InputError("must be at least two ascending numbers", key="time")
    given = {"simulated": simulated, "measured": measured}
    both = {name: _table(robot, each, len(moments), name) for name, each in given.items()}
    scene = build_scene(robot, pose, excitation, **options)
    count = min(len(moments), _MOST_SAMPLES)
    grid = np.linspace(moments[0], moments[-1], count)
    jacobian = robot.state(scene.envelope.pose).jacobian
    moved = max(float(np.linalg.norm(jacobian @ x, axis=0).max()) for x in both.values())
    scene.motion |= {
        "step": float(moments[-1] - moments[0]) / count,
        "samples": np.zeros((len(robot.flexible_joints), 3, count)),
        "factor": exaggeration(moved, scene.reach),
    }
    for (name, values), colour in zip(both.items(), (BLUE, VERMILION), strict=True):
        samples = np.array([np.interp(grid, moments, row) for row in values])
        scene.tracks.append({"layer": name, "text": name, "colour": colour, "samples": samples})
        scene.layers.append((name, f"{name}, as a ghost", True))
    # The robot itself stands still between its ghosts, and would hide them.
    scene.layers = [(i, text, on and i != "robot") for i, text, on in scene.layers]
    return scene


def _table(robot: FlexibleRobot, histories: Histories, count: int, key: str) -> FloatArray:
    names = robot.flexible_names
    if isinstance(histories, Mapping):
        values = np.zeros((len(names), count))
        for name, row in histories.items():
            if name not in names:
                raise InputError("no such flexible joint", key=key, value=name, choices=names)
            given = np.asarray(row, dtype=float)
            if given.shape != (count,):
                raise InputError(f"must have {count} samples", key=f"{key}.{name}",
                                 value=given.shape)  # fmt: skip
            values[names.index(name)] = given
    else:
        values = np.array(histories, dtype=float)
        if values.shape != (len(names), count):
            raise InputError(f"must be {len(names)} joints by {count} samples", key=key,
                             value=values.shape)  # fmt: skip
    if np.isinf(values).any():
        raise InputError("must be finite", key=key)
    return np.nan_to_num(values)
