"""Stresses of Table 2 as a function of a few numbers: the inputs that the paper leaves open."""

from __future__ import annotations

from collections.abc import Sequence
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

    def deflections(self, v: FloatArray, printed: Printed) -> FloatArray:
        """The deflections (..., 3 directions, k rivets, 3 joints), rad; NaN where out of reach.

        Args:
            v: (..., unknowns) of the fit: many worlds at once take little longer than one.
            printed: what the paper prints.
        """
        worlds = [self.base.but(**decode(x)) for x in v.reshape(-1, v.shape[-1])]
        poses = poses_at(np.array([rivet_points(given) for given in worlds]), self.base.elbow)
        within = ~np.isnan(poses).any(axis=(1, 2))
        rivets, joints = poses.shape[1:]
        found = np.full((len(worlds), len(printed.directions), rivets, joints), np.nan)
        if within.any():
            mass, jacobian = self.robot.mass_and_jacobian(poses[within].reshape(-1, joints))
            reached = [worlds[k] for k in np.flatnonzero(within)]
            extremes = steady_extremes(
                mass.reshape(-1, rivets, joints, joints), jacobian.reshape(-1, rivets, 3, joints),
                self.robot.stiffness, np.array([given.damping_ratio for given in reached]),
                [PulseTrain(printed.task.force, g.period, g.width) for g in reached],
                printed.directions,
            )  # fmt: skip
            found[within] = extremes[0] if self.measure == "peak" else extremes[1]
        return found.reshape(*v.shape[:-1], *found.shape[1:])


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
    damping_ratio: FloatArray,
    blows: Sequence[PulseTrain],
    directions: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Peak and range of the steady state by a Fourier sum: to 1 in 1000, for many trials.

    Args:
        mass: (w worlds, k, n, n).
        jacobian: (w, k, 3, n).
        stiffness: (n,).
        damping_ratio: (w,) of every mode.
        blows: w; the pulses.
        directions: (d, 3).

    Returns:
        largest magnitude, and crest less trough, each (w, d, k, n) rad.
    """
    root = np.linalg.inv(np.linalg.cholesky(mass))
    squared, vectors = np.linalg.eigh((root * stiffness) @ root.swapaxes(-1, -2))
    shapes = root.swapaxes(-1, -2) @ vectors
    push = directions @ (jacobian @ shapes)  # (w, k, d, modes)
    period = np.array([each.period for each in blows])
    wave = 2.0 * np.pi / period[:, None] * np.arange(_SAMPLES // 2)
    force = np.array([printed_series(each, _SAMPLES // 2 - 1) for each in blows])
    force[:, 1:] /= 2.0  # the other half stands at the negative frequencies
    wave, force = wave[:, None, None], force[:, None, None]
    ratio = np.asarray(damping_ratio)[:, None, None, None]
    gap = squared[..., None] - wave**2
    modal = force / (gap + (2j * ratio) * np.sqrt(squared)[..., None] * wave)
    history = np.fft.irfft(modal, n=_SAMPLES, axis=-1) * _SAMPLES  # (w, k, modes, samples)
    mixed = shapes[..., None, :, :] * push[..., None, :]  # (w, k, d, joints, modes)
    found = np.matmul(mixed.reshape(*mass.shape[:2], -1, len(stiffness)), history)
    high, low = _crest(found), -_crest(-found)
    shape = (*mass.shape[:2], len(directions), len(stiffness))
    peak = np.maximum(np.abs(high), np.abs(low)).reshape(shape)
    return np.moveaxis(peak, 2, 1), np.moveaxis((high - low).reshape(shape), 2, 1)


def _crest(history: FloatArray) -> FloatArray:
    """The top of the parabola through the highest sample and its neighbours."""
    top = history.argmax(axis=-1)[..., None]
    before, here, after = (
        np.take_along_axis(history, (top + step) % _SAMPLES, axis=-1)[..., 0] for step in (-1, 0, 1)
    )
    bend = 2.0 * here - before - after
    rise = (after - before) ** 2 / 8.0
    return np.asarray(here + np.divide(rise, bend, out=np.zeros_like(here), where=bend > 0.0))
