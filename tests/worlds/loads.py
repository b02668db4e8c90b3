"""Static loadings of flexible arms: an independent world for finding joint stiffness from nothing.

The arm stands under gravity, its motors held; a scale pulls, a gauge reads. The loaded pose is the
solution of the nonlinear equilibrium, by Newton's method on Pinocchio's own gravity and Jacobians;
nothing of the package's model of loads is used. All that is never exact is drawn anew: link masses,
joint zeros, the scale's calibration, each pull's direction, where it acts, the gauge's noise, and
now and then a pull that slipped.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from .pinocchio_chain import Chain, with_wrong_masses
from .robots import load as shipped

ROBOTS = {3: "fanuc_like_3dof", 6: "fanuc_r2000ic", 7: "kinova_gen3"}
LOADINGS = {3: 15, 6: 30, 7: 35}
"""At forty seconds each, ten to twenty-three minutes of work."""
DIAL, FACTOR = 1e-5, 4.0  # m, the gauge's stated noise; stiffness is off by up to this factor
SLIPPED = 3e-4  # m, by which a reading is off where the pull slipped


@dataclass(frozen=True, eq=False)
class Loads:
    """A drawn campaign.

    Attributes:
        robot: name of the shipped folder.
        joints: names, in the chain's order.
        nominal, truth: (n,) N m/rad.
        columns: of the record, by header without unit.
        noise: m, the true standard deviation of the gauge.
        slipped: (m,) which rows are outliers.
    """

    robot: str
    joints: tuple[str, ...]
    nominal: np.ndarray
    truth: np.ndarray
    columns: dict[str, np.ndarray]
    noise: float
    slipped: np.ndarray


@dataclass(frozen=True)
class Asked:
    """A loading that somebody planned: what is set, pulled and read, as told.

    Attributes:
        pose: (n,) rad.
        way: (3,) of the pull, unit, world.
        force: N.
        reads: (3,) along which a gauge reads, unit; the three axes if None.
    """

    pose: np.ndarray
    way: np.ndarray
    force: float
    reads: np.ndarray | None


def draw(joints: int, seed: int, *, exact: bool = False, loadings: int | None = None,
         base: float = 0.0, asked: list[Asked] | None = None, robot: str | None = None,
         gauge: bool = False) -> Loads:  # fmt: skip
    """A campaign of an arm with 3, 6 or 7 joints.

    Args:
        joints: how many.
        seed: of everything drawn.
        exact: whether nothing but the stiffness differs from the files.
        loadings: how many; `LOADINGS` if None.
        base: N m/rad about the world's x axis through the root; rigid if 0.
        asked: these loadings in place of drawn ones; all else is drawn alike.
        robot: another one with as many joints.
        gauge: one gauge along each pull, in any case.
    """
    rng = np.random.default_rng((seed, joints))
    own = shipped(robot or ROBOTS[joints])
    off = 0.0 if exact else 1.0
    model = with_wrong_masses(own.model, rng, 0.01 * off)
    nominal = np.array([curve[0] for curve in own.curves])
    truth = nominal * np.exp(rng.uniform(-1.0, 1.0, len(nominal)) * math.log(FACTOR))
    zero = 3.5e-4 * off * rng.standard_normal(len(nominal))  # rad, 0.02 degrees
    scale = 1.0 + 0.01 * off * rng.standard_normal()
    hook = 1e-3 * off * rng.standard_normal(3)
    noise = 0.0 if exact else DIAL * math.exp(rng.uniform(-0.7, 1.1))
    count = len(asked) if asked else loadings or LOADINGS[joints]
    slips = (rng.random() < 0.35) * 0.06 * off
    three = bool(rng.random() < 0.5) and not gauge
    arm = _Arm(model, own.tool, own.joints, truth)
    low, high = np.maximum(own.lower, -2.5), np.minimum(own.upper, 2.5)
    rows: dict[str, list] = {}

    def put(name: str, value: float) -> None:
        rows.setdefault(name, []).append(value)

    slipped = np.zeros(count, bool)
    for row in range(count):
        pose = rng.uniform(0.9 * low + 0.1 * high, 0.1 * low + 0.9 * high)
        way = rng.standard_normal(3)
        way /= np.linalg.norm(way)
        size = own.force * rng.uniform(0.6, 1.4)
        reads = None if three else way
        if asked:
            pose, way, size, reads = (
                asked[row].pose, asked[row].way, asked[row].force, asked[row].reads
            )  # fmt: skip
        pulled = _turned(way, 0.005 * off * rng.standard_normal(3)) * size * scale
        stands = pose + zero + 1e-4 * off * rng.standard_normal(len(pose))
        moved = arm.moved(stands, pulled, hook)
        if base > 0.0:
            place = arm.place(stands).translation
            moved = moved + np.cross([np.cross(place, pulled)[0] / base, 0.0, 0.0], place)
        slipped[row] = rng.random() < slips
        for name, value in zip(own.joints, pose, strict=True):
            put(f"pose.{name}", value)
        for axis, value in zip("xyz", size * way, strict=True):
            put(f"force.{axis}", value)
        slip = SLIPPED * rng.standard_normal(3) * slipped[row]
        read = moved + slip + noise * rng.standard_normal(3)
        if reads is None:
            for axis, value in zip("xyz", read, strict=True):
                put(f"displacement.{own.tool}.{axis}", value)
        else:
            put("dial", float(reads @ read))
            for axis, value in zip("xyz", reads, strict=True):
                put(f"dial_direction.{axis}", value)
    columns = {name: np.array(values) for name, values in rows.items()}
    return Loads(own.name, own.joints, nominal, truth, columns, noise, slipped)


class _Arm(Chain):
    """A chain with springs in its joints."""

    def __init__(self, model, tool, joints, springs) -> None:
        super().__init__(model, tool, joints)
        self.springs = springs

    def load(self, pose, force, hook):
        """Torques (n,) of a force (3,) at a point (3,) of the tool frame."""
        full, lever = self.jacobian(pose), self.place(pose).rotation @ hook
        return (full[:3] + np.cross(full[3:], lever, axis=0)).T @ force

    def moved(self, pose, force, hook):
        """(3,) m, how far the tool's origin moves when the force comes on."""
        held = self.gravity(pose)

        def left(turn):
            at = pose + turn
            return self.springs * turn + self.gravity(at) - held - self.load(at, force, hook)

        turn = np.zeros(len(pose))
        for _ in range(30):
            error = left(turn)
            if np.abs(error / self.springs).max() < 1e-13:
                break
            slope = np.column_stack([
                (left(turn + 1e-6 * unit) - left(turn - 1e-6 * unit)) / 2e-6
                for unit in np.eye(len(pose))
            ])  # fmt: skip
            turn = turn - np.linalg.solve(slope, error)
        else:
            raise RuntimeError("the equilibrium was not found")
        return self.place(pose + turn).translation - self.place(pose).translation


def _turned(way, by):
    return pin.exp3(by) @ way
