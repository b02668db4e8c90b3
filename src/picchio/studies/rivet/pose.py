"""What blows do to the joints at one pose: the one way from a model to a response.

Every study, plot and scene that looks at a pose begins here. Mass, damping, stiffness, force and
tool point come from the model, effects included. A linear model has a response in closed form; one
with nonlinear elements (backlash, friction, contact) is integrated in time.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.excitation.excitation import Excitation
from picchio.excitation.piecewise import PiecewiseForce
from picchio.fatigue.counting.counter import Residue, rainflow
from picchio.fatigue.counting.cycles import Cycles
from picchio.model.geometry import Geometry
from picchio.model.linear_system import LinearSystem
from picchio.model.model import Model
from picchio.model.plant import Plant
from picchio.model.system import ElementKind, VibratingSystem
from picchio.robot.dynamics.statics import RobotState
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.joint import Joint
from picchio.studies.tasks import Operation
from picchio.vibration.closed_form.modes import Modes, modal_analysis
from picchio.vibration.closed_form.response import (
    Peak,
    Response,
    response_from_rest,
    ring_down,
    steady_state,
    unit_vector,
)
from picchio.vibration.integration.integrate import Samples, integrate

# Samples of a nonlinear response, a period of the fastest mode that matters.
_PER_CYCLE = 40
_FINEST = 5e-5
_LONGEST_RING = 20.0
# Of one response: some minutes, and 300 MB.
_MOST_VALUES = 12_000_000


@dataclass(frozen=True, eq=False)
class SampledResponse:
    """The deflections of a nonlinear model under one force, sampled; used as a `Response`.

    Attributes:
        time: (t,) s.
        values: (n, t) rad: the spring's torque over the joint's stiffness.
        along: (3,) the direction of the force.
        force: the history that acts.
        modes: of the linear part.
        periodic: whether it repeats with the force's period.
    """

    time: FloatArray
    values: FloatArray
    along: FloatArray
    force: PiecewiseForce
    modes: Modes
    periodic: bool

    def deflection(self, time: ArrayLike, direction: ArrayLike) -> FloatArray:
        """The deflection (n, k) rad at times.

        Args:
            time: (k,) s.
            direction: (3,) of the force.

        Raises:
            InputError: another direction than the one that was integrated.
        """
        self._check(direction)
        wanted = np.asarray(time, dtype=float)
        if self.periodic:
            wanted = np.mod(wanted, self.force.end)
        return np.array([np.interp(wanted, self.time, row) for row in self.values])

    def turning_points(self, direction: ArrayLike) -> list[tuple[FloatArray, FloatArray]]:
        """The first, last and turning points of every joint: time (k,) s, value (k,) rad.

        Args:
            direction: (3,) of the force.

        Raises:
            InputError: as `deflection`.
        """
        self._check(direction)
        found = []
        for row in self.values:
            slope = np.sign(np.diff(row))
            moving = np.flatnonzero(slope)
            turns = moving[1:][slope[moving[1:]] != slope[moving[:-1]]]
            index = np.concatenate([[0], turns, [row.size - 1]])
            found.append((self.time[index], row[index]))
        return found

    def peaks(self, direction: ArrayLike) -> list[Peak]:
        """The largest absolute deflection of every joint.

        Args:
            direction: (3,) of the force.

        Raises:
            InputError: as `deflection`.
        """
        self._check(direction)
        at = np.abs(self.values).argmax(axis=1)
        return [
            Peak(float(row[k]), float(self.time[k])) for row, k in zip(self.values, at, strict=True)
        ]

    def _check(self, direction: ArrayLike) -> None:
        if not np.allclose(unit_vector(direction), self.along):
            raise InputError(
                "a nonlinear response belongs to one direction", key="direction", value=direction
            )


def need_springs(robot: FlexibleRobot) -> None:
    """Refuse a robot without a flexible joint.

    Args:
        robot: to be studied.

    Raises:
        InputError: no joint has a stiffness.
    """
    if not robot.flexible_joints:
        raise InputError(
            "no joint has a stiffness, so nothing can vibrate",
            file=robot.source,
            hint="annotate the URDF, or give a sidecar with --flex",
        )


class ModelAtPose:
    """A model at a pose: its linear system, modes and springs, computed when they are asked for.

    Args:
        model: the robot and its effects.
        pose: (nv,) rad or m, at rest under gravity.
        geometry: of the robot at this pose, where it is known.

    Raises:
        InputError: a bad pose, no flexible joint, an effect whose target the robot does not have.
    """

    def __init__(self, model: Model, pose: FloatArray, geometry: Geometry | None = None) -> None:
        robot = model.robot
        need_springs(robot)
        self.model = model
        self.state: RobotState = robot.state(pose)
        self._given_geometry = geometry

    @cached_property
    def geometry(self) -> Geometry:
        """Masses and kinematics at the pose, to second order; models of one robot share it."""
        return self._given_geometry or self.model.geometry(self.pose)

    @property
    def pose(self) -> FloatArray:
        """(nv,) rad or m."""
        return self.state.pose

    @cached_property
    def plant(self) -> Plant | None:
        """The equations of motion with the effects in them; None where no effect changes them."""
        if not self.model.changes_structure:
            return None
        return self.model.plant(self.geometry)

    @cached_property
    def linear(self) -> LinearSystem:
        """The linear equations; force goes in along the programmed direction, world axes."""
        if self.plant is None:
            system = self.model.linear_system(self.pose)
        else:
            system = self._unforced.linear()
        if not self.model.changes_blows:
            return system
        return replace(system, input_matrix=system.input_matrix @ self.force_directions)

    @cached_property
    def _unforced(self) -> VibratingSystem:
        assert self.plant is not None
        return self.plant.build(np.array([0.0, 0.0, 1.0]))

    @property
    def nonlinear(self) -> bool:
        """Whether it must be integrated in time."""
        return self.plant is not None and bool(self._unforced.elements)

    @cached_property
    def force_directions(self) -> FloatArray:
        """(3, 3): the direction of the force from the programmed one."""
        frame = self.model.robot.frame_placement(self.pose, self.model.robot.tool_frame)[1]
        return self.model.force_directions(frame)

    @cached_property
    def modes(self) -> Modes:
        """Of the linear equations."""
        return modal_analysis(self.linear)

    @property
    def natural_frequencies(self) -> FloatArray:
        """(n,) Hz: the lowest, as many as there are flexible joints."""
        return self.modes.natural_frequencies[: len(self.stiffness)]

    @cached_property
    def stiffness(self) -> FloatArray:
        """(n,) N m/rad, of the joints' springs."""
        if self.plant is None:
            return self.state.stiffness
        return np.array(list(self.plant.springs.values()))

    @cached_property
    def gravity_torque(self) -> FloatArray:
        """(n,) N m, that the joints hold against gravity, added masses included."""
        if self.model.gravity_balanced or self.plant is None:
            return self.model.holding_torque(self.state)
        return np.array(list(self.plant.gravity_torque.values()))

    def static_torque(self, excitation: Excitation, direction: FloatArray) -> FloatArray:
        """(n,) N m, through the springs before the first blow: feed force and gravity.

        Args:
            excitation: its `preload` is the feed force.
            direction: (3,) of the force as programmed.
        """
        if not excitation.preload:
            return -self.gravity_torque
        n = len(self.stiffness)
        feed = excitation.preload * (self.linear.input_matrix[:n] @ direction)
        return feed - self.gravity_torque

    def response(self, excitation: Excitation, hits: int | None) -> Response:
        """The deflections in closed form, for every programmed direction at once.

        Args:
            excitation: the blows.
            hits: of a burst from rest; None for the steady state.

        Raises:
            InputError: a nonlinear model, a resonance without damping, no hits.
        """
        return self._respond(self.modes, excitation, hits)

    def tool_response(self, excitation: Excitation, hits: int | None) -> Response:
        """As `response`, of the tool's displacement along x, y, z, m, instead of the joints'."""
        rows = self.state.jacobian if self.plant is None else self._unforced.force_jacobian
        system = replace(self.linear, output_matrix=rows, output_names=("x", "y", "z"))
        return self._respond(modal_analysis(system), excitation, hits)

    def _respond(self, modes: Modes, excitation: Excitation, hits: int | None) -> Response:
        if self.nonlinear:
            effects = ", ".join(e.label for e in self.model.effects if e.where == "nonlinear")
            raise InputError(
                "is not linear, so the response has no closed form for every direction",
                value=effects,
                hint="ask for one force direction",
            )
        force = self.model.force(excitation, hits)
        return steady_state(modes, force) if hits is None else response_from_rest(modes, force)

    def turning_points(
        self, excitation: Excitation, hits: int | None, direction: FloatArray
    ) -> list[FloatArray]:
        """Every joint's turning points, rad, as its spring's torque over its stiffness.

        Where the spring is not linear (backlash, hardening) this is the deflection of a linear
        spring under the same torque: what shaft and gear feel.

        Args:
            excitation: the blows.
            hits: of a burst from rest; None for the steady state.
            direction: (3,) of the force as programmed.

        Returns:
            n arrays (k,); of the steady state over one period.

        Raises:
            InputError: a mode without damping, a motion that does not become periodic.
        """
        response = self.response_along(excitation, hits, direction)
        return [value for _, value in response.turning_points(direction)]

    def response_along(
        self, excitation: Excitation, hits: int | None, direction: FloatArray
    ) -> Response | SampledResponse:
        """The deflections under a force along one direction, which any model has.

        Arguments and errors as in `turning_points`.
        """
        if self.plant is None or not self.nonlinear:
            return self.response(excitation, hits)
        system = self.plant.build(self.force_directions @ direction)
        force = self.model.force(excitation, hits)
        samples = self._samples(force)
        motion = integrate(system, force, samples)
        torque = _spring_torque(system, motion.position, self.stiffness)
        return SampledResponse(
            samples.start + samples.step * np.arange(samples.count),
            torque / self.stiffness[:, None],
            direction,
            force,
            self.modes,
            periodic=hits is None,
        )

    def _samples(self, force: PiecewiseForce) -> Samples:
        step = max(1.0 / (_PER_CYCLE * float(self.natural_frequencies.max())), _FINEST)
        length = float(force.end)
        if not np.isfinite(length):
            length = float(force.start[-1]) + min(ring_down(self.modes), _LONGEST_RING)
        most = _MOST_VALUES // len(self.stiffness)
        if length > most * step:
            raise InputError(
                f"{length:.4g} s of a nonlinear model are {length / step:.3g} samples; at most "
                f"{most} are integrated",
                key="hits",
                hint="give fewer hits, or a shorter period",
            )
        if np.isfinite(force.end):
            count = max(int(np.ceil(length / step)), 64)
            return Samples(0.0, length / count, count + 1)
        return Samples(0.0, step, int(length / step) + 1)


def _spring_torque(
    system: VibratingSystem, position: FloatArray, stiffness: FloatArray
) -> FloatArray:
    """Torque (n, t) of every joint's spring beyond what it carries at rest, N m.

    Args:
        system: gives the joints' deflections and nonlinear springs.
        position: (t, N) rad.
        stiffness: (n,) N m/rad.
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
        elif element.kind == ElementKind.BILINEAR:
            torque[joint] = torque[joint] + p[0] * np.maximum(d, 0.0)
    return torque


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
        """What wears before the first blow: shear stress, Pa, or a drive's share of its torque.

        Args:
            joint: with a shaft or a drive's strength.
        """
        return self.stiffness * self.static * joint.per_torque

    def stress_cycles(self, joint: Joint, residue: Residue, factor: float = 1.0) -> Cycles:
        """The cycles about zero of the vibration's shear stress, Pa, or share of the torque.

        Args:
            joint: with a shaft or a drive's strength.
            residue: how what rainflow leaves is counted.
            factor: on all of them; see `SNCurve.raised_by`.
        """
        assert self.rest is not None
        per = factor * joint.per_torque * self.stiffness
        return rainflow(per * self.rest, residue=residue)


class Rivet(ModelAtPose):
    """A rivet about to be set: a model at a pose, under the blows of an operation.

    Args:
        model: the robot and its effects.
        operation: its blows, direction and hits.
        pose: (nv,) rad or m.
        geometry: as in `ModelAtPose`.

    Raises:
        InputError: as `ModelAtPose`.
    """

    def __init__(
        self,
        model: Model,
        operation: Operation,
        pose: FloatArray,
        geometry: Geometry | None = None,
    ) -> None:
        super().__init__(model, pose, geometry)
        self.operation = operation

    def loads(self, need: str | None = None, *, both: bool = True) -> tuple[JointLoad, ...]:
        """Every joint's load.

        Args:
            need: "rest" or "steady", whichever must be there: where a mode has no damping the
                other is left out, and this one raises what is wrong.
            both: False: leave out what is not needed.

        Raises:
            InputError: a resonance without damping, a ring-down without end.
        """
        op = self.operation
        found: dict[str, list[FloatArray] | None] = {"rest": None, "steady": None}
        for name, hits in (("rest", op.hits_per_rivet), ("steady", None)):
            if not both and name != need:
                continue
            if name != need and not (self.modes.poles.real < 0.0).all():
                continue
            try:
                found[name] = self.turning_points(op.excitation, hits, op.direction)
            except InputError:
                if need in (None, name):
                    raise
        return self.joint_loads(found["rest"], found["steady"])

    def joint_loads(
        self, rest: list[FloatArray] | None, steady: list[FloatArray] | None = None
    ) -> tuple[JointLoad, ...]:
        """The joints' loads from their turning points, n arrays (k,) rad each.

        Args:
            rest: of a burst, from rest.
            steady: of the steady train, where it is wanted.
        """
        static = self.static_torque(self.operation.excitation, self.operation.direction)
        return tuple(
            JointLoad(
                None if steady is None else steady[j],
                None if rest is None else rest[j],
                float(static[j] / spring),
                float(spring),
            )
            for j, spring in enumerate(self.stiffness)
        )
