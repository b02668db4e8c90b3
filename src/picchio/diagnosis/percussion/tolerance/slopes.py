"""How what is never exact moves the residuals of every record."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import zip_longest

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.workers import shared_array, worker_pool
from picchio.diagnosis.attempt import attempt, trials
from picchio.diagnosis.percussion.data.problem import (
    MeasuredRecord,
    Problem,
    residual_changes,
    residual_under,
)
from picchio.diagnosis.percussion.fit.least_squares import JUMP, between
from picchio.diagnosis.percussion.tolerance.nudges import POSE, Inexact, Nudge, inexact, nudged
from picchio.model.effects.effect import Effect
from picchio.model.model import Model
from picchio.prediction.percussion import BY_MODES

# By so many standard deviations a number is moved to see what it does; one of the structure, which
# changes frequencies, by less, and a joint by so many rad. A blow that is moved by less than what
# its edge is known by stays where it is.
_STEP = 0.1
_STRUCTURE = 0.05
_TURN = 5e-6
# Where the motion has kinks, by what changes a record's residuals by so many deviations, all in
# all; and by so many standard deviations at least.
_SEEN = 0.1
_FINEST = 1e-6
# What moves all records together by less than this, in units of the noise, need not be looked at.
_IDLE = 0.01


@dataclass(frozen=True, eq=False)
class Slopes:
    """What one standard deviation of everything inexact does to a record.

    Attributes:
        what: the numbers, each as often as it has columns: the record's own first.
        own: how many columns are the record's own; the others the campaign shares.
        columns: (channels, samples, columns) in units of the noise, in single precision.
        norms: (columns,) their norms as they were taken, whatever has been taken out of them since.
        gram: (columns, columns) their products with each other, over channels and samples.
        silent: whether the columns are set to nothing, as small errors grow beyond what slopes say.
    """

    what: tuple[Inexact, ...]
    own: int
    columns: np.ndarray
    norms: FloatArray
    gram: FloatArray
    silent: bool = False

    @classmethod
    def of(
        cls,
        what: Sequence[Inexact],
        own: int,
        columns: np.ndarray,
        gram: FloatArray | None = None,
    ) -> Slopes:
        """Slopes as they are taken.

        Args:
            what: the numbers, as in the attributes.
            own: as there.
            columns: as there.
            gram: as there; found here where None.

        Returns:
            the slopes.
        """
        found = products(columns) if gram is None else gram
        return cls(tuple(what), own, columns, np.sqrt(np.diag(found)), found)

    @cached_property
    def means(self) -> tuple[str, ...]:
        """Of every column the effect and target that stand for it as a cause; empty for none."""
        return tuple(one.means for one in self.what)

    def without(self, names: Set[str]) -> Slopes:
        """The slopes of all but some numbers.

        Args:
            names: of these.
        """
        kept = np.array([one.name not in names for one in self.what], dtype=bool)
        if kept.all():
            return self
        what = tuple(one for one, stays in zip(self.what, kept, strict=True) if stays)
        own = int(kept[: self.own].sum())
        return replace(
            self,
            what=what,
            own=own,
            columns=self.columns[:, :, kept],
            norms=self.norms[kept],
            gram=self.gram[np.ix_(kept, kept)],
        )

    def dropped(self) -> Slopes:
        """The same numbers without their columns, which are large."""
        return replace(self, columns=np.zeros((0, 0, len(self.what)), self.columns.dtype))

    def silenced(self, most: float) -> Slopes:
        """Themselves; with columns of nothing where one standard deviation would do too much.

        Args:
            most: norm of what a record can be off by, in units of the noise.

        Returns:
            those, or slopes of the same numbers.
        """
        if not self.norms.size or self.norms.max() <= most:
            return self
        return replace(
            self,
            columns=np.zeros_like(self.columns),
            gram=np.zeros_like(self.gram),
            silent=True,
        )

    def by(self, sizes: FloatArray) -> FloatArray:
        """(channels, samples) what they do together.

        Args:
            sizes: (columns,) standard deviations.
        """
        from picchio.diagnosis.percussion.tolerance.kernel import taken_out

        out = np.zeros(self.columns.shape[:2])
        taken_out(self.columns, -sizes, out)
        return out

    def moved(self, sizes: FloatArray) -> list[tuple[Inexact, FloatArray]]:
        """What is moved by how many standard deviations, (numbers,) each.

        Args:
            sizes: (columns,) standard deviations.
        """
        found: dict[str, tuple[Inexact, list[float]]] = {}
        for one, size in zip(self.what, sizes, strict=True):
            found.setdefault(one.name, (one, []))[1].append(float(size))
        return [(one, np.array(numbers)) for one, numbers in found.values()]


def products(columns: np.ndarray) -> FloatArray:
    """(k, k) sums over channels and samples of the products of columns (channels, samples, k).

    Args:
        columns: in single precision; the sums are in double.
    """
    flat = columns.reshape(-1, columns.shape[2]).astype(float)
    return np.asarray(flat.T @ flat)


def all_slopes(
    problem: Problem, effects: Sequence[Effect], end: float | None = None, both: bool = False
) -> dict[str, Slopes]:
    """The slopes of every record about a model.

    Args:
        problem: data and noise, and where its inexact numbers are now.
        effects: of the model.
        end: s, up to when; None for whole records.
        both: whether the structure is moved either way: its slopes are then exact to the second
            order.

    Returns:
        by the record's name.
    """
    every = {
        r.name: [
            one
            for one in inexact(problem, r, problem.campaign.tolerance)
            if one.name not in problem.idle
        ]
        for r in problem.records
    }
    poses: dict[int, list[MeasuredRecord]] = {}
    for record in problem.records:
        poses.setdefault(record.pose, []).append(record)

    what = {
        r.name: [w for w in every[r.name] for _ in range(len(starts(r)) if w.each_blow else 1)]
        for r in problem.records
    }
    # Sending what is found would take as long as finding it.
    room = {
        r.name: shared_array(
            (len(r.values), r.until(end).samples.count, len(what[r.name])), np.float32
        )
        for r in problem.records
    }

    def at_pose(pose: int) -> list[FloatArray]:
        records = poses[pose]
        found = _of_records(problem, records, tuple(effects), every, end, both)
        for record, columns in zip(records, found, strict=True):
            room[record.name][:] = columns
        return [products(columns) for columns in found]

    with (
        problem.pinned(effects),
        worker_pool(problem.workers, trials({"slopes": at_pose})) as mapped,
    ):
        found = mapped("slopes", poses)
    slopes = {}
    for records, grams in zip(poses.values(), found, strict=True):
        for record, gram in zip(records, grams or (), strict=False):
            own, name = sum(not w.once for w in what[record.name]), record.name
            slopes[name] = Slopes.of(what[name], own, room[name], gram)
    if not problem.sizes:
        problem.idle |= _idle(slopes.values())
        slopes = {name: each.without(problem.idle) for name, each in slopes.items()}
    return slopes


def slopes_of(
    problem: Problem, record: MeasuredRecord, effects: Sequence[Effect], shared: Sequence[Inexact]
) -> Slopes:
    """The slopes of one more record, which is not one of the campaign's.

    Args:
        problem: data and noise.
        record: as it is stated.
        effects: of the model.
        shared: what the campaign shares, in the order of its slopes. What the record would share
            beside that, such as the gain of a sensor that is new, is its own.
    """
    names = {one.name for one in shared}
    every = [
        replace(one, once=one.name in names)
        for one in inexact(problem, record, problem.campaign.tolerance)
        if one.name not in problem.idle
    ]
    (columns,) = _of_records(problem, [record], tuple(effects), {record.name: every}, None, False)
    blows = len(starts(record))
    what = [one for one in every for _ in range(blows if one.each_blow else 1)]
    own = [k for k, one in enumerate(what) if not one.once]
    order = {one.name: k for k, one in enumerate(what) if one.once}
    together = np.zeros((*columns.shape[:2], len(own) + len(shared)), columns.dtype)
    together[:, :, : len(own)] = columns[:, :, own]
    for k, one in enumerate(shared, len(own)):
        if one.name in order:
            together[:, :, k] = columns[:, :, order[one.name]]
    return Slopes.of((*(what[k] for k in own), *shared), len(own), together)


def own_slopes(
    problem: Problem,
    record: MeasuredRecord,
    effects: Sequence[Effect],
    size: FloatArray,
    end: float | None = None,
) -> FloatArray:
    """(channels, m, own) the slopes of a record's own numbers, wherever those are taken to be.

    Args:
        problem: linearised before.
        record: one of the campaign's.
        effects: of the model.
        size: (columns,) standard deviations, as in `problem.sizes`.
        end: s, up to when; None for the whole record.
    """
    assert problem.marginal is not None
    slopes, kept = problem.marginal.slopes[record.name], problem.sizes
    every = list(dict.fromkeys(slopes.what[: slopes.own]))
    problem.sizes = {**kept, record.name: size}
    try:
        (found,) = _of_records(problem, [record], tuple(effects), {record.name: every}, end, False)
    finally:
        problem.sizes = kept
    return found


def _idle(slopes: Iterable[Slopes]) -> frozenset[str]:
    """Names of what moves no record by as much as counts."""
    power: dict[str, float] = {}
    for each in slopes:
        for one, column in zip(each.what, np.moveaxis(each.columns, -1, 0), strict=True):
            power[one.name] = power.get(one.name, 0.0) + float(np.vdot(column, column))
    return frozenset(name for name, found in power.items() if found < _IDLE**2)


def _of_records(
    problem: Problem,
    records: Sequence[MeasuredRecord],
    effects: tuple[Effect, ...],
    every: Mapping[str, Sequence[Inexact]],
    end: float | None,
    both: bool,
) -> list[np.ndarray]:
    """(channels, samples, columns) of each of a pose's records, in single precision."""
    begun = [_number_by_number(problem, r, effects, every[r.name], end, both) for r in records]
    found: list[list[FloatArray]] = [[] for _ in records]
    with np.errstate(all="ignore"):
        # In turns: records of a pose share the plant that a number asks for.
        for turn in zip_longest(*begun, fillvalue=()):
            for own, columns in zip(found, turn, strict=True):
                own += columns
    return [_packed(own) for own in found]


def _packed(found: Sequence[FloatArray]) -> np.ndarray:
    """Columns (channels, samples) together; what is no number is nothing."""
    columns = np.stack(found, axis=-1)
    columns[~np.isfinite(columns)] = 0.0
    return columns.astype(np.float32)


def _number_by_number(
    problem: Problem,
    record: MeasuredRecord,
    effects: tuple[Effect, ...],
    every: Sequence[Inexact],
    end: float | None,
    both: bool,
) -> Iterator[list[FloatArray]]:
    """The columns of each number in turn."""
    sizes, here = problem.sizes.get(record.name), {}
    norms: dict[str, list[float]] = {}
    last = problem.marginal.slopes.get(record.name) if problem.marginal is not None else None
    if last is not None:
        for one, norm in zip(last.what, last.norms, strict=True):
            norms.setdefault(one.name, []).append(float(norm))
        if sizes is not None:
            here = {one.name: (one, v) for one, v in last.moved(sizes)}
    # A pose asks for a geometry of its own, in which moved masses would have to be found anew.
    still = {name: pair for name, pair in here.items() if pair[0].where != "structure"}
    about = {
        False: (here, _moved_residual(problem, record, effects, here.values(), end)),
        True: (still, _moved_residual(problem, record, effects, still.values(), end)),
    }
    turned: dict[int, tuple[float, list[FloatArray]]] = {}
    quickly = _by_modes(problem, record, effects, every, here, end)
    for one in every:
        if one.name in quickly:
            yield quickly[one.name]
            continue
        if one.where == POSE:  # its zero and its repeatability turn a joint alike
            index, sigma = one.change
            if index not in turned:
                there, base = about[True]
                turned[index] = (
                    sigma,
                    _columns(problem, record, effects, base, one, there, end),
                )
            known, columns = turned[index]
            yield [sigma / known * column for column in columns]
            continue
        there, base = about[False]
        move = partial(_columns, problem, record, effects, base, one, there, end, norms)
        ahead = move()
        if both and one.where == "structure":
            behind = move(way=-1.0)
            ahead = [between(a, b) for a, b in zip(ahead, behind, strict=True)]
        yield ahead
    if not every:
        yield [np.zeros((*about[False][1].shape, 0))]


def _by_modes(
    problem: Problem,
    record: MeasuredRecord,
    effects: tuple[Effect, ...],
    every: Sequence[Inexact],
    here: Mapping[str, tuple[Inexact, FloatArray]],
    end: float | None,
) -> dict[str, list[FloatArray]]:
    """Columns (channels, m) of the numbers of which they are known without integrating anew.

    Both ways where that can be: what they do to the matrices is exact to the second order.
    """
    blows = len(starts(record))
    numbers = [
        (one, blow)
        for one in every
        if one.where in BY_MODES
        for blow in range(blows if one.each_blow else 1)
    ]
    model = problem.model.with_effects(effects)

    def found() -> FloatArray | None:
        there, more = nudged(record, list(here.values()))

        def moved(one: Inexact, blow: int, step: float) -> Model:
            if one.where == "structure":
                # By itself, after the others: these are put into a plant once.
                return _under(model, (*more, Nudge([(one, np.array([step]))], "structure")))
            return _under(model, nudged(record, _moved_on(here, one, blow, step))[1])

        pairs = []
        for one, blow in numbers:
            ends = (0.0, 2.0 * _STRUCTURE) if one.one_way else (-_STRUCTURE, _STRUCTURE)
            pairs.append((moved(one, blow, ends[0]), moved(one, blow, ends[1])))
        return residual_changes(
            record, model, there, _under(model, more), pairs, end, each_blow=True
        )

    changes = attempt("slopes", found)
    columns: dict[str, list[FloatArray]] = {}
    for (one, _), change in zip(numbers, () if changes is None else changes, strict=False):
        columns.setdefault(one.name, []).append(change / (2.0 * _STRUCTURE))
    known = {name: np.isfinite([own.sum() for own in each]).all() for name, each in columns.items()}
    return {name: each for name, each in columns.items() if known[name]}


def _moved_on(
    here: Mapping[str, tuple[Inexact, FloatArray]], one: Inexact, blow: int, step: float
) -> list[tuple[Inexact, FloatArray]]:
    """What is moved, with one number a little further."""
    if one.where == "structure" or one.name not in here:
        # What is moved already stays as it is, and so need not be found anew.
        return [*here.values(), (one, step * np.eye(blow + 1)[blow])]
    size = here[one.name][1].copy()
    size[blow] += step
    # In its place: turns about several axes in another order are another turn.
    return [(one, size) if name == one.name else pair for name, pair in here.items()]


def _under(model: Model, more: Sequence[Effect]) -> Model:
    return replace(model, effects=(*model.effects, *more))


def _columns(
    problem: Problem,
    record: MeasuredRecord,
    effects: tuple[Effect, ...],
    base: FloatArray,
    one: Inexact,
    here: Mapping[str, tuple[Inexact, FloatArray]],
    end: float | None,
    norms: Mapping[str, Sequence[float]] = {},
    way: float = 1.0,
) -> list[FloatArray]:
    """The change of the residual (channels, m): of every blow, where each has its own number.

    `norms` are those of the columns when they were last taken, which tell how fine a step need be.
    """
    step = way * _STRUCTURE if one.where == "structure" else _STEP
    if one.where == POSE:
        step = _TURN / one.change[1]

    rough = any(effect.where == "nonlinear" for effect in effects) and one.where != POSE

    def fine_step(norm: float) -> float:
        return math.copysign(max(_SEEN / max(norm, 1e-300), _FINEST), way)

    def change(blow: int, step: float) -> FloatArray:
        there = _moved_on(here, one, blow, step)
        moved = attempt(one.name, lambda: _moved_residual(problem, record, effects, there, end))
        found = np.zeros_like(base) if moved is None else (moved - base) / step
        fine = fine_step(float(np.linalg.norm(found)))
        if not rough or abs(fine) > 0.5 * abs(step) or abs(step) <= _FINEST:
            return found
        # Where a joint sticks once more within the step, the slope is none of either side.
        finer = change(blow, fine)
        # Where it does so however fine the step is, the quotient grows without bound.
        return finer if np.linalg.norm(finer) < JUMP * np.linalg.norm(found) else found

    # Each blow by itself: the first one's change, moved to the others, falls between samples, and
    # the little that is then wrong of all of them alike passes for a force that drifts.
    steps = [step] * (len(starts(record)) if one.each_blow else 1)
    if rough:
        for blow, norm in enumerate(norms.get(one.name, ())):
            steps[blow] = min(step, fine_step(norm), key=abs)
    return [change(blow, each) for blow, each in enumerate(steps)]


def _moved_residual(
    problem: Problem,
    record: MeasuredRecord,
    effects: tuple[Effect, ...],
    sizes: Iterable[tuple[Inexact, FloatArray]],
    end: float | None,
) -> FloatArray:
    there, more = nudged(record, list(sizes))
    return residual_under(record, problem.model.with_effects(effects), there, more, end)


def starts(record: MeasuredRecord) -> list[float]:
    """When each blow of a record begins, s.

    Args:
        record: with its blows.

    Returns:
        one a blow, as many as its numbers of hits differ.
    """
    blows = record.setup.blows
    return [float(blows.start[blows.hit == hit].min()) for hit in np.unique(blows.hit)]
