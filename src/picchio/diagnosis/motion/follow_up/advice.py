"""What to measure next, to know more."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from picchio.diagnosis.motion.conclude.holdout import judged_groups
from picchio.diagnosis.motion.data.system import Group, System
from picchio.diagnosis.motion.fit.least_squares import Fit
from picchio.model.effects.registry import effect_class
from picchio.model.motion import TORQUE, WINDUP

Pair = tuple[str, str]


def next_measurement(
    system: System,
    current: Fit,
    noise: Mapping[Group, float],
    found_rivals: Mapping[int, Sequence[Pair]],
) -> dict[str, Any] | None:
    """The motion that would tell rivals apart, or that would show more of what is left.

    Args:
        system: the training equations.
        current: the fit.
        noise: group -> standard deviation.
        found_rivals: number of an effect -> what could not be told from it.
    """
    for index, others in found_rivals.items():
        effect = current.state.effects[index]
        if others:
            other = others[0]
            motion = _separating(system, effect.target, (effect.name, other[0]))
            return {"why": f"{effect.name} of {effect.target} and {other[0]} of {other[1]} "
                    f"explain these records alike: {motion}", "joint": effect.target,
                    "pose": {}}  # fmt: skip
    left = {g: current.level[g] / noise[g] for g in judged_groups(system, current)}
    worst = max(left, key=lambda g: left[g], default=None)
    if worst is None or left[worst] < 1.5:
        return None
    kind, joint = worst
    what = {TORQUE: "torque", WINDUP: "link less motor angle"}.get(kind, "torque ripple")
    motion = _separating(system, joint, ())
    return {"why": f"most is left in the {what} of {joint} ({left[worst]:.1f} times its noise): "
            f"{motion}", "joint": joint, "pose": {}}  # fmt: skip


def _separating(system: System, joint: str, names: tuple[str, ...]) -> str:
    """What this joint's motion lacks."""
    velocity = [
        p.nominal.velocity[joint] for p in system.predictors if joint in p.log.moving
    ]  # fmt: skip
    if not velocity:
        return "repeat the fastest record with more joints moving at once"
    v = np.concatenate(velocity)
    still = max(p.nominal.still.get(joint, 0.0) for p in system.predictors)
    forwards, backwards = np.mean(v > still), np.mean(v < -still)
    wishes = []
    if min(forwards, backwards) < 0.1:
        wishes.append("move it in both directions")
    moving = np.abs(v[np.abs(v) > still])
    if moving.size and np.quantile(moving, 0.9) < 3.0 * np.quantile(moving, 0.1):
        wishes.append("at several constant speeds, a tenth of the fastest among them")
    wishes += [effect_class(name).told_by for name in names]
    return (
        ", ".join(dict.fromkeys(wish for wish in wishes if wish))
        or "move it alone, slowly and fast, in both directions"
    )
