"""Instrumental variables: least squares without what feedback and encoder noise do to it.

A measured motion is correlated with the measured torque's noise through the controller, and its
noise makes regressors too large. The commanded motion has neither: the same derivatives, taken
along `reference_position` (later by as much as the loop lags), are instruments Z, and
(Z^T X)^-1 Z^T y is consistent. Delays and orders are held at what the fit found: they are not
linear, and the command can't tell them.

Source: A. Janot, P.-O. Vandanjon, M. Gautier, IEEE Trans. Control Systems Technology 22(1), 2014.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.motion.data.system import System
from picchio.diagnosis.motion.fit.least_squares import Fit, difference, row_weights
from picchio.diagnosis.motion.fit.state import Coordinate, State
from picchio.model.motion import TORQUE
from picchio.prediction.motion.readings import Predictor

_LONGEST = 0.1  # s


@dataclass(frozen=True)
class Shift:
    """What instruments change of one fitted number.

    Attributes:
        effect: name, or "inertia".
        target: joint or other.
        parameter: its name.
        least_squares: the fitted value.
        instrumental: the value with instruments.
        std: standard deviation of the former.
    """

    effect: str
    target: str
    parameter: str
    least_squares: float
    instrumental: float
    std: float

    @property
    def significant(self) -> bool:
        """Whether the two differ by more than three standard deviations."""
        return abs(self.instrumental - self.least_squares) > 3.0 * self.std


def instrument_shifts(system: System, found: Fit) -> list[Shift]:
    """One step from a fit with the commanded motion as instruments.

    Only torques count, and only joints that were commanded in every record; others are left out.

    Args:
        system: the training equations.
        found: the fit.

    Returns:
        one entry a coordinate; empty where nothing was commanded.
    """
    logs = [
        replace(log, angle={**log.angle, **{
            j: _lagging(x, log.angle[j], log.rate) for j, x in log.reference.items()
            if j in log.angle
        }})
        for log in system.logs
    ]  # fmt: skip
    if not any(log.reference for log in logs):
        return []
    other = copy(system)
    other.predictors = [
        Predictor(system.robot, log, p.band) for log, p in zip(logs, system.predictors, strict=True)
    ]
    commanded = {j for log in logs for j in log.reference}
    rows = np.concatenate([
        np.arange(s.rows.start, s.rows.stop) for s in system.segments
        if s.group[0] == TORQUE and s.group[1] in commanded
    ] or [np.zeros(0, dtype=np.intp)])  # fmt: skip
    state = found.state
    predicted = other.predict(state.every, state.scales)
    kept, columns = [], []
    for i, c in enumerate(found.coordinates):
        if not np.any(found.columns[rows, i]) or _nonlinear(state, c):
            continue
        kept.append(i)
        columns.append(difference(other, state, c, predicted)[rows])
    if not kept:
        return []
    weight = row_weights(system, found.level)[rows]
    z = np.column_stack(columns) * weight[:, None]
    x = found.columns[rows][:, kept] * weight[:, None]
    scale = np.linalg.norm(x, axis=0)
    normal, right = z.T @ x, z.T @ (found.residual[rows] * weight)
    step = np.linalg.lstsq(normal / np.outer(scale, scale), right / scale, rcond=1e-8)[0] / scale
    shifts = []
    for i, change in zip(kept, step, strict=True):
        c = found.coordinates[i]
        effect = state.every[c.index] if c.index >= 0 else None
        shifts.append(Shift(
            effect.name if effect else "inertia", effect.target if effect else c.name, c.name,
            float(c.value), float(c.value + change), float(found.std[i]),
        ))  # fmt: skip
    return shifts


def _nonlinear(state: State, c: Coordinate) -> bool:
    return c.index >= 0 and (state.every[c.index].late or state.every[c.index].periodic)


def _lagging(reference: FloatArray, angle: FloatArray, rate: float) -> FloatArray:
    """The command, later by the lag at which it is most like the motion."""
    most = max(1, int(_LONGEST * rate))
    inner = slice(most, -most)
    lags = np.arange(most)
    miss = [float(np.sum((np.roll(reference, lag)[inner] - angle[inner]) ** 2)) for lag in lags]
    lag = int(np.argmin(miss))
    return np.concatenate([np.full(lag, reference[0]), reference[: reference.size - lag]])
