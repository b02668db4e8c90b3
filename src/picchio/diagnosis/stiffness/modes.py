"""Where to begin with frequency response functions, and whether another place is better.

A fit of the functions alone ends in the nearest basin. So the measured peaks of each pose are first
matched, by frequency and shape, with the modes of many springs drawn from the prior (Kuhn's
assignment; shapes by the modal assurance criterion, Allemang, Sound and Vibration 37 (2003) 14),
and the best are improved by Gauss-Newton on the logarithms of the frequencies, matched anew at
every step. A fit that stands is tried once more with each joint far from where it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.signal import find_peaks
from scipy.stats import qmc

from picchio.core.arrays import ComplexArray, FloatArray
from picchio.diagnosis.stiffness.fit import Fit, climb, score
from picchio.diagnosis.stiffness.responses import FrfProblem, Standing, natural

TAILS = 6.0
"""Degrees of freedom of the lines' errors."""
_LOOKS, _BASINS, _STRIDE, _GAIN = 3, 4, 0.12, 2.0  # at other basins; ln of stiffness; ln evidence
_WEAK, _MOVED = 0.04, 1.0  # deviation and move of the logarithm
_DRAWS = 2048
_REFINED, _KEPT = 12, 4
_OFF = 0.03  # of a measured frequency, by masses, damping and the grid of lines
_APART = 4.0  # squared deviations that shapes quite unlike cost
_UNMATCHED = 16.0  # squared deviations that a peak without a mode costs
_DEEP = 0.15  # of the logarithm (of ten): a peak stands so much above its surroundings


@dataclass(frozen=True, eq=False)
class Peaks:
    """The modes seen at one pose.

    Attributes:
        omega: (m,) rad/s.
        ratio: (m,) damping ratios, by half power; NaN where the peak's foot is not seen.
        shape: (m, functions) complex, of unit length: the functions there.
    """

    omega: FloatArray
    ratio: FloatArray
    shape: ComplexArray


def peaks(standing: Standing) -> Peaks:
    """The peaks of all functions of a pose together, as receptances that a mode lifts alike.

    Args:
        standing: the pose.

    Returns:
        as many as stand out.
    """
    low = max(one.omega[0] for one in standing.responses)
    high = min(one.omega[-1] for one in standing.responses)
    count = max(len(one) for one in standing.responses)
    omega = np.linspace(low, high, max(count, 8))
    every = np.array([
        np.interp(omega, one.omega, one.measured.real)
        + 1j * np.interp(omega, one.omega, one.measured.imag)
        for one in standing.responses
    ])  # fmt: skip
    size = np.linalg.norm(every, axis=0)
    # Each function's own peaks, too: one direction may see what the sum hides.
    found: set[int] = set()
    for curve in (size, *np.abs(every)):
        if len(standing.responses) > 1 and curve is not size and len(found) > 12:
            break
        level = np.log10(np.maximum(curve, 1e-12 * curve.max()))
        at, _ = find_peaks(level, prominence=_DEEP)
        for index in at:
            if all(abs(omega[index] / omega[k] - 1.0) > 0.03 for k in found):
                found.add(int(index))
    picked = np.array(sorted(found), dtype=int)
    ratio = np.array([_half_power(omega, size, k) for k in picked])
    shape = every[:, picked].T
    return Peaks(omega[picked], ratio, shape / np.linalg.norm(shape, axis=1, keepdims=True))


def _half_power(omega: FloatArray, size: FloatArray, peak: int) -> float:
    """The damping ratio from where the square of a peak is half as high."""
    level = size[peak] / np.sqrt(2.0)
    left = np.flatnonzero(size[:peak] < level)
    right = np.flatnonzero(size[peak:] < level)
    if not len(left) or not len(right):
        return float("nan")
    width = omega[peak + right[0]] - omega[left[-1]]
    return float(np.clip(width / (2.0 * omega[peak]), 1e-3, 0.3))


def starts(problem: FrfProblem, seed: int = 0) -> list[FloatArray]:
    """Where a fit may begin, the most promising first.

    Args:
        problem: what was measured.
        seed: of the draws.

    Returns:
        (p,) numbers each, see `FrfProblem`.
    """
    seen = [peaks(standing) for standing in problem.standings]
    n = problem.joints
    root = np.linalg.cholesky(problem.prior.covariance)
    uniform = qmc.Sobol(n, seed=seed).random(_DRAWS)
    drawn = _normal(uniform) @ root.T
    drawn[0] = 0.0
    price = np.zeros(_DRAWS)
    for standing, measured in zip(problem.standings, seen, strict=True):
        squared, shapes = natural(problem, standing, standing.spring * np.exp(drawn))
        for k in range(_DRAWS):
            price[k] += _match(standing, measured, squared[k], shapes[k])[0]
    price += np.einsum("kn,nm,km->k", drawn, np.linalg.inv(problem.prior.covariance), drawn)
    refined = [_improved(problem, seen, drawn[k]) for k in np.argsort(price)[:_REFINED]]
    refined.sort(key=lambda pair: pair[0])
    kept: list[FloatArray] = []
    ratios = np.concatenate([one.ratio for one in seen]) if seen else np.zeros(0)
    ratios = ratios[np.isfinite(ratios)]
    damping = np.log(np.median(ratios)) - np.log(problem.damping_ratio) if len(ratios) else 0.0
    for _, springs in refined:
        if all(np.abs(springs - one[:n]).max() > 0.05 for one in kept):
            at = np.zeros(len(problem.precision))
            at[:n] = springs
            at[n : 2 * n] = damping
            kept.append(at)
    return kept[:_KEPT]


def settled_elsewhere(problem: FrfProblem, fit: Fit) -> Fit:
    """The fit, or a better one far from it.

    Args:
        problem: what is fitted.
        fit: its best so far.
    """
    for _ in range(_LOOKS):
        better = _elsewhere(problem, fit)
        if better is None:
            break
        fit = better
    return fit


def _elsewhere(problem: FrfProblem, fit: Fit) -> Fit | None:
    """A better fit with one joint far from where it is; None where there is none.

    A joint that the functions hardly show may have ended at a false mode. Everything else held, its
    stiffness is tried over the whole prior; what looks better is fitted anew.
    """
    n = problem.joints
    held = problem.bare(fit.mean, problem.convention)
    here = fit.mean[: 2 * n]
    now = score(held, here, fit)
    tried: list[tuple[float, FloatArray]] = []
    for k in range(n):
        reach = 2.5 * problem.prior.std[k]
        grid = np.arange(-reach, reach + 1e-9, _STRIDE)
        places = np.tile(here, (len(grid), 1))
        places[:, k] = grid
        scores = np.array([score(held, place, fit) for place in places])
        inner = np.r_[False, (scores[1:-1] < scores[:-2]) & (scores[1:-1] <= scores[2:]), False]
        far = np.abs(grid - here[k]) > 2.0 * _STRIDE
        tried += [(float(scores[i]), places[i]) for i in np.flatnonzero(inner & far)]
    tried.sort(key=lambda pair: pair[0])
    for _, place in tried[:_BASINS]:
        found = climb(held, place, fit.tails)
        if score(held, found.mean, fit) < now - _GAIN:
            other = climb(problem, np.concatenate([found.mean, fit.mean[2 * n :]]), fit.tails)
            if other.evidence > fit.evidence + _GAIN:
                return other
    # Masses and places may have followed a false mode: with them free, what is told but not well.
    weak = (fit.std[:n] > _WEAK) & (fit.std[:n] < 0.5 * problem.prior.std)
    for k in np.flatnonzero(weak).tolist():
        for move in (-_MOVED, _MOVED):
            at = fit.mean.copy()
            at[k] += move
            if abs(at[k]) < 2.5 * problem.prior.std[k]:
                other = climb(problem, at, fit.tails)
                if other.evidence > fit.evidence + _GAIN:
                    return other
    return None


class Pair(NamedTuple):
    """A peak and the mode that it is.

    Attributes:
        measured, fitted: Hz.
        number: of the mode, by ascending frequency.
        mac: see `ModeSeen`.
        shape: (n,) of the mode.
    """

    measured: float
    fitted: float
    number: int
    mac: float
    shape: FloatArray


def paired(
    problem: FrfProblem, standing: Standing, springs: FloatArray, fitted: Sequence[ComplexArray]
) -> list[Pair]:
    """Peaks of a pose with the modes of a fit.

    Args:
        problem: whose pose it is, everything but springs and damping held.
        standing: the pose.
        springs: (n,) N m/rad.
        fitted: of each function its lines, as the fit has them.

    Returns:
        those that match to three times what peaks are off by.
    """
    measured = peaks(standing)
    squared, shapes = natural(problem, standing, springs)
    _, rows, columns = _match(standing, measured, squared, shapes)
    own = np.sqrt(np.maximum(squared, 0.0))
    found = []
    for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
        here, there = float(measured.omega[row]), float(own[column])
        if abs(np.log(here / max(there, 1e-9))) > 3.0 * _OFF:
            continue
        seen = measured.shape[row]
        like = np.array([
            np.interp(there, one.omega, lines.real) + 1j * np.interp(there, one.omega, lines.imag)
            for one, lines in zip(standing.responses, fitted, strict=True)
        ])  # fmt: skip
        mac = abs(np.vdot(seen, like)) ** 2 / max(float(np.vdot(like, like).real), 1e-300)
        told = float(mac) if len(seen) > 1 else float("nan")
        hertz = here / (2.0 * np.pi), there / (2.0 * np.pi)
        found.append(Pair(*hertz, column, told, shapes[:, column]))
    return found


def _normal(uniform: FloatArray) -> FloatArray:
    from scipy.special import ndtri

    return np.asarray(ndtri(np.clip(uniform, 1e-6, 1.0 - 1e-6)))


def _match(standing: Standing, measured: Peaks, squared: FloatArray, shapes: FloatArray
           ) -> tuple[float, np.ndarray, np.ndarray]:  # fmt: skip
    """What the best assignment of peaks to modes costs, and which they are."""
    if not len(measured.omega):
        return 0.0, np.zeros(0, int), np.zeros(0, int)
    omega = np.sqrt(np.maximum(squared, 1e-6))
    push = np.array([one.push for one in standing.responses]) @ shapes
    sight = np.array([one.sight for one in standing.responses]) @ shapes
    share = push * sight  # (functions, modes)
    size = np.linalg.norm(share, axis=0)
    like = np.abs(measured.shape.conj() @ (share / np.maximum(size, 1e-300))) ** 2
    off = (np.log(measured.omega)[:, None] - np.log(omega)[None]) / _OFF
    # What hardly moves in any function is no peak of theirs.
    hidden = np.clip(-2.0 * np.log10(np.maximum(size, 1e-300) / size.max()) - 3.0, 0.0, 9.0)
    cost = np.minimum(off**2 + _APART * (1.0 - like) + hidden[None], _UNMATCHED)
    rows, columns = linear_sum_assignment(cost)
    free = len(measured.omega) - len(rows)
    return float(cost[rows, columns].sum() + _UNMATCHED * free), rows, columns


def _improved(problem: FrfProblem, seen: list[Peaks], at: FloatArray) -> tuple[float, FloatArray]:
    """Gauss-Newton on the logarithms of matched frequencies, under the prior."""
    precise = np.linalg.inv(problem.prior.covariance)
    best = (np.inf, at)
    for _ in range(15):
        matrix, side = precise.copy(), -precise @ at
        price = float(at @ precise @ at)
        for standing, measured in zip(problem.standings, seen, strict=True):
            springs = standing.spring * np.exp(at)
            squared, shapes = natural(problem, standing, springs)
            cost, rows, columns = _match(standing, measured, squared, shapes)
            price += cost
            for row, column in zip(rows, columns, strict=True):
                off = np.log(measured.omega[row]) - 0.5 * np.log(squared[column])
                if abs(off) < 4.0 * _OFF * np.sqrt(_UNMATCHED):
                    slope = 0.5 * springs * shapes[:, column] ** 2 / squared[column]
                    matrix += np.outer(slope, slope) / _OFF**2
                    side += slope * off / _OFF**2
        if price < best[0]:
            best = (price, at)
        step = np.linalg.solve(matrix, side)
        at = at + step * min(1.0, 0.7 / max(float(np.abs(step).max()), 1e-9))
    return best
