"""Effects that draw numbers anew in every record: jitter, missed hits, the phase of the hum."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from picchio.core.arrays import FloatArray
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
_ROUNDS = 6
_SHARES = (1.0, 0.5, 0.25, 0.1)
_MAINS = (50.0, 60.0)


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
        return Suspect(best, gain, 2 * len(known.records), (best,))
    start = kind(target)
    fall, numbers = 0.0, 0
    for residual, columns in zip(known.residuals, _columns(problem, known, kind), strict=True):
        if columns.shape[1] == 0:
            continue
        weights = np.linalg.lstsq(columns, -residual.ravel(), rcond=1e-6)[0]
        fall += float((residual**2).sum() - ((residual.ravel() + columns @ weights) ** 2).sum())
        numbers += columns.shape[1]
    return Suspect(start, fall, numbers, (start,))


def _columns(problem: Problem, known: Fit, kind: type[Effect]) -> list[FloatArray]:
    """The residual's change with every blow's shift or weakening, per record."""
    hypothesis = known.hypothesis
    current = _current(hypothesis, kind.name)
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
        there = problem.residuals(_with(hypothesis, kind, hidden).effects, known.records, known.end)
        for i, (record, new, old) in enumerate(
            zip(known.records, there, known.residuals, strict=True)
        ):
            if hit <= record.setup.blows.hit.max():
                found[i].append(((new - old) / step).ravel())
    return [
        np.stack(columns, axis=1) if columns else np.zeros((r.size, 0))
        for columns, r in zip(found, known.residuals, strict=True)
    ]


def _current(hypothesis: Hypothesis, name: str) -> dict[str, tuple[float, ...]]:
    for effect in hypothesis.effects:
        if effect.name == name:
            return dict(effect.hidden)
    return {}


def _with(
    hypothesis: Hypothesis, kind: type[Effect], hidden: dict[str, tuple[float, ...]]
) -> Hypothesis:
    from dataclasses import replace

    effects = tuple(e.with_hidden(hidden) if e.name == kind.name else e for e in hypothesis.effects)
    if kind.name not in {e.name for e in hypothesis.effects}:
        effects = (*effects, kind("tool").with_hidden(hidden))
    return replace(hypothesis, effects=effects)


def fit_latent(problem: Problem, start: Fit, kind: type[Effect], target: str) -> Fit:
    """Fit the hidden numbers record by record, and the rest, in turns."""
    from dataclasses import replace

    if kind.name == "mains_hum":
        return start
    here = start
    if kind.name == "pulse_jitter":
        begun = blow_by_blow(problem, start, lambda known, late: _with(known, kind, dict(late)))
        here = fit(problem, begun, start.records, start.end, iterations=2)
    most = {r.name: int(r.setup.blows.hit.max()) + 1 for r in start.records}
    largest = 0.45 * start.records[0].setup.blows.interval
    for turn in range(_ROUNDS):
        current = _current(here.hypothesis, kind.name)
        known, wanted = {}, {}
        for record, residual, columns in zip(
            here.records, here.residuals, _columns(problem, here, kind), strict=True
        ):
            numbers = np.array(current.get(record.name, np.zeros(most[record.name])), dtype=float)
            known[record.name] = numbers.copy()
            if columns.shape[1]:
                numbers[1 : 1 + columns.shape[1]] += np.linalg.lstsq(
                    columns, -residual.ravel(), rcond=1e-6
                )[0]
            if kind.name == "pulse_jitter":
                numbers = np.clip(numbers, -largest, largest)
            else:
                numbers = np.round(np.clip(numbers, 0.0, 1.0))
            wanted[record.name] = numbers
        hidden = {name: tuple(numbers) for name, numbers in wanted.items()}
        if kind.name == "pulse_jitter":
            hidden = _shortened(problem, here, kind, known, wanted)
        hypothesis = _with(here.hypothesis, kind, hidden)
        before = here.cost
        here = fit(problem, hypothesis, here.records, here.end, iterations=2)
        if turn and before - here.cost < 1e-4 * here.cost:
            break
    numbers = np.concatenate(
        [np.array(v)[1:] for v in _current(here.hypothesis, kind.name).values()]
    )
    value = (
        {"std": float(np.sqrt(np.mean(numbers**2)))}
        if kind.name == "pulse_jitter"
        else {"fraction": float(numbers.mean())}
    )
    effects = tuple(
        e.with_values(**value) if e.name == kind.name else e for e in here.hypothesis.effects
    )
    return replace(here, hypothesis=replace(here.hypothesis, effects=effects))


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
        effects = _with(here.hypothesis, kind, {**best, **trial}).effects
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


def hidden_numbers(hypothesis: Hypothesis, n_records: int) -> float:
    """How many hidden numbers the causes hold, counted as BIC counts parameters."""
    total = 0.0
    for effect in hypothesis.causes:
        if effect.name == "mains_hum":
            total += 2 * n_records
        elif effect.name == "pulse_jitter":
            total += sum(max(len(v) - 1, 0) for v in effect.hidden.values())
        elif effect.name == "missed_hits":  # yes or no: a bit each, not a number
            bits = sum(max(len(v) - 1, 0) for v in effect.hidden.values())
            total += bits * math.log(2.0)
    return total


def hum_lines(problem: Problem, found: Fit) -> Hypothesis:
    """The hum's amplitude and phases of every record written into its effect."""
    from dataclasses import replace

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
