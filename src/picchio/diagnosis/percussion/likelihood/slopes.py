"""How percussion records change with every number, to first order, as weights on few series.

What a linear arm answers to its blows is a sum of its modes' answers and of their changes with the
poles (Nelson, AIAA J. 14 (1976) 1201, doi:10.2514/3.7211): about four series a mode, the same for
all channels. A slope by a mass, a spring, a joint's angle, a sensor's place is weights on them.
They are whitened once a channel group, and products of slopes are products of weights.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from picchio.core.arrays import BoolArray, ComplexArray, FloatArray, IndexArray
from picchio.core.errors import InputError
from picchio.diagnosis.evidence.numbers import Numbers
from picchio.diagnosis.percussion.data.problem import MeasuredRecord
from picchio.diagnosis.percussion.likelihood.strike_kernel import answer, whiten_all
from picchio.diagnosis.percussion.tolerance.nudges import POSE, Inexact, Nudge, as_effects
from picchio.measurement.noise.autoregression import AutoRegression
from picchio.model.effects.effect import Effect
from picchio.model.model import Model
from picchio.model.sensing import SensorChain
from picchio.model.system import VibratingSystem
from picchio.prediction.percussion import (
    Struck,
    _differing,
    _slopes_of,
    apply_filters,
)
from picchio.vibration.integration.integrate import AtJumps, Samples
from picchio.vibration.integration.sensitivity import Strike, _Modes

if TYPE_CHECKING:
    from picchio.diagnosis.percussion.likelihood.percussion import Percussion

_STEP = 0.05  # of a standard deviation, by which a number is moved
_TURN = 1e-4  # rad, by which a joint is
_ALIKE = 1e-7  # of the largest pole: poles nearer than this are one


@dataclass(frozen=True, eq=False)
class Change:
    """By how much one number changes the equations of a pose's records, per unit of the number.

    Attributes:
        mass, stiffness, damping: (n, n).
        jacobian: (3, n) of the force.
        moved: the system that sensors see, and how far it was moved; None where they see the same.
    """

    mass: FloatArray
    stiffness: FloatArray
    damping: FloatArray
    jacobian: FloatArray
    moved: tuple[VibratingSystem, float] | None = None

    @classmethod
    def between(
        cls, before: VibratingSystem, after: VibratingSystem, size: float, seen: bool = False
    ) -> Change:
        """Of two systems with the same coordinates, `size` apart.

        Args:
            before: a system.
            after: another.
            size: how far the number was moved.
            seen: whether sensors see the change, too.
        """
        return cls(
            (after.mass - before.mass) / size,
            (after.stiffness - before.stiffness) / size,
            (after.damping - before.damping) / size,
            (after.force_jacobian - before.force_jacobian) / size,
            (after, size) if seen else None,
        )


@dataclass(frozen=True, eq=False)
class Column:
    """Where the slope by one number comes from.

    Attributes:
        kind: "change" of the equations; "force": direction and size; "sensor": how a group reads;
            "strikes": blows that come and go; "none".
        change: of the equations.
        direction: (3,) change of the blows' direction.
        louder: relative change of all blows.
        chains: group -> the sensor before and after.
        strikes: blows.
        size: how far these are apart.
    """

    kind: Literal["change", "force", "sensor", "strikes", "none"]
    change: Change | None = None
    direction: FloatArray | None = None
    louder: float = 0.0
    chains: tuple[dict[str, SensorChain], dict[str, SensorChain]] | None = None
    strikes: tuple[Strike, ...] = ()
    size: float = 1.0


_NONE = Column("none")


@dataclass(frozen=True, eq=False)
class Family:
    """Channels that are read, filtered and whitened alike.

    Attributes:
        rows: their places among the record's channels.
        basis: (S, m) the series, whitened.
        weights: (numbers, rows, S) of each number's slope.
    """

    rows: tuple[int, ...]
    basis: FloatArray
    weights: FloatArray


@dataclass(frozen=True, eq=False)
class RecordSlopes:
    """Slopes of one record.

    Attributes:
        families: of its channels.
        explicit: (k, channels, m) whitened slopes that are no weights.
        index: (numbers,) own, group's, shared: place of each among weights, then explicit ones.
    """

    families: tuple[Family, ...]
    explicit: FloatArray
    index: IndexArray
    products: FloatArray = field(default_factory=lambda: np.zeros(0), repr=False)

    def gram(self, residual: FloatArray) -> FloatArray:
        """(numbers + 1, numbers + 1) products of all columns and the residual (channels, m).

        Args:
            residual: whitened.

        Returns:
            symmetric.
        """
        n = self.index.size
        out = np.empty((n + 1, n + 1))
        out[:n, :n] = self.products_of_columns
        weighed = np.zeros(self.families[0].weights.shape[0])
        for f in self.families:
            onto = residual[list(f.rows)] @ f.basis.T
            weighed += np.tensordot(f.weights, onto, 2)
        plain = np.tensordot(self.explicit, residual, 2)
        out[:n, n] = out[n, :n] = np.concatenate([weighed, plain])[self.index]
        out[n, n] = float(np.vdot(residual, residual))
        return out

    @cached_property
    def products_of_columns(self) -> FloatArray:
        """(numbers, numbers)."""
        count, k = self.families[0].weights.shape[0], len(self.explicit)
        both = np.zeros((count + k, count + k))
        for f in self.families:
            gram = f.basis @ f.basis.T
            for c, row in enumerate(f.rows):
                w = f.weights[:, c]
                both[:count, :count] += (w @ gram) @ w.T
                if k:
                    cross = w @ (self.explicit[:, row] @ f.basis.T).T
                    both[:count, count:] += cross
                    both[count:, :count] += cross.T
        if k:
            flat = self.explicit.reshape(k, -1)
            both[count:, count:] = flat @ flat.T
        return both[np.ix_(self.index, self.index)]

    def column(self, number: int) -> FloatArray:
        """(channels, m) the slope by one number.

        Args:
            number: its place.
        """
        place, count = int(self.index[number]), self.families[0].weights.shape[0]
        if place >= count:
            return np.asarray(self.explicit[place - count])
        rows = sum(len(f.rows) for f in self.families)
        out = np.zeros((rows, self.families[0].basis.shape[1]))
        for f in self.families:
            out[list(f.rows)] += f.weights[place] @ f.basis
        return out


@dataclass(frozen=True, eq=False)
class Slopes:
    """Slopes of all records at a point."""

    records: tuple[RecordSlopes, ...]

    def grams(self, residuals: Sequence[FloatArray]) -> list[FloatArray]:
        """(k, k) of each record: own, group's, shared numbers, residual.

        Args:
            residuals: whitened, of each record.
        """
        return [one.gram(rows) for one, rows in zip(self.records, residuals, strict=True)]

    @classmethod
    def of(cls, of: Percussion, at: Numbers) -> Slopes:
        """At a point.

        Args:
            of: the records under a hypothesis.
            at: the numbers.
        """
        by_pose: dict[int, list[int]] = {}
        for k, pose in enumerate(of.group_of):
            by_pose.setdefault(pose, []).append(k)
        found: dict[int, RecordSlopes] = {}
        for records in by_pose.values():
            found |= _Pose(of, at, records).slopes()
        return cls(tuple(found[k] for k in range(len(of.group_of))))


class _Pose:
    """The records of one pose at a point: what they have in common is found once."""

    def __init__(self, of: Percussion, at: Numbers, records: list[int]) -> None:
        self.of, self.at, self.records = of, at, records
        self.base = of.effects_at(at)
        self.there = {k: of.there(k, at, self.base) for k in records}
        self.setups = {k: self.there[k][0].until(of.end) for k in records}
        self.struck = {k: self.setups[k].struck(self.there[k][1]) for k in records}
        first = records[0]
        self.model, self.setup = self.there[first][1], self.setups[first]
        self.systems = {
            k: self.setups[k]._system(self.there[k][1], self.struck[k].blows) for k in records
        }
        self.system = self.systems[first]
        self.chains = {
            g: self.model.sensors(self.setup.conditions).get(g) for g in self.setup.groups
        }

    def moved(self, one: Inexact, step: float) -> Model:
        """The first record's model with a number of blows or sensors moved on."""
        return self.moved_of(self.records[0], one, step)

    def moved_of(self, k: int, one: Inexact, step: float) -> Model:
        """A record's model with a number of blows or sensors moved on."""
        moved = {m.name: (m, size) for m, size in self.of.moved(k, self.at)}
        size = moved[one.name][1] if one.name in moved else np.zeros(1)
        moved[one.name] = (one, size + step)
        more = as_effects([m for m in moved.values() if m[0].where != POSE])
        return self.of.data.problem.model.with_effects((*self.base, *more))

    # One column each -----------------------------------------------------------------------

    def structural(self, ends: Sequence[Model], size: float) -> list[Column]:
        """Of two models whose equations differ."""
        blows = self.struck[self.records[0]].blows
        b, a = (
            self.system if model is self.model else self.setup._system(model, blows)
            for model in ends
        )
        return [Column("change", change=Change.between(b, a, size))] * len(self.records)

    def inexact(self, one: Inexact) -> list[Column]:
        """By a number that is never exact, of each record."""
        if self.of.light:
            return [_NONE] * len(self.records)
        if one.where == "structure":
            after = _under(self.model, Nudge([(one, np.array([_STEP]))], "structure"))
            return self.structural([self.model, after], _STEP)
        if one.where == POSE:
            index, sigma = one.change
            moved = self.setup.geometry.pose.copy()
            moved[index] += _TURN
            near = replace(self.setup, geometry=self.setup.geometry.beside(moved))
            turned = near._system(self.model, self.struck[self.records[0]].blows)
            change = Change.between(self.system, turned, _TURN / sigma, seen=True)
            return [Column("change", change=change)] * len(self.records)
        if one.where == "sensor":
            ends = [self.moved(one, s) for s in (-_STEP, _STEP)]
            return [self.sensor(ends, 2.0 * _STEP)] * len(self.records)
        return [self.apart(k, one, 0.0 if one.one_way else -_STEP) for k in self.records]

    def apart(self, k: int, one: Inexact, low: float) -> Column:
        """Of a record's blows by a number of theirs, moved from `low` to a step on."""
        return self.blows(k, [self.moved_of(k, one, s) for s in (low, _STEP)], _STEP - low)

    def sensor(self, ends: Sequence[Model], size: float) -> Column:
        """Of two models whose sensors differ."""
        conditions = self.setup.conditions
        both = [{g: m.sensors(conditions).get(g) for g in self.chains} for m in ends]
        return Column("sensor", chains=(both[0], both[1]), size=size)

    def blows(self, k: int, ends: Sequence[Model], size: float) -> Column:
        """Of two models whose blows differ."""
        one, other = (self.setups[k].struck(model) for model in ends)
        ours = self.struck[k]
        if one.alike(other) and one.alike(ours):
            turned = (other.blows.direction - one.blows.direction) / size
            return Column(
                "force", direction=turned, louder=(other.peak - one.peak) / ours.peak / size
            )
        return Column("strikes", strikes=tuple(_differing(one, other)), size=size)

    def effect(self, now: Effect, ends: Sequence[Effect], size: float) -> list[Column]:
        """By a parameter of an effect."""

        def pair(k: int) -> list[Model]:
            return [_swapped(self.there[k][1], now, end) for end in ends]

        if now.where == "structure":
            return self.structural(pair(self.records[0]), size)
        return [self.blows(k, pair(k), size) for k in self.records]

    # All together ----------------------------------------------------------------------------

    def slopes(self) -> dict[int, RecordSlopes]:
        """Of every record of the pose."""
        of, at, data = self.of, self.at, self.of.data
        tail: list[list[Column]] = []  # of each number: of each record
        tail += [self.inexact(one) for one in data.groups[of.group_of[self.records[0]]]]
        for u, factor, now in zip(at.shared, data.base, self.base, strict=False):
            before, after = np.clip([u - 1e-3 * factor.std, u + 1e-3 * factor.std], *factor.ends)
            ends = [factor.at(before), factor.at(after)]
            tail.append(self.effect(now, ends, float(after - before)))
        tail += [self.inexact(one) for one in data.shared]
        found = {}
        for i, k in enumerate(self.records):
            head: list[Column] = []
            blows: list[tuple[float, bool, int]] = []
            for one, blow in data.own[k]:
                if of.light:
                    head.append(_NONE)
                elif blow >= 0:
                    head.append(Column("strikes", size=1.0))
                    sigma = float(getattr(of.data.problem.campaign.tolerance, one.key))
                    blows.append((sigma, one.key == "blow_time", blow))
                else:
                    head.append(self.apart(k, one, -_STEP))
            columns = head + [c[i] for c in tail]
            found[k] = _Record(self, k).slopes(columns, blows)
        return found


class _Record:
    """One record at a point."""

    def __init__(self, pose: _Pose, k: int) -> None:
        self.pose, self.k, self.of = pose, k, pose.of
        self.record, self.model = pose.there[k]
        self.setup, self.struck, self.system = pose.setups[k], pose.struck[k], pose.systems[k]
        self.own: MeasuredRecord = pose.of.data.records[k]

    def slopes(
        self, columns: Sequence[Column], blows: Sequence[tuple[float, bool, int]]
    ) -> RecordSlopes:
        """Of all numbers.

        Args:
            columns: of each number.
            blows: (size, whether of its time, blow) of those columns of strikes that have none.
        """
        setup, own, channels = self.setup, self.own, self.own.channels
        count = setup.samples.count
        weighed = [c for c in columns if c.kind in ("change", "force", "sensor", "none")]
        listed = [c for c in columns if c.kind == "strikes"]
        places, a, b = [], 0, len(weighed)
        for c in columns:
            if c.kind == "strikes":
                places.append(b)
                b += 1
            else:
                places.append(a)
                a += 1
        explicit = np.zeros((len(listed), len(channels), count))
        families: list[Family] = []
        modes = _Modes.of(self.system)
        if modes is None:
            raise InputError("no independent modes of vibration")
        members: dict[str, list[int]] = {}
        for i, channel in enumerate(channels):
            members.setdefault(channel.group, []).append(i)
        edges = self.of.edges[self.k]
        series_of: dict[object, tuple[Any, ...]] = {}
        for group, rows in members.items():
            first = channels[rows[0]]
            taken = setup._taken(first, self.pose.chains[group])
            chain, key = taken.chain, (taken.samples, taken.at_jumps)
            if key not in series_of:
                plan = setup._plan(self.struck, self.system, *key)
                y, slope, pushed = modes.series(plan, taken.samples.count)
                whole = np.concatenate([y.real, y.imag, slope.real, slope.imag, pushed[None]])
                series_of[key] = (
                    whole,
                    self._weights(modes, weighed),
                    _Strikes.of(modes, self.struck, *key),
                )
            whole, (position, velocity, acceleration), strikes = series_of[key]
            reader = _slopes_of(first, chain, self.system)
            silent = not any(part.any() for part in reader)
            if first.kind.axes:
                pick = ["xyz".index(channels[i].axis or "x") for i in rows]
            elif first.kind.of == "joint":
                pick = [
                    setup.geometry.robot.flexible_names.index(channels[i].subject or "")
                    for i in rows
                ]
            else:
                pick = [0] * len(rows)
            axes = bool(first.kind.axes)

            def through(
                link: SensorChain, values: FloatArray, axes: bool = axes, pick: list[int] = pick
            ) -> FloatArray:
                """Of what is read (..., rows, S): behind axes and gain."""
                turned = link.turn @ values if axes else values
                return np.asarray(link.gain * turned[..., pick, :])

            def read(
                by: tuple[FloatArray, FloatArray, FloatArray],
                which: int,
                position: FloatArray = position,
                velocity: FloatArray = velocity,
                acceleration: FloatArray = acceleration,
            ) -> FloatArray:
                return (
                    by[0] @ position[which] + by[1] @ velocity[which] + by[2] @ acceleration[which]
                )

            weights = np.zeros((len(weighed), len(rows), len(whole)))
            if not silent:
                base = read(reader, -1)
                every = (
                    np.tensordot(reader[0], position, (1, 1))
                    + np.tensordot(reader[1], velocity, (1, 1))
                    + np.tensordot(reader[2], acceleration, (1, 1))
                )
                every = np.moveaxis(every, 1, 0)  # (numbers + 1, rows, S)
                weights[:] = through(chain, every[:-1])
                for w, c in enumerate(weighed):
                    if c.kind == "change" and c.change is not None and c.change.moved is not None:
                        seen, size = c.change.moved
                        weights[w] += through(
                            chain, (read(_slopes_of(first, chain, seen), -1) - base) / size
                        )
                    elif c.kind == "sensor" and c.chains is not None:
                        ends = [c.chains[0][group], c.chains[1][group]]
                        if ends[0] is ends[1] or all(
                            np.array_equal(ends[0].turn, e.turn)
                            and ends[0].gain == e.gain
                            and np.array_equal(ends[0].place, e.place)
                            for e in ends
                        ):
                            continue
                        both = []
                        for link in ends:
                            by = (
                                reader
                                if np.array_equal(link.place, chain.place)
                                else _slopes_of(first, link, self.system)
                            )
                            both.append(through(link, base if by is reader else read(by, -1)))
                        weights[w] = (both[1] - both[0]) / c.size
            series = whole
            if chain.filters:
                series = apply_filters(chain, series, taken.samples.step, taken.factor)[
                    ..., taken.lead :
                ]
            free = setup.steady or first.kind.free_offset
            unknown = edges[group][:count] if edges is not None and first.kind.jumps else None
            noise = [own.noise[channels[i].name].model for i in rows]
            dead: list[BoolArray | None] = [unknown] * len(rows)
            if np.isfinite(chain.limit):
                now = setup._group(self.model, chain, [channels[i] for i in rows])
                for r, i in enumerate(rows):
                    clipped = np.abs(now[channels[i].name]) >= chain.limit
                    dead[r] = clipped if unknown is None else clipped | unknown
            alike: dict[object, list[int]] = {}
            for r in range(len(rows)):
                name = noise[r].reflection.tobytes(), None if dead[r] is unknown else r
                alike.setdefault(name, []).append(r)
            for own_rows in alike.values():
                lead = own_rows[0]
                basis = _whitened(series, noise[lead], dead[lead], free, unknown)
                scale = np.sqrt([noise[lead].variance / noise[r].variance for r in own_rows])
                own_weights = weights[:, own_rows] * scale[:, None]
                families.append(Family(tuple(rows[r] for r in own_rows), basis, own_weights))
            if silent:
                continue
            on = strikes.weights
            block = reader[0] @ on[0] + reader[1] @ on[1] + reader[2] @ on[2]
            block = through(replace(chain), block)  # (rows, 2m + 1)
            mine = iter(blows)
            for e, c in enumerate(listed):
                if c.strikes or c.size != 1.0:
                    values = block @ strikes.series(c.strikes) / c.size
                else:
                    sigma, later, blow = next(mine)
                    values = sigma * (block @ strikes.of_blow(blow, later))
                if chain.filters:
                    values = apply_filters(chain, values, taken.samples.step, taken.factor)[
                        ..., taken.lead :
                    ]
                for r, i in enumerate(rows):
                    explicit[e, i] = _whitened(values[r][None], noise[r], dead[r], free, unknown)[0]
        return RecordSlopes(tuple(families), explicit, np.array(places, dtype=np.intp))

    def _weights(
        self, modes: _Modes, columns: Sequence[Column]
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(numbers + 1, n, S) weights of position, velocity, acceleration; last the motion's."""
        system, direction = self.system, self.struck.blows.direction
        n, count = len(system.coordinates), len(columns)
        mass, held, force = (
            np.zeros((count + 1, n, n)),
            np.zeros((count + 1, n, 2 * n)),
            np.zeros((count + 1, n)),
        )
        louder = np.zeros(count + 1)
        louder[-1] = 1.0
        for i, c in enumerate(columns):
            if c.change is not None:
                mass[i] = c.change.mass
                held[i, :, :n], held[i, :, n:] = c.change.stiffness, c.change.damping
                force[i] = c.change.jacobian.T @ direction
            elif c.kind == "force" and c.direction is not None:
                force[i] = system.force_jacobian.T @ c.direction
                louder[i] = c.louder
        poles, back = modes.poles, modes.back
        among = -back[:, n:] @ (modes.inverse @ (held - mass @ modes.held)) @ modes.modes
        push = (force - mass @ (modes.inverse @ system.force)) @ modes.inverse.T
        apart = poles[None, :] - poles[:, None]
        alike = np.abs(apart) < _ALIKE * np.abs(poles).max()
        quotient = np.where(alike, 0.0, among * modes.driven / np.where(alike, 1.0, apart))
        weights = quotient.astype(complex)
        index = np.arange(2 * n)
        weights[:, index, index] += (
            push @ back[:, n:].T - quotient.sum(axis=2) + louder[:, None] * modes.driven
        )
        on, slopes = modes.modes @ weights, modes.modes @ np.where(alike, among * modes.driven, 0.0)

        def rows(first: ComplexArray, second: ComplexArray, straight: FloatArray) -> FloatArray:
            return np.concatenate([modes.real(first), modes.real(second), straight], axis=-1)

        none = np.zeros((count + 1, n, 1))
        moving, turning = on[:, n:], slopes[:, n:]
        return (
            rows(on[:, :n], slopes[:, :n], none),
            rows(moving, turning, none),
            rows(moving * poles + turning, turning * poles, moving.sum(axis=2).real[..., None]),
        )


@dataclass(frozen=True, eq=False)
class _Strikes:
    """What single blows do, as series that all channels share.

    Attributes:
        poles: (m,) of the modes that are kept.
        blows: (blows, m, count) the answer to each of the record's blows, and (blows, count) its
            force.
        weights: of position, velocity and acceleration on the real and imaginary parts and the
            force, (n, 2m + 1) each.
        key: samples, and how jumps are taken.
    """

    poles: ComplexArray
    blows: ComplexArray
    forces: FloatArray
    weights: tuple[FloatArray, FloatArray, FloatArray]
    key: tuple[Samples, AtJumps]

    @classmethod
    def of(cls, modes: _Modes, struck: Struck, samples: Samples, at_jumps: AtJumps) -> _Strikes:
        """Of a record's blows."""
        poles, blows = modes.poles[modes.kept], struck.blows
        hits = np.unique(blows.hit) if blows.period is None else np.zeros(0)
        answers = np.zeros((hits.size, poles.size, samples.count), complex)
        forces = np.zeros((hits.size, samples.count))
        for height, shape in blows.parts if hits.size else ():
            pieces = np.column_stack([shape.start, shape.constant, shape.slope])
            waves = np.asarray(shape.amplitude, complex), np.asarray(shape.angular_frequency, float)
            last = shape.end if np.isfinite(shape.end) else float(shape.start[-1])
            for k in range(blows.start.size):
                h = int(np.searchsorted(hits, blows.hit[k]))
                answer(
                    poles,
                    pieces,
                    *waves,
                    last,
                    float(blows.start[k]),
                    float(height[k]),
                    samples.start,
                    samples.step,
                    answers[h],
                    forces[h],
                )
        n = len(modes.inverse)
        on = modes.modes * modes.driven
        moving = on[n:]
        none = np.zeros((n, 1))
        at_once = moving.sum(axis=1).real[:, None]
        weights = (
            np.hstack([modes.real(on[:n]), none]),
            np.hstack([modes.real(moving), none]),
            np.hstack([modes.real(moving * modes.poles), at_once]),
        )
        return cls(poles, answers, forces, weights, (samples, at_jumps))

    def of_blow(self, blow: int, later: bool) -> FloatArray:
        """(2m + 1, count) by a blow's relative height, or by the time when it comes."""
        y, force = self.blows[blow], self.forces[blow]
        if later:
            y = -(self.poles[:, None] * y + force)
            force = np.zeros_like(force)
        return np.vstack([y.real, y.imag, force])

    def series(self, strikes: Sequence[Strike]) -> FloatArray:
        """(2m + 1, count) of blows that come and go."""
        samples, _ = self.key
        y = np.zeros((self.poles.size, samples.count), complex)
        force = np.zeros(samples.count)
        for s in strikes:
            shape = s.shape
            pieces = np.column_stack([shape.start, shape.constant, shape.slope])
            last = shape.end if np.isfinite(shape.end) else float(shape.start[-1])
            answer(
                self.poles,
                pieces,
                np.asarray(shape.amplitude, complex),
                np.asarray(shape.angular_frequency, float),
                last,
                s.start,
                s.height,
                samples.start,
                samples.step,
                y,
                force,
            )
        return np.vstack([y.real, y.imag, force])


def _under(model: Model, more: Effect) -> Model:
    return replace(model, effects=(*model.effects, more))


def _swapped(model: Model, old: Effect, new: Effect) -> Model:
    return replace(model, effects=tuple(new if e is old else e for e in model.effects))


def _whitened(
    series: FloatArray,
    noise: AutoRegression,
    dead: BoolArray | None,
    free: bool,
    unknown: BoolArray | None,
) -> FloatArray:
    """(S, m) in units of the noise; 0 where nothing is known."""
    if free:
        series = series - series.mean(axis=1, keepdims=True)
    if dead is not None:
        series = np.where(dead, 0.0, series)
    out = np.empty(series.shape)
    whiten_all(np.ascontiguousarray(series), *noise.filters, out)
    if unknown is not None:
        out[:, unknown] = 0.0
    return out
