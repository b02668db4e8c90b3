"""Trials of an effect made smaller or larger."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from picchio.model import Effect


def moves_one_each(trials: Sequence[Effect]) -> bool:
    """Whether the trials move one parameter each, as a vector's components."""
    moved = [tuple(p.name for p in t.parameters if t.values[p.name] != p.neutral) for t in trials]
    return len(trials) > 1 and len(set(moved)) == len(moved) and all(len(m) == 1 for m in moved)


def acts_either_way(kind: type[Effect], faint: bool) -> bool:
    """Whether an effect may have either sign; a `faint` factor acts as a difference does."""
    return all(
        (p.neutral == 0.0 and p.lower < 0.0) or (faint and p.neutral == 1.0 and p.logarithmic)
        for p in kind.parameters
    )


def smallest(trials: Sequence[Effect]) -> Effect:
    """Of trials of an effect of one parameter, that which is nearest to doing nothing."""

    def size(trial: Effect) -> float:
        (p,) = trial.parameters
        value = trial.values[p.name]
        return abs(math.log(value)) if p.logarithmic and p.neutral == 1.0 else abs(value)

    return min(trials, key=size)


def scaled(trial: Effect, weight: float, signed: bool) -> Effect:
    """The trial made larger or smaller as the residual asks."""
    size = float(np.clip(abs(weight), 0.05, 8.0))
    return bounded(trial, resized(trial, math.copysign(size, weight) if signed else size))


def resized(trial: Effect, size: float) -> dict[str, float]:
    """A trial's values with its distance from doing nothing so many times as large."""
    values = dict(trial.values)
    for p in trial.parameters:
        value = values[p.name]
        if value == p.neutral or not math.isfinite(value):
            continue
        if p.neutral == 0.0 and not p.logarithmic:
            new = value * size
        elif p.neutral == 1.0 and p.logarithmic:
            new = math.exp(math.log(value) * float(np.clip(size, -3.0, 3.0)))
        elif math.isinf(p.neutral) and p.name in ("stiffness", "limit"):
            new = value / size if p.name == "stiffness" else value
        else:
            continue
        values[p.name] = min(max(new, p.lower), p.upper)
    return {p.name: values[p.name] for p in trial.parameters if values[p.name] != p.neutral}


def bounded(trial: Effect, values: dict[str, float]) -> Effect:
    """The effect with values brought within their bounds."""
    bounds = {p.name: (p.lower, p.upper) for p in trial.parameters}
    inside = {k: min(max(v, bounds[k][0]), bounds[k][1]) for k, v in values.items()}
    return type(trial)(trial.target, **inside)
