"""What every channel of a percussion record would have read, by a model with any effects."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property

import numpy as np

from picchio.campaign.campaign import Campaign
from picchio.campaign.channels import AXES, Channel
from picchio.campaign.readers import Reading
from picchio.campaign.record import Record
from picchio.core.arrays import BoolArray, FloatArray
from picchio.core.errors import InputError, warn_user
from picchio.core.recent import Recent
from picchio.excitation.piecewise import PiecewiseForce
from picchio.model.blows import Blows
from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect
from picchio.model.expansion import WideChain
from picchio.model.geometry import Geometry
from picchio.model.model import Model
from picchio.model.sensing import Filter, SensorChain
from picchio.model.system import VibratingSystem
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.vibration.integration.integrate import (
    AtJumps,
    CoordinateMotion,
    Plan,
    Samples,
    default_step,
    follow,
    integrate,
    make_plan,
)
from picchio.vibration.integration.sensitivity import (
    MotionChanges,
    Strike,
    blow_changes,
    motion_changes,
)

# Filters need the motion this finely, s.
_FILTER_STEP = 1e-4
# How many results are kept: of a record; of what the records of a campaign have in common.
_KEPT = 6
_KEPT_IN_COMMON = 48
# By so much a coordinate is moved to see what a reader makes of it, rad and rad/s.
_SLIGHTLY = 1e-6
# What a record holds of second order in the deflections is left out of slopes up to this share: a
# harder blow and a sensor's gain, which differ in nothing else, would seem to be told apart.
_BENT = 0.005
# Relative difference of rounding.
_SAME = 1e-12
BY_MODES = ("structure", "blows")
"""Where effects change the motion without a change of its steps: see `PercussionSetup.changes`."""
_SILENCE = PiecewiseForce(np.zeros(1), np.inf, *np.zeros((4, 1)))


@dataclass(frozen=True, eq=False)
class InCommon:
    """What records that are struck alike have in common.

    Attributes:
        forces: the blows' force, the highest blow of 1 N.
        plans: the steps of the integration.
        edges: which samples stand near a jump of the force; None where nothing jumps.
    """

    forces: Recent[PiecewiseForce] = field(default_factory=lambda: Recent(_KEPT_IN_COMMON))
    plans: Recent[Plan] = field(default_factory=lambda: Recent(_KEPT_IN_COMMON))
    edges: Recent[BoolArray | None] = field(default_factory=lambda: Recent(_KEPT_IN_COMMON))


@dataclass(frozen=True, eq=False)
class Struck:
    """The blows of a record with a model's effects in them.

    Attributes:
        blows: as they come.
        peak: N.
        forces: those that are known, of blows of which the highest is 1 N.
    """

    blows: Blows
    peak: float
    forces: Recent[PiecewiseForce] = field(repr=False)

    @cached_property
    def unit(self) -> PiecewiseForce:
        """The force they make, divided by `peak`: the same in many records."""
        unit = self.blows.change(height=self.blows.height / self.peak)
        return self.forces.get(unit.key, unit.force)

    @property
    def force(self) -> PiecewiseForce:
        """The force they make."""
        return self.unit.scaled(self.peak)

    def alike(self, other: Struck) -> bool:
        """Whether the two forces are the same but for their size.

        Args:
            other: blows that may be harder, or along another direction.
        """
        one, two = self.blows, other.blows
        return (
            one.start.shape == two.start.shape
            and one.key[2:] == two.key[2:]
            and bool((np.abs(one.start - two.start) <= _SAME * np.abs(two.start)).all())
            and bool((np.abs(one.height / self.peak - two.height / other.peak) <= _SAME).all())
        )


@dataclass(frozen=True, eq=False)
class _Taken:
    """How a channel group is read: its sensor, the samples of the motion, and how it goes on.

    Attributes:
        chain: the sensor, with what its kind always has.
        samples: of the motion.
        at_jumps: the acceleration at a jump of the force.
        lead: samples before the record, for filters to settle.
        factor: samples of the motion to one of the record.
    """

    chain: SensorChain
    samples: Samples
    at_jumps: AtJumps
    lead: int
    factor: int


@dataclass(frozen=True, eq=False)
class PercussionSetup:
    """What is known of a percussion record before anything is predicted.

    Attributes:
        name: the record's file.
        geometry: of the robot at its pose.
        blows: as programmed.
        conditions: date and temperature.
        samples: the record's clock.
        channels: those that can be predicted.
        in_common: what it shares with other records of its campaign.
    """

    name: str
    geometry: Geometry
    blows: Blows
    conditions: Conditions
    samples: Samples
    channels: tuple[Channel, ...]
    in_common: InCommon = field(default_factory=InCommon, repr=False)
    _motions: Recent[tuple[VibratingSystem, CoordinateMotion]] = field(
        default_factory=lambda: Recent(_KEPT), init=False, repr=False
    )
    _struck: Recent[Struck] = field(default_factory=lambda: Recent(_KEPT), init=False, repr=False)
    _systems: Recent[VibratingSystem] = field(
        default_factory=lambda: Recent(_KEPT), init=False, repr=False
    )

    @property
    def steady(self) -> bool:
        """Whether the record is of a steady state, its mean removed."""
        return self.blows.period is not None

    @property
    def groups(self) -> tuple[str, ...]:
        """Its channel groups."""
        return tuple(self._members)

    @cached_property
    def _members(self) -> dict[str, list[Channel]]:
        found: dict[str, list[Channel]] = {}
        for channel in self.channels:
            found.setdefault(channel.group, []).append(channel)
        return found

    def predict(self, model: Model) -> dict[str, FloatArray]:
        """Every channel at the record's samples, (count,) in its SI unit.

        Args:
            model: robot and effects; its robot must be the geometry's.

        Raises:
            InputError: an effect whose target the robot does not have, a frame that is none.
        """
        sensors = model.sensors(self.conditions)
        out: dict[str, FloatArray] = {}
        for group, members in self._members.items():
            out |= self._group(model, sensors.get(group), members)
        if self.steady:
            out = {name: values - values.mean() for name, values in out.items()}
        return out

    def _group(
        self, model: Model, chain: SensorChain, members: Sequence[Channel]
    ) -> dict[str, FloatArray]:
        taken = self._taken(members[0], chain)
        rows = self._behind(taken, members, self._read(model, chain, members, taken))
        if np.isfinite(chain.limit):
            rows = {name: np.clip(row, -chain.limit, chain.limit) for name, row in rows.items()}
        for frequency, cosine, sine in chain.hum:
            phase = 2.0 * np.pi * frequency * self.samples.times
            line = cosine * np.cos(phase) + sine * np.sin(phase)
            rows = {name: row + line for name, row in rows.items()}
        return rows

    def _read(
        self, model: Model, chain: SensorChain, members: Sequence[Channel], taken: _Taken
    ) -> FloatArray:
        """(rows, k) what the reader of a group makes of the motion, or of the force."""
        reader = members[0].kind.reader
        assert reader is not None
        return reader(
            Reading(
                members[0].subject,
                taken.samples,
                lambda: self.struck(model).force,
                lambda: self._motion(model, taken.samples, taken.at_jumps),
                chain.place if chain.place.any() else None,
            )
        )

    def _taken(self, channel: Channel, chain: SensorChain) -> _Taken:
        if channel.kind.ac_corner and chain.highpass is None:
            chain = replace(chain, highpass=Filter(channel.kind.ac_corner))
        samples = self._shifted(chain)
        if not chain.filters:
            return _Taken(chain, samples, "after", 0, 1)
        factor = 1
        if chain.analogue:
            factor = max(1, int(np.ceil(samples.step / _FILTER_STEP - 1e-9)))
        # Samples before a steady record, for filters to settle.
        lead = int(min(2.0 / samples.step, 20000)) if self.steady else 0
        fine = samples.step / factor
        samples = Samples(
            samples.start - lead * samples.step, fine, factor * (samples.count + lead - 1) + 1
        )
        at_jumps: AtJumps = "moments" if chain.smooth else "mean" if chain.analogue else "after"
        return _Taken(chain, samples, at_jumps, lead, factor)

    def _behind(
        self, taken: _Taken, members: Sequence[Channel], values: FloatArray
    ) -> dict[str, FloatArray]:
        """The channels of a group behind its filters: (..., count) of a reader's (..., rows, k)."""
        kind, chain = members[0].kind, taken.chain
        if chain.filters:
            values = apply_filters(chain, values, taken.samples.step, taken.factor)
            values = np.ascontiguousarray(values[..., taken.lead :])
        if kind.axes:
            values = chain.gain * (chain.turn @ values)
            return {c.name: values[..., AXES.index(c.axis or "x"), :] for c in members}
        values = chain.gain * values
        if kind.of == "joint":
            names = self.geometry.robot.flexible_names
            return {c.name: values[..., names.index(c.subject or ""), :] for c in members}
        return {c.name: values[..., 0, :] for c in members}

    def changes(
        self, model: Model, pairs: Sequence[tuple[Model, Model]], each_blow: bool = False
    ) -> dict[str, FloatArray] | None:
        """By how much every channel changes between models that differ little.

        To first order, without integrating anew (`motion_changes`): models may differ in their
        structure, in the direction of the blows and in how hard all of them are; with `each_blow`,
        instead, in when and how hard each of them is.

        Args:
            model: about which; the sensors are those of all.
            pairs: (before, after) of each change.
            each_blow: whether blows that differ one by one are known as well: the change is that
                between the two, however far apart they are.

        Returns:
            (pairs, count) of each channel, SI, not a number where the models differ in another way;
            None where the motion is not nearly linear, or is steady. Where a sensor has a limit, a
            sample that is there stays there, and what is not nearly linear is predicted twice.
        """
        sensors = model.sensors(self.conditions)
        chains = {group: sensors.get(group) for group in self._members}
        if self.steady:
            return None
        struck = self.struck(model)
        system, same = self._system(model, struck.blows), self._system_key(model, struck.blows)
        blows = [(self.struck(one), self.struck(other)) for one, other in pairs]
        around = [
            (self._system(one, ours.blows), self._system(other, theirs.blows))
            for (one, other), (ours, theirs) in zip(pairs, blows, strict=True)
        ]
        alone = [
            k for k, (ours, theirs) in enumerate(blows)
            if each_blow and not ours.alike(theirs)
            and all(
                self._system_key(m, b.blows) == same
                for m, b in zip(pairs[k], (ours, theirs), strict=True)
            )
        ]  # fmt: skip
        together = [k for k in range(len(pairs)) if k not in alone]
        louder = np.array([
            (after.peak - before.peak) / struck.peak
            if before.alike(struck) and after.alike(struck) else np.nan
            for before, after in (blows[k] for k in together)
        ])  # fmt: skip
        made: dict[tuple[Samples, AtJumps], tuple[MotionChanges, MotionChanges]] = {}
        out: dict[str, FloatArray] = {}
        for group, members in self._members.items():
            chain, taken = chains[group], self._taken(members[0], chains[group])
            key = taken.samples, taken.at_jumps
            if key not in made:
                plan, count = self._plan(struck, system, *key), taken.samples.count
                # The last change is that from rest: the whole motion, had it no second order.
                asked = [*(around[k] for k in together), (system, system)]
                found = motion_changes(system, plan, count, asked, np.append(louder, 1.0))
                apart = blow_changes(system, *key, [_differing(*blows[k]) for k in alone])
                if found is None or apart is None:
                    return None
                made[key] = found, apart
            slopes = _slopes_of(members[0], chain, system)
            if not any(by.any() for by in slopes):  # reads the force alone
                read = [[self._group(m, chain, members) for m in pair] for pair in pairs]
                out |= {
                    c.name: np.array([after[c.name] - before[c.name] for before, after in read])
                    for c in members
                }
                continue
            among, single = (_read(slopes, each) for each in made[key])
            whole = self._read(model, chain, members, taken)
            limited = np.isfinite(chain.limit)
            bent = np.linalg.norm(whole - among[-1]) > _BENT * np.linalg.norm(whole)
            if bent and not any(np.isfinite(each.limit) for each in chains.values()):
                return None
            rows = np.empty((len(pairs), *whole.shape))
            if bent:
                for row, (one, other) in zip(rows, pairs, strict=True):
                    row[:] = self._read(other, chain, members, taken)
                    row -= self._read(one, chain, members, taken)
            else:
                rows[together], rows[alone] = among[:-1], single
            changed = self._behind(taken, members, rows)
            if limited:
                there = self._behind(taken, members, whole)
                changed = {
                    name: np.where(np.abs(there[name]) < chain.limit, own, 0.0)
                    for name, own in changed.items()
                }
            out |= changed
        return out

    def struck(self, model: Model) -> Struck:
        """The blows with the model's effects in them, and the force they make.

        Args:
            model: whose effects change the blows.
        """

        def make() -> Struck:
            blows = model.blows(self.blows, self.conditions)
            return Struck(blows, blows.peak, self.in_common.forces)

        return self._struck.get(model.key("blows"), make)

    @staticmethod
    def _system_key(model: Model, blows: Blows) -> tuple[Hashable, ...]:
        moving = model.key("structure", "over-time", "nonlinear")
        return moving, model.gravity_stiffness, blows.direction.tobytes()

    def _system(self, model: Model, blows: Blows) -> VibratingSystem:
        key = self._system_key(model, blows)

        def make() -> VibratingSystem:
            # Only what drifts asks for more than the pose.
            when = self.conditions if model.key("over-time") else None
            plant = self.geometry.plants.get(
                (*key[:2], when), lambda: model.plant(self.geometry, self.conditions)
            )
            return plant.build(blows.direction)

        return self._systems.get(key, make)

    def _shifted(self, chain: SensorChain) -> Samples:
        rate = 1.0 + chain.clock_rate
        mine = self.samples
        return Samples(mine.start * rate - chain.delay, mine.step * rate, mine.count)

    def _motion(
        self, model: Model, samples: Samples, at_jumps: AtJumps = "after"
    ) -> tuple[VibratingSystem, CoordinateMotion]:
        moving = model.key("structure", "over-time", "nonlinear", "blows")
        key = (moving, model.gravity_stiffness, samples, at_jumps)

        def make() -> tuple[VibratingSystem, CoordinateMotion]:
            struck = self.struck(model)
            system = self._system(model, struck.blows)
            if self.steady:
                return system, integrate(system, struck.force, samples, at_jumps=at_jumps)
            plan = self._plan(struck, system, samples, at_jumps)
            return system, follow(system, plan, samples.count)

        return self._motions.get(key, make)

    def _plan(
        self, struck: Struck, system: VibratingSystem, samples: Samples, at_jumps: AtJumps
    ) -> Plan:
        # Most effects leave the steps as they are.
        step = default_step(system)
        plan = self.in_common.plans.get(
            (struck.unit, samples, step, at_jumps),
            lambda: make_plan(struck.unit, samples, step, at_jumps=at_jumps),
        )
        return plan.scaled(struck.peak)


def _differing(one: Struck, other: Struck) -> list[Strike]:
    """The blows that come from one to the other, and those that go."""
    before, after = one.blows, other.blows
    own = np.ones(before.start.shape, bool), np.ones(after.start.shape, bool)
    if before.start.shape == after.start.shape and before.key[2:] == after.key[2:]:
        apart = (before.start != after.start) | (before.height != after.height)
        own = apart, apart
    return [
        Strike(shape, float(blows.start[k]), sign * float(height[k]))
        for blows, chosen, sign in ((before, own[0], -1.0), (after, own[1], 1.0))
        for height, shape in blows.parts
        for k in np.flatnonzero(chosen)
    ]


def _slopes_of(
    channel: Channel, chain: SensorChain, system: VibratingSystem
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(rows, N) each: what a reader makes of position, velocity and acceleration, at rest."""
    n = len(system.coordinates)
    # Readers look at one sample at a time: each sample moves one number.
    steps = np.repeat([_SLIGHTLY, _SLIGHTLY, 1.0], n)
    moved = np.concatenate([np.diag(steps), np.zeros((1, 3 * n))])
    motion = CoordinateMotion(moved[:, :n], moved[:, n : 2 * n], moved[:, 2 * n :])
    assert channel.kind.reader is not None
    values = channel.kind.reader(
        Reading(
            channel.subject,
            Samples(0.0, 1.0, 3 * n + 1),
            lambda: _SILENCE,
            lambda: (system, motion),
            chain.place if chain.place.any() else None,
        )
    )
    found = (values[:, :-1] - values[:, -1:]) / steps
    return found[:, :n], found[:, n : 2 * n], found[:, 2 * n :]


def _read(slopes: tuple[FloatArray, FloatArray, FloatArray], changes: MotionChanges) -> FloatArray:
    """(changes, rows, count) of what a reader at rest makes of changes of the motion."""
    by_position, by_velocity, by_acceleration = slopes
    weights = by_position @ changes.position + by_velocity @ changes.velocity
    weights = weights + by_acceleration @ changes.acceleration
    return np.asarray(weights @ changes.series)


_SECONDS_A_DAY = 86400.0


def percussion_setups(robot: FlexibleRobot, campaign: Campaign) -> list[PercussionSetup]:
    """What is needed to predict a campaign's percussion records.

    Poses that are the same share their geometry, blows that are the same their force.

    Args:
        robot: the robot.
        campaign: the records.

    Raises:
        InputError: a pose that does not fit the robot, a channel of a joint or frame it does
            not have, a record without stated blows or measured force.
    """
    chain, geometries = WideChain(robot), {}  # type: WideChain, dict[bytes, Geometry]
    chosen = [r for r in campaign.records if r.kind == "percussion"]
    taken = [r.taken for r in chosen if r.taken is not None]
    warm = [r.temperature for r in chosen if r.temperature is not None]
    setups, in_common = [], InCommon()
    for record in chosen:
        pose = pose_of(robot, record)
        geometry = geometries.setdefault(pose.tobytes(), Geometry(chain, pose))
        days = (
            (record.taken - min(taken)).total_seconds() / _SECONDS_A_DAY if record.taken else None
        )
        kelvin = (
            record.temperature - float(np.mean(warm)) if record.temperature is not None else None
        )
        clock = record.clock
        rotation = geometry.motion(robot.tool_frame).rotation
        blows = _blows(record).change(tool_rotation=rotation)
        _warn_of_blows_beyond(record)
        setups.append(
            PercussionSetup(
                record.file,
                geometry,
                blows,
                Conditions(record.file, days, kelvin),
                Samples(clock.start, clock.step, clock.samples),
                _channels(record, robot),
                in_common,
            )
        )
    return setups


def pose_of(robot: FlexibleRobot, record: Record) -> FloatArray:
    """The pose (nv,) in which a record was taken, rad or m; joints that it does not name are at 0.

    Args:
        robot: the robot.
        record: of a campaign.

    Raises:
        InputError: as `FlexibleRobot.pose`, with the campaign's file and the record's number.
    """
    return record.posed(robot)


def _warn_of_blows_beyond(record: Record) -> None:
    """Say that a burst goes on after its record's end: milliseconds given as seconds, often."""
    period, hits = record.excitation.period, record.hits
    end = record.clock.start + record.clock.step * (record.clock.samples - 1)
    if period is None or hits is None or (hits - 1) * period <= end:
        return
    warn_user(
        f"{record.file} ends at {end:.3g} s, before the last of {hits} blows at "
        f"{(hits - 1) * period:.3g} s: is the period of {period:g} s right?"
    )


def _blows(record: Record) -> Blows:
    direction = record.direction
    assert direction is not None
    return Blows.of(*record.acting(), direction, record.reads_force)


def _channels(record: Record, robot: FlexibleRobot) -> tuple[Channel, ...]:
    found = []
    for name in record.channels:
        channel = record.channel(name)
        if channel.kind.of_force and record.reads_force:
            continue  # what the prediction is driven by says nothing of it
        if channel.kind.reader is None:
            if not channel.kind.unused:
                warn_user(
                    f"{record.file}: {name} is not used: nothing predicts a {channel.kind.name} "
                    "while the tool hits"
                )
            continue
        if channel.kind.of == "joint" and channel.subject not in robot.flexible_names:
            raise InputError(
                f"{record.file} has a {channel.kind.name} of a joint that is not flexible",
                key=name,
                value=channel.subject,
                choices=robot.flexible_names,
            )
        if channel.kind.of == "frame":
            robot.link_of(channel.subject or "")
        found.append(channel)
    return tuple(found)


def predict(
    robot: FlexibleRobot,
    campaign: Campaign,
    effects: Sequence[Effect] = (),
    *,
    gravity_stiffness: bool = True,
) -> Mapping[str, dict[str, FloatArray]]:
    """What every percussion record would have read: {file: {channel: (samples,)}}, SI.

    Args:
        robot: the robot.
        campaign: its percussion records are predicted.
        effects: that extend the nominal model.
        gravity_stiffness: include the change of gravity's torque with deflection.

    Raises:
        InputError: as `percussion_setups`.
    """
    model = Model(robot, gravity_stiffness).with_effects(effects)
    return {s.name: s.predict(model) for s in percussion_setups(robot, campaign)}


# First- and second-order sensor filters; analogue ones exact for straight lines between samples.


def apply_filters(
    chain: SensorChain, values: FloatArray, step: float, factor: int = 1
) -> FloatArray:
    """What is left of (c, k) values `step` s apart behind the chain's mount and filters.

    Before the first sample there is rest.

    Args:
        chain: the sensor.
        values: (..., k) of the signal.
        step: s.
        factor: every so-manyth of them is a sample that is written down.

    Returns:
        (..., samples).
    """
    from scipy.signal import lfilter

    for b, a in _transfer_functions(chain):
        numerator, denominator = _first_order_hold(tuple(b), tuple(a), step)
        values = lfilter(numerator, denominator, values, axis=-1)
    values = values[..., ::factor]
    for kind, each in chain.passes(digital=True):
        values = lfilter(*each.sampled(kind, factor * step), values, axis=-1)
    return values


def _transfer_functions(chain: SensorChain) -> list[tuple[FloatArray, FloatArray]]:
    """Numerators and denominators in s, highest power first."""
    found = []
    if chain.mount is not None and np.isfinite(chain.mount[0]):
        w, zeta = 2.0 * np.pi * chain.mount[0], chain.mount[1]
        found.append((np.array([w * w]), np.array([1.0, 2.0 * zeta * w, w * w])))
    return found + [each.analogue(kind) for kind, each in chain.passes(digital=False)]


@cache
def _first_order_hold(
    b: tuple[float, ...], a: tuple[float, ...], step: float
) -> tuple[FloatArray, FloatArray]:
    from scipy.signal import cont2discrete

    numerator, denominator, _ = cont2discrete((list(b), list(a)), step, method="foh")
    return np.atleast_1d(np.squeeze(numerator)), denominator
