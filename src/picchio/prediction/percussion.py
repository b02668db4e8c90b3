"""What every channel of a percussion record would have read, by a model with any effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from picchio.campaign import Campaign, Channel, Record
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.excitation import PiecewiseForce
from picchio.model import Model
from picchio.model.blows import Blows
from picchio.model.conditions import Conditions
from picchio.model.effects import Effect
from picchio.model.geometry import Geometry
from picchio.model.sensing import SensorChain
from picchio.model.system import VibratingSystem
from picchio.prediction.filters import apply_filters
from picchio.prediction.readings import reading
from picchio.robot import FlexibleRobot
from picchio.robot.expansion import WideChain
from picchio.vibration.integrate import CoordinateMotion, Samples, integrate

# Filters need the motion this finely, s.
_FILTER_STEP = 1e-4
_KEPT_MOTIONS = 6
PREDICTED = (
    "force",
    "deflection",
    "acceleration",
    "accelerometer",
    "velocity",
    "displacement",
)
POSITION_KINDS = ("deflection", "displacement")
_SECONDS_A_DAY = 86400.0


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
    """

    name: str
    geometry: Geometry
    blows: Blows
    conditions: Conditions
    samples: Samples
    channels: tuple[Channel, ...]
    _motions: dict[object, tuple[VibratingSystem, CoordinateMotion]] = field(default_factory=dict)
    _forces: dict[object, tuple[Blows, PiecewiseForce]] = field(default_factory=dict)
    _systems: dict[object, VibratingSystem] = field(default_factory=dict)

    @property
    def steady(self) -> bool:
        """Whether the record is of a steady state, its mean removed."""
        return self.blows.period is not None

    @property
    def groups(self) -> tuple[str, ...]:
        """Its channel groups."""
        return tuple(dict.fromkeys(channel.group for channel in self.channels))

    def cut(self, end: float) -> PercussionSetup:
        """The same record up to a time, s."""
        count = int(np.searchsorted(self.samples.times, end + 1e-9))
        return PercussionSetup(
            self.name,
            self.geometry,
            self.blows,
            self.conditions,
            Samples(self.samples.start, self.samples.step, min(count, self.samples.count)),
            self.channels,
        )

    def predict(self, model: Model) -> dict[str, FloatArray]:
        """Every channel at the record's samples, (count,) in its SI unit.

        Args:
            model: robot and effects; its robot must be the geometry's.

        Raises:
            InputError: an effect whose target the robot does not have, a frame that is none.
        """
        sensors = model.sensors(self.conditions)
        out: dict[str, FloatArray] = {}
        for group in self.groups:
            chain = sensors.get(group)
            members = [channel for channel in self.channels if channel.group == group]
            out |= self._group(model, chain, members)
        if self.steady:
            out = {name: values - values.mean() for name, values in out.items()}
        return out

    def _group(
        self, model: Model, chain: SensorChain, members: Sequence[Channel]
    ) -> dict[str, FloatArray]:
        samples = self._shifted(chain)
        lead, factor = 0, 1
        if chain.filters:
            factor = max(1, int(np.ceil(samples.step / _FILTER_STEP - 1e-9)))
            lead = self._lead(samples.step) if self.steady else 0
            fine = samples.step / factor
            samples = Samples(
                samples.start - lead * samples.step, fine, factor * (samples.count + lead - 1) + 1
            )
        system, motion, force = self._motion(model, samples, middle=chain.filters)
        kind = members[0].kind.name
        values = reading(kind, members[0].subject, system, motion, force)
        if chain.filters:
            values = apply_filters(chain, values, samples.step)[:, factor * lead :: factor]
        axes = "xyz"
        if len(values) == 3 and members[0].axis is not None:
            values = chain.gain * (chain.turn @ values)
            rows = {c.name: values[axes.index(c.axis or "x")] for c in members}
        elif kind == "deflection":
            names = self.geometry.robot.flexible_names
            values = chain.gain * values
            rows = {c.name: values[names.index(c.subject or "")] for c in members}
        else:
            rows = {c.name: chain.gain * values[0] for c in members}
        rows = {name: np.clip(row, -chain.limit, chain.limit) for name, row in rows.items()}
        for frequency, cosine, sine in chain.hum:
            phase = 2.0 * np.pi * frequency * self.samples.times
            line = cosine * np.cos(phase) + sine * np.sin(phase)
            rows = {name: row + line for name, row in rows.items()}
        return rows

    def struck(self, model: Model) -> tuple[Blows, PiecewiseForce]:
        """The blows with the model's effects in them, and the force they make."""
        key = tuple(e.key for e in model.effects if e.where == "blows")
        if key not in self._forces:
            blows = model.blows(self.blows, self.conditions)
            _forget(self._forces)
            self._forces[key] = (blows, blows.force())
        return self._forces[key]

    def _system(self, model: Model, blows: Blows) -> VibratingSystem:
        inside = ("structure", "over-time", "nonlinear")
        moving = tuple(e.key for e in model.effects if e.where in inside)
        key = (moving, model.gravity_stiffness, blows.direction.tobytes())
        if key not in self._systems:
            _forget(self._systems)
            plant = model.plant(self.geometry, self.conditions)
            self._systems[key] = plant.build(blows.direction)
        return self._systems[key]

    def _shifted(self, chain: SensorChain) -> Samples:
        rate = 1.0 + chain.clock_rate
        mine = self.samples
        return Samples(mine.start * rate - chain.delay, mine.step * rate, mine.count)

    def _lead(self, step: float) -> int:
        """Samples before a steady record, for filters to settle."""
        return int(min(2.0 / step, 20000))

    def _motion(
        self, model: Model, samples: Samples, *, middle: bool
    ) -> tuple[VibratingSystem, CoordinateMotion, FloatArray]:
        moving = tuple(e.key for e in model.effects if e.where not in ("sensor", "motion"))
        key = (moving, model.gravity_stiffness, samples, middle)
        blows, force = self.struck(model)
        if key not in self._motions:
            system = self._system(model, blows)
            _forget(self._motions)
            self._motions[key] = (system, integrate(system, force, samples, middle=middle))
        system, motion = self._motions[key]
        times = samples.times
        history = force(np.mod(times, force.end)) if np.isfinite(force.end) else force(times)
        return system, motion, history


def _forget(cache: dict[Any, Any]) -> None:
    """Keep a cache small: the oldest goes first."""
    while len(cache) >= _KEPT_MOTIONS:
        cache.pop(next(iter(cache)), None)


def percussion_setups(
    robot: FlexibleRobot, campaign: Campaign, *, records: Sequence[Record] | None = None
) -> list[PercussionSetup]:
    """What is needed to predict a campaign's percussion records.

    Poses that are the same share their geometry.

    Args:
        robot: the robot.
        campaign: the records.
        records: only these.

    Raises:
        InputError: a pose that does not fit the robot, a channel of a joint or frame it does
            not have, a record without stated blows or measured force.
    """
    chain, geometries = WideChain(robot), {}  # type: WideChain, dict[bytes, Geometry]
    chosen = [r for r in (records or campaign.records) if r.kind == "percussion"]
    taken = [r.taken for r in chosen if r.taken is not None]
    warm = [r.temperature for r in chosen if r.temperature is not None]
    setups = []
    for record in chosen:
        pose = robot.pose(record.pose)  # type: ignore[arg-type]
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
        setups.append(
            PercussionSetup(
                record.file,
                geometry,
                blows,
                Conditions(record.file, days, kelvin),
                Samples(clock.start, clock.step, clock.samples),
                _channels(record, robot),
            )
        )
    return setups


def _blows(record: Record) -> Blows:
    direction = record.direction
    assert direction is not None
    excitation = record.blows()
    if excitation is None:
        from picchio.excitation import MeasuredForce

        data = record.read(["force"])
        after = data["time"] >= -1e-12
        excitation = MeasuredForce(data["time"][after], data["force"][after])
        return Blows.of(excitation, 1, direction)
    return Blows.of(excitation, record.hits, direction)


def _channels(record: Record, robot: FlexibleRobot) -> tuple[Channel, ...]:
    found = []
    for name in record.channels:
        channel = record.channel(name)
        kind = channel.kind.name
        if kind not in PREDICTED or (kind == "velocity" and channel.axis is None):
            continue
        if kind == "deflection" and channel.subject not in robot.flexible_names:
            raise InputError(
                f"{record.file} has a deflection of a joint that is not flexible",
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

    Raises:
        InputError: as `percussion_setups`.
    """
    model = Model(robot, gravity_stiffness).with_effects(effects)
    return {s.name: s.predict(model) for s in percussion_setups(robot, campaign)}
