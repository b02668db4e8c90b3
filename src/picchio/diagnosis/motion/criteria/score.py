"""How much an effect helps, judged on stretches of the records that it was not fitted to.

And by that: whether a candidate may be claimed, and whether one that was added is still needed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.motion.data.system import Group, Segment, System
from picchio.diagnosis.motion.fit.least_squares import (
    Fit,
    correlation_length,
    jacobian,
    row_weights,
)
from picchio.diagnosis.motion.fit.orders import Spectrum, order_spectrum
from picchio.diagnosis.motion.fit.state import Coordinate
from picchio.diagnosis.motion.fit.stretches import (
    Stretch,
    Validated,
    confidence,
    cross_validate,
    stretches_of,
    without_added,
)
from picchio.model.effects.effect import Effect
from picchio.model.effects.registry import effect_class
from picchio.model.motion import TORQUE

_TINY = 1e-300
_ROUNDED = 1e-9
_SAME = 0.02  # of a column's power: less of its own and others do the same already
_LEAST_BIC = 3.0
_STAYS = 0.5  # of that is enough for what is in: what is just worth it does not come and go
_LEAST_CONFIDENCE = 0.90
_LEAST_SHARE = 0.005
_SPOILT = 1.1  # power left in a channel over that before
_MANY = 2  # numbers: with more, one channel could be paid for with another
_TIE = 2.0
_SURE = 0.95


@dataclass(frozen=True)
class Score:
    """A candidate's score.

    Attributes:
        gain: log-likelihood gained in stretches held out, for autocorrelated residuals.
        rank: the same less the penalty, with what a sample is worth taken from the base: it
            compares candidates.
        bic: half of what Schwarz' criterion falls by, in the stretches fitted to.
        share: part of the groups' power that it removes in stretches held out.
        confidence: that the gain is one, from its spread over the stretches.
        values: of the candidate's coordinates.
        admissible: within their bounds, and everywhere where it has to be.
        spoils: whether it has many numbers and makes a channel worse.
        groups: equations that it acts in.
        differences: what every stretch that was held out gains.
        numbers: how many it has, those that were searched for among them.
    """

    gain: float
    rank: float
    bic: float
    share: float
    confidence: float
    values: tuple[float, ...]
    admissible: bool
    spoils: bool
    groups: tuple[Group, ...]
    differences: Mapping[int, float]
    numbers: int = 1


class Scorer:
    """Scores candidates against one fit, linearised, by normal equations of every stretch.

    Args:
        system: the training equations.
        base: the fit that candidates are added to.
        level: group -> RMS to weigh by; what the base leaves if None.
    """

    def __init__(self, system: System, base: Fit, level: dict[Group, float] | None = None) -> None:
        self.system, self.base = system, base
        self.weight = row_weights(system, base.level if level is None else level)
        self.left = base.columns * self.weight[:, None]
        self.right = base.residual * self.weight
        self.prior = np.array([c.precision for c in base.coordinates])
        self.pull = np.array([c.pull for c in base.coordinates])
        self._stretches: dict[int, list[Stretch]] = {}
        self._sums: dict[int, tuple[np.ndarray, FloatArray, FloatArray]] = {}
        self._spectra: dict[str, Spectrum | None] = {}
        self._bases: dict[object, Validated] = {}
        self._own: dict[str, FloatArray | None] = {}
        # A coordinate at its bound stays there.
        self.free = np.array([
            c.lower + 1e-9 < c.value < c.upper - 1e-9 for c in base.coordinates
        ], dtype=bool)  # fmt: skip

    def score(
        self,
        effect: Effect,
        columns: FloatArray,
        coordinates: list[Coordinate],
        neutral: FloatArray,
        *,
        searched: int = 0,
        without: Sequence[int] = (),
        back: FloatArray | None = None,
        noise: float | None = None,
    ) -> Score | None:
        """Score a candidate.

        Args:
            effect: which.
            columns: (rows, c) its derivatives.
            coordinates: the c of them.
            neutral: (c,) the values at which nothing changes.
            searched: further parameters that were searched for.
            without: coordinates of the base that are left out.
            back: (rows,) what is added to the base's residual.
            noise: of a candidate that is a line in the spectrum: power of a sample's noise there.
                A line is to be held against the noise beside it, not against all that is left.

        Returns:
            None where it does nothing in these records, or nothing that the base can't do.
        """
        touched = [s for s in self.system.segments if np.any(columns[s.rows])]
        groups = tuple(dict.fromkeys(s.group for s in touched))
        if not groups:
            return None
        beside = self._beside(effect, groups)
        beside += [columns[:, i] for i, c in enumerate(coordinates) if c.name in effect.beside]
        added = np.column_stack([*beside, columns]) * self.weight[:, None]
        kept = [s for s in self.system.segments if s.group in groups]
        # Coordinates of the base that other groups determine as well are held by those, too.
        free = self.free.copy()
        free[list(without)] = False
        parts = [part for s in kept for part in self._of(s)]
        touched_by = np.zeros(free.size, dtype=bool)
        touched_by[np.concatenate([part.columns for part in parts])] = True
        index = np.flatnonzero(free & touched_by)
        right = self.right if back is None else self.right + back * self.weight
        second = [part.block(index, added, right) for part in parts]
        elsewhere = self._elsewhere(groups, index)
        prior, pull = self.prior[index], self.pull[index]
        if beside:
            elsewhere = (
                np.pad(elsewhere[0], (0, len(beside))),
                np.pad(elsewhere[1], (0, len(beside))),
            )
            prior, pull = np.pad(prior, (0, len(beside))), np.pad(pull, (0, len(beside)))
        size = len(prior)
        key = None
        if back is None and not without and not effect.beside:
            key = groups, index.tobytes(), effect.over
        base = self._bases.get(key)
        if base is None:
            first = [without_added(block, size) for block in second]
            base = cross_validate(first, elsewhere, prior, pull, size)
        # What is known beforehand of the added numbers, which start where they do nothing.
        known = np.array([c.precision for c in coordinates])
        towards = known * (np.array([c.centre for c in coordinates]) - neutral)
        prior, pull = np.append(prior, known), np.append(pull, towards)
        if key is not None:
            self._bases[key] = base
        wide = cross_validate(second, elsewhere, prior, pull, size)
        if wide.own < _SAME:
            return None
        values = neutral + wide.solution[size:]
        bounds = zip(coordinates, values, neutral, strict=True)
        beyond = np.array([
            (v < c.lower - _ROUNDED and n <= c.lower) or (v > c.upper + _ROUNDED and n >= c.upper)
            for c, v, n in bounds
        ])  # fmt: skip
        if beyond.any() and not beyond.all():
            # What would leave its bounds where it does nothing stays there, as in a fit.
            inside = np.flatnonzero(~beyond)
            fewer = self.score(
                effect, columns[:, inside], [coordinates[i] for i in inside], neutral[inside],
                searched=searched, without=without, back=back, noise=noise,
            )  # fmt: skip
            if fewer is None:
                return None
            values = neutral.copy()
            values[inside] = fewer.values
            return replace(fewer, values=tuple(float(v) for v in values))
        admissible = all(
            c.lower - 1e-9 <= v <= c.upper + 1e-9
            for c, v in zip(coordinates, values, strict=True)
        )  # fmt: skip
        # What a sample is worth is told by what is left once the candidate is in.
        left = np.zeros(self.system.size)
        for s in kept:
            left[s.rows] = right[s.rows] - self.left[s.rows][:, index] @ (
                wide.solution[: len(index)]
            ) - added[s.rows] @ wide.solution[len(index):]  # fmt: skip
        common = dict(self.base.correlation)
        if noise is None:
            correlation = {g: correlation_length(self.system, left, g) for g in groups}
        else:
            correlation = {g: noise / self.base.level[g] ** 2 for g in groups}
            common |= correlation
        return _compare(base, wide, correlation, common, groups,
                        columns.shape[1] + searched, tuple(float(v) for v in values),
                        admissible, effect.everywhere)  # fmt: skip

    def validated(self, groups: tuple[Group, ...]) -> Validated:
        """What the base leaves of some groups' stretches, each told by the others."""
        nothing, index = np.zeros((self.system.size, 0)), np.flatnonzero(self.free)
        parts = [p for s in self.system.segments if s.group in groups for p in self._of(s)]
        blocks = [part.block(index, nothing, self.right) for part in parts]
        elsewhere = self._elsewhere(groups, index)
        return cross_validate(blocks, elsewhere, self.prior[index], self.pull[index], index.size)

    def _beside(self, effect: Effect, groups: tuple[Group, ...]) -> list[FloatArray]:
        """Columns (rows,) of what does in each joint by itself what the effect does in several."""
        there = {e.label for e in self.base.state.every}
        found = []
        for name in effect.over:
            for joint in dict.fromkeys(joint for kind, joint in groups if kind == TORQUE):
                own = effect_class(name)(joint)
                if own.label in there:
                    continue
                if own.label not in self._own:
                    self._own[own.label] = self._unit(own)
                column = self._own[own.label]
                if column is not None:
                    found.append(column)
        return found

    def _unit(self, effect: Effect) -> FloatArray | None:
        system, state = self.system, self.base.state.with_effect(effect)
        coordinates = state.numbers(system, len(state.every) - 1)
        predicted = system.measured - self.base.residual
        columns = jacobian(system, state, predicted, coordinates)[1]
        return columns[:, 0] if columns.size else None

    def noise_of(self, effect: Effect) -> float | None:
        """Of a ripple, the power of a sample's noise beside its line; None of others."""
        if "order" not in effect.values:
            return None
        if effect.target not in self._spectra:
            base = self.base
            self._spectra[effect.target] = order_spectrum(
                self.system, base.residual, effect.target, base.state
            )
        spectrum = self._spectra[effect.target]
        return None if spectrum is None else spectrum.noise(effect.values["order"])

    def _of(self, s: Segment) -> list[Stretch]:
        if s.rows.start not in self._stretches:
            self._stretches[s.rows.start] = stretches_of(s, self.system.block, self.left)
        return self._stretches[s.rows.start]

    def _elsewhere(self, groups: tuple[Group, ...],
                   index: np.ndarray) -> tuple[FloatArray, FloatArray]:  # fmt: skip
        """Normal equations of the other groups, for the coordinates that matter here.

        What is added, or added back, is nothing there.
        """
        normal, target = np.zeros((index.size, index.size)), np.zeros(index.size)
        for s in self.system.segments:
            if s.group in groups:
                continue
            columns, own, right = self._sum(s)
            shared, place, here = np.intersect1d(index, columns, True, return_indices=True)
            if shared.size:
                normal[np.ix_(place, place)] += own[np.ix_(here, here)]
                target[place] += right[here]
        return normal, target

    def _sum(self, s: Segment) -> tuple[np.ndarray, FloatArray, FloatArray]:
        """A segment's normal equations: columns, left and right side."""
        if s.rows.start not in self._sums:
            parts = self._of(s)
            normal = sum(part.normal for part in parts)
            right = sum(self.right[part.rows] @ part.left for part in parts)
            self._sums[s.rows.start] = (parts[0].columns, np.asarray(normal), np.asarray(right))
        return self._sums[s.rows.start]


def _compare(
    base: Validated,
    wide: Validated,
    correlation: Mapping[Group, float],
    common: Mapping[Group, float],
    groups: tuple[Group, ...],
    added: int,
    values: tuple[float, ...],
    admissible: bool,
    everywhere: bool,
) -> Score:
    gain = rank = bic = removed = total = effective = 0.0
    spoils = False
    differences: dict[int, float] = {}
    raw: dict[int, float] = {}
    for group in groups:
        rows = sum(number for (g, _), number in base.count.items() if g == group)
        samples = rows / correlation[group]
        before = sum(x for (g, _), x in base.outside.items() if g == group)
        after = sum(x for (g, _), x in wide.outside.items() if g == group)
        effective += samples
        fall = np.log(max(before, _TINY) / max(after, _TINY))
        gain += 0.5 * samples * fall
        rank += 0.5 * rows / common[group] * fall
        inside = max(base.inside[group], _TINY) / max(wide.inside[group], _TINY)
        bic += 0.5 * samples * np.log(inside)
        removed, total = removed + before - after, total + before
        admissible = admissible and not (everywhere and after > before)
        spoils = spoils or (added > _MANY and after > _SPOILT * before)
        for (g, number), x in base.outside.items():
            if g == group:
                # In logarithms one bad stretch does not outvote the others; without, stretches
                # in which nothing happens don't. Evidence by either is evidence.
                other = wide.outside[g, number]
                fall = np.log(max(x, _TINY) / max(other, _TINY))
                change = 0.5 * base.count[g, number] / correlation[g] * fall
                differences[number] = differences.get(number, 0.0) + change
                power = max(wide.inside[g], _TINY) / rows
                raw[number] = raw.get(number, 0.0) + (x - other) / correlation[g] / power
    penalty = 0.5 * added * np.log(max(effective, 2.0))
    bic -= penalty
    rank -= penalty
    sure = max(confidence(np.array(list(x.values()))) for x in (differences, raw))
    return Score(
        gain=float(gain), rank=float(rank), bic=float(bic), share=removed / max(total, _TINY),
        confidence=sure, values=values, admissible=admissible, spoils=spoils, groups=groups,
        differences=differences, numbers=added,
    )  # fmt: skip


def passes(score: Score, ripple: bool = False, there: bool = False) -> bool:
    """Whether a candidate may be claimed: penalised, held out, and on every stretch.

    Args:
        score: its score.
        ripple: whether it is a line.
        there: whether it is in the fit already.
    """
    least = _LEAST_BIC * (_STAYS if there else 1.0)
    enough = ripple or score.share >= _LEAST_SHARE
    return (
        score.admissible and score.bic > least and score.gain > 0.0
        and score.confidence >= _LEAST_CONFIDENCE and enough
        and (there or not score.spoils)
    )  # fmt: skip


def necessity(scorer: Scorer, index: int) -> Score | None:
    """What an effect of the scorer's fit gains over the fit without it."""
    current = scorer.base
    own, part = contribution(current, index)
    if not own:
        return None
    coordinates = [current.coordinates[i] for i in own]
    columns = current.columns[:, own]
    values = np.array([c.value for c in coordinates])
    noise = scorer.noise_of(current.state.effects[index])
    return scorer.score(current.state.effects[index], columns, coordinates, values - part,
                        without=own, back=columns @ part, noise=noise)  # fmt: skip


def borne_out(scorer: Scorer, index: int, fewer: Fit) -> Score | None:
    """As `necessity`, by the fit without the effect: nothing is linearised over its absence.

    None where the effect may not be claimed, or makes a channel worse by its many numbers.

    Args:
        scorer: of the fit with it.
        index: of the effect.
        fewer: all others, fitted to the end.
    """
    system, current = scorer.system, scorer.base
    effect, (own, part) = current.state.effects[index], contribution(current, index)
    touched = [s.group for s in system.segments if np.any(current.columns[s.rows][:, own])]
    groups = tuple(dict.fromkeys(touched))
    if not groups:
        return None
    noise = scorer.noise_of(effect)
    correlation = {
        g: current.correlation[g] if noise is None else noise / current.level[g] ** 2
        for g in groups
    }
    # What a bound holds would have to be what cannot be.
    admissible = all(scorer.free[i] or not p for i, p in zip(own, part, strict=True))
    score = _compare(
        Scorer(system, fewer, current.level).validated(groups),
        scorer.validated(groups),
        correlation,
        correlation,
        groups,
        len(own),
        (),
        admissible,
        effect.everywhere,
    )
    return score if passes(score, effect.periodic, there=True) and not score.spoils else None


def contribution(current: Fit, index: int) -> tuple[list[int], FloatArray]:
    """An effect's coordinates, and how far each is from where it does nothing.

    At the optimum the residual is what the full model leaves: with the effect's own part (its
    columns times these) added back, a fit without it has to leave it.
    """
    number = len(current.state.nuisances) + index
    own = [i for i, c in enumerate(current.coordinates) if c.index == number]
    return own, np.array([_from_neutral(current, i) for i in own])


def _from_neutral(current: Fit, i: int) -> float:
    """How far a linear parameter is from where it does nothing; others count as they are."""
    c = current.coordinates[i]
    effect = current.state.every[c.index]
    parameter = next(p for p in effect.parameters if p.name == c.name)
    if parameter.shape or parameter.logarithmic:
        return c.value if c.name in effect.inverse else 0.0
    return c.value - parameter.neutral


def indistinguishable(score: Score, other: Score) -> bool:
    """Whether a rival is nearly as likely, or loses in no clear majority of the stretches.

    One that needs more numbers to do the same loses nowhere: it has to be as likely.

    Args:
        score: the best's.
        other: the rival's.
    """
    if other.rank >= score.rank - _TIE:
        return True
    if other.numbers > score.numbers + 1:
        return False
    shared = sorted(set(score.differences) | set(other.differences))
    lead = np.array([
        score.differences.get(b, 0.0) - other.differences.get(b, 0.0) for b in shared
    ])  # fmt: skip
    return confidence(lead) < _SURE and float(lead.sum()) < 3.0 * _TIE
