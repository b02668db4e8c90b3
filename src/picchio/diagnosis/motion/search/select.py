"""Effects are added one after the other, then those that are not needed are taken out again.

Last, which other effects would do as well as one that was found.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from picchio.diagnosis.motion.criteria.score import (
    Score,
    Scorer,
    borne_out,
    contribution,
    indistinguishable,
    necessity,
    passes,
)
from picchio.diagnosis.motion.data.system import Group, System
from picchio.diagnosis.motion.fit.least_squares import Fit, fit, len_of, row_weights
from picchio.diagnosis.motion.fit.state import State
from picchio.diagnosis.motion.search.candidates import Candidate, candidates, usual
from picchio.diagnosis.motion.search.timing import time_by_ripple
from picchio.model.effects.effect import Effect

_AGAIN = 3
_TIE = 1.0
_ALIKE = 0.9
_ROUNDS = 12
_NEAR = 0.05  # orders
_WITHIN = 3.0  # standard deviations
_MANY = 2  # numbers
_RARE = 8  # of `Effect.usual`: from there on it is what drives report wrongly, or rarer
_CONTENDERS = 4
_TINY = 1e-300
_TOLD_APART = 0.1  # orders: no chance hit of a whole number

Scored = tuple[Score, Candidate]
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Step:
    """One round of the search, for the report.

    Attributes:
        accepted: labels of what was added.
        levels: group -> RMS before.
        scores: the best candidates' scores.
    """

    accepted: tuple[tuple[str, str], ...]
    levels: Mapping[str, float]
    scores: tuple[Mapping[str, Any], ...]


def select(
    system: System, start: State, kinds: Mapping[str, type[Effect]], progress: Progress
) -> tuple[Fit, list[Step]]:
    """Search forwards and backwards until nothing changes.

    The order: ripple, and what it tells of timing; everything else but elasticity; bodies and
    whatever else has many numbers (`_bodies`); elasticity, which needs the torque that the gears
    transmit; ripple again; then what is no longer needed goes, and everything is tried once more.

    Args:
        system: the training equations.
        start: the baseline.
        kinds: the catalogue.
        progress: told (stage, stages).
    """
    ripple = {n: k for n, k in kinds.items() if k.periodic}
    elastic = {n: k for n, k in kinds.items() if k.elastic}
    rest = {n: k for n, k in kinds.items() if not (k.periodic or k.elastic)}
    broad = {n: k for n, k in rest.items() if len(k.parameters) > _MANY}
    slow = {n: k for n, k in rest.items() if n not in broad}
    steps: list[Step] = []

    def forward(current: Fit, pool: Mapping[str, type[Effect]], rounds: int) -> Fit:
        return _forward(system, current, pool, kinds, rounds, steps)

    def bodies(current: Fit) -> Fit:
        return _bodies(system, current, broad, slow, forward)

    stages: list[Callable[[Fit], Fit]] = [
        lambda now: forward(now, ripple, 2), lambda now: forward(now, slow, _ROUNDS), bodies,
        lambda now: forward(now, elastic, 3), lambda now: forward(now, ripple, _ROUNDS),
    ]  # fmt: skip
    current = fit(system, start)
    for number, stage in enumerate(stages):
        progress(number, len(stages) + _AGAIN)
        current = stage(current)
    for number in range(_AGAIN):
        progress(len(stages) + number, len(stages) + _AGAIN)
        current = eliminate(system, current)
        before = [e.label for e in current.state.effects]
        for pool in (slow, broad, elastic):
            current = forward(current, pool, 3)
        if before == [e.label for e in current.state.effects]:
            break
    return eliminate(system, current), steps


def _bodies(
    system: System,
    current: Fit,
    broad: Mapping[str, type[Effect]],
    slow: Mapping[str, type[Effect]],
    forward: Callable[[Fit, Mapping[str, type[Effect]], int], Fit],
) -> Fit:
    """The fit with what has many numbers.

    Wrong bodies look like wrong gains and offsets of what the drives report, and those are found
    first. So bodies are looked for without these as well, which then have to be found again; the
    better fit of the two is kept, by Schwarz' criterion.
    """
    found = forward(current, broad, _ROUNDS)
    state = current.state
    for index, effect in reversed(list(enumerate(state.effects))):
        if effect.needs or (effect.usual >= _RARE and not effect.periodic):
            fixed = state.fixed - {effect.target}
            state = replace(state.without(index), fixed=fixed)
    if state is current.state:
        return found
    bare = fit(system, state)
    several = {n: k for n, k in broad.items() if k.target_kind != "joint"}
    other = forward(bare, several, _ROUNDS)
    if len(other.state.effects) == len(bare.state.effects):
        return found
    other = forward(other, slow, _ROUNDS)
    return min(found, other, key=lambda each: _cost(system, each, other.correlation))


def _forward(system: System, current: Fit, pool: Mapping[str, type[Effect]],
             kinds: Mapping[str, type[Effect]], rounds: int, steps: list[Step]) -> Fit:  # fmt: skip
    """Add from a pool until nothing passes."""
    for _ in range(rounds if pool else 0):
        scored = score_all(system, current, pool)
        chosen = choose(scored)
        levels = {".".join(group): level for group, level in current.level.items()}
        table = tuple(describe(*pair) for pair in scored[:20])
        steps.append(Step(tuple(c.label for _, c in chosen), levels, table))
        if not chosen:
            break
        current = _contest(system, current, chosen, scored, kinds)
        if any(kind.periodic for kind in pool.values()):
            current = lock(system, current)
            for late in (kind for kind in kinds.values() if kind.late):
                current = time_by_ripple(system, current, late)
    return current


def _contest(
    system: System,
    current: Fit,
    chosen: list[Scored],
    scored: list[Scored],
    kinds: Mapping[str, type[Effect]],
) -> Fit:
    """The fit with what was chosen; where that has many numbers, the best of it and simpler ones.

    A cause of many numbers bends to whatever is wrong: scores are linearised, and it makes up for
    what others cannot in one step. So what is simpler is fitted to the end, and in turn with the
    numbers that refine it.
    """
    grown = fit(system, _grown(system, current, chosen))
    first = chosen[0]
    if not _broad(first):
        return grown
    groups = set(first[0].groups)
    simpler = [p for p in scored if passes(p[0], p[1].effect.periodic) and not _broad(p)
               and groups & set(p[0].groups)]  # fmt: skip
    fits = [grown]
    for pair in simpler[:_CONTENDERS]:
        fits.append(fit(system, _grown(system, current, [pair])))
        finer = [k for k in kinds.values() if k.refines == pair[1].effect.name]
        for kind in finer:
            own = next(e for e in fits[-1].state.effects if e.label == pair[1].effect.label)
            fits.append(fit(system, fits[-1].state.with_effect(kind(own.target, **own.values))))
    best = min(fits, key=lambda each: _cost(system, each, each.correlation))
    return min(fits, key=lambda each: _cost(system, each, best.correlation))


def _grown(system: System, current: Fit, chosen: list[Scored]) -> State:
    state = current.state
    for score, candidate in chosen:
        grown = state.with_effect(candidate.started(score.values))
        state = _take_over(system, current, grown, candidate)
    return state


def _broad(pair: Scored) -> bool:
    return len(pair[1].coordinates) > _MANY


def _cost(system: System, each: Fit, correlation: Mapping[Group, float]) -> float:
    """Schwarz' criterion, halved."""
    samples = {g: len_of(system, g) / correlation[g] for g in system.groups}
    misfit = sum(n * math.log(max(each.level[g], _TINY)) for g, n in samples.items())
    return misfit + 0.5 * len(each.coordinates) * math.log(max(sum(samples.values()), 2.0))


def lock(system: System, current: Fit) -> Fit:
    """The fit with orders that are whole within three standard deviations made whole.

    What repeats with the motor's turn does so a whole number of times. A line that does not fit a
    whole number (a bearing's, or that of a wave generator against its flexspline) stays where it
    is, and so does every order where the gear ratio is not known.
    """
    state = current.state
    for c, std in zip(current.coordinates, current.std, strict=True):
        if c.name != "order" or c.index < 0:
            continue
        effect = state.every[c.index]
        whole = round(c.value)
        ratio = system.predictors[0].nominal.gear_ratio[effect.target]
        near = abs(c.value - whole) <= _WITHIN * std <= _TOLD_APART
        if ratio != 1.0 and whole >= 1 and near:
            state = state.moved(c, float(whole))
    return current if state is current.state else fit(system, state, rounds=2)


def score_all(system: System, base: Fit, kinds: Mapping[str, type[Effect]]) -> list[Scored]:
    """Every candidate's score, the best first."""
    scorer = Scorer(system, base)
    found = []
    for candidate in candidates(system, base, dict(kinds)):
        score = scorer.score(
            candidate.effect, candidate.columns, candidate.coordinates, candidate.neutral,
            searched=candidate.searched, noise=candidate.noise,
        )  # fmt: skip
        if score is not None:
            found.append((score, candidate))
    return sorted(found, key=lambda pair: -pair[0].rank)


def choose(scored: list[Scored]) -> list[Scored]:
    """The best of each set of equations; of equals the more usual."""
    good = [pair for pair in scored if passes(pair[0], pair[1].effect.periodic)]
    taken: set[tuple[str, str]] = set()
    chosen: list[Scored] = []
    blocked = False
    for score, candidate in good:
        groups = set(score.groups)
        if candidate.effect.periodic:
            if all(_apart(candidate.effect, other.effect) for _, other in chosen):
                chosen.append((score, candidate))
            continue
        # One cause for several joints is not kept waiting by one for each of them.
        if groups & taken and (len(groups) == 1 or blocked or _broad((score, candidate))):
            continue
        blocked = blocked or len(groups) > 1
        equal = [
            pair for pair in good
            if not pair[1].effect.periodic and set(pair[0].groups) == groups
            and pair[0].rank >= score.rank - _TIE
        ]  # fmt: skip
        chosen.append(min(equal, key=lambda pair: (usual(pair[1].effect.name), -pair[0].rank)))
        taken |= groups
    return chosen


def _apart(first: Effect, second: Effect) -> bool:
    distance = abs(first.values["order"] - second.values["order"])
    return first.target != second.target or distance > _NEAR


def _take_over(system: System, base: Fit, state: State, candidate: Candidate) -> State:
    """A cause that does what a joint's nuisance factor does takes its place."""
    weight = row_weights(system, base.level)
    fixed = set(state.fixed)
    for index, c in enumerate(base.coordinates):
        if c.index >= 0:
            continue
        rows = np.flatnonzero(base.columns[:, index])
        x = base.columns[rows, index] * weight[rows]
        columns = candidate.columns[rows] * weight[rows, None]
        if not np.any(columns):
            continue
        left = x - columns @ np.linalg.lstsq(columns, x, rcond=None)[0]
        if 1.0 - float(left @ left) / float(x @ x) > _ALIKE:
            fixed.add(c.name)
    scales = {j: 1.0 if j in fixed else s for j, s in state.scales.items()}
    return replace(state, fixed=frozenset(fixed), scales=scales)


def eliminate(system: System, current: Fit) -> Fit:
    """Take out what is no longer needed, what bends to anything by its many numbers first.

    A linearised score proposes; a removal stands if the fit without bears it out.
    """
    borne: set[int] = set()
    while True:
        scorer = Scorer(system, current)
        tried = []
        for index, effect in enumerate(current.state.effects):
            score = necessity(scorer, index)
            enough = score is not None and passes(score, effect.periodic, there=True)
            if index not in borne and not enough:
                few = score is not None and score.numbers <= _MANY
                tried.append((few, -np.inf if score is None else score.gain, index))
        if not tried:
            return current
        index = min(tried)[2]
        fewer = fit(system, current.state.without(index))
        if borne_out(scorer, index, fewer) is None:
            current, borne = fewer, set()
        else:
            borne.add(index)


def describe(score: Score, candidate: Candidate) -> dict[str, Any]:
    """A score as a row of the report."""
    effect = candidate.started(score.values)
    return {
        "effect": effect.name,
        "target": effect.target,
        "parameters": dict(effect.values),
        "rank": score.rank,
        "gain": score.gain,
        "bic": score.bic,
        "share": score.share,
        "confidence": score.confidence,
        "admissible": score.admissible,
    }


def alternatives(
    system: System, current: Fit, kinds: Mapping[str, type[Effect]]
) -> dict[int, list[tuple[str, str]]]:
    """Number of an effect of the fit -> those that the training records can't tell from it.

    A rival takes the effect's place beside all others. It can't be told apart where it is
    nearly as likely, or where its losses are not of one sign over the stretches held out.
    """
    slow = {name: kind for name, kind in kinds.items() if not kind.periodic}
    scorer = Scorer(system, current)
    found: dict[int, list[tuple[str, str]]] = {}
    for index, effect in enumerate(current.state.effects):
        if effect.periodic:
            continue
        score = necessity(scorer, index)
        own, part = contribution(current, index)
        if score is None:
            continue
        back = current.columns[:, own] @ part
        # Derivatives are those without the effect: a gain would else scale its rival with it.
        state = current.state.without(index)
        residual = system.measured - system.predict(state.every, state.scales)
        without = replace(current, state=state, residual=residual)
        near = effect.target if effect.target_kind == "joint" else None
        for candidate in candidates(system, without, slow, near):
            other = scorer.score(
                candidate.effect, candidate.columns, candidate.coordinates, candidate.neutral,
                searched=candidate.searched, without=own, back=back,
            )  # fmt: skip
            if other is None or not passes(other) or not set(other.groups) & set(score.groups):
                continue
            same = candidate.label == (effect.name, effect.target)
            if not same and indistinguishable(score, other):
                known = found.setdefault(index, [])
                if candidate.label not in known:
                    known.append(candidate.label)
    return found
