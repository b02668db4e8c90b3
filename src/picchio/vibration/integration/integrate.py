"""The motion of a system to second order, nonlinear elements included, at given sample times."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from picchio.core.arrays import BoolArray, FloatArray, IndexArray
from picchio.core.errors import InputError
from picchio.excitation.piecewise import PiecewiseForce
from picchio.model.system import ElementKind, VibratingSystem

# Longest steps, s: the linear part is exact, so these resolve only what comes on top.
SMOOTH_STEP = 1e-3
KINKED_STEP = 5e-4
STICKING_STEP = 4e-4
ROUGH_STEP = 2e-4
_EDGE = 1e-10
_ON = 1e-6  # of a step: a jump so near a sample is at it
AtJumps = Literal["after", "mean", "moments"]
Pushed = Callable[[FloatArray, float], FloatArray]
"""The force, N, so many s after some times."""
_GAUSS = 0.5 - np.sqrt(3.0) / 6.0
_SHOOTING = 40
_MASSLESS = "something that the model lets move has no mass"
_SHOOTING_TOLERANCE = 1e-7


@dataclass(frozen=True)
class Samples:
    """Uniform sample times: start + step k, k = 0 ... count - 1 (s)."""

    start: float
    step: float
    count: int

    @property
    def times(self) -> FloatArray:
        """(count,) s."""
        return self.start + self.step * np.arange(self.count)

    @property
    def last(self) -> float:
        """The time of the last, s."""
        return self.start + self.step * (self.count - 1)


@dataclass(frozen=True, eq=False)
class CoordinateMotion:
    """Motion of all coordinates at the sample times, each (count, N): rad, rad/s, rad/s^2."""

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


@dataclass(frozen=True, eq=False)
class Plan:
    """Steps between the samples that end where the force jumps."""

    step: float
    lengths: FloatArray
    regular: BoolArray
    same: IndexArray
    force0: FloatArray
    force1: FloatArray
    sample: IndexArray
    force_after: FloatArray

    def scaled(self, factor: float) -> Plan:
        """The same steps under a force so many times as large.

        Args:
            factor: of the force.
        """
        return replace(
            self,
            force0=factor * self.force0,
            force1=factor * self.force1,
            force_after=factor * self.force_after,
        )


def integrate(
    system: VibratingSystem,
    force: PiecewiseForce,
    samples: Samples,
    *,
    longest_step: float | None = None,
    at_jumps: AtJumps = "after",
) -> CoordinateMotion:
    """The system's motion from rest under a burst, or its steady motion under a periodic force.

    Args:
        system: the equations.
        force: an endless history from t = 0 (burst), or one period.
        samples: when; before t = 0 a burst finds the system at rest.
        longest_step: s; by default fine enough for what the system holds.
        at_jumps: the acceleration at a jump of the force: "after", "mean" of before and after, or,
            for a filter that takes straight lines between the samples and lets no jump through,
            accelerations beside the jump by which its response is right ("moments"; see
            `jump_corrections`).

    Returns:
        the motion at the samples.

    Raises:
        InputError: a periodic motion that does not settle.
    """
    longest = longest_step or default_step(system)
    if np.isfinite(force.end):
        try:
            return _periodic(system, force, samples, longest, at_jumps)
        except np.linalg.LinAlgError:
            raise InputError(_MASSLESS) from None
    return follow(system, make_plan(force, samples, longest, at_jumps=at_jumps), samples.count)


def follow(system: VibratingSystem, plan: Plan, count: int) -> CoordinateMotion:
    """The system's motion from rest along a burst's steps.

    Args:
        system: the equations.
        plan: made by `make_plan`, with a step no longer than `default_step`.
        count: of samples.
    """
    try:
        return _run(system, plan, count, _rest(system))[0]
    except np.linalg.LinAlgError:
        raise InputError(_MASSLESS) from None


def default_step(system: VibratingSystem) -> float:
    """How fine the steps should be, s."""
    kinds = [element.kind for element in system.elements]
    if ElementKind.BOUC_WEN in kinds:
        return ROUGH_STEP
    if ElementKind.COULOMB in kinds:
        return STICKING_STEP
    return KINKED_STEP if kinds else SMOOTH_STEP


def _rest(system: VibratingSystem) -> FloatArray:
    return np.zeros(2 * len(system.coordinates) + len(system.elements))


def make_plan(
    force: PiecewiseForce,
    samples: Samples,
    longest: float,
    until: float | None = None,
    *,
    at_jumps: AtJumps = "after",
) -> Plan:
    """Steps from t = 0 to the last sample (or `until`), split at the force's edges."""
    from picchio.vibration.integration.step_kernel import (
        force_beside,
        force_lines,
        merged,
        sample_numbers,
    )

    times = samples.times
    first = int(np.searchsorted(times, -_EDGE))
    times = times[first:]
    parts = max(1, int(np.ceil(samples.step / longest - 1e-9)))
    fine = samples.step / parts
    end = until if until is not None else (times[-1] if times.size else 0.0)
    back = int(np.floor((times[0] if times.size else 0.0) / fine + 1e-9))
    start = (times[0] if times.size else 0.0) - back * fine
    count = int(np.floor((end - start) / fine + 1e-6)) + 1
    edges = _edges(force, end)
    extra = np.sort(np.concatenate([[0.0, end], edges]))
    pieces = _pieces(force)
    points = merged(start, fine, max(count, 0), extra, end, _EDGE)
    lengths = np.diff(points)
    force0, force1 = force_lines(points, _GAUSS, *pieces)
    sample = sample_numbers(points, times, 2 * _EDGE, first)

    if at_jumps == "moments" and (stepped := force.stepped(samples.step)) is not force:
        edges, pieces = _edges(stepped, end), _pieces(stepped)

    def pushed(time: FloatArray, later: float) -> FloatArray:
        return np.asarray(force_beside(time, later, *pieces))

    after = _beside(pushed, points, at_jumps)
    if at_jumps == "moments":
        added = _moments(pushed, edges, samples, first)
        after = after + np.where(sample >= 0, added[np.maximum(sample, 0)], 0.0)
    regular = np.abs(lengths - fine) < 1e-9 * fine + 2 * _EDGE
    same = np.full(lengths.size, -1)
    same[~regular] = np.unique(np.round(lengths[~regular], 12), return_inverse=True)[1]
    return Plan(fine, lengths, regular, same, force0, force1, sample, force_after=after)


def force_at(
    shape: PiecewiseForce, start: float, samples: Samples, at_jumps: AtJumps
) -> FloatArray:
    """(count,) N, what one blow pushes at the samples, as the steps of `make_plan` have it.

    Args:
        shape: the blow.
        start: s, when it begins; before t = 0 nothing is felt.
        samples: when.
        at_jumps: as in `integrate`.
    """
    if at_jumps == "moments":
        shape = shape.stepped(samples.step)
    out = np.zeros(samples.count)
    ends = np.array([max(start, 0.0), start + shape.end])
    ends = np.floor((ends - samples.start) / samples.step).astype(int)
    low, high = np.clip(ends + np.array([-2, 4]), 0, samples.count)
    times = samples.times[low:high]

    def pushed(time: FloatArray, later: float) -> FloatArray:
        return np.where(time + later >= 0.0, shape(time + later - start), 0.0)

    after = _beside(pushed, times, at_jumps)
    first = int(np.searchsorted(times, -_EDGE))
    if at_jumps == "moments":
        edges = np.unique(np.maximum([*(start + shape.start), start + shape.end], 0.0))
        local = Samples(samples.start + low * samples.step, samples.step, times.size)
        after = after + _moments(pushed, edges, local, first)
    out[low + first : high] = after[first:]
    return out


def _beside(pushed: Pushed, points: FloatArray, at_jumps: AtJumps) -> FloatArray:
    """(K,) N just after each point, or the mean of both of its sides."""
    after = pushed(points, 2 * _EDGE)
    return after if at_jumps == "after" else 0.5 * (pushed(points, -2 * _EDGE) + after)


def _moments(pushed: Pushed, edges: FloatArray, samples: Samples, first: int) -> FloatArray:
    """(count,) N that samples beside jumps get more, by `jump_corrections`."""
    edges = edges.copy()  # the compiled code is made for arrays that can be written
    jumps = pushed(edges, 2 * _EDGE) - pushed(edges, -2 * _EDGE)
    return jump_corrections(samples.start, samples.step, samples.count, first, edges, jumps)


def jump_corrections(
    start: float, step: float, count: int, first: int, times: FloatArray, heights: FloatArray
) -> FloatArray:
    """What to add to samples of a history with jumps, of which one at a sample has its mean there.

    A filter that takes straight lines between samples (first-order hold) sees a jump as a ramp of
    one step, wherever within the step it is: its response then moves in stairs as the jump moves,
    by half a step of area. Three sample values around the jump, corrected so that area, first and
    second moment of the difference vanish, leave an error of third order in the step. The
    correction is continuous in the jump's time.

    Args:
        start: s, time of the first sample.
        step: s between samples.
        count: of the samples.
        first: the first sample that can be corrected.
        times: (m,) s, of the jumps.
        heights: (m,) of the jumps.

    Returns:
        (count,) in the unit of the heights.
    """
    found = np.zeros(count)
    place = (np.asarray(times) - start) / step
    centre = np.rint(place).astype(np.int64)
    delta = place - centre
    delta = np.where(np.abs(delta) < _ON, 0.0, delta)
    # Moments of the true step less those of the ramp, about the nearest sample, in steps.
    side = np.sign(delta)
    area = 0.5 * side - delta
    first_moment = 1.0 / 6.0 - 0.5 * delta**2
    second_moment = side / 12.0 - delta**3 / 3.0
    even = second_moment - area / 6.0
    left, right = 0.5 * (even - first_moment), 0.5 * (even + first_moment)
    middle = area - even
    # Where nothing stands on the left, two samples keep area and first moment: the first two.
    alone = centre - 1 < first
    beyond = centre < first  # the first is then one step right of where moments are taken
    two_middle = np.where(beyond, 0.0, area - first_moment)
    two_right = np.where(beyond, 2.0 * area - first_moment, first_moment)
    _add(found, centre - 1, heights * np.where(alone, 0.0, left))
    _add(found, centre, heights * np.where(alone, two_middle, middle))
    _add(found, centre + 1, heights * np.where(alone, two_right, right))
    _add(found, centre + 2, heights * np.where(beyond, first_moment - area, 0.0))
    found[:first] = 0.0
    return found


def _add(found: FloatArray, index: IndexArray, values: FloatArray) -> None:
    inside = (index >= 0) & (index < found.size)
    np.add.at(found, index[inside], values[inside])


def _pieces(force: PiecewiseForce) -> tuple[Any, ...]:
    """What the compiled code needs of a force."""
    return (force.start, force.end, force.constant, force.slope, force.amplitude,
            force.angular_frequency)  # fmt: skip


def _edges(force: PiecewiseForce, end: float) -> FloatArray:
    if not np.isfinite(force.end):
        return np.asarray(force.start)
    periods = int(np.floor(end / force.end + 1e-9)) + 1
    return (force.start + force.end * np.arange(periods)[:, None]).ravel()


def _run(
    system: VibratingSystem, plan: Plan, count: int, start: FloatArray
) -> tuple[CoordinateMotion, FloatArray]:
    from picchio.vibration.integration import integrate_kernel as kernel

    n = len(system.coordinates)
    x, v, a = (np.zeros((count, n)) for _ in range(3))
    end = np.empty(2 * n + len(system.elements))
    if plan.sample[0] >= 0:
        k = plan.sample[0]
        x[k], v[k] = start[:n], start[n : 2 * n]
        held = system.damping @ v[k] + system.stiffness @ x[k]
        a[k] = np.linalg.solve(system.mass, system.force * plan.force_after[0] - held)
    equations = (
        start[: 2 * n], system.mass, system.mass_gradient, system.gravity_curvature,
        system.damping, system.stiffness, system.force, system.force_gradient,
    )  # fmt: skip
    steps = (
        plan.step, plan.lengths, plan.regular, plan.same, plan.force0, plan.force1,
        plan.sample[1:], plan.force_after[1:],
    )  # fmt: skip
    kinds = np.array([int(e.kind) for e in system.elements], dtype=np.int64)
    parameters = np.zeros((kinds.size, 6))
    for row, element in zip(parameters, system.elements, strict=True):
        row[: len(element.parameters)] = element.parameters
    elements = (kinds if kinds.size else None, parameters, system.rows, start[2 * n :])
    run = kernel.integrate_with_friction if ElementKind.COULOMB in kinds else kernel.integrate
    run(*equations, *elements, *steps, x, v, a, end)
    return CoordinateMotion(x, v, a), end


def _periodic(
    system: VibratingSystem,
    force: PiecewiseForce,
    samples: Samples,
    longest: float,
    at_jumps: AtJumps,
) -> CoordinateMotion:
    """Shooting for the state that repeats, with the linear system's own map as its Jacobian."""
    from picchio.vibration.integration.step_kernel import step_matrices

    period, n = force.end, len(system.coordinates)
    parts = int(np.ceil(period / longest))
    once = make_plan(force, Samples(0.0, period / parts, 1), longest, until=period)
    ik, ic = np.linalg.solve(system.mass, np.stack([system.stiffness, system.damping]))
    whole = step_matrices(ik, ic, period)[0]
    correction = np.linalg.inv(np.eye(2 * n) - whole)
    state = _rest(system)
    for _ in range(_SHOOTING):
        end = _run(system, once, 1, state)[1]
        move = correction @ (end[: 2 * n] - state[: 2 * n])
        state = np.concatenate([state[: 2 * n] + move, end[2 * n :]])
        if np.abs(move).max() <= _SHOOTING_TOLERANCE * np.abs(state[: 2 * n]).max() + 1e-300:
            break
    else:
        state = _settle(system, once, state)
    origin = samples.start
    if origin < -_EDGE:  # a steady record may begin before its t = 0
        shift = period * np.ceil(-origin / period)
        samples = Samples(origin + shift, samples.step, samples.count)
    plan = make_plan(force, samples, longest, at_jumps=at_jumps)
    return _run(system, plan, samples.count, state)[0]


def _settle(system: VibratingSystem, once: Plan, state: FloatArray) -> FloatArray:
    """Period after period until the motion repeats: for what shooting cannot find."""
    size = 2 * len(system.coordinates)
    for _ in range(2000):
        end = _run(system, once, 1, state)[1]
        if np.abs(end[:size] - state[:size]).max() <= 1e-6 * np.abs(end[:size]).max():
            return end
        state = end
    raise InputError("the motion under these blows does not become periodic")
