"""What one rivet at one pose does to the joints: turning points, torques and stress cycles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.fatigue import Cycles, rainflow, shear_stress
from picchio.fatigue.rainflow import Residue
from picchio.model import Model
from picchio.robot import Joint
from picchio.studies.task import Operation
from picchio.vibration import modal_analysis, response_from_rest, steady_state


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


def loads_at(
    model: Model, operation: Operation, pose: FloatArray, *, need: str | None = None
) -> PoseLoads:
    """What one rivet of an operation does at a pose.

    Args:
        model: the robot.
        operation: blows and direction.
        pose: (nv,) rad or m.
        need: "rest" or "steady", whichever must be there: without damping the other is left
            out, and this one raises what is wrong.

    Raises:
        InputError: a resonance without damping, a ring-down without end.
    """
    state = model.robot.state(pose)
    modes = modal_analysis(model.linear_system(pose))
    n = len(model.robot.flexible_joints)
    damped = bool((modes.poles.real < 0.0).all())
    rest: list[FloatArray | None] = [None] * n
    steady: list[FloatArray | None] = [None] * n
    if damped or need == "rest":
        response = response_from_rest(modes, operation.excitation, operation.hits_per_rivet)
        rest = [value for _, value in response.turning_points(operation.direction)]
    if damped or need == "steady":
        response = steady_state(modes, operation.excitation)
        steady = [value for _, value in response.turning_points(operation.direction)]
    feed = operation.excitation.preload * (state.jacobian.T @ operation.direction)
    held = model.holding_torque(state)
    static = (feed - held) / state.stiffness
    joints = tuple(
        JointLoad(steady[j], rest[j], float(static[j]), float(state.stiffness[j])) for j in range(n)
    )
    return PoseLoads(
        joints,
        modes.natural_frequencies,
        state.tool_position,
        held,
        state.stiffness,
    )
