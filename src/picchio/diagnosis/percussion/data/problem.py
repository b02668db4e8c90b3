"""Measured records beside their prediction: residuals in units of their noise."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from picchio.campaign.campaign import Campaign
from picchio.campaign.channels import Channel
from picchio.core.arrays import BoolArray, FloatArray
from picchio.core.errors import InputError
from picchio.core.recent import Recent
from picchio.diagnosis.percussion.data.noise import quiet_noise
from picchio.excitation.piecewise import PiecewiseForce
from picchio.measurement.noise.estimate import noise_levels
from picchio.measurement.noise.level import Noise
from picchio.model.effects.effect import Effect
from picchio.model.model import Model
from picchio.prediction.percussion import PercussionSetup, percussion_setups
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.vibration.integration.integrate import Samples

if TYPE_CHECKING:
    from picchio.diagnosis.percussion.fit.parallel import _Helpers
    from picchio.diagnosis.percussion.tolerance.marginal import Marginal, TakenUp

# A sample this near a jump of the force, but not on it, holds neither side for sure: a sensor of
# finite bandwidth smears a jump, and what keeps it from aliasing by about half a sample.
_NEAR_EDGE = 1.8e-4
# s, more: two samples that stand alike on either side of an edge are to be both in or both out,
# whatever a fit does to the clock; else it gains by moving one of them out.
_MARGIN = 2e-5
_SMEARED = 0.5
_ON_EDGE = 1e-7
_SMALL_JUMP = 0.05
_KEPT_EDGES = 8
# So many times the tolerated rise time after an edge the force may still be on its way.
_RISES = 3.0


@dataclass(frozen=True, eq=False)
class MeasuredRecord:
    """One record to be explained.

    Attributes:
        setup: what is needed to predict it.
        values: channel -> (m,) SI.
        noise: channel -> its noise at the record's rate.
        pose: number of its pose among the campaign's.
        smeared: s, more than usual by which a sample may be away from a jump and not tell its side.
    """

    setup: PercussionSetup
    values: Mapping[str, FloatArray]
    noise: Mapping[str, Noise]
    pose: int
    smeared: float = 0.0
    _cuts: dict[float, PercussionSetup] = field(default_factory=dict)
    _edges: Recent[dict[str, BoolArray] | None] = field(default_factory=lambda: Recent(_KEPT_EDGES))
    _fillers: dict[str, FloatArray] = field(default_factory=dict)
    _pinned: list[dict[str, BoolArray] | None] = field(default_factory=list)

    @property
    def name(self) -> str:
        """Its file."""
        return self.setup.name

    @cached_property
    def channels(self) -> list[Channel]:
        """The channels of `values`, in their order."""
        known = {channel.name: channel for channel in self.setup.channels}
        return [known[name] for name in self.values]

    def filler(self, channel: str) -> FloatArray:
        """(m,) of +-1 without a pattern, always the same: in place of what is not known.

        Args:
            channel: its name.
        """
        if channel not in self._fillers:
            seed = zlib.crc32(f"{self.name}/{channel}".encode())
            signs = np.random.default_rng(seed).integers(0, 2, self.setup.samples.count)
            self._fillers[channel] = 2.0 * signs - 1.0
        return self._fillers[channel]

    def until(self, end: float | None) -> PercussionSetup:
        """The setup up to a time, s.

        Args:
            end: s; None for all of the record.
        """
        clock = self.setup.samples
        if end is None or end >= clock.last:
            return self.setup
        if end not in self._cuts:
            count = int(np.searchsorted(clock.times, end + 1e-9))
            self._cuts[end] = replace(self.setup, samples=replace(clock, count=count))
        return self._cuts[end]


@dataclass(frozen=True, eq=False)
class Moved:
    """Where a record's inexact numbers are taken to be: what is linearised is linearised there.

    Attributes:
        record: with its pose moved.
        effects: what else is moved.
        size: (columns,) standard deviations by which all is.
    """

    record: MeasuredRecord
    effects: tuple[Effect, ...]
    size: FloatArray


def near_edges(
    setup: PercussionSetup, model: Model, smeared: float = 0.0
) -> dict[str, BoolArray] | None:
    """Which samples of each group stand so near a jump that either side may be meant.

    Args:
        setup: of the record.
        model: whose blows and sensors count.
        smeared: s, more than usual by which a sample may be away.

    Returns:
        (samples,) of each group; None where nothing jumps.
    """
    force = setup.struck(model).unit
    sensors, clock = model.sensors(setup.conditions), setup.samples
    found = {}
    for group in setup.groups:
        timing = sensors.get(group).timing
        near = setup.in_common.edges.get(
            (force, clock, timing, smeared), partial(_marked, force, clock, *timing, smeared)
        )
        if near is None:
            return None
        found[group] = near
    return found


def _marked(
    force: PiecewiseForce, clock: Samples, delay: float, rate: float, smeared: float
) -> BoolArray | None:
    """(count,) which samples of a sensor; None where nothing jumps."""
    from picchio.diagnosis.percussion.data.residual_kernel import near_edges as mark

    edges = force.start
    if edges.size > 400:  # a measured history has no jumps
        return None
    jump = np.abs(force(edges + _ON_EDGE) - force(edges - _ON_EDGE))
    edges = edges[jump > _SMALL_JUMP * max(float(jump.max()), 1e-300)]
    if not edges.size:
        return None
    if np.isfinite(force.end):
        edges = (edges + force.end * np.arange(int(clock.last / force.end) + 2)[:, None]).ravel()
    near = max(_NEAR_EDGE, _SMEARED * clock.step) + _MARGIN + smeared
    out = np.empty(clock.count, dtype=bool)
    mark(clock.start, clock.step, rate, delay, edges, near, out)
    return out


# Effects of the model whose edges are held fixed.
Pin = tuple[Effect, ...]


class Problem:
    """A campaign's percussion records, a robot, and the noise between them.

    Args:
        robot: the robot as its files have it.
        campaign: the records.
        gravity_stiffness: whether gravity's change with the deflection counts.
        workers: processes for what is independent; as many as cores where None.

    Attributes:
        shifts: (channels, m) by record, what all that is moved does to the residual by the slopes:
            it is added again; without, the residual is as it is there.
        idle: numbers that are not exact but that no record shows, such as the centre of mass of a
            link that turns about its own axis.
        unsettled: chi-square per sample that what is not exact leaves on the average, where it is
            neither integrated out nor settled; else 0.

    Raises:
        InputError: no percussion record, or none with a channel that can be predicted.
    """

    def __init__(
        self,
        robot: FlexibleRobot,
        campaign: Campaign,
        *,
        gravity_stiffness: bool = True,
        workers: int | None = 1,
    ) -> None:
        self.workers = workers
        self.helpers: _Helpers | None = None
        self.marginal: Marginal | None = None
        self.moved: dict[str, Moved] = {}
        self.shifts: dict[str, FloatArray] = {}
        self.sizes: dict[str, FloatArray] = {}
        self.idle: frozenset[str] = frozenset()
        self.unsettled = 0.0
        self.pins: list[Pin] = []
        self.robot, self.campaign = robot, campaign
        self.model = Model(robot, gravity_stiffness)
        setups = percussion_setups(robot, campaign)
        values = [campaign[s.name].read([c.name for c in s.channels]) for s in setups]
        # From the quiet time where there is enough of it, else from all that can be used.
        noise = quiet_noise(setups, values)
        if any(c.name not in noise for s in setups for c in s.channels):
            noise = {**noise_levels(campaign), **noise}
        self.noise = noise
        poses: dict[bytes, int] = {}
        self.records: list[MeasuredRecord] = []
        for setup, data in zip(setups, values, strict=True):
            names = [c.name for c in setup.channels if noise[c.name].std > 0.0]
            if not names:
                continue
            rate = 1.0 / setup.samples.step
            self.records.append(
                MeasuredRecord(
                    setup,
                    {name: data[name] for name in names},
                    {name: noise[name].at(rate) for name in names},
                    poses.setdefault(setup.geometry.pose.tobytes(), len(poses)),
                    _RISES * campaign.tolerance.rise_time,
                )
            )
        if not self.records:
            raise InputError(
                "no percussion record with a channel that can be predicted",
                file=campaign.folder,
                hint="percussion records need pose, direction and accelerations or deflections",
            )
        self.n_poses = len(poses)

    @property
    def groups(self) -> tuple[str, ...]:
        """All channel groups."""
        return tuple(dict.fromkeys(g for r in self.records for g in r.setup.groups))

    @property
    def recorded(self) -> bool:
        """Whether the force of every record was read, no blows being stated."""
        return all(record.setup.blows.recorded for record in self.records)

    @cached_property
    def natural_frequencies(self) -> FloatArray:
        """(poses, modes) Hz, ascending; of the nominal robot."""
        geometries = {record.pose: record.setup.geometry for record in self.records}
        found = []
        for geometry in geometries.values():
            system = self.model.plant(geometry).build(np.array([0.0, 0.0, 1.0]))
            squared = np.linalg.eigvals(np.linalg.solve(system.mass, system.stiffness)).real
            found.append(np.sort(np.sqrt(np.maximum(squared, 0.0))) / (2.0 * np.pi))
        return np.array(found)

    def residuals(
        self,
        effects: Iterable[Effect],
        records: Sequence[MeasuredRecord] | None = None,
        end: float | None = None,
    ) -> list[FloatArray]:
        """Whitened residuals of every record, (channels, m): unit variance where all is noise.

        What is never exact is integrated out, once its slopes are known (`marginal`).

        Args:
            effects: of the model.
            records: all where None.
            end: s, look no further.

        Returns:
            an array (channels, m) a record.
        """
        chosen = self.records if records is None else records
        wanted = tuple(effects)
        found = self.unmarginalised(wanted, chosen, end)
        if self.marginal is None or not chosen:
            return found
        names = [record.name for record in chosen]
        return self.marginal.whitened(found, names, (effect.label for effect in wanted))

    def taken_up(
        self,
        effects: Iterable[Effect],
        records: Sequence[MeasuredRecord] | None = None,
        temper: float = 1.0,
    ) -> TakenUp | None:
        """Where a model asks what is not exact to be, and what that leaves.

        Args:
            effects: of the model.
            records: all where None.
            temper: variance of what the residuals hold beside the inexact numbers, 1 for noise.

        Returns:
            None where nothing is integrated out.
        """
        chosen = self.records if records is None else records
        if self.marginal is None or not chosen:
            return None
        wanted = tuple(effects)
        raw = self.unmarginalised(wanted, chosen)
        names = [record.name for record in chosen]
        return self.marginal.taken_up(raw, names, temper, (e.label for e in wanted))

    def unmarginalised(
        self,
        effects: Iterable[Effect],
        records: Sequence[MeasuredRecord] | None = None,
        end: float | None = None,
    ) -> list[FloatArray]:
        """As `residuals`, in units of the noise alone.

        Args:
            effects: of the model.
            records: all where None.
            end: s, look no further.

        Returns:
            an array (channels, m) a record.
        """
        chosen = self.records if records is None else records
        wanted = tuple(effects)
        told = self.helpers.residuals(wanted, chosen, end) if self.helpers else None
        found = self.own_residuals(wanted, chosen, end) if told is None else told
        # Here, so that other processes need not know of it.
        for rows, record in zip(found, chosen, strict=True):
            if record.name in self.shifts:
                rows -= self.shifts[record.name][:, : rows.shape[1]]
        return found

    def own_residuals(
        self, effects: Iterable[Effect], records: Sequence[MeasuredRecord], end: float | None
    ) -> list[FloatArray]:
        """As `unmarginalised` without `shifts`, by this process alone.

        Args:
            effects: of the model.
            records: to predict.
            end: s, look no further; None for all.

        Raises:
            InputError: no model there, or one whose motion diverges: it is no explanation.
        """
        model = self.model.with_effects(effects)
        # One after the other: threads would wait for the interpreter most of the time.
        try:
            with np.errstate(all="ignore"):
                found = [self._residual(record, model, end) for record in records]
        except (ArithmeticError, np.linalg.LinAlgError) as error:
            raise InputError(f"no model that can be computed: {error}") from error
        if not all(math.isfinite(each.sum()) for each in found):
            raise InputError("no model that can be computed: the motion diverges")
        return found

    def _residual(self, record: MeasuredRecord, model: Model, end: float | None) -> FloatArray:
        moved = self.moved.get(record.name)
        if moved is None:
            return residual(record, model, end)
        return residual_under(record, model, moved.record, moved.effects, end)

    def changes(
        self,
        effects: Iterable[Effect],
        pairs: Sequence[tuple[Iterable[Effect], Iterable[Effect]]],
        records: Sequence[MeasuredRecord],
        end: float | None,
    ) -> list[list[FloatArray] | None]:
        """By how much `residuals` change between models that differ a little.

        Args:
            effects: about which model.
            pairs: the effects before and after each change.
            records: of which.
            end: s, look no further.

        Returns:
            per pair an array (channels, m) a record, to first order; None for a pair of which
            that is not known without integrating.
        """
        wanted = tuple(effects)
        asked = [(tuple(before), tuple(after)) for before, after in pairs]
        told = self.helpers.changes(wanted, asked, records, end) if self.helpers else None
        found = self.own_changes(wanted, asked, records, end) if told is None else told
        if all(each is None for each in found):
            return [None] * len(pairs)

        def change(record: MeasuredRecord, changes: FloatArray | None, k: int) -> FloatArray:
            if changes is not None:
                return np.asarray(changes[k])
            # As the slopes of what is not exact are taken in this record, or what no record can
            # tell, such as the mass of all, would seem to be told.
            before, after = map(self.model.with_effects, asked[k])
            return self._residual(record, after, end) - self._residual(record, before, end)

        names, labels = [r.name for r in records], [effect.label for effect in wanted]
        out: list[list[FloatArray] | None] = []
        for k in range(len(pairs)):
            known = all(e is None or math.isfinite(e[k].sum()) for e in found)
            own = [change(*each, k) for each in zip(records, found, strict=True)] if known else []
            if known and self.marginal is not None:
                own = self.marginal.whitened(own, names, labels)
            out.append(own if known else None)
        return out

    def own_changes(
        self,
        effects: Iterable[Effect],
        pairs: Sequence[tuple[Iterable[Effect], Iterable[Effect]]],
        records: Sequence[MeasuredRecord],
        end: float | None,
    ) -> list[FloatArray | None]:
        """As `changes`, in units of the noise alone, by this process alone.

        Args:
            effects: about which model.
            pairs: the effects before and after each change.
            records: of which.
            end: s, look no further.

        Returns:
            (pairs, channels, m) a record, as `residual_changes`.
        """
        model = self.model.with_effects(effects)
        around = [tuple(map(self.model.with_effects, pair)) for pair in pairs]
        found: list[FloatArray | None] = []
        for record in records:
            moved = self.moved.get(record.name)
            there, more = (record, ()) if moved is None else (moved.record, moved.effects)

            def under(one: Model, more: tuple[Effect, ...] = more) -> Model:
                return replace(one, effects=(*one.effects, *more)) if more else one

            both = [(under(one), under(other)) for one, other in around]
            found.append(residual_changes(record, model, there, under(model), both, end))
        return found

    def renew(self) -> None:
        """Have other processes see what was moved: they have it as it was when they began."""
        if self.helpers is not None:
            self.helpers.renew()

    @contextmanager
    def set_aside(self) -> Iterator[None]:
        """Within the block nothing is integrated out: what is not exact is where it is taken to be.

        Returns:
            a context manager.
        """
        kept = self.marginal, self.shifts
        self.marginal, self.shifts = None, {}
        try:
            yield
        finally:
            self.marginal, self.shifts = kept

    @contextmanager
    def pinned(self, effects: Iterable[Effect]) -> Iterator[None]:
        """Within the block, samples near edges are those of this model, whatever is tried.

        What moves edges changes which samples are known. A sample that is left out costs what
        noise does on average, one that is not costs what it happens to: by a choice among
        thousands of them a fit gains as much as a small cause does.

        Args:
            effects: of the model whose edges count.

        Returns:
            a context manager.
        """
        self.pin(tuple(effects))
        try:
            yield
        finally:
            self.unpin()

    def pin(self, pin: Pin) -> None:
        """As `pinned`, until `unpin`.

        Args:
            pin: the effects of the model whose edges count.
        """
        model = self.model.with_effects(pin)
        self.pins.append(pin)
        for record in self.records:
            record._pinned.append(near_edges(record.setup, model, record.smeared))

    def unpin(self) -> None:
        """Undo the last `pin`."""
        self.pins.pop()
        for record in self.records:
            record._pinned.pop()

    def predictions(
        self, effects: Iterable[Effect], records: Sequence[MeasuredRecord] | None = None
    ) -> list[dict[str, FloatArray]]:
        """What every channel would read.

        Args:
            effects: of the model.
            records: all where None.
        """
        model = self.model.with_effects(effects)
        chosen = self.records if records is None else records
        return [record.setup.predict(model) for record in chosen]


def residual_under(
    record: MeasuredRecord,
    model: Model,
    there: MeasuredRecord,
    more: Sequence[Effect],
    end: float | None = None,
) -> FloatArray:
    """As `residual`, with small changes of the record and the model.

    Args:
        record: as stated; with `model` it says which samples are known.
        model: without the changes.
        there: the record with its changes.
        more: what else is changed.
        end: s, up to when.
    """
    kept = _kept_edges(record, record.until(end), model)
    return residual(there, replace(model, effects=(*model.effects, *more)), end, lambda: kept)


def residual_changes(
    record: MeasuredRecord,
    model: Model,
    there: MeasuredRecord,
    about: Model,
    pairs: Sequence[tuple[Model, Model]],
    end: float | None = None,
    each_blow: bool = False,
) -> FloatArray | None:
    """By how much a record's whitened residual changes between models that differ a little.

    Args:
        record: as stated; with `model` it says which samples are known.
        model: without small changes.
        there: the record with its changes.
        about: the model with its changes: about which the residual is linear.
        pairs: the models before and after each change.
        end: s, up to when.
        each_blow: as of `PercussionSetup.changes`.

    Returns:
        (pairs, channels, m), to first order; not a number, or None for all, where that is not
        known without integrating (`PercussionSetup.changes`).
    """
    from picchio.diagnosis.percussion.data.residual_kernel import whitened

    setup = there.until(end)
    if any(e.latent and e.latent.linear and setup.name not in e.hidden for e in model.effects):
        return None
    found = setup.changes(about, pairs, each_blow)
    if found is None:
        return None
    masked = _kept_edges(record, record.until(end), model)
    count = setup.samples.count
    still, room, known = np.zeros(count), np.empty(count), np.zeros(0, bool)
    out = np.empty((len(pairs), len(record.values), count))
    for i, channel in enumerate(record.channels):
        free = setup.steady or channel.kind.free_offset
        jumps = masked is not None and channel.kind.jumps
        unknown = masked[channel.group] if masked is not None and jumps else known
        for k, change in enumerate(found[channel.name]):
            offset = -float(change.mean()) if free else 0.0
            whitened(
                still, change, offset, unknown, still,
                *record.noise[channel.name].model.filters, room, out[k, i],
            )  # fmt: skip
    return out


def residual(
    record: MeasuredRecord,
    model: Model,
    end: float | None = None,
    near: Callable[[], dict[str, BoolArray] | None] | None = None,
) -> FloatArray:
    """One record's whitened residual (channels, m) up to a time.

    Args:
        record: to predict.
        model: by which.
        end: s; None for all of the record.
        near: which samples stand near a jump; as the model has it where None.
    """
    from picchio.diagnosis.percussion.data.residual_kernel import whitened

    setup = record.until(end)
    predicted = setup.predict(model)
    count = setup.samples.count
    solved = [
        e for e in model.effects if e.latent and e.latent.linear and setup.name not in e.hidden
    ]
    if solved:
        rows = {name: values[:count] - predicted[name] for name, values in record.values.items()}
        for effect in solved:
            take_out(rows, setup, effect)
        predicted = {name: record.values[name][:count] - row for name, row in rows.items()}
    masked = _kept_edges(record, setup, model) if near is None else near()
    out, room, known = np.empty((len(record.values), count)), np.empty(count), np.zeros(0, bool)
    for i, channel in enumerate(record.channels):
        name = channel.name
        simulated = predicted[name]
        offset = 0.0
        if setup.steady or channel.kind.free_offset:
            offset = float((record.values[name][:count] - simulated).sum()) / count
        unknown = known
        if masked is not None and channel.kind.jumps:
            # Before the filter, which would spread what is not known, and after it; there as
            # large as noise, lest a fit gain by moving edges towards samples it misses.
            unknown = masked[channel.group]
        whitened(
            record.values[name], simulated, offset, unknown, record.filler(name),
            *record.noise[name].model.filters, room, out[i],
        )  # fmt: skip
    return out


def signal_power(records: Sequence[MeasuredRecord], end: float | None = None) -> float:
    """Sum of squares of all that was measured, in units of the noise.

    Args:
        records: which.
        end: s, up to when; None for all.
    """
    total = 0.0
    for record in records:
        count = None if end is None else record.until(end).samples.count
        for name, values in record.values.items():
            total += float(values[:count].var()) * len(values[:count]) / record.noise[name].std ** 2
    return total


def take_out(
    rows: dict[str, FloatArray], setup: PercussionSetup, effect: Effect
) -> tuple[float, ...]:
    """Subtract what an effect's own numbers explain of its group's channels, in place.

    Args:
        rows: channel -> (m,) residual.
        setup: of the record.
        effect: one whose readings are linear in the numbers that it draws.

    Returns:
        the numbers; 0 where the record has none of these channels.
    """
    names = [c.name for c in setup.channels if c.group == effect.target and c.name in rows]
    if not names:
        assert effect.latent is not None
        return (0.0,) * effect.latent.size(0)
    left, numbers = effect.take_out(np.stack([rows[n] for n in names]), setup.samples.times)
    rows |= dict(zip(names, left, strict=True))
    return numbers


def _kept_edges(
    record: MeasuredRecord, setup: PercussionSetup, model: Model
) -> dict[str, BoolArray] | None:
    """As `near_edges`, which most trials leave as it was, or as it was pinned."""
    if record._pinned:
        fixed = record._pinned[-1]
        count = setup.samples.count
        return None if fixed is None else {g: mask[:count] for g, mask in fixed.items()}
    key = (setup.samples, model.key("blows", "sensor"))
    return record._edges.get(key, lambda: near_edges(setup, model, record.smeared))


# Which records a model is fitted to, and which it is judged on.

# One pose of so many is held out.
_EVERY = 3

Split = tuple[list[MeasuredRecord], list[MeasuredRecord]]


def held_out(problem: Problem) -> list[Split]:
    """Ways to choose records to fit and records held out, the usual one first.

    Whole poses are held out, every third; of fewer poses every third record; of fewer records none.
    """
    ways: list[Split] = []
    for offset in reversed(range(_EVERY)):
        if problem.n_poses >= _EVERY:
            kept = [r for r in problem.records if r.pose % _EVERY == offset]
        elif len(problem.records) >= _EVERY:
            kept = problem.records[offset::_EVERY]
        else:
            return [(list(problem.records), [])]
        ways.append(([r for r in problem.records if r not in kept], kept))
    return ways
