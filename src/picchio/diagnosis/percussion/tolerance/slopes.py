"""How what is never exact moves the residuals of every record."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.attempt import attempt
from picchio.diagnosis.percussion.data.problem import MeasuredRecord, Problem, residual_under
from picchio.diagnosis.percussion.fit.parallel import worker_pool
from picchio.diagnosis.percussion.tolerance.nudges import POSE, Inexact, inexact, nudged
from picchio.model.effects.effect import Effect

# By so many standard deviations a number is moved to see what it does; one of the structure, which
# changes frequencies, by less, and a joint by so many rad. A blow that is moved by less than what
# its edge is known by stays where it is.
_STEP = 0.1
_STRUCTURE = 0.05
_TURN = 5e-6


@dataclass(frozen=True, eq=False)
class Slopes:
    """What one standard deviation of everything inexact does to a record.

    Attributes:
        what: the numbers, each as often as it has columns: the record's own first.
        own: how many columns are the record's own; the others the campaign shares.
        columns: (channels, samples, columns) in units of the noise, in single precision.
    """

    what: tuple[Inexact, ...]
    own: int
    columns: np.ndarray

    @property
    def means(self) -> tuple[str, ...]:
        """Of every column the effect and target that stand for it as a cause; empty for none."""
        return tuple(one.means for one in self.what)

    def moved(self, sizes: FloatArray) -> list[tuple[Inexact, FloatArray]]:
        """What is moved by how many standard deviations, (numbers,) each.

        Args:
            sizes: (columns,) standard deviations.
        """
        found: dict[str, tuple[Inexact, list[float]]] = {}
        for one, size in zip(self.what, sizes, strict=True):
            found.setdefault(one.name, (one, []))[1].append(float(size))
        return [(one, np.array(numbers)) for one, numbers in found.values()]


def all_slopes(
    problem: Problem, effects: Sequence[Effect], end: float | None = None, both: bool = False
) -> dict[str, Slopes]:
    """The slopes of every record about a model.

    Args:
        problem: data and noise, and where its inexact numbers are now.
        effects: of the model.
        end: s, up to when; None for whole records.
        both: whether the structure is moved either way: slopes are then exact to the second order.

    Returns:
        by the record's name.
    """
    every = {r.name: inexact(problem, r, problem.campaign.tolerance) for r in problem.records}
    poses: dict[int, list[MeasuredRecord]] = {}
    for record in problem.records:
        poses.setdefault(record.pose, []).append(record)

    def at_pose(pose: int) -> list[np.ndarray]:
        # Records of one pose share what its geometry costs.
        found = []
        for record in poses[pose]:
            ahead = _of_record(problem, record, tuple(effects), every[record.name], end, 1.0)
            if both:
                behind = _of_record(problem, record, tuple(effects), every[record.name], end, -1.0)
                ahead = 0.5 * (ahead + behind)
            found.append(ahead)
        return found

    with problem.pinned(effects), worker_pool(problem.workers, {"slopes": at_pose}) as mapped:
        found = mapped("slopes", poses)
    slopes = {}
    for records, columns in zip(poses.values(), found, strict=True):
        for record, own in zip(records, columns or (), strict=False):
            blows = len(_starts(record))
            what = tuple(w for w in every[record.name] for _ in range(blows if w.each_blow else 1))
            slopes[record.name] = Slopes(what, sum(not w.once for w in what), own)
    return slopes


def _of_record(
    problem: Problem,
    record: MeasuredRecord,
    effects: tuple[Effect, ...],
    every: Sequence[Inexact],
    end: float | None,
    way: float,
) -> np.ndarray:
    """(channels, samples, columns) in single precision."""
    sizes = problem.sizes.get(record.name)
    here = {}
    if sizes is not None and problem.marginal is not None:
        here = {one.name: (one, v) for one, v in problem.marginal.slopes[record.name].moved(sizes)}
    # A pose asks for a geometry of its own, in which moved masses would have to be found anew.
    still = {name: pair for name, pair in here.items() if pair[0].where != "structure"}
    found: list[FloatArray] = []
    with np.errstate(all="ignore"):
        about = {
            False: (here, _moved_residual(problem, record, effects, here.values(), end)),
            True: (still, _moved_residual(problem, record, effects, still.values(), end)),
        }
        for one in every:
            there, base = about[one.where == POSE]
            found += _columns(problem, record, effects, base, one, there, end, way)
    columns = np.stack(found, axis=-1) if found else np.zeros((*base.shape, 0))
    columns[~np.isfinite(columns)] = 0.0
    return columns.astype(np.float32)


def _columns(
    problem: Problem,
    record: MeasuredRecord,
    effects: tuple[Effect, ...],
    base: FloatArray,
    one: Inexact,
    here: Mapping[str, tuple[Inexact, FloatArray]],
    end: float | None,
    way: float,
) -> Iterator[FloatArray]:
    """The change of the residual (channels, m): of every blow, where each has its own number."""
    step = way * _STRUCTURE if one.where == "structure" else _STEP
    if one.where == POSE:
        step = _TURN / one.change[1]
    there = list(here.values())
    if one.where == "structure" or one.name not in here:
        # What is moved already stays as it is, and so need not be found anew.
        there.append((one, np.array([step])))
    else:
        size = here[one.name][1].copy()
        size[0] += step
        there = [pair for pair in there if pair[0].name != one.name] + [(one, size)]
    moved = attempt(one.name, lambda: _moved_residual(problem, record, effects, there, end))
    change = np.zeros_like(base) if moved is None else (moved - base) / step
    if one.each_blow:
        yield from _every_blow(record, change)
    else:
        yield change


def _moved_residual(
    problem: Problem,
    record: MeasuredRecord,
    effects: tuple[Effect, ...],
    sizes: Iterable[tuple[Inexact, FloatArray]],
    end: float | None,
) -> FloatArray:
    there, more = nudged(record, list(sizes))
    return residual_under(record, problem.model.with_effects(effects), there, more, end)


def _every_blow(record: MeasuredRecord, first: FloatArray) -> Iterator[FloatArray]:
    """The first blow's change, moved to every blow: the answer to a blow is nearly its own."""
    samples = np.arange(first.shape[1], dtype=float)
    starts = _starts(record)
    for start in starts:
        shift = (start - starts[0]) / record.setup.samples.step
        yield np.array([np.interp(samples - shift, samples, row, left=0.0) for row in first])


def _starts(record: MeasuredRecord) -> list[float]:
    """When each blow of a record begins, s."""
    blows = record.setup.blows
    return [float(blows.start[blows.hit == hit].min()) for hit in np.unique(blows.hit)]
