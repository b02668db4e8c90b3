"""Fits of the numbers that an effect draws anew in every record, together with all others."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.diagnosis.percussion.drawn_numbers import with_drawn
from picchio.diagnosis.percussion.fit import (
    HOPELESS,
    Fit,
    bounded_step,
    fit,
    prior_cost,
    prior_weights,
)
from picchio.diagnosis.percussion.latent import current_hidden, hidden_columns, with_hidden
from picchio.diagnosis.percussion.latent_start import blow_by_blow
from picchio.diagnosis.percussion.problem import Problem
from picchio.diagnosis.percussion.slopes import jacobian
from picchio.model import Effect

_ROUNDS = 6
_SHARES = (1.0, 0.5, 0.25, 0.1)
_CONVERGED = 1e-4
_SMALLEST = 1e-6  # of the singular values of what a record's blows can do


def fit_latent(
    problem: Problem, start: Fit, kind: type[Effect], target: str, rival: float = np.inf
) -> Fit:
    """Fit the hidden numbers of every record and the unknowns common to all.

    Blows' times are looked for blow by blow first, unless they are known in all of these records.
    Then all are moved at once, by Gauss and Newton's step, where that helps; else in turns. What
    stays far above the cost of a `rival` is given up.
    """
    if kind.name == "mains_hum":
        return _priced_hum(problem, start, target)
    here = start
    jitter = kind.name == "pulse_jitter"
    known_in = set(current_hidden(start.hypothesis, kind.name))
    if jitter and not {r.name for r in start.records} <= known_in:
        begun = blow_by_blow(problem, start, lambda old, late: with_hidden(old, kind, dict(late)))
        here = fit(problem, begun, start.records, start.end, iterations=2)
    for turn in range(_ROUNDS):
        before = here.cost
        if turn > 1 and before > HOPELESS * rival:
            break
        columns = hidden_columns(problem, here, kind)
        together = _together(problem, here, kind, columns) if jitter else None
        here = together or _in_turns(problem, here, kind, columns)
        if (turn or together) and before - here.cost < _CONVERGED * here.cost:
            break
    return _told_times(here, kind, columns) if jitter else _told_share(here, kind)


def _told_times(here: Fit, kind: type[Effect], columns: Sequence[FloatArray]) -> Fit:
    """With the width of the blows' times, without what noise adds to it, and what they cost."""
    known = _numbers(here, kind)
    moved, fall, count = 0.0, 0.0, 0
    for record, own in zip(here.records, columns, strict=True):
        numbers = known[record.name][1 : 1 + own.shape[1]]
        moved += float(numbers @ numbers)
        fall += float(((own @ numbers) ** 2).sum())
        count += own.shape[1]
    std = math.sqrt(moved / max(count, 1) * max(1.0 - count / max(fall, 1e-300), 0.0))
    return _priced(_with_own(here, kind, std=std), f"{kind.name}:tool", fall, count)


def _told_share(here: Fit, kind: type[Effect]) -> Fit:
    """With the share of the blows that are missing."""
    hidden = current_hidden(here.hypothesis, kind.name)
    numbers = np.concatenate([np.array(v)[1:] for v in hidden.values()])
    return _with_own(here, kind, fraction=float(numbers.mean()))


def _with_own(here: Fit, kind: type[Effect], **values: float) -> Fit:
    """With the effect's own parameter as its hidden numbers have it."""
    effects = tuple(
        e.with_values(**values) if e.name == kind.name else e for e in here.hypothesis.effects
    )
    return replace(here, hypothesis=replace(here.hypothesis, effects=effects))


def _priced_hum(problem: Problem, here: Fit, target: str) -> Fit:
    """With what the lines' sines and cosines cost, by how much chi-square falls by them."""
    label = f"mains_hum:{target}"
    effects = tuple(e for e in here.hypothesis.effects if e.label != label)
    without = problem.residuals(effects, here.records, here.end)
    fall = sum(float((r * r).sum()) for r in without) - here.chi_square
    return _priced(here, label, fall, 2 * len(here.records))


def _priced(here: Fit, label: str, fall: float, count: int) -> Fit:
    return replace(here, hypothesis=with_drawn(here.hypothesis, label, fall, count))


def _in_turns(
    problem: Problem, here: Fit, kind: type[Effect], columns: Sequence[FloatArray]
) -> Fit:
    """Hidden numbers first, record by record; then what is common to all."""
    known = _numbers(here, kind)
    largest = 0.45 * here.records[0].setup.blows.interval
    wanted = {}
    for record, residual, slopes in zip(here.records, here.residuals, columns, strict=True):
        numbers = known[record.name].copy()
        if slopes.shape[1]:
            numbers[1 : 1 + slopes.shape[1]] += np.linalg.lstsq(
                slopes, -residual.ravel(), rcond=_SMALLEST
            )[0]
        if kind.name == "pulse_jitter":
            wanted[record.name] = np.clip(numbers, -largest, largest)
        else:
            wanted[record.name] = np.round(np.clip(numbers, 0.0, 1.0))
    hidden = {name: tuple(numbers) for name, numbers in wanted.items()}
    if kind.name == "pulse_jitter":
        hidden = _shortened(problem, here, kind, known, wanted)
    hypothesis = with_hidden(here.hypothesis, kind, hidden)
    return fit(problem, hypothesis, here.records, here.end, iterations=2)


def _together(
    problem: Problem, here: Fit, kind: type[Effect], columns: Sequence[FloatArray]
) -> Fit | None:
    """One step of hidden and common numbers at once; None where it does not help.

    What each record's hidden numbers can do is projected out first, so that the equations are no
    larger than the common unknowns (Golub and Pereyra, doi:10.1137/0710036).
    """
    unknowns = here.hypothesis.unknowns()
    if not unknowns:
        return None
    slopes = jacobian(problem, here.hypothesis, here.records, here.end, here.residuals)
    vector, weights = here.hypothesis.vector(), prior_weights(here.hypothesis)
    means = np.array([u.prior[0] if u.prior else 0.0 for u in unknowns])
    normal = np.diag(weights**2)
    gradient = weights**2 * (vector - means)
    for residual, common, own in zip(here.residuals, slopes, columns, strict=True):
        alive = np.linalg.norm(own, axis=0) > 0.0
        basis = np.linalg.qr(own[:, alive])[0] if alive.any() else own[:, :0]
        free = common - basis @ (basis.T @ common)
        normal = normal + free.T @ free
        gradient = gradient + free.T @ residual.ravel()
    if not np.isfinite(normal).all():
        return None
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-12 * np.diag(normal).max() + 1e-300))
    lower, upper = np.array([u.lower for u in unknowns]), np.array([u.upper for u in unknowns])
    step = bounded_step(normal, gradient, scale, 1e-6, vector, lower, upper)
    known = _numbers(here, kind)
    largest = 0.45 * here.records[0].setup.blows.interval
    for share in _SHARES:
        hidden = {}
        for record, residual, common, own in zip(
            here.records, here.residuals, slopes, columns, strict=True
        ):
            numbers = known[record.name].copy()
            if own.shape[1]:
                right = -(residual.ravel() + common @ step)
                moved = np.linalg.lstsq(own, right, rcond=_SMALLEST)[0]
                numbers[1 : 1 + own.shape[1]] += share * moved
            hidden[record.name] = tuple(np.clip(numbers, -largest, largest))
        hypothesis = with_hidden(here.hypothesis.at(vector + share * step), kind, hidden)
        try:
            there = problem.residuals(hypothesis.effects, here.records, here.end)
        except InputError:
            continue
        cost = float(sum((r * r).sum() for r in there)) + prior_cost(hypothesis)
        if cost < here.cost:
            return replace(here, hypothesis=hypothesis, residuals=there, jacobians=None, cost=cost)
    return None


def _numbers(here: Fit, kind: type[Effect]) -> dict[str, FloatArray]:
    """Every record's hidden numbers, 0 where none are known."""
    current = current_hidden(here.hypothesis, kind.name)
    return {
        r.name: np.array(
            current.get(r.name, np.zeros(int(r.setup.blows.hit.max()) + 1)), dtype=float
        )
        for r in here.records
    }


def _shortened(
    problem: Problem,
    here: Fit,
    kind: type[Effect],
    known: dict[str, FloatArray],
    wanted: dict[str, FloatArray],
) -> dict[str, tuple[float, ...]]:
    """Each record's step to what is wanted, halved until it helps that record."""
    best = {name: tuple(numbers) for name, numbers in known.items()}
    before = {
        r.name: float((x * x).sum()) for r, x in zip(here.records, here.residuals, strict=True)
    }
    left = list(here.records)
    for share in _SHARES:
        trial = {
            r.name: tuple(known[r.name] + share * (wanted[r.name] - known[r.name])) for r in left
        }
        effects = with_hidden(here.hypothesis, kind, {**best, **trial}).effects
        there = problem.residuals(effects, left, here.end)
        worse = []
        for record, residual in zip(left, there, strict=True):
            if float((residual * residual).sum()) < before[record.name]:
                best[record.name] = trial[record.name]
            else:
                worse.append(record)
        left = worse
        if not left:
            break
    return best
