"""One record's set-up: the robot at a pose, what is wrong with it, the blows, the sensors.

Effects write into a Bench; `Bench.system` turns it into the arrays of the equations of motion.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache

import numpy as np
from scipy.linalg import eigh

from . import equations, robots
from .arm import GRAVITY, dynamics, jacobian_column, kinematics, workspace
from .blows import Blows
from .chain import Chain, from_pinocchio
from .sensors import Sensor


@cache
def nominal_chain(name: str) -> Chain:
    """The robot as its URDF has it."""
    robot = robots.load(name)
    return from_pinocchio(robot.model, robot.joints, robot.tool)


def rest(chain, positions):
    """(mass matrix, gravity torque, work arrays) of a chain that stands still."""
    n = chain.parent.size
    work = workspace(n)
    kinematics(chain.arrays(), np.asarray(positions, float), np.zeros(n), work)
    dynamics(chain.arrays(), GRAVITY, work)
    return work[12].copy(), work[13].copy(), work


def modal_damping(mass, stiffness, ratio):
    """C = M S diag(2 zeta omega) S^T M, of the undamped modes of M and K."""
    squared, shapes = eigh(stiffness, mass)
    weighted = mass @ shapes
    return weighted @ np.diag(2.0 * ratio * np.sqrt(squared)) @ weighted.T


@dataclass
class Bench:
    """What happens in one record; see `system` for what each field does.

    Attributes:
        robot: nominal.
        pose: (n,) rad, of the flexible joints.
        direction: (3,) unit, world.
        blows: the burst.
        chain: bodies; effects replace it.
        springs: (n,) N m/rad.
        damping_ratio: of all modes.
        coupling: (n, n) N m/rad, further stiffness between the joints' deflections.
        dampers: (n,) N m s/rad, further dampers between link and motor.
        armature: joint, or what else yields -> kg m^2 that turns with the link.
        servos: joint -> (rotor inertia, stiffness, damping) of a motor side that yields.
        soft: inserted coordinate -> (stiffness, damping) against its parent.
        elements: (kind, joint, p0, p1) nonlinear, on the joint's deflection.
        points: (kind, joint whose body or None for the tool's, point in the body or None for the
            force's, N/m, N s/m, preload N, normal or None for the blows' direction).
        force_offset: (3,) m, tool frame.
        sensor_offset: (3,) m, tool frame, of the accelerometer and its like.
        by_mode: (n,) factors on the modes' damping ratios, the slowest first; None for one.
        gravity_stiffness: relative, by which gravity changes too much with the deflection.
        floor: (x, y, z m/s^2, Hz, phase in (0, 2 pi], ramp's start s, ramp's length s); the phase 0
            stands for no floor vibration.
        sensors: channel group -> how it reads.
        when: days since the first record; temperature: deg C, and the mean over the records.
        modal: what C is made of: the "joints" alone, everything else held still, and then it acts
            between link and motor side; or "all" coordinates and linear springs.
        index: of the record. chance: record's own random numbers.
    """

    robot: robots.Robot
    pose: np.ndarray
    direction: np.ndarray
    blows: Blows
    chain: Chain
    springs: np.ndarray
    damping_ratio: float
    when: float = 0.0
    temperature: float = 20.0
    mean_temperature: float = 20.0
    modal: str = "joints"
    index: int = 0
    chance: np.random.Generator = field(default_factory=np.random.default_rng)
    coupling: np.ndarray | None = None
    dampers: np.ndarray | None = None
    armature: dict = field(default_factory=dict)
    servos: dict = field(default_factory=dict)
    soft: dict = field(default_factory=dict)
    elements: list = field(default_factory=list)
    points: list = field(default_factory=list)
    force_offset: np.ndarray = field(default_factory=lambda: np.zeros(3))
    sensor_offset: np.ndarray = field(default_factory=lambda: np.zeros(3))
    by_mode: np.ndarray | None = None
    gravity_stiffness: float = 0.0
    floor: np.ndarray = field(default_factory=lambda: np.zeros(7))
    sensors: dict[str, Sensor] = field(default_factory=dict)

    def joint(self, name) -> int:
        """Index among the flexible joints."""
        return self.robot.joints.index(name)

    def sensor(self, group) -> Sensor:
        """How a group reads; made when first asked for."""
        return self.sensors.setdefault(group, Sensor())

    def positions(self):
        """(bodies,) of the chain at rest: the pose, zero elsewhere."""
        out = np.zeros(len(self.chain.names))
        for name, value in zip(self.robot.joints, self.pose, strict=True):
            out[self.chain.names.index(name)] = value
        return out

    def body(self, link) -> int:
        """The body of a URDF link that a flexible joint carries."""
        return self.chain.names.index(self.robot.joints[self.robot.links().index(link)])

    def nominal_mass(self):
        """(n, n) of the flexible joints, everything else held still."""
        matrix = rest(self.chain, self.positions())[0]
        at = [self.chain.names.index(name) for name in self.robot.joints]
        matrix = matrix[np.ix_(at, at)]
        for name, value in self.armature.items():
            if name in self.robot.joints:
                matrix[self.joint(name), self.joint(name)] += value
        return matrix

    def damping_matrix(self):
        """(n, n): modal, of mass and springs alone."""
        return modal_damping(
            self.nominal_mass(), np.diag(self.springs), self.ratios(len(self.springs))
        )

    def ratios(self, count):
        """Damping ratios of the slowest `count` modes: one number, or (count,)."""
        if self.by_mode is None:
            return self.damping_ratio
        factors = np.ones(count)
        factors[: self.by_mode.size] = self.by_mode
        return self.damping_ratio * factors

    def gravity_change(self):
        """(bodies, bodies) N m/rad: gravity's torque at rest by the coordinates, by differences."""
        at, step, columns = self.positions(), 1e-5, []
        for i in range(at.size):
            aside = step * np.eye(at.size)[i]
            columns.append(rest(self.chain, at + aside)[1] - rest(self.chain, at - aside)[1])
        change = np.array(columns) / (2.0 * step)
        return 0.5 * (change + change.T)

    def system(self):
        """(arrays for `equations.rates`, outputs at rest, inner states, delayed, fastest).

        `fastest` is the largest natural angular frequency, rad/s, that the step must resolve.
        """
        chain, n = self.chain, len(self.robot.joints)
        bodies = len(chain.names)
        total = bodies + len(self.servos)
        at = [chain.names.index(name) for name in self.robot.joints]
        positions = self.positions()
        matrix, gravity_torque, work = rest(chain, positions)
        turn, place = work[0], work[1]

        joints = np.zeros((n, total))
        joints[np.arange(n), at] = 1.0
        inertia = np.zeros(total)
        for name, value in self.armature.items():
            inertia[chain.names.index(name)] += value
        stiff, damp = np.zeros((total, total)), np.zeros((total, total))
        motors = {name: bodies + i for i, name in enumerate(self.servos)}
        for name, (rotor, servo, drag) in self.servos.items():
            k = motors[name]
            joints[self.joint(name), k] = -1.0
            inertia[k], stiff[k, k], damp[k, k] = rotor, servo, drag
        for name, (stiffness, damping) in self.soft.items():
            k = chain.names.index(name)
            stiff[k, k] += stiffness
            damp[k, k] += damping
        springs = np.diag(self.springs)
        if self.coupling is not None:
            springs = springs + self.coupling
        loose = [self.joint(e[1]) for e in self.elements if e[0] == equations.BACKLASH]
        full = joints.T @ springs @ joints + stiff
        springs = springs.copy()
        springs[loose, loose] -= self.springs[loose]
        stiff = joints.T @ springs @ joints + stiff
        mass = np.zeros((total, total))
        mass[:bodies, :bodies] = matrix
        mass += np.diag(inertia)
        if self.dampers is not None:
            damp = damp + joints.T @ np.diag(self.dampers) @ joints
        if self.modal == "all":
            tied = full + self._tethers(work, total)
            damp = damp + modal_damping(mass, tied, self.ratios(total))
        else:
            damp = damp + joints.T @ self.damping_matrix() @ joints

        if self.gravity_stiffness:
            stiff[:bodies, :bodies] += self.gravity_stiffness * self.gravity_change()

        elements, inner, delayed = np.zeros((len(self.elements), 9)), 0, -1
        for row, (kind, name, p0, p1) in zip(elements, self.elements, strict=True):
            j = self.joint(name)
            row[:6] = kind, at[j], motors.get(name, -1), p0, p1, 0.0
            row[8] = -1
            if kind == equations.BACKLASH:
                # what the spring carries: it holds the link up against gravity
                row[3:6] = self.springs[j], p0, -gravity_torque[at[j]]
            if kind == equations.HYSTERESIS:
                row[8], inner = inner, inner + 1
            if kind == equations.DELAYED:
                delayed = at[j]
        tool = chain.tool + 1
        off_t = chain.tool_offset + chain.tool_rotation @ self.sensor_offset
        off_f = chain.tool_offset + chain.tool_rotation @ self.force_offset
        points = np.zeros((len(self.points), 14))
        for row, (kind, name, local, stiffness, damping, preload, normal) in zip(
            points, self.points, strict=True
        ):
            body = tool if name is None else chain.names.index(name) + 1
            local = off_f if local is None else np.asarray(local, float)
            row[0], row[1], row[2:5] = kind, body, local
            row[5:8] = place[body] + turn[body] @ local
            row[8:11] = stiffness, damping, preload
            row[11:14] = self.direction if normal is None else normal

        tool_turn = turn[tool] @ chain.tool_rotation
        blows = self.blows.table(self.direction, tool_turn)
        hold = np.zeros(total)
        hold[:bodies] = gravity_torque
        rest_values = np.zeros(equations.OUTPUTS + n)
        rest_values[:3] = tool_turn.T @ -GRAVITY
        rest_values[9:12] = place[tool] + turn[tool] @ off_t
        fastest = float(np.sqrt(max(eigh(full, mass, eigvals_only=True)[-1], 1.0)))
        for kind, name, p0, p1 in self.elements:
            if kind == equations.SMOOTHED:  # a stiff damper as long as the joint hardly moves
                light = np.linalg.inv(mass)[at[self.joint(name)], at[self.joint(name)]]
                fastest = max(fastest, 0.5 * p0 / p1 * light)
        system = (
            chain.arrays(), GRAVITY,
            (tool, np.ascontiguousarray(chain.tool_rotation), off_t.copy(), off_f.copy()),
            positions, inertia, hold, stiff, damp, joints, elements, points, blows, self.floor,
        )  # fmt: skip
        return system, rest_values, inner, delayed, fastest

    def _tethers(self, work, total):
        """(total, total) N m/rad of the springs between bodies and the world, at rest."""
        chain, out = self.chain, np.zeros((total, total))
        for kind, name, local, stiffness, *_ in self.points:
            if kind == equations.TETHER:
                body = chain.names.index(name) + 1
                at = work[1][body] + work[0][body] @ np.asarray(local, float)
                columns = [
                    jacobian_column(chain.arrays(), work, i, body, *at)
                    for i in range(len(chain.names))
                ]
                jacobian = np.zeros((3, total))
                jacobian[:, : len(columns)] = np.array(columns).T
                out += stiffness * jacobian.T @ jacobian
        return out
