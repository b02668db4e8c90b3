"""The robot's equations of motion at a pose, before and after effects have changed them."""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.model.conditions import Conditions
from picchio.model.expansion import link_end
from picchio.model.geometry import Geometry
from picchio.model.inertia import point_masses
from picchio.model.linear_system import shared_damping
from picchio.model.swept import Motion
from picchio.model.system import Element, ElementKind, VibratingSystem
from picchio.robot.dynamics.rigid_model import Mass
from picchio.robot.flexible_robot import FlexibleRobot

Row = dict[str, float]

# Below this share of its own size a mass matrix has something in it that no mass resists.
_MASSLESS = 1e-9
# What then stands for the unknown own inertia of what yields, relative to all that it carries.
_OWN_INERTIA = 1e-4
# How far apart the point masses stand that make up a body; any size does as well.
_REACH = 0.1  # m


@dataclass
class _Spring:
    """A linear spring and damper of a coordinate, a joint's deflection, or a link's origin."""

    of: str
    stiffness: float
    damping: float
    deflection: bool = False


class Changes:
    """What effects may change: springs, damping, masses, coordinates, nonlinear elements.

    Args:
        robot: the robot.
        springs: stiffness of every flexible joint by name, N m/rad.
        conditions: when and how warm.
        angles: (n,) rad or m, of the flexible joints in this pose.

    Attributes:
        damping_scale: factor on all modal damping ratios.
        mode_scales: factors on the modes' ratios, those of the lowest frequency first; modes beyond
            them keep theirs.
        gravity_scale: factor on gravity's change with the deflection.
        modal_share: whether the stated modal damping is that of the modes with all coordinates
            and springs (1, the convention of linear effects in `docs`), or acts between link
            and motor side alone, as if nothing else moved (0), or in between: where an effect
            lets something else yield, the two differ, and data can tell.
        force_offset: (3,) m, in the tool frame, from where the force is taken to act.
        centres: (3,) m by which links' centres of mass were moved, in the links' frames.
        added_inertias: (coordinate, kg m^2) of inertias that move with a coordinate.
        coordinates: those of the wide chain that move, then those that effects add.
    """

    def __init__(
        self,
        robot: FlexibleRobot,
        springs: dict[str, float],
        conditions: Conditions,
        angles: FloatArray,
    ) -> None:
        self.robot = robot
        self.angles = dict(zip(springs, angles.tolist(), strict=True))
        self.springs = springs
        self.conditions = conditions
        self.damping_scale = 1.0
        self.mode_scales: tuple[float, ...] = ()
        self.gravity_scale = 1.0
        self.modal_share = 1.0
        self.force_offset = np.zeros(3)
        self.coordinates: list[str] = list(robot.flexible_names)
        self._motors: dict[str, str] = {}
        self._bent: dict[str, tuple[float, float]] = {}
        self._masses: dict[tuple[str, tuple[float, ...] | None], float] = {("robot", None): 1.0}
        self._bodies: dict[str, FloatArray] = {}
        self.centres: dict[str, FloatArray] = {}
        self.added_inertias: list[tuple[str, float]] = []
        self._springs: list[_Spring] = []
        self._anchors: list[_Spring] = []
        self._couplings: list[tuple[str, str, float]] = []
        self._hanging: list[tuple[str, list[str], float]] = []
        self._elements: list[tuple[Element, str]] = []
        self._contacts: list[Element] = []

    @property
    def gravity_torque(self) -> dict[str, float]:
        """Torque by which each joint holds the arm against gravity, added masses included, N m."""
        raise NotImplementedError

    def check_joint(self, joint: str) -> str:
        """The name, if it is a flexible joint's.

        Raises:
            InputError: it is none.
        """
        if joint not in self.springs:
            raise InputError("no flexible joint", key="target", value=joint, choices=self.springs)
        return joint

    def add_mass(self, weight: float, link: str, point: tuple[float, ...] | None = None) -> None:
        """Add `weight` times a link's own inertia, or kg at a point (3,) m of it."""
        self._masses[link, point] = self._masses.get((link, point), 0.0) + weight

    def add_body(self, link: str, ten: FloatArray) -> None:
        """Add a body that is fixed in a link, as in `picchio.model.inertia`.

        Args:
            link: its name, or the tool frame's.
            ten: (10,) mass, first moments and inertia in the link's frame.
        """
        self._bodies[link] = self._bodies.get(link, 0.0) + ten

    def add_inertia(self, joint: str, inertia: float) -> None:
        """Add a constant inertia that turns with the link side, kg m^2."""
        self.added_inertias.append((self.check_joint(joint), inertia))

    def add_coordinate(
        self, name: str, stiffness: float, damping: float, inertia: float = 0.0
    ) -> None:
        """Let a coordinate of the wide chain move, or add one of `inertia` kg m^2 of its own."""
        if name not in self.coordinates:
            self.coordinates.append(name)
        self._springs.append(_Spring(name, stiffness, damping))
        if inertia:
            self.added_inertias.append((name, inertia))

    def add_bending(
        self,
        joint: str,
        angle: float,
        apart: float,
        stiffness: tuple[float, float],
        damping: float,
    ) -> None:
        """Let the link that a joint carries bend in its middle.

        Args:
            joint: the joint's name.
            angle: rad, of the first axis about which it bends, across the link.
            apart: how far its halves' centres of mass are, over those of a uniform rod.
            stiffness: N m/rad, about that axis and about the one at right angles to it.
            damping: N m s/rad, about the first; about the other it is in the same ratio.

        Raises:
            InputError: a link without length, or none on the way to the tool.
        """
        if link_end(self.robot, self.check_joint(joint)) is None:
            raise InputError("carries no link that could bend", key="target", value=joint)
        self._bent[joint] = angle, apart
        for i, own in enumerate(stiffness, start=1):
            self.add_coordinate(f"bend.{joint}.{i}", own, damping * own / stiffness[0])

    def add_motor(self, joint: str, inertia: float, stiffness: float, damping: float) -> None:
        """Let the motor side of a joint yield against its servo."""
        self._motors[self.check_joint(joint)] = name = f"motor.{joint}"
        self.add_coordinate(name, stiffness, damping, inertia)

    def add_damper(self, joint: str, damping: float) -> None:
        """Add a viscous damper beside a joint's spring, N m s/rad."""
        self._springs.append(_Spring(self.check_joint(joint), 0.0, damping, deflection=True))

    def add_coupling(self, joint: str, stiffness: float) -> None:
        """Let a joint's deflection load the flexible joint before it, and the other way, N m/rad.

        Args:
            joint: the outer of the two.
            stiffness: off the diagonal.

        Raises:
            InputError: no flexible joint, or the first one.
        """
        names = list(self.springs)
        place = names.index(self.check_joint(joint))
        if place == 0:
            raise InputError("is the first flexible joint: none is before it", key="target",
                             value=joint, choices=names[1:])  # fmt: skip
        self._couplings.append((names[place - 1], joint, stiffness))

    def add_hanging(self, link: str, mass: float, stiffness: float, damping: float) -> None:
        """Hang a mass at a link's origin on a spring, the same in all directions.

        Args:
            link: its name, or the tool frame's.
            mass: kg.
            stiffness: N/m.
            damping: N s/m.
        """
        self.add_mass(mass, link, (0.0, 0.0, 0.0))
        names = [f"hanging.{link}.{axis}" for axis in "xyz"]
        for name in names:
            self.add_coordinate(name, stiffness, damping, mass)
        self._hanging.append((link, names, mass))

    def angle(self, joint: str) -> float:
        """Where a flexible joint stands in this pose, rad or m.

        Args:
            joint: its name.
        """
        return self.angles[self.check_joint(joint)]

    def add_anchor(self, link: str, stiffness: float, damping: float) -> None:
        """Tie a link's origin to the world with a spring (N/m) and damper (N s/m)."""
        self._anchors.append(_Spring(link, stiffness, damping))

    def add_element(self, joint: str, kind: ElementKind, *parameters: float) -> None:
        """Add a nonlinear torque between a joint's link and motor side; see `Element`."""
        self._elements.append((Element(kind, parameters), self.check_joint(joint)))

    def add_contact(self, stiffness: float, damping: float, preload: float) -> None:
        """Add a force between the tool and the workpiece, along the blow, while they touch."""
        self._contacts.append(Element(ElementKind.CONTACT, (stiffness, damping, preload)))

    def deflection(self, joint: str) -> Row:
        """The coordinates that make a joint's deflection: link side minus motor side."""
        row = {self.check_joint(joint): 1.0}
        if joint in self._motors:
            row[self._motors[joint]] = -1.0
        return row

    @property
    def joints_only(self) -> bool:
        """Whether nothing but the joints' own springs, modally damped, carries the arm."""
        return not (
            self._springs
            or self._anchors
            or self._couplings
            or self._elements
            or self._contacts
            or len(self.coordinates) > len(self.springs)
        )

    @property
    def added_masses(self) -> tuple[Mass, ...]:
        """(weight, link, point) of every mass beside the robot's own."""
        return tuple((weight, *of) for of, weight in self._weights().items())[1:]

    def _weights(self) -> dict[tuple[str, tuple[float, ...] | None], float]:
        """Of the robot, of links and of points of them, the bodies made of point masses."""
        found = self._masses.copy()
        for link, ten in self._bodies.items():
            for weight, point in point_masses(ten, _REACH):
                found[link, point] = found.get((link, point), 0.0) + weight
        return found


class Plant(Changes):
    """A robot's equations of motion at a pose.

    Args:
        geometry: the robot's masses and kinematics at the pose.
        gravity_stiffness: whether gravity's change with the deflection counts.
        conditions: when and how warm.
    """

    def __init__(
        self,
        geometry: Geometry,
        gravity_stiffness: bool = True,
        conditions: Conditions | None = None,
    ) -> None:
        names = geometry.robot.flexible_names
        springs = dict(zip(names, geometry.stiffness, strict=True))
        angles = geometry.pose[geometry.robot.flexible_index]
        super().__init__(geometry.robot, springs, conditions or Conditions(), angles)
        self.geometry = geometry
        self.gravity_stiffness = gravity_stiffness

    def copy(self, conditions: Conditions) -> Plant:
        """A plant that can be changed further by itself.

        Args:
            conditions: its own.
        """
        twin = copy.copy(self)
        twin.__dict__.pop("_unloaded", None)
        twin.conditions = conditions
        for name, own in vars(self).items():
            if isinstance(own, list | dict):
                setattr(twin, name, own.copy())
        return twin

    @property
    def gravity_torque(self) -> dict[str, float]:
        """Torque by which each joint holds the arm against gravity, added masses included, N m."""
        held = self.geometry.gravity_torque
        for weight, what, point in self.added_masses:
            held = held + weight * self.geometry.inertia(what, point).gravity[: held.size]
        return dict(zip(self.springs, held, strict=True))

    # What comes of it ------------------------------------------------------------------------

    def build(self, direction: FloatArray) -> VibratingSystem:
        """The equations of motion; what effects do to the plant after the first call is not seen.

        Args:
            direction: (3,) unit vector of the force, world.

        Raises:
            InputError: a mass matrix that is not positive definite, an unknown link.
        """
        unloaded, point = self._unloaded
        force = unloaded.force_jacobian.T @ direction
        change = (direction @ point.gradient[:, :3]).T
        gradient = np.zeros_like(unloaded.mass)
        if change.shape == gradient.shape:
            gradient[:] = change
        else:
            gradient[np.ix_(unloaded.wide, unloaded.wide)] = change
        elements = (*unloaded.elements, *self._contacts)
        rows = [*unloaded.rows, *[force for _ in self._contacts]]
        return replace(
            unloaded,
            force=force,
            force_gradient=gradient,
            elements=elements,
            rows=np.array(rows).reshape(len(elements), force.size),
        )

    @cached_property
    def _unloaded(self) -> tuple[VibratingSystem, Motion]:
        """All that does not depend on the force's direction, and how the force's point moves."""
        geometry = self.geometry.bending(tuple((j, *how) for j, how in self._bent.items()))
        names = self.coordinates
        size = len(names)
        chain = geometry.chain.coordinates
        wide = [i for i, name in enumerate(names) if name in chain]
        taken = [chain.index(names[i]) for i in wide]

        def among_all(values: FloatArray) -> FloatArray:
            """Of the chain's coordinates, as rows and columns of all: nothing on the others."""
            if len(wide) == size:
                return values
            out = np.zeros((size,) * values.ndim)
            out[np.ix_(*[wide] * values.ndim)] = values
            return out

        inertia = geometry.total(self._weights(), tuple(taken))
        mass, gradient = among_all(inertia.mass), among_all(inertia.mass_gradient)
        gravity, curvature = np.zeros((size, size)), np.zeros((size, size, size))
        if self.gravity_stiffness:
            gravity = self.gravity_scale * among_all(inertia.gravity_gradient)
            curvature = self.gravity_scale * among_all(inertia.gravity_curvature)
        for name, value in self.added_inertias:
            mass = mass.copy()
            mass[names.index(name), names.index(name)] += value
        for link, hung, weight in self._hanging:
            mass = mass.copy()
            at = [names.index(name) for name in hung]
            moves = weight * geometry.motion(link).jacobian[:3, taken]
            mass[np.ix_(at, wide)] += moves
            mass[np.ix_(wide, at)] += moves.T
        mass = self._with_own_inertia(mass)

        joints = np.array(list(self.springs.values()))
        deflections = np.eye(len(joints), size)  # the joints' coordinates are the first
        for row_of, joint in zip(deflections, self.springs, strict=True):
            if joint in self._motors:
                row_of[:] = self._vector(self.deflection(joint))
        springs = deflections.T @ (joints[:, None] * deflections)
        stiffness = springs.copy()
        dampers = np.zeros((size, size))
        for spring in self._springs:
            row = self.deflection(spring.of) if spring.deflection else {spring.of: 1.0}
            vector = self._vector(row)
            stiffness += spring.stiffness * np.outer(vector, vector)
            dampers += spring.damping * np.outer(vector, vector)
        for first, second, coupling in self._couplings:
            one, other = (self._vector(self.deflection(j)) for j in (first, second))
            stiffness += coupling * (np.outer(one, other) + np.outer(other, one))
        for anchor in self._anchors:
            jacobian = np.zeros((3, size))
            jacobian[:, wide] = geometry.motion(anchor.of).jacobian[:3, taken]
            stiffness += anchor.stiffness * jacobian.T @ jacobian
            dampers += anchor.damping * jacobian.T @ jacobian
        # Where nothing but the joints' springs holds it, both conventions of damping are one.
        share = self.modal_share if not np.array_equal(stiffness, springs) else 0.0
        ratios = self.damping_scale * geometry.robot.damping_ratio
        damping = dampers + shared_damping(
            mass, stiffness, deflections, joints, ratios, share, self.mode_scales
        )

        robot = geometry.robot
        # The force acts at the tool point; an offset is given in the tool frame.
        motion = geometry.motion(robot.tool_point, tuple(taken))
        if self.force_offset.any():
            turn = motion.rotation.T @ geometry.motion(robot.tool_frame).rotation
            motion = motion.at(turn @ self.force_offset)
        jacobian = np.zeros((3, size))
        jacobian[:, wide] = motion.jacobian[:3]
        rows = [self._vector(self.deflection(joint)) for _, joint in self._elements]
        system = VibratingSystem(
            coordinates=tuple(names),
            mass=mass,
            mass_gradient=gradient,
            damping=damping,
            stiffness=stiffness + 0.5 * (gravity + gravity.T),
            gravity_curvature=curvature,
            force_jacobian=jacobian,
            force=np.zeros(size),
            force_gradient=np.zeros((size, size)),
            deflections=deflections,
            wide=tuple(wide),
            taken=tuple(taken),
            elements=tuple(element for element, _ in self._elements),
            rows=np.array(rows).reshape(len(rows), size),
            geometry=geometry,
        )
        return system, motion

    def _with_own_inertia(self, mass: FloatArray) -> FloatArray:
        """A mass matrix in which what yields has a little inertia of its own, where it needs it.

        Where a base turns about the axis of the first joint, and the URDF gives the base no mass,
        nothing resists their turning against each other: the two springs are in series, and what
        is between them answers far above all else, whatever its small inertia.
        """
        n = len(self.springs)
        size = np.sqrt(np.maximum(mass.diagonal(), 1e-300))
        if len(mass) == n or np.linalg.eigvalsh(mass / np.outer(size, size))[0] > _MASSLESS:
            return mass
        own = np.zeros(len(mass))
        own[n:] = _OWN_INERTIA * mass.diagonal()[n:]
        return np.asarray(mass + np.diag(own))

    def _vector(self, row: Row) -> FloatArray:
        vector = np.zeros(len(self.coordinates))
        for name, value in row.items():
            vector[self.coordinates.index(name)] = value
        return vector
