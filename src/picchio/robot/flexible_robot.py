"""The robot as every later stage uses it: rigid dynamics at a pose, and springs in its joints."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from picchio.core.errors import InputError
from picchio.core.results import TableResult
from picchio.core.shown import Shown
from picchio.robot.dynamics.pose import check_pose
from picchio.robot.dynamics.rigid_model import RigidModel
from picchio.robot.dynamics.statics import RobotState, balancing, stiffness_at_torque
from picchio.robot.finding import Finding
from picchio.robot.joint import Joint
from picchio.robot.masses.check import check_mass_at
from picchio.robot.spread import Posterior, Spread
from picchio.robot.tool import Gun, Mounting, Tool
from picchio.robot.units import SLIDING
from picchio.robot.urdf.tree import UrdfTree

if TYPE_CHECKING:
    import pandas
    import yourdfpy

Array = NDArray[np.float64]
_MATTERS = 0.05  # of a weight or an inertia: less is within what models are off by
_POSES = 20  # drawn to see whether one joint's weight depends on another
_TURN = 2.0  # rad or m: as far as those go
_BEYOND = 1.0  # m beyond its tool frame, which what an arm holds may reach


class Joints(TableResult, Mapping[str, Joint]):
    """The movable joints of a robot by name, in its order, and as a table.

    Args:
        origins: where each value is from: "joint_1.stiffness" -> "flex.toml: Dumas 2011".
        joints: by name.
    """

    LACKS: ClassVar = {"plot": "it is a list to read", "show": "show the robot"}

    INDEX = "joint"
    UNITS: ClassVar = {
        "stiffness": "N m/rad, N/m",
        "lower": "rad, m",
        "upper": "rad, m",
        "effort_limit": "N m, N",
        "shaft_radius": "m",
    }

    def __init__(self, origins: Mapping[str, str], joints: Mapping[str, Joint]) -> None:
        self._origins, self._joints = origins, joints

    def __getitem__(self, name: str) -> Joint:
        if name in self._joints:
            return self._joints[name]
        raise InputError("no such joint", key="joint", value=name, choices=self._joints)

    def __iter__(self) -> Iterator[str]:
        return iter(self._joints)

    def __len__(self) -> int:
        return len(self._joints)

    def __contains__(self, name: object) -> bool:
        return name in self._joints

    def _headline(self) -> str:
        guess = any(joint.estimated for joint in self.values())
        return ", ".join(self) + ("; some stiffnesses are estimates" if guess else "")

    def _content(self) -> Mapping[str, Any]:
        return {"joints": list(self._rows())}

    def _rows(self) -> Iterator[Mapping[str, Any]]:
        for joint in self.values():
            yield {
                "joint": joint.name,
                "kind": joint.kind,
                "stiffness": joint.stiffness,
                "damping_ratio": joint.damping_ratio,
                "lower": joint.lower,
                "upper": joint.upper,
                "effort_limit": joint.effort_limit,
                "shaft_radius": joint.shaft.radius if joint.shaft else np.nan,
                "reducer": joint.reducer.name if joint.reducer else "",
                "estimated": joint.estimated,
                "stiffness_from": self._origins.get(f"{joint.name}.stiffness", ""),
            }


@dataclass(frozen=True, eq=False, repr=False)
class FlexibleRobot(Shown):
    """A robot with flexible joints; immutable, picklable, safe to share between threads.

    Made by `load_robot`. Poses are (nv,): one number a movable joint, rad or m, in the order
    of `joint_names`; mimicking joints follow and have none.

    Args:
        name: what it is called.
        source: the URDF file.
        task_path: the robot's own example task, or None.
        files: every file that was read.
        tree: the URDF's links and joints.
        tool: what the last frame carries.
        gun: the percussive gun, or None.
        mounting: how the robot stands.
        flexible_joints: the n joints with a stiffness, in tangent order.
        origins: where each value is from: "joint_1.stiffness" -> "flex.toml: Dumas 2011".
        named_poses: poses by name, from the SRDF.
        rigid: the rigid robot's dynamics.
        tool_point: the link at whose origin the force acts.
        effect_tables: of a saved model: how the world departs from the robot's files, as
            `picchio.model.effects.from_dict` reads it.
        fitted_gravity: of a saved model: whether its fit added gravity's stiffness; None: not said.
        warnings: what was warned of while it was loaded.
        findings: what is impossible or doubtful about its own numbers; among the warnings, too.
        spreads: how well values are known, by name such as "stiffness.joint_1".
        posterior: how these are correlated, or None.
        again: makes it once more with other `values` and what it `carries`, as `load_robot` has
            them; None of a robot that was changed since.
    """

    PLOTS: ClassVar = {"robot": "visuals.scene.portrait:plot_standing"}

    name: str
    source: Path
    task_path: Path | None
    files: tuple[Path, ...]
    tree: UrdfTree
    tool: Tool
    gun: Gun | None
    mounting: Mounting
    flexible_joints: tuple[Joint, ...]
    origins: Mapping[str, str]
    named_poses: dict[str, tuple[float, ...]]
    rigid: RigidModel
    tool_point: str
    effect_tables: tuple[Mapping[str, Any], ...] = ()
    fitted_gravity: bool | None = None
    warnings: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()
    spreads: Mapping[str, Spread] = field(default_factory=dict)
    posterior: Posterior | None = None
    again: Callable[..., FlexibleRobot] | None = None
    lower: Array = field(init=False)
    upper: Array = field(init=False)
    stiffness: Array = field(init=False)
    damping_ratio: Array = field(init=False)
    flexible_index: NDArray[np.intp] = field(init=False)

    def __post_init__(self) -> None:
        names = self.rigid.joint_names
        urdf = [self.tree.joints.get(name) for name in names]
        unlimited = float("inf")
        computed: dict[str, Any] = {
            "lower": np.array([joint.lower if joint else -unlimited for joint in urdf]),
            "upper": np.array([joint.upper if joint else unlimited for joint in urdf]),
            "stiffness": np.array([joint.stiffness for joint in self.flexible_joints]),
            "damping_ratio": np.array([joint.damping_ratio for joint in self.flexible_joints]),
            "flexible_index": np.array(
                [names.index(joint.name) for joint in self.flexible_joints], dtype=np.intp
            ),
        }
        for key, value in computed.items():
            value.setflags(write=False)
            object.__setattr__(self, key, value)

    def __repr__(self) -> str:
        return (
            f"FlexibleRobot({self.name!r}, joints={list(self.joint_names)}, "
            f"flexible={list(self.flexible_names)}, tool_frame={self.tool_frame!r})"
        )

    @property
    def joints(self) -> Joints:
        """Every movable joint by name: stiffness (infinite where rigid), limits, drive."""
        known = {joint.name: joint for joint in self.flexible_joints}
        own = self.tree.joints
        return Joints(
            self.origins,
            {
                name: known.get(name)
                or Joint(
                    name,
                    "prismatic" if own[name].type == "prismatic" else "revolute",
                    np.inf,
                    np.nan,
                    effort_limit=own[name].effort,
                    lower=own[name].lower,
                    upper=own[name].upper,
                )
                for name in self.joint_names
            },
        )

    @property
    def urdf(self) -> yourdfpy.URDF:
        """The file as `yourdfpy` has it: links, joints, meshes, collision shapes, a trimesh scene.

        Read anew each time, so that changing it changes no robot.

        Raises:
            InputError: what yourdfpy has no room for, such as a capsule.
        """
        from picchio.robot.urdf.by_yourdfpy import as_yourdfpy

        return as_yourdfpy(self.source)

    def _seen(self) -> Mapping[str, Any]:
        return {"robot": self}

    def to_frame(self) -> pandas.DataFrame:
        """`joints` as a table."""
        return self.joints.to_frame()

    def _repr_html_(self) -> str:
        from picchio.core.html import sheet

        flexible = len(self.flexible_joints)
        head = f"{len(self.joint_names)} joints, {flexible} flexible; tool frame {self.tool_frame}"
        return sheet(self.name, head=head) + self.joints._repr_html_()

    def with_stiffness(
        self, stiffness: Mapping[str, float] | None = None, /, **joints: float
    ) -> FlexibleRobot:
        """The same robot with other stiffnesses, known exactly; everything else stays.

        Args:
            stiffness: N m/rad (N/m of a prismatic joint) by joint; for names that are no words of
                Python.
            **joints: likewise: `robot.with_stiffness(elbow_joint=1e4)`.

        Raises:
            InputError: no such joint, one that cannot be flexible, or a number that cannot be.
        """
        again = self._again()
        new = {name: dict(table) for name, table in (again.keywords["values"] or {}).items()}
        for name, value in {**(stiffness or {}), **joints}.items():
            kept = {k: v for k, v in new.get(name, {}).items() if not k.startswith("stiffness")}
            new[name] = {**kept, "stiffness": value}
        return again(values=new)

    def with_payload(
        self,
        mass: float,
        *,
        com: Sequence[float] = (0.0, 0.0, 0.0),
        inertia: Sequence[float] = (0.0,) * 6,
    ) -> FlexibleRobot:
        """The same robot with something else at its tool frame; everything else stays.

        It takes the place of the mass that the files give the tool; a gun's body stays.

        Args:
            mass: kg, of all that the frame carries.
            com: (3,) m, centre of mass in the tool's frame.
            inertia: (6,) kg m^2, about the centre of mass: ixx, ixy, ixz, iyy, iyz, izz.

        Raises:
            InputError: a number that cannot be.
        """
        carries = {"mass": mass, "com": list(com), "inertia": list(inertia)}
        return self._again()(carries=carries)

    def _again(self) -> Any:
        if self.again is None:
            raise InputError(
                "was changed since it was loaded",
                key="robot",
                value=self.name,
                hint="load it again",
            )
        return self.again

    @property
    def joint_names(self) -> tuple[str, ...]:
        """All movable joints in tangent order, length nv."""
        return self.rigid.joint_names

    @property
    def flexible_names(self) -> tuple[str, ...]:
        """Names of the flexible joints, length n."""
        return tuple(joint.name for joint in self.flexible_joints)

    @property
    def tool_frame(self) -> str:
        """The frame that carries the tool."""
        return self.tool.frame

    def pose(self, values: str | Sequence[float] | Mapping[str, float] | ArrayLike) -> Array:
        """A checked pose (nv,) from a list, from joint names (the rest at zero), or a name.

        Args:
            values: rad or m; by joint name, in the robot's joint order, or a named pose.

        Raises:
            InputError: wrong length, unknown joint or pose name, not a finite number.
        """
        return check_pose(self, values)

    @property
    def joint_names_given(self) -> tuple[str, ...]:
        """The joints that a list of numbers is about: all but the gun's recoil."""
        return tuple(name for name in self.joint_names if name in self.tree.joints)

    def limit_violations(self, pose: ArrayLike) -> list[str]:
        """The names of the joints that stand beyond their limits at this pose.

        Args:
            pose: (nv,) rad or m.
        """
        checked = self.pose(pose)
        # Angles typed in are rounded: a limit of pi must accept 3.1416.
        slack = 1e-4
        beyond = (checked < self.lower - slack) | (checked > self.upper + slack)
        return [name for name, out in zip(self.joint_names, beyond, strict=True) if out]

    def state(self, pose: ArrayLike) -> RobotState:
        """The mass matrix, Jacobian, stiffness, gravity and tool position at a pose.

        Args:
            pose: (nv,) rad or m.

        Raises:
            InputError: as `pose`; a motion that moves no mass there.
        """
        full = self.pose(pose)
        index = self.flexible_index
        point = self.rigid.frame(self.tool_point)
        jacobian = self.rigid.jacobian(full, point)[:3, index]
        position, rotation = self.rigid.placement(full, point)
        torque = self.gravity_torque(full)
        mass = self.rigid.mass_matrix(full)[np.ix_(index, index)]
        check_mass_at(self, full, mass)
        return RobotState(
            pose=full,
            mass_matrix=mass,
            jacobian=jacobian,
            stiffness=stiffness_at_torque(self.flexible_joints, torque),
            gravity_torque=torque,
            tool_position=position,
            tool_rotation=rotation,
        )

    def mass_and_jacobian(self, poses: Array) -> tuple[Array, Array]:
        """Only M (p, n, n) and J (p, 3, n) at many poses.

        Args:
            poses: (p, nv) rad or m, not checked.
        """
        index = self.flexible_index
        point = self.rigid.frame(self.tool_point)
        return self.rigid.mass_and_jacobian(poses, point, index)

    def tool_positions(self, poses: Array) -> Array:
        """Only the points (p, 3) in m, world, where the force acts at many poses.

        Args:
            poses: (p, nv) rad or m, not checked.
        """
        return self.rigid.origins(poses, self.rigid.frame(self.tool_point))

    def tool_position(self, pose: Array) -> Array:
        """Only the point (3,) in m, world, where the force acts.

        Args:
            pose: (nv,) rad or m, not checked.
        """
        return self.rigid.placement(pose, self.rigid.frame(self.tool_point))[0]

    def gravity_torque(self, pose: ArrayLike) -> Array:
        """The torque (n,) that the springs carry at rest, N m (N), without the balancers' part.

        Args:
            pose: (nv,) rad or m.
        """
        full = self.pose(pose)
        index = self.flexible_index
        balanced, _ = balancing(self.flexible_joints, self.tree, full[index])
        return self.rigid.gravity_torque(full)[index] + balanced

    def adds_gravity(self, asked: bool | None, usual: bool) -> bool:
        """Whether gravity's stiffness is added to the springs'.

        Args:
            asked: by the user; None where nothing was.
            usual: of robots of which no fit assumed anything.
        """
        said = self.fitted_gravity if asked is None else asked
        return usual if said is None else said

    def gravity_stiffness(self, pose: ArrayLike) -> Array:
        """The gravity stiffness dg/dq (n, n) of the flexible joints, N m/rad, with balancers.

        Args:
            pose: (nv,) rad or m.
        """
        full = self.pose(pose)
        index = self.flexible_index
        gradient = self.rigid.gravity_gradient(full)[np.ix_(index, index)]
        _, balanced = balancing(self.flexible_joints, self.tree, full[index])
        return gradient + np.diag(balanced)

    def largest_inertia(self, joint: str) -> float:
        """What the whole arm has about a joint when it is stretched out, at the most, kg m^2.

        Args:
            joint: its name; of one that slides nothing is said.
        """
        place = self.tree.joints.get(joint)
        if place is not None and place.units is SLIDING:
            return math.inf
        return self.rigid.total_mass() * (self.rigid.length(self.tool_frame) + _BEYOND) ** 2

    def resting_on(self, unknown: Collection[str]) -> list[str]:
        """Joints whose weight or inertia depends on where some others stand.

        Args:
            unknown: the others.

        Returns:
            their names; empty where the others' places change nothing.
        """
        names, rng = self.joint_names, np.random.default_rng(0)
        apart = [name in unknown for name in names]
        if not any(apart):
            return []
        low, high = np.clip([self.lower, self.upper], -_TURN, _TURN)
        poses = rng.uniform(low, high, (_POSES, len(names)))
        still = np.zeros_like(poses)
        others = np.where(apart, rng.uniform(low, high, poses.shape), poses)
        size = [
            np.stack(
                [
                    self.rigid.inverse_dynamics(q, still, still),
                    np.diagonal([self.rigid.mass_matrix(each) for each in q], 0, 1, 2),
                ]
            )
            for q in (poses, others)
        ]
        change = np.abs(size[1] - size[0]).max(axis=1)
        most = np.abs(size).max(axis=(0, 2))
        # A weight that is next to nothing beside the arm's largest does not matter.
        rests = change > _MATTERS * np.maximum(most, _MATTERS * most.max(axis=1, keepdims=True))
        return [n for n, a, b in zip(names, apart, rests.any(axis=0), strict=True) if b and not a]

    def link_of(self, frame: str) -> str:
        """The link whose frame this is: a link's name, or a joint's for the link it carries.

        Args:
            frame: of the URDF.

        Raises:
            InputError: no such frame.
        """
        if (link := self.tree.link_of(frame)) is not None:
            return link
        raise InputError("no such frame", key="frame", value=frame, choices=self.tree.links)

    def frame_placement(self, pose: ArrayLike, frame: str) -> tuple[Array, Array]:
        """The world position (3,) in m and rotation (3, 3) of a frame.

        Args:
            pose: (nv,) rad or m.
            frame: of the URDF.

        Raises:
            InputError: no such frame; as `pose`.
        """
        return self.rigid.placement(self.pose(pose), self.rigid.frame(self.link_of(frame)))

    def frame_jacobian(self, pose: ArrayLike, frame: str) -> Array:
        """The Jacobian (6, n) of a frame's origin, world axes: linear [m], then angular [1].

        Args:
            pose: (nv,) rad or m.
            frame: of the URDF.

        Raises:
            InputError: no such frame; as `pose`.
        """
        full = self.rigid.jacobian(self.pose(pose), self.rigid.frame(self.link_of(frame)))
        return full[:, self.flexible_index]

    def all_branches(
        self, point: ArrayLike, *, axis: ArrayLike | None = None, seed: int = 0
    ) -> list[Array]:
        """Every branch of poses (nv,) found that puts the tool on a point.

        See `picchio.robot.ik.inverse_kinematics.solve`.

        Args:
            point: (3,) m, world.
            axis: (3,) world, along which the tool shall point; None: any way.
            seed: of the first guesses.
        """
        # Compiled code takes a second to load: only when it is needed.
        from picchio.robot.ik.inverse_kinematics import solve

        return list(solve(self, point, axis=axis, seed=seed).poses)

    def inverse_kinematics(
        self,
        point: ArrayLike,
        *,
        axis: ArrayLike | None = None,
        branch: str | Sequence[str] = "any",
        seed: int = 0,
    ) -> Array:
        """A pose (nv,) that puts the tool on a point: the least bent one of the branch.

        Args:
            point: (3,) m, world.
            axis: (3,) the way the tool shall point, world; None leaves it free, and so does an
                arm of fewer than five joints, which cannot choose.
            branch: "any", "elbow-up", "elbow-down", or words such as "joint_3+" (see
                `picchio.robot.ik.branch`).
            seed: moves the starts of the search.

        Raises:
            InputError: out of reach (with the distance), or not on this branch.
        """
        from picchio.robot.ik.branch import branch_words, choose_branch

        words = branch_words(self, branch)  # a misspelt word need not wait for the search
        return choose_branch(self, self.all_branches(point, axis=axis, seed=seed), words, point)
