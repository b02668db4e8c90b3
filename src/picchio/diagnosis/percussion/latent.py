"""Effects that draw numbers anew in every record: jitter, missed hits, the phase of the hum."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.diagnosis.percussion.drawn_numbers import drawn_cost
from picchio.diagnosis.percussion.fit import Fit, fit
from picchio.diagnosis.percussion.latent_start import blow_by_blow
from picchio.diagnosis.percussion.problem import Problem
from picchio.diagnosis.percussion.unknowns import Hypothesis
from picchio.model import Effect
from picchio.model.effects import effect_class

if TYPE_CHECKING:
    from picchio.diagnosis.percussion.screen import Projector, Suspect

LATENT = ("pulse_jitter", "missed_hits", "mains_hum")
_SHIFT = 2e-4  # s
_WEAKER = 0.2
_MAINS = (50.0, 60.0)
# Late blows that the screening tries.
_LOOKED_AT = 1.8


def latent_gain(
    problem: Problem,
    known: Fit,
    kind: type[Effect],
    target: str,
    project: Projector,
    left: FloatArray,
) -> Suspect:
    """How much of the residual the effect's hidden numbers could explain."""
    from picchio.diagnosis.percussion.screen import Suspect

    if kind.name == "mains_hum":
        best, gain = kind(target, amplitude=0.0, frequency=_MAINS[0]), 0.0
        for frequency in _MAINS:
            hum = kind(target, amplitude=0.0, frequency=frequency)
            there = problem.residuals(known.hypothesis.plus(hum).effects, known.records, known.end)
            fall = known.chi_square - sum(float((r * r).sum()) for r in there)
            if fall > gain:
                best, gain = hum, fall
        return _promise(best, gain, 2 * len(known.records), known.samples)
    start = kind(target)
    fall, numbers = 0.0, 0
    for residual, columns in zip(
        known.residuals, hidden_columns(problem, known, kind), strict=True
    ):
        if columns.shape[1] == 0:
            continue
        weights = np.linalg.lstsq(columns, -residual.ravel(), rcond=1e-6)[0]
        fall += float((residual**2).sum() - ((residual.ravel() + columns @ weights) ** 2).sum())
        numbers += columns.shape[1]
    if kind.name == "pulse_jitter" and known.end is not None:
        fall = max(fall, _late_share(problem, known, kind) * float(left @ left))
    if kind.discrete:
        return Suspect(start, fall, numbers, (start,))
    return _promise(start, fall, numbers, known.samples)


def _promise(start: Effect, fall: float, count: int, samples: int) -> Suspect:
    """A suspect with numbers that are drawn: they cost less than as many free ones."""
    from picchio.diagnosis.percussion.screen import Suspect

    cost = drawn_cost(fall, count, samples)
    return Suspect(start, fall, 1 + cost / math.log(max(samples, 2)), (start,))


def _late_share(problem: Problem, known: Fit, kind: type[Effect]) -> float:
    """What share of the residual the times of the first late blows explain.

    A blow that comes late by more than its own edges' width is not seen in any slope.
    """
    interval = min(r.setup.blows.interval for r in known.records)
    end = min((1 + _LOOKED_AT) * interval, known.end or math.inf)
    try:
        first = fit(problem, known.hypothesis, known.records, end, iterations=3)
        early = replace(first, end=end)
        begun = blow_by_blow(problem, early, lambda old, late: with_hidden(old, kind, dict(late)))
        late = fit(problem, begun, known.records, end, iterations=2)
    except InputError:  # led to where there is no model
        return 0.0
    return max(1.0 - late.chi_square / max(first.chi_square, 1e-300), 0.0)


def hidden_columns(problem: Problem, known: Fit, kind: type[Effect]) -> list[FloatArray]:
    """The residual's change with every blow's shift or weakening, per record."""
    hypothesis = known.hypothesis
    current = current_hidden(hypothesis, kind.name)
    most = max(int(r.setup.blows.hit.max()) + 1 for r in known.records)
    step = _SHIFT if kind.name == "pulse_jitter" else _WEAKER
    found: list[list[FloatArray]] = [[] for _ in known.records]
    for hit in range(1, most):
        hidden = {}
        for record in known.records:
            count = int(record.setup.blows.hit.max()) + 1
            numbers = np.array(current.get(record.name, np.zeros(count)), dtype=float)
            if hit < count:
                numbers[hit] += step
            hidden[record.name] = tuple(numbers)
        there = problem.residuals(
            with_hidden(hypothesis, kind, hidden).effects, known.records, known.end
        )
        for i, (record, new, old) in enumerate(
            zip(known.records, there, known.residuals, strict=True)
        ):
            if hit <= record.setup.blows.hit.max():
                found[i].append(((new - old) / step).ravel())
    return [
        np.stack(columns, axis=1) if columns else np.zeros((r.size, 0))
        for columns, r in zip(found, known.residuals, strict=True)
    ]


def current_hidden(hypothesis: Hypothesis, name: str) -> dict[str, tuple[float, ...]]:
    """Record -> an effect's hidden numbers, as far as they are known."""
    for effect in hypothesis.effects:
        if effect.name == name:
            return dict(effect.hidden)
    return {}


def with_hidden(
    hypothesis: Hypothesis, kind: type[Effect], hidden: dict[str, tuple[float, ...]]
) -> Hypothesis:
    """With an effect's hidden numbers (record -> numbers), and the effect if it was not there."""
    effects = tuple(e.with_hidden(hidden) if e.name == kind.name else e for e in hypothesis.effects)
    if kind.name not in {e.name for e in hypothesis.effects}:
        effects = (*effects, kind("tool").with_hidden(hidden))
    return replace(hypothesis, effects=effects)


def hidden_cost(hypothesis: Hypothesis, n_records: int, samples: int) -> float:
    """What the causes' hidden numbers cost, in units of chi-square."""
    known = {label: drawn_cost(fall, count, samples) for label, fall, count in hypothesis.drawn}
    total = 0.0
    for effect in hypothesis.causes:
        count = 0.0
        if effect.name == "mains_hum":
            count = 2 * n_records
        elif effect.name == "pulse_jitter":
            count = sum(max(len(v) - 1, 0) for v in effect.hidden.values())
        elif effect.name == "missed_hits":  # yes or no: a bit each, not a number
            bits = sum(max(len(v) - 1, 0) for v in effect.hidden.values())
            total += bits * math.log(2.0) * math.log(max(samples, 2))
        total += min(known.get(effect.label, math.inf), count * math.log(max(samples, 2)))
    return total


def hum_lines(problem: Problem, found: Fit) -> Hypothesis:
    """The hum's amplitude and phases of every record written into its effect."""
    from picchio.diagnosis.percussion.problem import take_out_line

    hypothesis = found.hypothesis
    effects = list(hypothesis.effects)
    for i, effect in enumerate(effects):
        if effect.name != "mains_hum":
            continue
        others = [e for k, e in enumerate(effects) if k != i]
        predictions = problem.predictions(others)
        hidden = {}
        for record, predicted in zip(problem.records, predictions, strict=True):
            rows = {n: v - predicted[n] for n, v in record.values.items()}
            frequency = effect.values["frequency"]
            hidden[record.name] = take_out_line(rows, record.setup, effect.target, frequency)
        amplitude = float(np.sqrt(np.mean([a * a + b * b for a, b in hidden.values()])))
        kind = effect_class("mains_hum")
        effects[i] = kind(effect.target, amplitude=amplitude, frequency=effect.values["frequency"])
        effects[i] = effects[i].with_hidden(hidden)
    return replace(hypothesis, effects=tuple(effects))
