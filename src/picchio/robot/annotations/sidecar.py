"""The sidecar `picchio-sidecar/1`: what a URDF does not say, value by value with its source.

The same records validate the `picchio:` annotations of a URDF, so the two can say the same.

```toml
format = "picchio-sidecar/1"
robot = "ur10"               # optional: the example-robot-data arm it belongs to

[joint.elbow_joint]
stiffness = 2.4e5            # N m/rad; N/m for a prismatic joint, which has no shaft
# or, from a strain-wave catalogue (N m/rad, N m); the slope at the gravity torque is used:
# stiffness_curve = { k1 = 1e4, k2 = 2e4, k3 = 3e4, t1 = 10.0, t2 = 40.0 }
damping_ratio = 0.03
source = "..."
estimated = true             # not measured
shaft = { radius = 0.01765, length = 0.0504, shear_modulus = 79.3e9, sn_curve = "..." }
reducer = "RV-80E-121"
rotor_inertia = 1e-4         # kg m^2, on the motor's side
gear_ratio = 121.0
# a spring [N/m] between two points [m] in the joint's frame at position zero; it may also have
# a free_length [m] and a constant force [N]:
balancer = { parent_point = [0, 0, 0.3], child_point = [0.2, 0, 0], stiffness = 9e3 }

[tool]                       # on top of the URDF's own masses
frame = "tool0"
xyz = [0.0, 0.0, 0.1]        # m, from the frame to where the force acts
axis = [0.0, 0.0, 1.0]       # the way the tool points, in the frame
mass = 2.0                   # kg
com = [0.0, 0.0, 0.05]       # m, in the frame
inertia = [0.01, 0, 0, 0.01, 0, 0.01]   # kg m^2 about com: ixx ixy ixz iyy iyz izz

[gun]                        # its body, at the tool point
mass = 1.5                   # kg
recoil_stiffness = 3e4       # N/m, optional: the body then slides along the tool's axis
damping_ratio = 0.1
feed_force = 80.0            # N

[base]
xyz = [0.0, 0.0, 0.0]        # m
rpy = [0.0, 0.0, 0.0]        # rad
gravity = [0.0, 0.0, -9.81]  # m/s^2, world
```
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from picchio.core.errors import InputError
from picchio.core.toml import Finite, NotNegative, Positive, StrictModel, parse_toml

FORMAT = "picchio-sidecar/1"
Vector = tuple[Finite, Finite, Finite]
Tensor = Annotated[tuple[Finite, ...], Field(min_length=6, max_length=6)]
LONGEST_SHAFT = 2.0  # m: no arm has a longer one, a number beyond it is in millimetres
SOFTEST, STIFFEST = 1e-3, 1e12  # N m/rad or N/m: far beyond any drive on either side


def _in_metres(value: float) -> float:
    if value > LONGEST_SHAFT:
        raise ValueError(f"is above {LONGEST_SHAFT:g} m (in metres?)")
    return value


def _in_newtons(value: float) -> float:
    if not SOFTEST <= value <= STIFFEST:
        raise ValueError(
            f"is outside {SOFTEST:g} to {STIFFEST:g} N m/rad (N/m for a prismatic joint)"
        )
    return value


ShaftLength = Annotated[Positive, AfterValidator(_in_metres)]
Stiffness = Annotated[Positive, AfterValidator(_in_newtons)]


class ShaftEntry(StrictModel):
    """A round solid shaft that carries the joint's torque.

    Attributes:
        radius: m, at most 2.
        length: m, at most 2; used to check that k = G Jp / l.
        shear_modulus: Pa, 79.3e9 for steel.
        sn_curve: name of a shipped S-N curve, or a `picchio-sn-curve/1` file.
    """

    radius: ShaftLength
    length: ShaftLength
    shear_modulus: Positive
    sn_curve: str | None = None


class StiffnessCurveEntry(StrictModel):
    """Stiffness of a strain-wave gear by torque, as its catalogue gives it.

    Attributes:
        k1: N m/rad, below the torque t1.
        k2: N m/rad, from t1 to t2.
        k3: N m/rad, above t2.
        t1: N m, first corner.
        t2: N m, second corner; above t1.
    """

    k1: Stiffness
    k2: Stiffness
    k3: Stiffness
    t1: Positive
    t2: Positive

    @model_validator(mode="after")
    def _corners_ascend(self) -> Self:
        if self.t2 <= self.t1:
            raise ValueError(f"t2 must be above t1 = {self.t1:g}, it is {self.t2:g}")
        return self


class BalancerEntry(StrictModel):
    """A spring between two points that carries part of the gravity torque.

    Attributes:
        parent_point: m, on the parent link, in the joint's frame at position zero.
        child_point: m, on the child link, in the joint's frame at position zero.
        stiffness: N/m, of the spring.
        free_length: m, of the unloaded spring.
        force: N, constant pull beside the spring.
    """

    parent_point: Vector
    child_point: Vector
    stiffness: NotNegative = 0.0
    free_length: NotNegative = 0.0
    force: Finite = 0.0


class JointEntry(StrictModel):
    """One joint's drive.

    Attributes:
        stiffness: N m/rad (N/m for a prismatic joint), 1e-3 to 1e12. Without it, or a curve, the
            joint is rigid.
        stiffness_curve: in place of `stiffness`: a strain-wave gear's curve, whose slope at the
            gravity torque is used.
        damping_ratio: 1, modal damping ratio.
        shaft: the part whose fatigue is assessed.
        reducer: a catalogue name, such as "RV-80E-121"; its torque limits are checked.
        rotor_inertia: kg m^2, at the motor, before the gear.
        gear_ratio: 1, motor turns for one turn of the joint.
        balancer: a spring that carries part of the gravity torque.
        source: where the values come from.
        estimated: true if the values were not measured.
    """

    stiffness: Stiffness | None = None
    stiffness_curve: StiffnessCurveEntry | None = None
    damping_ratio: NotNegative | None = None
    shaft: ShaftEntry | None = None
    reducer: str | None = None
    rotor_inertia: NotNegative | None = None
    gear_ratio: Finite | None = None
    balancer: BalancerEntry | None = None
    source: str | None = None
    estimated: bool = False

    @model_validator(mode="after")
    def _one_stiffness(self) -> Self:
        if self.stiffness is not None and self.stiffness_curve is not None:
            raise ValueError("give stiffness or stiffness_curve, not both")
        if self.gear_ratio == 0:
            raise ValueError("gear_ratio must not be zero")
        return self


class ToolEntry(StrictModel):
    """The tool, in addition to the URDF's own masses; all in the tool frame.

    Attributes:
        frame: the URDF frame that carries the tool.
        xyz: m, from the frame's origin to the point where the force acts.
        axis: the way the tool points, of any length.
        mass: kg, of the tool.
        com: m, centre of mass.
        inertia: kg m^2, about the centre of mass: ixx, ixy, ixz, iyy, iyz, izz.
        source: where the values come from.
    """

    frame: str | None = None
    xyz: Vector = (0.0, 0.0, 0.0)
    axis: Vector = (0.0, 0.0, 1.0)
    mass: NotNegative = 0.0
    com: Vector = (0.0, 0.0, 0.0)
    inertia: Tensor = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    source: str | None = None

    @model_validator(mode="after")
    def _axis_has_length(self) -> Self:
        if not any(abs(part) > 1e-9 for part in self.axis):
            raise ValueError("the axis has length zero")
        xx, xy, xz, yy, yz, zz = self.inertia
        principal = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        if principal[0] < -1e-9 * max(abs(principal).max(), 1e-12):
            raise ValueError("the inertia is not positive semidefinite")
        if self.mass == 0 and any(self.inertia):
            raise ValueError("an inertia needs a mass")
        return self


class GunEntry(StrictModel):
    """The percussive tool's body, at the tool point.

    Attributes:
        mass: kg, of the body.
        recoil_stiffness: N/m, of the spring on which the body slides along the tool's axis; without
            it the body is fixed.
        damping_ratio: 1, of the body on its spring.
        feed_force: N, steady force along the direction, where the task gives no preload.
        source: where the values come from.
    """

    mass: NotNegative
    recoil_stiffness: Positive | None = None
    damping_ratio: NotNegative = 0.0
    feed_force: Finite = 0.0
    source: str | None = None

    @model_validator(mode="after")
    def _recoiling_mass(self) -> Self:
        if self.recoil_stiffness is not None and self.mass == 0:
            raise ValueError("a recoil spring needs the gun's mass")
        return self


class BaseEntry(StrictModel):
    """How the robot stands.

    Attributes:
        xyz: m, of the base in the world.
        rpy: rad, roll, pitch and yaw of the base.
        gravity: m/s^2, world.
        source: where the values come from.
    """

    xyz: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)
    gravity: Vector = (0.0, 0.0, -9.81)
    source: str | None = None


class Sidecar(StrictModel):
    """Everything a sidecar may say.

    Attributes:
        robot: the arm of example-robot-data that it belongs to, where the URDF is not beside it.
        description: free text.
        joint: drives, by the URDF's joint names.
        tool: the tool, in addition to the URDF.
        gun: the percussive tool's body.
        base: how the robot stands.
    """

    robot: str | None = None
    description: str | None = None
    joint: dict[str, JointEntry] = Field(default_factory=dict)
    tool: ToolEntry | None = None
    gun: GunEntry | None = None
    base: BaseEntry | None = None


def read_sidecar(path: str | Path) -> Sidecar:
    """Read and check a sidecar.

    Raises:
        InputError: no such file, bad TOML, a misspelt key, a value that cannot be.
    """
    try:
        return parse_toml(path, Sidecar, format=FORMAT)
    except ValueError as error:  # tomllib on an integer of thousands of digits
        raise InputError(f"is not valid TOML: {error}", file=path) from None


def given(entry: StrictModel | None) -> dict[str, Any]:
    """The values that were actually written, not the defaults, in the record's order."""
    if entry is None:
        return {}
    written = entry.model_fields_set  # a set: its own order changes from run to run
    return {name: getattr(entry, name) for name in type(entry).model_fields
            if name in written and getattr(entry, name) is not None}  # fmt: skip
