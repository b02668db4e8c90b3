"""How a linear system's motion changes with its matrices, to first order, without integrating.

In the modes of the state matrix A the response is a sum of y_k, y_k' = pole_k y_k + F. A change of
A, P in those modes, adds (y_j - y_i) / (pole_j - pole_i) for every pair of modes and dy_i/dpole_i
for every mode (Nelson, AIAA J. 14 (1976) 1201, doi:10.2514/3.7211, has the same for modes alone):
two series a mode serve every change there is; another force has series of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import ComplexArray, FloatArray, IndexArray
from picchio.excitation.piecewise import PiecewiseForce
from picchio.model.system import VibratingSystem
from picchio.vibration.integration.integrate import AtJumps, Plan, Samples, force_at

# Poles nearer to each other than this share are one: their difference quotient is a derivative.
_ALIKE = 1e-7


@dataclass(frozen=True, eq=False)
class MotionChanges:
    """Changes of a motion as weights on series.

    Attributes:
        series: (S, count) at the samples, which all changes share, or (changes, S, count).
        position, velocity, acceleration: (changes, N, S) weights, or (N, S) that all changes share:
            rad, rad/s, rad/s^2.
    """

    series: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


@dataclass(frozen=True, eq=False)
class _Modes:
    """A linear system in the modes of its state matrix.

    Attributes:
        inverse: (N, N) of the mass matrix.
        held: (N, 2N) M^-1 [K C].
        poles: (2N,) 1/s.
        modes, back: (2N, 2N) in columns, and the inverse.
        driven: (2N,) what the force does to each.
        kept: of a conjugate pair one is enough,
        twice: its real part as often as this.
    """

    inverse: FloatArray
    held: FloatArray
    poles: ComplexArray
    modes: ComplexArray
    back: ComplexArray
    driven: ComplexArray
    kept: IndexArray
    twice: FloatArray

    @classmethod
    def of(cls, system: VibratingSystem) -> _Modes | None:
        """None where a system is not linear or its modes are not independent."""
        if system.elements:
            return None
        n = len(system.coordinates)
        inverse = np.linalg.inv(system.mass)
        held = inverse @ np.hstack([system.stiffness, system.damping])
        state = np.block([[np.zeros((n, n)), np.eye(n)], [-held]])
        poles, modes = np.linalg.eig(state)
        if not np.isfinite(modes).all() or np.linalg.cond(modes) > 1e10:
            return None
        back = np.linalg.inv(modes)
        driven = back[:, n:] @ (inverse @ system.force)
        kept = np.flatnonzero(poles.imag >= 0.0)
        twice = np.where(poles[kept].imag > 0.0, 2.0, 1.0)
        return cls(inverse, held, poles, modes, back, driven, kept, twice)

    def series(self, plan: Plan, count: int) -> tuple[ComplexArray, ComplexArray, FloatArray]:
        """(m, count) what the modes that are kept answer, its change with the pole, the force."""
        from picchio.vibration.integration.series_kernel import modal_series

        y = np.zeros((count, self.kept.size), dtype=complex)
        slope, pushed = np.zeros_like(y), np.zeros(count)
        modal_series(
            self.poles[self.kept], plan.lengths, plan.force0, plan.force1, plan.sample,
            plan.force_after, y, slope, pushed,
        )  # fmt: skip
        return y.T, slope.T, pushed

    def real(self, weights: ComplexArray) -> FloatArray:
        """(..., N, 2m) of weights (..., N, 2N) on the modes: on their real and imaginary parts."""
        one = weights[..., self.kept] * self.twice
        return np.concatenate([one.real, -one.imag], axis=-1)


@dataclass(frozen=True, eq=False)
class Strike:
    """One blow of a force.

    Attributes:
        shape: from its start on.
        start: s.
        height: times the shape.
    """

    shape: PiecewiseForce
    start: float
    height: float


def blow_changes(
    system: VibratingSystem,
    samples: Samples,
    at_jumps: AtJumps,
    changes: Sequence[Sequence[Strike]],
) -> MotionChanges | None:
    """A linear system's motion from rest under a few blows, exactly, for each of several changes.

    Args:
        system: the equations; its terms of second order are left out.
        samples: when. What a blow does before t = 0 is not felt.
        at_jumps: as in `integrate`.
        changes: the blows of each: those that come, and with a negative height those that go.

    Returns:
        one change each; None where a system is not linear or its modes are not independent.
    """
    modes = _Modes.of(system)
    if modes is None:
        return None
    n, poles = len(system.coordinates), modes.poles[modes.kept]
    decay = np.exp(np.outer(poles * samples.step, np.arange(samples.count)))
    series = np.zeros((len(changes), 2 * len(poles) + 1, samples.count))
    known: dict[tuple[bytes, float], FloatArray] = {}
    at_starts: dict[bytes, ComplexArray] = {}  # of each shape, whenever it strikes
    for own, strikes in zip(series, changes, strict=True):
        for strike in strikes:
            key = strike.shape.key, strike.start
            if key not in known:
                if key[0] not in at_starts:
                    at_starts[key[0]] = _at_starts(poles, strike.shape)
                y = _answer(poles, decay, strike, samples, at_starts[key[0]])
                force = force_at(strike.shape, strike.start, samples, at_jumps)
                known[key] = np.vstack([y.real, y.imag, force])
            own += strike.height * known[key]
    on = modes.modes * modes.driven
    none = np.zeros((n, 1))

    def weights(of: ComplexArray, straight: FloatArray = none) -> FloatArray:
        return np.hstack([modes.real(of), straight])

    moving = on[n:]
    at_once = moving.sum(axis=1).real[:, None]
    return MotionChanges(
        series, weights(on[:n]), weights(moving), weights(moving * modes.poles, at_once)
    )


def _at_starts(poles: ComplexArray, shape: PiecewiseForce) -> ComplexArray:
    """(m, pieces + 1) of y' = pole y + F from rest: where each piece begins, and the last ends."""
    after = [np.zeros(poles.size, complex)]
    for piece, span in enumerate(shape.duration):
        grown = after[-1] * np.exp(poles * span)
        after.append(grown + shape.convolve(poles, np.array([piece]), np.array([span]))[:, 0])
    return np.stack(after, axis=1)


def _answer(
    poles: ComplexArray,
    decay: ComplexArray,
    strike: Strike,
    samples: Samples,
    at_start: ComplexArray,
) -> ComplexArray:
    """(m, count) of y' = pole y + F from rest, F one blow of height 1.

    `decay` is (m, count), of each pole after so many samples; `at_start` as `_at_starts`.
    """
    shape = strike.shape

    def within(u: FloatArray) -> ComplexArray:
        piece = np.searchsorted(shape.start, u, side="right") - 1
        since = u - shape.start[piece]
        grown = at_start[:, piece] * np.exp(poles[:, None] * since)
        return np.asarray(grown + shape.convolve(poles, piece, since))

    y = np.zeros_like(decay)
    since = samples.times - strike.start
    begun = max(0.0, -strike.start)
    first, last = np.searchsorted(since, [begun, shape.end])
    y[:, first:last] = within(since[first:last])
    if last < samples.count:
        rest = at_start[:, -1] * np.exp(poles * (since[last] - shape.end))
        y[:, last:] = rest[:, None] * decay[:, : samples.count - last]
    if begun > 0.0 and first < samples.count:  # nothing moved before t = 0
        missed = within(np.array([begun]))[:, 0] * np.exp(poles * (since[first] - begun))
        y[:, first:] -= missed[:, None] * decay[:, : samples.count - first]
    return y


def motion_changes(
    system: VibratingSystem,
    plan: Plan,
    count: int,
    pairs: Sequence[tuple[VibratingSystem, VibratingSystem]],
    louder: FloatArray | None = None,
) -> MotionChanges | None:
    """By how much the motion from rest changes between systems that differ little.

    Args:
        system: about which; its terms of second order are left out.
        plan: the steps, as `follow` takes them.
        count: of samples.
        pairs: (before, after) of each change, with the same coordinates.
        louder: (changes,) by what share of the plan's the force changes as well.

    Returns:
        one change a pair; None where a system is not linear or its modes are not independent.
    """
    if any(s.coordinates != system.coordinates for p in pairs for s in p):
        return None
    of = _Modes.of(system)
    if of is None:
        return None
    n = len(system.coordinates)
    inverse, held, poles, modes, driven = of.inverse, of.held, of.poles, of.modes, of.driven
    back = of.back

    # What changes of M^-1 [K C] and of M^-1 b, and that in the modes.
    mass = np.array([after.mass - before.mass for before, after in pairs]).reshape(-1, n, n)
    springs = np.array([
        np.hstack([after.stiffness - before.stiffness, after.damping - before.damping])
        for before, after in pairs
    ]).reshape(-1, n, 2 * n)  # fmt: skip
    force = np.array([after.force - before.force for before, after in pairs]).reshape(-1, n)
    held_change = inverse @ (springs - mass @ held)
    push = (force - mass @ (inverse @ system.force)) @ inverse.T
    among = -back[:, n:] @ held_change @ modes

    apart = poles[None, :] - poles[:, None]  # [i, j]: pole_j - pole_i
    alike = np.abs(apart) < _ALIKE * np.abs(poles).max()
    quotient = np.where(alike, 0.0, among * driven / np.where(alike, 1.0, apart))
    weights = quotient.astype(complex)
    index = np.arange(2 * n)
    weights[:, index, index] += push @ back[:, n:].T - quotient.sum(axis=2)
    if louder is not None:
        weights[:, index, index] += louder[:, None] * driven
    on_series = modes @ weights
    on_slopes = modes @ np.where(alike, among * driven, 0.0)
    y, slope, pushed = of.series(plan, count)

    def rows(first: ComplexArray, second: ComplexArray, straight: FloatArray) -> FloatArray:
        return np.concatenate([of.real(first), of.real(second), straight], axis=-1)

    none = np.zeros((len(pairs), n, 1))
    moving, moving_slope = on_series[:, n:], on_slopes[:, n:]
    return MotionChanges(
        np.concatenate([y.real, y.imag, slope.real, slope.imag, pushed[None]]),
        rows(on_series[:, :n], on_slopes[:, :n], none),
        rows(moving, moving_slope, none),
        # y' = pole y + F, and (dy/dpole)' = pole dy/dpole + y.
        rows(moving * poles + moving_slope, moving_slope * poles,
             moving.sum(axis=2).real[..., None]),
    )  # fmt: skip
