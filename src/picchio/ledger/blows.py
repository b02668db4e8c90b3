"""From what a ledger holds to blows and bursts: a function of the samples in the order of time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from picchio.core.arrays import FloatArray, IndexArray
from picchio.core.errors import InputError
from picchio.ledger.store import Kept, pieces
from picchio.model.model import Model
from picchio.studies.tasks import Operation

# The motor side of a joint that is held stands still to less than this, rad or m.
_SAME_POSE = 2e-3
# Blows that are computed as one history: a longer one is cut, and rings down as if from there.
_LONGEST = 600
_AT_ONCE = 512  # blows whose poses are looked at together
# A smooth blow of 20 samples has 0.2 % less impulse by straight lines: four times as many do.
_FINER = 4


SEEN = ("force", "acceleration")
"""Kinds of blows whose size was logged."""


@dataclass(frozen=True, eq=False, slots=True)
class Blow:
    """One blow.

    Attributes:
        onset: ns from 1970, of its first sample above the foot.
        kind: how it was told: see `picchio.ledger.samples.KINDS`.
        time: (m,) s after the onset.
        force: (m,) N along the direction.
        direction: (3,) unit, world.
        pose: (nv,) rad or m.
        cut: whether a log begins or ends within it.
        samples: that lie within it; 0 where none was seen.
    """

    onset: int
    kind: str
    time: FloatArray
    force: FloatArray
    direction: FloatArray
    pose: FloatArray
    cut: bool = False
    samples: int = 0

    @property
    def seen(self) -> bool:
        """Whether its size was logged, and not assumed."""
        return self.kind in SEEN

    @property
    def peak(self) -> float:
        """N, its largest force."""
        return float(np.abs(self.force).max())

    @property
    def impulse(self) -> float:
        """N s."""
        return float(np.trapezoid(self.force, self.time))


@dataclass(frozen=True, eq=False)
class Burst:
    """Blows that follow one another at one pose before the robot has come to rest.

    Attributes:
        blows: by time.
        start: (m,) s from the first onset, of straight pieces of the force; the last is endless.
        constant: (m,) N at the start of each.
        slope: (m,) N/s.
        direction: (3,) unit, world.
        pose: (nv,) rad or m.
    """

    blows: tuple[Blow, ...]
    start: FloatArray
    constant: FloatArray
    slope: FloatArray
    direction: FloatArray
    pose: FloatArray

    @property
    def onset(self) -> int:
        """Ns from 1970, of the first blow."""
        return self.blows[0].onset


def covered(spans: IndexArray, gap: int) -> IndexArray:
    """(s, 2) the time that was logged, ns, as intervals that do not touch, ascending.

    Args:
        spans: (r, 2) in any order, overlaps included.
        gap: ns, over which two are one.
    """
    if not len(spans):
        return np.empty((0, 2), np.int64)
    order = spans[np.lexsort((spans[:, 1], spans[:, 0]))]
    ends = np.maximum.accumulate(order[:, 1])
    cuts = np.flatnonzero(order[1:, 0] - ends[:-1] > gap) + 1
    return np.column_stack([order[np.append(0, cuts), 0], ends[np.append(cuts - 1, len(ends) - 1)]])


def uncovered(blows: Iterable[Blow], intervals: IndexArray) -> Iterator[Blow]:
    """The blows that begin in none of some intervals.

    Args:
        blows: any.
        intervals: (s, 2) ns, as of `covered`.
    """
    for blow in blows:
        at = int(np.searchsorted(intervals[:, 0], blow.onset, side="right"))
        if not (intervals[at - 1 : at, 1] >= blow.onset).any():
            yield blow


@dataclass(frozen=True, eq=False)
class Run:
    """Neighbouring samples that may be a blow, or some: see `Stream.active`.

    Attributes:
        onset: ns, its first sample.
        last: ns, its last one.
        stamps: (m,) ns, with the sample before and after where there is one.
        values: (m, k).
        pose: (nv,).
        cut: whether the sample before or after is missing.
    """

    onset: int
    last: int
    stamps: IndexArray
    values: FloatArray
    pose: FloatArray
    cut: bool


def runs(kept: Kept) -> list[Run]:
    """The runs of a stream, by time.

    Args:
        kept: what the ledger holds of it.

    Raises:
        InputError: no pose anywhere.
    """
    stream, found = kept.stream, []
    size = stream.size(kept.values)
    around = 0 if stream.hold else 1
    for piece in pieces(kept.stamps, stream.gap):
        own, stamps, values = size[piece], kept.stamps[piece], kept.values[piece]
        for a, b in zip(*stream.active(stamps, own), strict=True):
            first, last = max(a - around, 0), min(b + around, own.size)
            at = np.searchsorted(kept.pose_stamps, stamps[a], side="right") - 1
            if not len(kept.poses):
                raise InputError("no position was logged, so that nobody knows where the robot "
                                 "stood", key="channel")  # fmt: skip
            found.append(
                Run(
                    int(stamps[a]), int(stamps[b - 1]), stamps[first:last], values[first:last],
                    kept.poses[max(at, 0)], first == a or last == b,
                )
            )  # fmt: skip
    return found


def shaped(
    stamps: IndexArray, values: FloatArray, onset: int, last: int
) -> tuple[FloatArray, FloatArray]:
    """A blow's force between its samples: Akima's curve, which no jump makes swing.

    A blow begins and ends between samples: where its first two, or its last two, lie on a line that
    comes from zero in the step beyond them, it is there. Without this a half-sine of 20 samples has
    0.2 % too much impulse.

    Args:
        stamps: (m,) ns.
        values: (m,) N.
        onset: ns, of the first sample above the foot.
        last: ns, of the last one.

    Returns:
        (r,) s after the onset, (r,) N: straight lines between these are near enough.

    Source: Akima, J. ACM 17 (1970) 589-602.
    """
    time = (stamps - onset) * 1e-9
    if time.size < 5:
        return time, values
    from picchio.ledger.damage_kernel import akima

    values = values.copy()
    if stamps[0] < onset:
        time[0], values[0] = _zero(time[:3], values[:3])
    if stamps[-1] > last:
        time[-1], values[-1] = _zero(time[:-4:-1], values[:-4:-1])
    return akima(time, np.ascontiguousarray(values), _FINER)


def _zero(time: FloatArray, values: FloatArray) -> tuple[float, float]:
    """Where a force that stands at a first sample is zero before it; else the sample as it is.

    Args:
        time: (3,) s: beyond the blow, its outermost sample, the next one.
        values: (3,) N.
    """
    step = values[2] - values[1]
    back = values[1] / step if step * values[1] > 0.0 else np.inf  # of the inner step
    at = time[1] - back * (time[2] - time[1])
    share = (at - time[1]) / (time[0] - time[1])  # of the outer step
    if not share < 1.0:
        return float(time[0]), float(values[0])
    return float(time[1] + max(share, 0.05) * (time[0] - time[1])), 0.0


def measured(
    run: Run, direction: FloatArray | None, rotation: Callable[[FloatArray], FloatArray] | None
) -> Blow:
    """The blow that a run of a force is.

    Args:
        run: its samples.
        direction: (3,) unit, of one channel; None of three.
        rotation: from a pose to (3, 3), the axes that the direction or the channels are in; None
            where they are the world's.
    """
    turn = np.eye(3) if rotation is None else rotation(run.pose)
    if direction is not None:
        along, values = direction, run.values[:, 0]
    else:
        whole = run.values.sum(axis=0)
        along = whole / np.linalg.norm(whole)
        values = run.values @ along
    time, force = shaped(run.stamps, values, run.onset, run.last)
    within = int(((run.stamps >= run.onset) & (run.stamps <= run.last)).sum())
    return Blow(run.onset, "force", time, force, turn @ along, run.pose, run.cut, within)


Shape = tuple[float, FloatArray, FloatArray]
"""Of a blow that is assumed: s after the first one, s after its own onset, N."""


def assumed(
    run: Run,
    operation: Operation,
    kind: str,
    count: int,
    model: Model,
    shapes: dict[tuple[int, int], list[Shape]] | None = None,
) -> list[Blow]:
    """Blows that nobody saw: those of the task, as the model's effects on them have it.

    Args:
        run: while the tool was on, or at a blow.
        operation: its blows and direction.
        kind: of the stream.
        count: of blows.
        model: the robot and its effects.
        shapes: those that were made before for the same operations, and are added to.

    Returns:
        the blows, by time.
    """
    robot = model.robot
    frame = robot.frame_placement(run.pose, robot.tool_frame)[1]
    along = model.force_directions(frame) @ operation.direction
    known: dict[tuple[int, int], list[Shape]] = {} if shapes is None else shapes
    found = []
    for first in range(0, count, _LONGEST):
        key = id(operation), min(count - first, _LONGEST)
        if key not in known:
            known[key] = _shapes(operation, key[1], model)
        begin = first * operation.excitation.period
        for after, time, force in known[key]:
            onset = run.onset + round((begin + after) * 1e9)
            found.append(Blow(onset, kind, time, force, along, run.pose, False))
    return found


def _shapes(operation: Operation, hits: int, model: Model) -> list[Shape]:
    """So many blows of an operation."""
    period = operation.excitation.period
    force = model.force(operation.excitation, hits)
    # A piece belongs to the blow in whose period it begins; the last one is silence.
    of = np.clip(((force.start[:-1] + 1e-9) / period).astype(int), 0, hits - 1)
    found = []
    for k in range(hits):
        time, values = [np.zeros(1)], [np.zeros(1)]
        for piece in np.flatnonzero(of == k):
            start, end = force.start[piece], force.start[piece + 1]
            inner = np.linspace(0.0, end - start, 33 if force.amplitude[piece] else 2)
            size = force.in_piece(np.full(inner.size, piece), inner)
            if size.any():
                time.append(start - k * period + inner)
                values.append(size)
        found.append((k * period, np.concatenate(time), np.concatenate(values)))
    return found


def bursts(blows: Iterable[Blow], rest: Callable[[FloatArray], FloatArray]) -> Iterator[Burst]:
    """The blows that are computed together, by time.

    A blow joins the one before it where the robot stands at the same pose and has not come to
    rest.

    Args:
        blows: by time.
        rest: from poses (p, nv) to (p,) s: how long the robot rings there.
    """
    coming = iter(blows)
    part: list[Blow] = []
    while new := list(islice(coming, _AT_ONCE)):
        row = [*part[-1:], *new]
        poses = np.array([blow.pose for blow in row])
        onset = np.array([blow.onset for blow in row])
        end = np.array([blow.onset + int(blow.time[-1] * 1e9) for blow in row])
        moved = np.abs(np.diff(poses, axis=0)).max(axis=1) > _SAME_POSE
        places, which = np.unique(poses[:-1], axis=0, return_inverse=True)
        near = (onset[1:] - end[:-1]) * 1e-9 < rest(places)[which.ravel()]
        part += new[: len(new) - len(moved)]  # the very first one
        for blow, joins in zip(row[1:], near & ~moved, strict=True):
            if not joins or len(part) >= _LONGEST:
                yield burst(part)
                part = []
            part.append(blow)
    if part:
        yield burst(part)


def burst(blows: Sequence[Blow]) -> Burst:
    """Blows as one history of the force, zero between them.

    Args:
        blows: by time, at one pose.

    Returns:
        the burst.
    """
    impulses = np.array([blow.impulse for blow in blows])
    along = np.array([blow.direction for blow in blows])
    whole = (impulses[:, None] * along).sum(axis=0)
    length = np.linalg.norm(whole)
    direction = whole / length if length > 0.0 else along[0]
    first = blows[0].onset
    offset = -float(blows[0].time[0])  # the sample before the onset is the beginning
    start, constant, slope = [], [], []
    reached = -np.inf
    for blow in blows:
        time = (blow.onset - first) * 1e-9 + offset + blow.time
        force = blow.force * float(blow.direction @ direction)
        late = time >= reached
        if late.sum() < 2:
            continue
        time, force = time[late], force[late]
        rises, steps = np.diff(force), np.diff(time)
        start.append(time)
        constant.append(np.append(force[:-1], 0.0))
        slope.append(np.append(np.divide(rises, steps, np.zeros(steps.size), where=steps > 0.0), 0))
        reached = float(time[-1])
    begin = np.concatenate(start)
    # A blow that begins where the last one ends leaves no silence between them.
    keep = np.append(np.diff(begin) > 0.0, True)
    begin, level, rise = (x[keep] for x in (begin, np.concatenate(constant), np.concatenate(slope)))
    return Burst(tuple(blows), begin - begin[0], level, rise, direction, blows[0].pose)
