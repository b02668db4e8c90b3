"""What is currently believed: effects with values, nuisances, and what may be varied."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from lxml import etree

from picchio.diagnosis.motion.data.system import System
from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.registry import catalogue
from picchio.model.motion import ROTOR, TORQUE, Motion
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.urdf.xml import parse_urdf, read_urdf_bytes

_SMALL = 1e-3


@dataclass(frozen=True)
class Coordinate:
    """One number that a fit may vary.

    Attributes:
        index: of the effect in `State.every`; -1 for a factor on a joint's rigid-body torque.
        name: the effect's parameter, or the joint.
        value: now.
        lower: smallest allowed.
        upper: largest.
        step: for differences.
        prior: standard deviation about `centre`, or None.
        centre: of the prior.
    """

    index: int
    name: str
    value: float
    lower: float
    upper: float
    step: float
    prior: float | None = None
    centre: float = 0.0

    @property
    def precision(self) -> float:
        """One over the prior's variance; 0 without a prior."""
        return 0.0 if self.prior is None else 1.0 / self.prior**2

    @property
    def pull(self) -> float:
        """How strongly the prior pulls towards its centre."""
        return self.precision * (self.centre - self.value)


@dataclass(frozen=True)
class State:
    """Effects and nuisances with their values.

    Attributes:
        nuisances: effects that the nominal robot has in it with unknown values.
        effects: those claimed so far.
        scales: joint -> factor on its rigid-body torque, within the tolerance.
        tolerance: relative standard deviation of that factor.
        fixed: joints whose factor an effect has taken over: it is 1.
        priors: (label, parameter, value, standard deviation) told by other records.
        held: numbers of the nuisances that stay as they are.
    """

    nuisances: tuple[Effect, ...] = ()
    effects: tuple[Effect, ...] = ()
    scales: Mapping[str, float] = field(default_factory=dict)
    tolerance: float = 0.05
    fixed: frozenset[str] = frozenset()
    priors: tuple[tuple[str, str, float, float], ...] = ()
    held: frozenset[int] = frozenset()

    @property
    def every(self) -> tuple[Effect, ...]:
        """Nuisances, then effects."""
        return self.nuisances + self.effects

    def coordinates(self, system: System) -> list[Coordinate]:
        """What may be varied.

        Args:
            system: the equations.
        """
        found = [
            Coordinate(-1, joint, value, 1.0 - 2.0 * self.tolerance, 1.0 + 2.0 * self.tolerance,
                       0.01, self.tolerance, 1.0)
            for joint, value in self.scales.items() if joint not in self.fixed
        ]  # fmt: skip
        told = {(label, name): (value, std) for label, name, value, std in self.priors}
        for index, effect in enumerate(self.every):
            if index in self.held:
                continue
            for c in self.numbers(system, index):
                if (effect.label, c.name) in told:
                    value, std = told[effect.label, c.name]
                    if c.name in effect.inverse:
                        value, std = 1.0 / value, std / value**2
                    c = replace(c, prior=std, centre=value)
                found.append(c)
        return found

    def numbers(self, system: System, index: int) -> list[Coordinate]:
        """An effect's parameters as a fit varies them, within what can be.

        Args:
            system: the equations.
            index: of the effect in `every`.
        """
        effect, rate = self.every[index], system.logs[0].rate
        possible = dict(effect.possible(system.robot))
        for name, (other, parameter) in effect.within.items():
            size = sum(
                e.values[parameter]
                for e in self.every
                if (e.name, e.target) == (other, effect.target)
            )
            possible[name] = (-size, size)
        found = []
        for p in effect.parameters:
            value, lower, upper = effect.values[p.name], p.lower, p.upper
            if p.whole or (p.name == "order" and value.is_integer()):
                continue  # locked to the motor's turn: no measured order is whole to the last digit
            if p.moving is not None:
                lower = p.moving
            if p.name in effect.inverse:
                value, lower, upper = 1.0 / value, 1.0 / p.upper, 1.0 / p.lower
                step = 0.1
            else:
                step = _step(p, value, rate)
            least, most = possible.get(p.name, (lower, upper))
            known = (p.spread, p.neutral if p.centre is None else p.centre) if p.spread else ()
            found.append(
                Coordinate(index, p.name, value, max(lower, least), min(upper, most), step, *known)
            )
        return found

    def within(self, system: System) -> State:
        """With every number brought within what can be, beside the others.

        Args:
            system: the equations.
        """
        state = self
        for c in self.coordinates(system):
            if not c.lower <= c.value <= c.upper:
                state = state.moved(c, min(max(c.value, c.lower), c.upper))
        return state

    def given(self) -> State:
        """What was found, as a robot to start from: friction is fitted anew, all else stays."""
        held = {i for i, e in enumerate(self.every) if not e.urdf}
        return replace(
            self, nuisances=self.every, effects=(), priors=(), held=frozenset(held),
            fixed=frozenset(self.scales),
        )  # fmt: skip

    def informed(self, effect: Effect, std: Mapping[str, float]) -> State:
        """With an effect of which other records tell the values, and how well.

        Args:
            effect: at those values; it is added where it is missing.
            std: parameter -> standard deviation, SI.
        """
        there = any(e.label == effect.label for e in self.every)
        kept = tuple(p for p in self.priors if p[0] != effect.label)
        told = tuple((effect.label, name, effect.values[name], s) for name, s in std.items())
        return replace(self if there else self.with_effect(effect), priors=kept + told)

    def moved(self, coordinate: Coordinate, value: float) -> State:
        """With another value of one coordinate.

        Args:
            coordinate: which.
            value: in its own unit.
        """
        if coordinate.index < 0:
            return replace(self, scales={**self.scales, coordinate.name: value})
        effect = self.every[coordinate.index]
        changed = with_coordinate(effect, coordinate.name, value)
        every, count = list(self.every), len(self.nuisances)
        every[coordinate.index] = changed
        return replace(self, nuisances=tuple(every[:count]), effects=tuple(every[count:]))

    def with_effect(self, effect: Effect) -> State:
        """With one effect more, or in place of the one that it refines.

        Args:
            effect: to be added.
        """
        coarser = [(e.name, e.target) for e in self.effects]
        if (effect.refines, effect.target) not in coarser:
            return replace(self, effects=(*self.effects, effect))
        return self.replaced(coarser.index((effect.refines, effect.target)), effect)

    def replaced(self, index: int, effect: Effect) -> State:
        """With another effect in the place of one.

        Args:
            index: of the one among those of this state.
            effect: the other.
        """
        effects = (*self.effects[:index], effect, *self.effects[index + 1 :])
        return replace(self, effects=effects)

    def without(self, index: int) -> State:
        """Without the effect of this number.

        Args:
            index: of the effect among those of this state.

        Returns:
            the state that is left.
        """
        kept = tuple(e for i, e in enumerate(self.effects) if i != index)
        gone = self.effects[index].label
        priors = tuple(p for p in self.priors if p[0] != gone)
        return replace(self, effects=kept, priors=priors)


def with_coordinate(effect: Effect, name: str, value: float) -> Effect:
    """The effect with one parameter set as a fit sees it."""
    if name in effect.inverse:
        value = 1.0 / max(value, _SMALL)
    return effect.bounded(**{name: value})


def _step(p: Parameter, value: float, rate: float) -> float:
    if p.unit == "s":
        return 0.1 / rate
    if p.name == "order":
        return 1e-5 * value
    if p.logarithmic:
        return 1e-3 * value
    return min(1.0, _SMALL * (p.upper - p.lower))


def baseline(system: System, tolerance: float) -> State:
    """The nominal model's state.

    The rigid bodies' torque of each joint may be off by the tolerance of forces: masses are
    rounded, currents calibrated. Friction that the URDF states is there, but friction is never
    known beforehand: it is fitted without prior. Where nobody says how joints without an angle
    stand, the others may take as much more or less to turn as they do in the pose assumed, and no
    factor says more.

    Args:
        system: the training equations.
        tolerance: relative standard deviation.
    """
    robot = system.robot
    driven = [joint for kind, joint in system.groups if kind == TORQUE]
    folded = [UnknownInertia(joint) for joint in driven if joint in system.unposed]
    own = np.diag(robot.rigid.mass_matrix(np.zeros(len(robot.joint_names))))
    size = dict(zip(robot.joint_names, own.tolist(), strict=True))
    return State(
        nuisances=(*stated_friction(robot, driven), *folded),
        scales=dict.fromkeys([joint for joint in driven if joint not in system.unposed], 1.0),
        tolerance=tolerance,
        priors=tuple((e.label, "inertia", 0.0, size[e.target]) for e in folded),
    )


class UnknownInertia(Effect):
    """What the arm beyond a joint takes to turn more than in the pose that is assumed."""

    name = "unknown_inertia"
    where = "motion"
    target_kind = "joint"
    parameters = (Parameter("inertia", "kg*m^2", lower=-1e5, upper=1e5, meaning="more"),)
    linear = ("inertia",)
    meaning = "joints without an angle stand in a pose that nobody wrote down"

    def motion(self, motion: Motion) -> None:
        """Add what it takes to accelerate it."""
        torque = self.values["inertia"] * motion.acceleration[self.target]
        motion.add(ROTOR, self.target, torque)


def stated_friction(robot: FlexibleRobot, joints: list[str]) -> tuple[Effect, ...]:
    """The friction that the URDF states for these joints."""
    root = parse_urdf(read_urdf_bytes(robot.source), robot.source)
    found: list[Effect] = []
    for element in root.iter("joint"):
        name, dynamics = element.get("name"), element.find("dynamics")
        if name in joints and dynamics is not None:
            found += _stated(str(name), dynamics)
    return tuple(found)


def _stated(joint: str, dynamics: etree._Element) -> list[Effect]:
    found = []
    stated = [(*each, kind) for kind in catalogue().values() for each in kind.urdf.items()]
    for attribute, parameter, kind in sorted(stated, key=lambda each: each[:2]):
        try:
            value = float(dynamics.get(attribute) or 0.0)
        except ValueError:
            continue
        if value > 0.0:
            found.append(kind(joint, **{parameter: value}))
    return found
