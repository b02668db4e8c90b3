"""The robots as the worlds see them, read from the files that ship, by a reader of its own."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.metadata import distribution
from pathlib import Path

import numpy as np
import pinocchio as pin

ROBOTS = Path(__file__).resolve().parents[2] / "robots"

# Newtons that give a few mrad at the most; the shipped example tasks' levels, or near them.
FORCE = {
    "fanuc_like_3dof": 300.0,
    "fanuc_r2000ic": 600.0,
    "ur10": 50.0,
    "kinova_gen3": 30.0,
    "kuka_iiwa14": 60.0,
}


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot with its joints' springs.

    Attributes:
        name: of the shipped folder.
        urdf: the file.
        model: pinocchio's, for placements, axes and inertias.
        tool: frame name.
        joints: the flexible joints' names, in the chain's order.
        curves: for each flexible joint (k1, k2, k3, t1, t2), or (k,).
        damping_ratio: of every mode.
        lower, upper: (n,) of the flexible joints, rad; pi for continuous ones.
        force: N, the usual blow.
    """

    name: str
    urdf: Path
    model: pin.Model
    tool: str
    joints: tuple[str, ...]
    curves: tuple[tuple[float, ...], ...]
    damping_ratio: float
    lower: np.ndarray
    upper: np.ndarray
    force: float

    def springs(self, gravity_torque):
        """(n,) N m/rad at the gravity torque that each joint carries."""
        out = np.empty(len(self.joints))
        for i, (curve, load) in enumerate(zip(self.curves, np.abs(gravity_torque), strict=True)):
            if len(curve) == 1:
                out[i] = curve[0]
            else:
                k1, k2, k3, t1, t2 = curve
                out[i] = k1 if load <= t1 else k2 if load <= t2 else k3
        return out

    def near_a_corner(self, gravity_torque, margin=0.2, least=3.0) -> bool:
        """Whether a joint's load is so near a corner of its curve that a payload may cross it."""
        for curve, load in zip(self.curves, np.abs(gravity_torque), strict=True):
            if any(abs(load - corner) < max(margin * corner, least) for corner in curve[3:]):
                return True
        return False

    def links(self) -> tuple[str, ...]:
        """The URDF links that the flexible joints carry, in order."""
        out = []
        for name in self.joints:
            index = self.model.getJointId(name)
            body = [
                f.name
                for f in self.model.frames
                if f.parentJoint == index
                and f.type == pin.FrameType.BODY
                and np.allclose(f.placement.homogeneous, np.eye(4))
            ]
            out.append(body[0])
        return tuple(out)


@cache
def load(name: str) -> Robot:
    """The shipped robot of this name."""
    folder = ROBOTS / name
    flex = tomllib.loads((folder / "flex.toml").read_text())
    urdf = folder / "robot.urdf"
    if not urdf.is_file():
        share = Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share")))
        urdf = next(share.rglob(f"{flex['robot']}.urdf"))
    model = pin.buildModelFromUrdf(str(urdf))
    joints, curves, lower, upper = [], [], [], []
    ratios = set()
    for index in range(1, model.njoints):
        entry = flex["joint"].get(model.names[index])
        if entry is None:
            continue
        joints.append(model.names[index])
        curve = entry.get("stiffness_curve")
        keys = ("k1", "k2", "k3", "t1", "t2")
        curves.append(tuple(curve[k] for k in keys) if curve else (entry["stiffness"],))
        ratios.add(entry.get("damping_ratio", 0.03))
        joint = model.joints[index]
        at = joint.idx_q
        bounded = joint.nq == 1
        lower.append(max(model.lowerPositionLimit[at], -np.pi) if bounded else -np.pi)
        upper.append(min(model.upperPositionLimit[at], np.pi) if bounded else np.pi)
    if len(ratios) != 1:
        raise ValueError(f"{name}: the worlds take one damping ratio for all modes")
    return Robot(
        name=name,
        urdf=urdf,
        model=model,
        tool=flex["tool"]["frame"],
        joints=tuple(joints),
        curves=tuple(curves),
        damping_ratio=ratios.pop(),
        lower=np.array(lower),
        upper=np.array(upper),
        force=FORCE.get(name, 50.0),
    )
