"""Stresses of Table 2 as a function of a few numbers: the inputs that the paper leaves open."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.excitation.pulse_train import PulseTrain
from picchio.paper.arm import arm, poses_at, rivet_points
from picchio.paper.assumptions import Assumptions
from picchio.paper.fourier import printed_series
from picchio.paper.printed import Printed
from picchio.robot.flexible_robot import FlexibleRobot

BOUNDS = {
    "period": (0.02, 0.3), "duty": (0.02, 0.5), "damping_ratio": (0.003, 0.15),
    "panel_x": (0.3, 1.45), "panel_y": (-0.1, 1.0), "panel_z": (-0.3, 1.8), "pitch": (0.02, 0.35),
}  # fmt: skip
FREE = tuple(BOUNDS)
"""Fitted with every hypothesis, and the stress per twist, which is solved for: the same freedom."""
_LOG = ("period", "duty", "damping_ratio", "pitch")
_SAMPLES = 128


@dataclass(frozen=True)
class Place:
    """The choices that are not numbers: rows, elbow, the inertias' point, peak or range.

    Attributes:
        base: gives rows, columns, elbow and `inertia_about`, and what is not fitted.
        measure: of a steady state: its "peak", or its "range" from trough to crest.
    """

    base: Assumptions
    measure: str = "peak"

    @cached_property
    def robot(self) -> FlexibleRobot:
        """The arm; its damping and shafts are not used here."""
        return arm(self.base)

    def deflections(self, v: FloatArray, printed: Printed) -> FloatArray | None:
        """The deflections (3 directions, k rivets, 3 joints) rad; None where one is out of reach.

        Args:
            v: (unknowns,) of the fit.
            printed: what the paper prints.
        """
        given = self.base.but(**decode(v))
        poses = poses_at(rivet_points(given), given.elbow)
        if np.isnan(poses).any():
            return None
        mass, jacobian = self.robot.mass_and_jacobian(poses)
        blows = PulseTrain(printed.task.force, given.period, given.width)
        found = steady_extremes(
            mass, jacobian, self.robot.stiffness, given.damping_ratio, blows, printed.directions
        )
        return found[0] if self.measure == "peak" else found[1]


def encode(values: dict[str, float]) -> FloatArray:
    """A vector from values by name; sizes as logarithms."""
    return np.array([np.log(values[n]) if n in _LOG else values[n] for n in FREE])


def decode(v: FloatArray) -> dict[str, float]:
    """Values by name from a vector."""
    return {n: float(np.exp(x) if n in _LOG else x) for n, x in zip(FREE, v, strict=True)}


def limits() -> tuple[FloatArray, FloatArray]:
    """The least and the largest vector."""
    return (
        encode({name: low for name, (low, _) in BOUNDS.items()}),
        encode({name: high for name, (_, high) in BOUNDS.items()}),
    )


def steady_extremes(
    mass: FloatArray,
    jacobian: FloatArray,
    stiffness: FloatArray,
    damping_ratio: float,
    blows: PulseTrain,
    directions: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Peak and range of the steady state by a Fourier sum: to 1 in 1000, for many trials.

    Args:
        mass: (k, n, n).
        jacobian: (k, 3, n).
        stiffness: (n,).
        damping_ratio: of every mode.
        blows: the pulses.
        directions: (d, 3).

    Returns:
        largest magnitude, and crest less trough, each (d, k, n) rad.
    """
    root = np.linalg.inv(np.linalg.cholesky(mass))
    squared, vectors = np.linalg.eigh((root * stiffness) @ root.transpose(0, 2, 1))
    shapes = root.transpose(0, 2, 1) @ vectors
    push = directions @ (jacobian @ shapes)  # (k, d, modes)
    wave = 2.0 * np.pi / blows.period * np.arange(_SAMPLES // 2)
    force = printed_series(blows, _SAMPLES // 2 - 1)
    force[1:] /= 2.0  # the other half stands at the negative frequencies
    gap = squared[..., None] - wave**2
    modal = force / (gap + (2j * damping_ratio) * np.sqrt(squared)[..., None] * wave)
    history = np.fft.irfft(modal, n=_SAMPLES, axis=-1) * _SAMPLES  # (k, modes, samples)
    mixed = shapes[:, None] * push[:, :, None, :]  # (k, d, joints, modes)
    found = np.matmul(mixed.reshape(len(mass), -1, len(stiffness)), history)
    high, low = _crest(found), -_crest(-found)
    shape = (len(mass), len(directions), len(stiffness))
    peak = np.maximum(np.abs(high), np.abs(low)).reshape(shape)
    return np.moveaxis(peak, 1, 0), np.moveaxis((high - low).reshape(shape), 1, 0)


def _crest(history: FloatArray) -> FloatArray:
    """The top of the parabola through the highest sample and its neighbours."""
    rows, columns = np.indices(history.shape[:2])
    top = history.argmax(axis=-1)
    here = history[rows, columns, top]
    before, after = history[rows, columns, top - 1], history[rows, columns, (top + 1) % _SAMPLES]
    bend = 2.0 * here - before - after
    rise = (after - before) ** 2 / 8.0
    return np.asarray(here + np.divide(rise, bend, out=np.zeros_like(here), where=bend > 0.0))
