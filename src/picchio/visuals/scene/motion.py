"""The vibration that the page animates: g_j(t) of every joint, and its exaggeration."""

from __future__ import annotations

from typing import Any

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.studies.envelopes import DirectionEnvelope
from picchio.visuals.plots.style import direction_label

_MOST_SAMPLES = 1600
_SAMPLES_PER_CYCLE = 12
_SHOWN_SHARE = 0.05
"""The tool's largest displacement is drawn this large, as a share of the robot."""


def vibration(
    robot: FlexibleRobot,
    envelope: DirectionEnvelope,
    reach: float,
    direction: FloatArray | None,
    chosen: int,
) -> dict[str, Any]:
    """Samples and choices of the animation.

    Args:
        robot: for its tool's Jacobian.
        envelope: at the pose, with the response.
        reach: m, size of the robot.
        direction: (3,) of the task's force, or None.
        chosen: joint whose worst direction comes first where there is no task.

    Returns:
        "samples" (n, 3, k) rad, "step" s, "directions" [{"text", "along"}], "factor" (how much
        the deflections are exaggerated at first) and "slow" (seconds of show per second).
    """
    response = envelope.response
    poles = response.modes.poles
    if response.periodic:
        end = float(response.force.end)
    else:
        last = float(response.force.start[-1])
        slowest = -float(poles.real.max())
        end = min(response.horizon, last + 3.0 / slowest)
    fastest = float(np.abs(poles).max()) / (2.0 * np.pi)
    count = int(np.clip(end * fastest * _SAMPLES_PER_CYCLE, 200, _MOST_SAMPLES))
    step = end / count
    samples = response.unit_deflection(np.arange(count) * step)
    offered = [] if direction is None else [("the task's", direction)]
    for k in [chosen, *(k for k in range(len(envelope.joint_names)) if k != chosen)]:
        offered.append((f"worst for {envelope.joint_names[k]}", envelope.worst_direction[k]))
    offered.append(("worst for the tool", envelope.worst_tool_direction))
    directions = [
        {"text": f"{words}, {direction_label(along)}", "along": along.tolist()}
        for words, along in offered
    ]
    first = np.asarray(directions[0]["along"])
    jacobian = robot.state(envelope.pose).jacobian
    tool = np.linalg.norm(jacobian @ np.einsum("ndk,d->nk", samples, first), axis=0).max()
    # The slowest mode at about one cycle a second.
    slow = float(np.clip(float(np.abs(poles).min()) / (2.0 * np.pi), 1.0, 200.0))
    return {"samples": samples, "step": step, "directions": directions,
            "factor": exaggeration(float(tool), reach), "slow": _round(slow)}  # fmt: skip


def exaggeration(tool: float, reach: float) -> float:
    """How much to exaggerate a motion that moves the tool by so many metres."""
    return _round(_SHOWN_SHARE * reach / tool) if tool > 0.0 else 1.0


def _round(value: float) -> float:
    """To 1, 2 or 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * min((1.0, 2.0, 5.0, 10.0), key=lambda m: abs(np.log(value / power / m))))
