"""What one rivet at one pose does to the joints: turning points, torques and stress cycles."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.excitation.excitation import Excitation
from picchio.excitation.piecewise import PiecewiseForce
from picchio.fatigue.counting.counter import Residue, rainflow
from picchio.fatigue.counting.cycles import Cycles
from picchio.fatigue.shaft_stress import shear_stress
from picchio.model.blows import Blows
from picchio.model.elements import ElementKind
from picchio.model.geometry import Geometry
from picchio.model.linear_system import LinearSystem
from picchio.model.model import Model
from picchio.model.system import VibratingSystem
from picchio.robot.dynamics.statics import RobotState
from picchio.robot.joint import Joint
from picchio.studies.tasks import Operation
from picchio.vibration.closed_form.modes import Modes, modal_analysis
from picchio.vibration.closed_form.response import RING_DOWN_LEVEL, response_from_rest, steady_state
from picchio.vibration.integration.integrate import Samples, integrate


@dataclass(frozen=True, eq=False)
class JointLoad:
    """One joint under one rivet.

    Attributes:
        steady: (k,) rad, turning points over one period of the steady state; None where there is
            none, or where it was not asked for.
        rest: (k,) rad, turning points from rest to the end of the ring-down; None where a mode
            has no damping.
        static: rad, deflection before the first blow, by gravity and the feed force.
        stiffness: N m/rad, of the joint at this pose.
    """

    steady: FloatArray | None
    rest: FloatArray | None
    static: float
    stiffness: float

    @property
    def peak_torque_with_gravity(self) -> float:
        """N m, largest magnitude of everything the joint carries; NaN where `rest` is None."""
        if self.rest is None:
            return float("nan")
        return float(np.abs(self.stiffness * (self.static + self.rest)).max())

    def static_stress(self, joint: Joint) -> float:
        """Pa, shear stress before the first blow; the joint has a shaft."""
        assert joint.shaft is not None
        return float(shear_stress(self.stiffness * self.static, joint.shaft))

    def stress_cycles(self, joint: Joint, residue: Residue) -> Cycles:
        """Cycles of the vibration's shear stress, Pa, about zero; the joint has a shaft."""
        assert joint.shaft is not None
        assert self.rest is not None
        return rainflow(shear_stress(self.stiffness * self.rest, joint.shaft), residue=residue)


@dataclass(frozen=True, eq=False)
class PoseLoads:
    """All joints at one pose.

    Attributes:
        joints: n loads.
        natural_frequencies: (n,) Hz.
        tool_position: (3,) m.
        gravity_torque: (n,) N m, that the joints hold.
        stiffness: (n,) N m/rad.
    """

    joints: tuple[JointLoad, ...]
    natural_frequencies: FloatArray
    tool_position: FloatArray
    gravity_torque: FloatArray
    stiffness: FloatArray


@dataclass(frozen=True, eq=False)
class Rivet:
    """A rivet about to be set at a pose: all that its loads follow from.

    Attributes:
        system: M, C, K and where force goes in.
        excitation: the blows.
        direction: (3,) unit vector of the force.
        hits: blows of the rivet.
        static_torque: (n,) N m, through the springs before the first blow: gravity and feed force.
        stiffness: (n,) N m/rad, of the joints' springs.
    """

    system: LinearSystem
    excitation: Excitation
    direction: FloatArray
    hits: int
    static_torque: FloatArray
    stiffness: FloatArray

    @classmethod
    def at(
        cls, model: Model, operation: Operation, state: RobotState, pose: FloatArray, **more: Any
    ) -> Self:
        """The rivet of an operation at a pose, (nv,) rad or m, whose state is known."""
        feed = operation.excitation.preload * (state.jacobian.T @ operation.direction)
        return cls(
            system=model.linear_system(pose),
            excitation=operation.excitation,
            direction=operation.direction,
            hits=operation.hits_per_rivet,
            static_torque=feed - model.holding_torque(state),
            stiffness=state.stiffness,
            **more,
        )

    def perturbed(self, stiffness: float, damping: float, excitation: Excitation) -> Self:
        """The same with all stiffnesses and damping ratios times a factor, and other blows.

        The torque before the first blow stays.
        """
        system = replace(
            self.system,
            stiffness_matrix=stiffness * self.system.stiffness_matrix,
            # Modal damping with the same mode shapes: C goes with zeta omega.
            damping_matrix=damping * math.sqrt(stiffness) * self.system.damping_matrix,
        )
        springs = stiffness * self.stiffness
        return replace(self, system=system, excitation=excitation, stiffness=springs)

    def loads(
        self, modes: Modes | None = None, *, need: str | None = None, both: bool = True
    ) -> tuple[JointLoad, ...]:
        """Every joint's load.

        Args:
            modes: of the system, if they are known.
            need: "rest" or "steady", whichever must be there; see `loads_at`.
            both: False: leave out what is not needed, damped or not.
        """
        modes = modal_analysis(self.system) if modes is None else modes
        also = both and bool((modes.poles.real < 0.0).all())
        rest: list[FloatArray] | None = None
        steady: list[FloatArray] | None = None
        if also or need == "rest":
            response = response_from_rest(modes, self.excitation, self.hits)
            rest = [value for _, value in response.turning_points(self.direction)]
        if also or need == "steady":
            response = steady_state(modes, self.excitation)
            steady = [value for _, value in response.turning_points(self.direction)]
        return self.joint_loads(rest, steady)

    def joint_loads(
        self,
        rest: list[FloatArray] | None,
        steady: list[FloatArray] | None = None,
        *,
        stiffness: FloatArray | None = None,
    ) -> tuple[JointLoad, ...]:
        """The joints' loads from their turning points, rad; with other springs, (n,) N m/rad."""
        springs = self.stiffness if stiffness is None else stiffness
        static = self.static_torque / springs
        return tuple(
            JointLoad(
                None if steady is None else steady[j],
                None if rest is None else rest[j],
                float(static[j]),
                float(spring),
            )
            for j, spring in enumerate(springs)
        )


def loads_at(
    model: Model,
    operation: Operation,
    pose: FloatArray,
    *,
    need: str | None = None,
    both: bool = True,
) -> PoseLoads:
    """What one rivet of an operation does at a pose.

    Args:
        model: the robot.
        operation: blows and direction.
        pose: (nv,) rad or m.
        need: "rest" or "steady", whichever must be there: without damping the other is left
            out, and this one raises what is wrong.
        both: False: leave out what is not needed.

    Raises:
        InputError: a resonance without damping, a ring-down without end.
    """
    state = model.robot.state(pose)
    if model.moving:
        return _extended_loads(model, operation, pose, state, need, both)
    rivet = Rivet.at(model, operation, state, pose)
    modes = modal_analysis(rivet.system)
    return PoseLoads(
        rivet.loads(modes, need=need, both=both),
        modes.natural_frequencies,
        state.tool_position,
        model.holding_torque(state),
        state.stiffness,
    )


def _extended_loads(
    model: Model,
    operation: Operation,
    pose: FloatArray,
    state: RobotState,
    need: str | None,
    both: bool,
) -> PoseLoads:
    """As `loads_at`, by a model whose effects change the motion."""
    extended = ExtendedRivet(model, operation, pose)
    found: dict[str, list[FloatArray] | None] = {"rest": None, "steady": None}
    for name in ("rest", "steady"):
        if not both and name != need:
            continue
        try:
            found[name] = extended.turning_points(steady=name == "steady")
        except InputError:
            if need in (None, name):
                raise
            found[name] = None
    held = model.holding_torque(state)
    feed = operation.excitation.preload * (state.jacobian.T @ operation.direction)
    static = (feed - held) / extended.stiffness
    joints = tuple(
        JointLoad(
            None if found["steady"] is None else found["steady"][j],
            None if found["rest"] is None else found["rest"][j],
            float(static[j]),
            float(spring),
        )
        for j, spring in enumerate(extended.stiffness)
    )
    return PoseLoads(
        joints,
        extended.natural_frequencies[: len(joints)],
        state.tool_position,
        held,
        extended.stiffness,
    )


# One rivet's loads by a model with effects: other springs, other blows, nonlinear joints.

# Samples of a nonlinear response, a period of the fastest mode that matters.
_PER_CYCLE = 40
_FINEST = 5e-5
_LONGEST_RING = 20.0


class ExtendedRivet:
    """A rivet of an operation at a pose, by a model whose effects change the motion.

    Args:
        model: with its effects.
        operation: blows, direction, hits.
        pose: (nv,) rad or m.

    Attributes:
        stiffness: (n,) N m/rad, of the joints' springs.
        natural_frequencies: Hz, of the linear part; effects that let something else move add some.
    """

    def __init__(self, model: Model, operation: Operation, pose: FloatArray) -> None:
        self._model, self._operation = model, operation
        self._geometry = Geometry.of(model.robot, pose)
        self._rotation = self._geometry.motion(model.robot.tool_frame).rotation
        plant = model.plant(self._geometry)
        self.stiffness = np.array(list(plant.springs.values()))
        force, direction = self._force(operation.hits_per_rivet)
        self._system = plant.build(direction)
        self._burst, self._direction = force, direction
        self._modes = modal_analysis(self._system.linear())
        self.natural_frequencies = self._modes.natural_frequencies

    def _force(self, hits: int | None) -> tuple[PiecewiseForce, FloatArray]:
        operation = self._operation
        blows = Blows.of(operation.excitation, hits, operation.direction)
        blows = self._model.blows(blows.change(tool_rotation=self._rotation))
        return blows.force(), blows.direction

    def turning_points(self, *, steady: bool = False) -> list[FloatArray]:
        """Every joint's turning points, rad, as its spring's torque over its stiffness.

        Where the spring is not linear (backlash, hardening) this is the deflection of a linear
        spring under the same torque: what shaft and gear feel.

        Args:
            steady: of the steady state, else of the burst from rest.

        Raises:
            InputError: a mode without damping, a motion that does not become periodic.
        """
        force = self._force(None)[0] if steady else self._burst
        if not self._system.elements:
            if steady:
                response = steady_state(self._modes, force)
            else:
                response = response_from_rest(self._modes, force)
            return [value for _, value in response.turning_points(self._direction)]
        samples = self._samples(force)
        motion = integrate(self._system, force, samples)
        history = spring_torque(self._system, motion.position, self.stiffness)
        return [_turning(row / k) for row, k in zip(history, self.stiffness, strict=True)]

    def _samples(self, force: PiecewiseForce) -> Samples:
        fastest = float(self._modes.natural_frequencies[: len(self.stiffness)].max())
        step = max(1.0 / (_PER_CYCLE * fastest), _FINEST)
        if np.isfinite(force.end):
            count = max(int(np.ceil(force.end / step)), 64)
            return Samples(0.0, force.end / count, count + 1)
        slowest = -float(self._modes.poles.real.max())
        if slowest <= 0.0:
            raise InputError(
                "a mode has no damping: after the blows it rings for ever, and a rivet has no end",
                key="damping_ratio",
                value=0.0,
                hint="give the joints a damping ratio above 0",
            )
        ring = min(-float(np.log(RING_DOWN_LEVEL)) / slowest, _LONGEST_RING)
        return Samples(0.0, step, int((float(force.start[-1]) + ring) / step) + 1)


def spring_torque(
    system: VibratingSystem, position: FloatArray, stiffness: FloatArray
) -> FloatArray:
    """Torque of every joint's spring beyond what it carries at rest, N m.

    Args:
        system: gives the joints' deflections and nonlinear springs.
        position: (k, N) rad.
        stiffness: (n,) N m/rad.

    Returns:
        (n, k).
    """
    deflection = system.deflections @ position.T
    torque = stiffness[:, None] * deflection
    for element, row in zip(system.elements, system.rows, strict=True):
        joint = int(np.abs(system.deflections @ row).argmax())
        d, p = deflection[joint], element.parameters
        if element.kind == ElementKind.BACKLASH:
            total = d + p[2]
            beyond = total - np.clip(total, -0.5 * p[1], 0.5 * p[1])
            torque[joint] = torque[joint] - p[0] * d + p[0] * beyond - p[3]
        elif element.kind == ElementKind.CUBIC:
            torque[joint] = torque[joint] + p[0] * d**3
    return torque


def _turning(values: FloatArray) -> FloatArray:
    """First, last and every turning point between."""
    slope = np.sign(np.diff(values))
    moving = np.flatnonzero(slope)
    if not moving.size:
        return values[[0, -1]]
    turns = moving[1:][slope[moving[1:]] != slope[moving[:-1]]]
    return values[np.concatenate([[0], turns, [values.size - 1]])]
