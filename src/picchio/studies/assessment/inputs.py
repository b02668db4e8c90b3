"""What entered an assessment, value by value, so that two results can say what differs."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from typing import Any

import numpy as np

from picchio.excitation.excitation import Excitation
from picchio.fatigue.sn.curve import SNCurve
from picchio.model.model import Model
from picchio.robot.drives.reducer import Reducer
from picchio.studies.tasks import Operation, Task


def inputs_of(
    model: Model,
    task: Task,
    curves: Iterable[SNCurve | None],
    reducers: Iterable[Reducer | None],
    **options: Any,
) -> dict[str, Any]:
    """Everything that an assessment used, SI.

    Args:
        model: the robot and its effects.
        task: as it was read: points have become poses.
        curves: S-N curves of the joints.
        reducers: of the joints.
        **options: of the method.

    Returns:
        robot, sidecar (joint, tool, gun, base: the values in use, wherever they are from), effects,
        task, options, sn_curves and reducers by name.
    """
    robot = model.robot
    tables = {"tool": robot.tool, "gun": robot.gun, "base": robot.mounting}
    return {
        "robot": {"name": robot.name, "urdf": robot.source.name, "joints": robot.joint_names},
        "sidecar": {
            "joint": {
                joint.name: vars(joint) | {"reducer": joint.reducer and joint.reducer.name}
                for joint in robot.flexible_joints
            },
            **{key: table.model_dump() if table else None for key, table in tables.items()},
        },
        "effects": [effect.to_dict() for effect in model.effects],
        "task": {op.name: _operation(op) for op in task.operations},
        "options": options
        | {
            "gravity_stiffness": model.gravity_stiffness,
            "gravity_balanced": model.gravity_balanced,
        },
        "sn_curves": {curve.name: curve.to_dict() for curve in curves if curve is not None},
        "reducers": {r.name: r.model_dump() for r in reducers if r is not None},
    }


def _operation(operation: Operation) -> dict[str, Any]:
    return vars(operation) | {"excitation": _blows(operation.excitation)}


def _blows(excitation: Excitation) -> dict[str, Any]:
    """Its numbers; a measured history stands in its own file, whose hash is in the provenance."""
    values = {f.name: getattr(excitation, f.name) for f in dataclasses.fields(excitation)}  # type: ignore[arg-type]
    plain = {key: value for key, value in values.items() if not isinstance(value, np.ndarray)}
    return {"kind": excitation.kind, **plain}
