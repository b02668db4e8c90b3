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
reducer = "RV-80E-121"       # alone, it brings its catalogue's stiffness
# what the drive bears, where no reducer is known [N m]; a reducer and a shaft stand in its place:
strength = { repeated_peak_torque = 1200.0, repeated_peak_torque_spread = 1.7, estimated = true }
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
mass_std = 0.1               # kg, one standard deviation
com = [0.0, 0.0, 0.05]       # m, in the frame
inertia = [0.01, 0, 0, 0.01, 0, 0.01]   # kg m^2 about com: ixx ixy ixz iyy iyz izz

[gun]                        # its body, at the tool point
mass = 1.5                   # kg
recoil_stiffness = 3e4       # N/m, optional: the body then slides along the tool's axis
damping_ratio = 0.1
feed_force = 80.0            # N

[link.forearm_link]          # in place of the URDF's
mass = 4.2                   # kg
com = [0.0, 0.0, 0.12]       # m, in the link's frame
inertia = [0.05, 0, 0, 0.05, 0, 0.01]   # kg m^2 about com, along the link's axes

[links]                      # or: a total, spread over the links by the volume of their shapes
total_mass = 25.0            # kg, base included
shapes = "collision"         # or "visual"

[base]
xyz = [0.0, 0.0, 0.0]        # m
rpy = [0.0, 0.0, 0.0]        # rad
gravity = [0.0, 0.0, -9.81]  # m/s^2, world

[posterior]                  # optional: how values with a spread are correlated
names = ["stiffness.elbow_joint", "mass.tool"]
correlation = [[1.0, -0.3], [-0.3, 1.0]]
```

Every number may have a spread beside it, here and in annotations: `stiffness_spread = 2.0` (a
factor: one standard deviation of the logarithm is ln 2) or `stiffness_std = 1e4` (one standard
deviation, absolute). An `estimated = true` without a spread is a factor of 2.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Self

from pydantic import Field, model_validator

from picchio.core.toml import Finite, Name, NotNegative, StrictModel, parse_toml
from picchio.robot.joint import Balancer, DampingRatio, Shaft, Stiffness, StiffnessCurve, Strength
from picchio.robot.link import LinkEntry, LinkMasses
from picchio.robot.spread import Posterior, Spread, spreads_in, with_spreads
from picchio.robot.tool import Gun, Mounting, Tool

FORMAT = "picchio-sidecar/1"


@with_spreads
class JointEntry(StrictModel):
    """One joint's drive.

    Attributes:
        stiffness: N m/rad (N/m for a prismatic joint), 1e-3 to 1e12. Without it, a curve or a
            reducer, the joint is rigid.
        stiffness_curve: in place of `stiffness`: a strain-wave gear's curve, whose slope at the
            gravity torque is used.
        damping_ratio: 1, modal damping ratio.
        shaft: the part whose fatigue is assessed.
        reducer: a catalogue name, such as "RV-80E-121"; its torque limits are checked, and its
            stiffness is the joint's where none is given.
        strength: what the drive bears, where no reducer is known. A reducer's torques stand in
            place of these, and a shaft's fatigue in place of the drive's.
        rotor_inertia: kg m^2, at the motor, before the gear.
        gear_ratio: 1, motor turns for one turn of the joint.
        balancer: a spring that carries part of the gravity torque.
        source: where the values come from.
        estimated: true if stiffness and damping ratio were not measured: each without a spread
            of its own is then uncertain by a factor of 2.
    """

    stiffness: Stiffness | None = None
    stiffness_curve: StiffnessCurve | None = None
    damping_ratio: DampingRatio | None = None
    shaft: Shaft | None = None
    reducer: Name | None = None
    strength: Strength | None = None
    rotor_inertia: NotNegative | None = None
    gear_ratio: Finite | None = None
    balancer: Balancer | None = None
    source: str | None = None
    estimated: bool = False

    @property
    def flexible(self) -> bool:
        """Whether it gives the joint a spring; a reducer's is in its catalogue."""
        return any(x is not None for x in (self.stiffness, self.stiffness_curve, self.reducer))

    @property
    def implied(self) -> dict[str, Any]:
        """Values that others stand for: a curve's slope at no load is the stiffness.

        A reducer's is in its catalogue; here it counts as 1.
        """
        if self.stiffness_curve is not None:
            return {"stiffness": self.stiffness_curve.k1}
        return {"stiffness": 1.0} if self.reducer and self.stiffness is None else {}

    @model_validator(mode="after")
    def _one_stiffness(self) -> Self:
        if self.stiffness is not None and self.stiffness_curve is not None:
            raise ValueError("give stiffness or stiffness_curve, not both")
        if self.gear_ratio == 0:
            raise ValueError("gear_ratio must not be zero")
        return self


class Sidecar(StrictModel):
    """Everything a sidecar may say.

    Attributes:
        robot: the arm of example-robot-data that it belongs to, where the URDF is not beside it.
        description: free text.
        joint: drives, by the URDF's joint names.
        tool: the tool, in addition to the URDF.
        gun: the percussive tool's body.
        link: masses in place of the URDF's, by its links' names.
        links: a total mass, spread over the links by the volume of their shapes.
        base: how the robot stands.
        posterior: how values with a spread are correlated.
    """

    robot: str | None = None
    description: str | None = None
    joint: dict[str, JointEntry] = Field(default_factory=dict)
    tool: Tool | None = None
    gun: Gun | None = None
    link: dict[str, LinkEntry] = Field(default_factory=dict)
    links: LinkMasses | None = None
    base: Mounting | None = None
    posterior: Posterior | None = None

    @model_validator(mode="after")
    def _known_names(self) -> Self:
        if self.posterior is not None:
            known = [spread.name for spread in spreads_of(self)]
            for name in self.posterior.names:
                if name not in known:
                    raise ValueError(f"[posterior] names {name!r}, which has no spread; those that "
                                     f"have one: {', '.join(known) or 'none'}")  # fmt: skip
        return self


def read_sidecar(path: str | Path) -> Sidecar:
    """Read and check a sidecar.

    Raises:
        InputError: no such file, bad TOML, a misspelt key, a value that cannot be.
    """
    return parse_toml(path, Sidecar, format=FORMAT)


def given(entry: StrictModel | None) -> dict[str, Any]:
    """The values that were actually written, not the defaults, in the record's order."""
    if entry is None:
        return {}
    written = entry.model_fields_set  # a set: its own order changes from run to run
    return {name: getattr(entry, name) for name in type(entry).model_fields
            if name in written and getattr(entry, name) is not None}  # fmt: skip


def spreads_of(content: Sidecar) -> list[Spread]:
    """Every value of a sidecar with a spread, stated or as an estimate.

    Args:
        content: what one file says, before others join it.

    Raises:
        InputError: as `picchio.robot.spread.spreads_in`.
    """
    found: list[Spread] = []
    for table, field in type(content).model_fields.items():
        value = getattr(content, table)
        owners = value if isinstance(value, dict) else {"": value}
        for owner, record in owners.items():
            if isinstance(record, StrictModel) and field.annotation is not None:
                found += spreads_within(record, table, owner, elsewhere=True)
    return found


def spreads_within(
    record: StrictModel,
    table: str,
    owner: str = "",
    path: tuple[str, ...] = (),
    source: str = "",
    elsewhere: bool = False,
) -> list[Spread]:
    """The spreads that a record states, tables within it included.

    Args:
        record: the table.
        table: see `spreads_in`; likewise the rest.
        owner: see `spreads_in`.
        path: see `spreads_in`.
        source: see `spreads_in`.
        elsewhere: see `spreads_in`.

    Raises:
        InputError: as `picchio.robot.spread.spreads_in`.
    """
    values = {**given(record), **getattr(record, "implied", {})}
    guessed = values if values.get("estimated") else ()
    kind = type(record)
    found = list(
        spreads_in(kind, values, guessed, table=table, owner=owner, path=path, source=source,
                   elsewhere=elsewhere)
    )  # fmt: skip
    for key, value in values.items():
        if isinstance(value, StrictModel):
            found += spreads_within(value, table, owner, (*path, key), source, elsewhere)
    return found
