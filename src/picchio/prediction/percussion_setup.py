"""One percussion record before and after it is predicted, by a model with any effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from picchio.campaign import Channel
from picchio.core.arrays import BoolArray, FloatArray
from picchio.core.recent import Recent
from picchio.excitation import PiecewiseForce
from picchio.model import Model
from picchio.model.blows import Blows
from picchio.model.conditions import Conditions
from picchio.model.geometry import Geometry
from picchio.model.sensing import SensorChain
from picchio.model.system import VibratingSystem
from picchio.prediction.filters import apply_filters
from picchio.prediction.readings import reading
from picchio.vibration.integrate import (
    AtJumps,
    CoordinateMotion,
    Plan,
    Samples,
    default_step,
    follow,
    integrate,
    make_plan,
)

# Filters need the motion this finely, s.
_FILTER_STEP = 1e-4
# How many results are kept: of a record; of what the records of a campaign have in common.
_KEPT = 6
_KEPT_IN_COMMON = 48


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
        unit: the force they make, divided by `peak`: the same in many records.
        peak: N.
    """

    blows: Blows
    unit: PiecewiseForce
    peak: float

    @property
    def force(self) -> PiecewiseForce:
        """The force they make."""
        return self.unit.scaled(self.peak)


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

    def cut(self, end: float) -> PercussionSetup:
        """The same record up to a time, s."""
        count = int(np.searchsorted(self.samples.times, end + 1e-9))
        mine = self.samples
        return replace(self, samples=Samples(mine.start, mine.step, min(count, mine.count)))

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
        samples = self._shifted(chain)
        lead, factor = 0, 1
        if chain.filters:
            factor = max(1, int(np.ceil(samples.step / _FILTER_STEP - 1e-9)))
            lead = self._lead(samples.step) if self.steady else 0
            fine = samples.step / factor
            samples = Samples(
                samples.start - lead * samples.step, fine, factor * (samples.count + lead - 1) + 1
            )
        kind = members[0].kind.name
        if kind == "force":
            values = _history(self.struck(model).force, samples.times)[None]
        else:
            at_jumps: AtJumps = "after"
            if chain.filters:
                at_jumps = "moments" if chain.smooth else "mean"
            system, motion = self._motion(model, samples, at_jumps)
            values = reading(kind, members[0].subject, system, motion)
        if chain.filters:
            filtered = apply_filters(chain, values, samples.step)
            values = np.ascontiguousarray(filtered[:, factor * lead :: factor])
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
        if np.isfinite(chain.limit):
            rows = {name: np.clip(row, -chain.limit, chain.limit) for name, row in rows.items()}
        for frequency, cosine, sine in chain.hum:
            phase = 2.0 * np.pi * frequency * self.samples.times
            line = cosine * np.cos(phase) + sine * np.sin(phase)
            rows = {name: row + line for name, row in rows.items()}
        return rows

    def struck(self, model: Model) -> Struck:
        """The blows with the model's effects in them, and the force they make."""

        def make() -> Struck:
            blows = model.blows(self.blows, self.conditions)
            peak = blows.peak
            unit = blows.change(height=blows.height / peak)
            return Struck(blows, self.in_common.forces.get(unit.key, unit.force), peak)

        return self._struck.get(model.key("blows"), make)

    def _system(self, model: Model, blows: Blows) -> VibratingSystem:
        moving = model.key("structure", "over-time", "nonlinear")

        def make() -> VibratingSystem:
            # Only what drifts asks for more than the pose.
            when = self.conditions if model.key("over-time") else None
            plant = self.geometry.plant(
                (moving, model.gravity_stiffness, when),
                lambda: model.plant(self.geometry, self.conditions),
            )
            return plant.build(blows.direction)

        key = (moving, model.gravity_stiffness, blows.direction.tobytes())
        return self._systems.get(key, make)

    def _shifted(self, chain: SensorChain) -> Samples:
        rate = 1.0 + chain.clock_rate
        mine = self.samples
        return Samples(mine.start * rate - chain.delay, mine.step * rate, mine.count)

    def _lead(self, step: float) -> int:
        """Samples before a steady record, for filters to settle."""
        return int(min(2.0 / step, 20000))

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
            # Most effects leave the steps as they are.
            step = default_step(system)
            plan = self.in_common.plans.get(
                (struck.unit, samples, step, at_jumps),
                lambda: make_plan(struck.unit, samples, step, at_jumps=at_jumps),
            )
            return system, follow(system, plan.scaled(struck.peak), samples.count)

        return self._motions.get(key, make)


def _history(force: PiecewiseForce, times: FloatArray) -> FloatArray:
    return force(np.mod(times, force.end)) if np.isfinite(force.end) else force(times)
