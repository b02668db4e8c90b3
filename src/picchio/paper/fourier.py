"""Eqs. 12 and 13 as printed, to compare with the exact solution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import ComplexArray, FloatArray
from picchio.excitation.pulse_train import PulseTrain
from picchio.paper.world import World
from picchio.studies.rivet.pose import ModelAtPose
from picchio.vibration.closed_form.response import Response

_HARMONICS = 4000


def printed_series(blows: PulseTrain, harmonics: int) -> ComplexArray:
    """Eq. 12: a0, then a_j - i b_j, (harmonics + 1,) N."""
    j = np.arange(1, harmonics + 1)
    share = blows.width / blows.period
    a = blows.force / (j * np.pi) * np.sin(2.0 * np.pi * j * share)
    b = blows.force / (j * np.pi) - blows.force / (j * np.pi) * np.cos(2.0 * np.pi * j * share)
    return np.concatenate([[blows.force * share], a - 1j * b])


def printed_force(blows: PulseTrain, harmonics: int, time: FloatArray) -> FloatArray:
    """Fig. 4 by eq. 12: the truncated series at times (k,) s, N."""
    terms = printed_series(blows, harmonics)
    wave = np.exp(2j * np.pi / blows.period * np.outer(np.arange(harmonics + 1), time))
    return np.asarray((terms @ wave).real)


def printed_response(
    omega: FloatArray, ratio: float, blows: PulseTrain, time: FloatArray, *, plain: bool
) -> FloatArray:
    """Eq. 13 for modes of unit mass and unit n_d: (modes, k).

    Args:
        omega: (modes,) rad/s.
        ratio: damping ratio.
        blows: the pulses.
        time: (k,) s.
        plain: the phase by a plain arctangent, as written; else by one of the full circle.
    """
    terms = printed_series(blows, _HARMONICS)
    j = np.arange(1, _HARMONICS + 1)
    a, b = terms[1:].real, -terms[1:].imag
    wave = 2.0 * np.pi / blows.period
    found = np.empty((len(omega), len(time)))
    for i, own in enumerate(omega):
        r = j * wave / own
        stiffness = own**2
        size = np.hypot(a, b) / stiffness / np.sqrt((1.0 - r**2) ** 2 + (2.0 * ratio * r) ** 2)
        if plain:
            with np.errstate(divide="ignore", invalid="ignore"):
                phase = np.arctan(2.0 * ratio * r / (1.0 - r**2)) + np.arctan(b / a)
            phase = np.nan_to_num(phase)
        else:
            phase = np.arctan2(2.0 * ratio * r, 1.0 - r**2) + np.arctan2(b, a)
        angle = np.outer(j * wave, time) - phase[:, None]
        found[i] = terms[0].real / stiffness + size @ np.cos(angle)
    return found


@dataclass(frozen=True, eq=False)
class PhaseCheck:
    """Eq. 13 with two arctangents, on the most stressed rivet of a world.

    Attributes:
        time: (k,) s, one period.
        exact: (k,) mrad; plain: (k,); right: (k,): the same joint by eq. 13.
        joint: index; the figure's labels.
        plain_error: of the peak, relative; right_error: likewise.
        plain_history: largest error over the exact peak.
    """

    time: FloatArray
    exact: FloatArray
    plain: FloatArray
    right: FloatArray
    joint: int
    plain_error: float
    right_error: float
    plain_history: float


def amplitude_and_phase(world: World) -> PhaseCheck:
    """Eq. 13's phase as written and as meant, against the exact steady state."""
    direction, rivet, joint = worst_of(world)
    n = world.printed.directions[direction]
    at = ModelAtPose(world.model, world.rivet_poses[rivet])
    modes = at.modes
    time = np.linspace(0.0, world.blows.period, 400, endpoint=False)
    exact = 1e3 * at.response(world.blows, None).deflection(time, n)[joint]
    push = modes.mode_shapes.T @ (at.linear.input_matrix @ n)
    omega = 2.0 * np.pi * modes.natural_frequencies
    ours = {
        plain: 1e3 * ((modes.mode_shapes[joint] * push) @ printed_response(
            omega, world.given.damping_ratio, world.blows, time, plain=plain))
        for plain in (True, False)
    }  # fmt: skip
    peak = np.abs(exact).max()
    return PhaseCheck(
        time, exact, ours[True], ours[False], joint,
        abs(float(np.abs(ours[True]).max() / peak) - 1.0),
        abs(float(np.abs(ours[False]).max() / peak) - 1.0),
        float(np.abs(ours[True] - exact).max() / peak),
    )  # fmt: skip


def worst_of(world: World) -> tuple[int, int, int]:
    """Direction, rivet and joint of the world's largest stress."""
    d, k, j = np.unravel_index(int(world.rivet_stress.argmax()), world.rivet_stress.shape)
    return int(d), int(k), int(j)


def worst_responses(world: World, hits: int) -> tuple[Response, Response, FloatArray, int]:
    """A rivet from rest and the steady state, the force's direction, and the joint, at the worst.

    For Fig. 8 and the transient.
    """
    direction, rivet, joint = worst_of(world)
    at = ModelAtPose(world.model, world.rivet_poses[rivet])
    rest, steady = at.response(world.blows, hits), at.response(world.blows, None)
    return rest, steady, world.printed.directions[direction], joint
