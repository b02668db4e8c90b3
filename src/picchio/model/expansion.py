"""The robot's dynamics about a pose to second order, in more coordinates than its joints.

A measurement sees more than the linear model: M, J and gravity change with the deflection,
and the base or a bearing may yield where the URDF has it rigid. Here the robot stands on six
further coordinates of its base and two hinges beside every flexible joint, and on two in the
middle of a link that bends; which of them move is for the model to say.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from picchio.core.arrays import FloatArray, IndexArray
from picchio.core.errors import InputError
from picchio.core.recent import Recent
from picchio.model.inertia import pseudo_inertia, ten_numbers
from picchio.model.swept import CROSS, STEP, Inertia, Swept
from picchio.robot.dynamics.rigid_model import unit_inertia
from picchio.robot.flexible_robot import FlexibleRobot

BASE_AXES = ("x", "y", "z", "rx", "ry", "rz")
_KEPT_BENT = 32
_SHORT = 1e-3  # m, a link that has no length to bend over

# Joints whose links bend; the angle, rad, of the first of the two axes about which each does; how
# far its halves' centres of mass are apart, over those of a uniform rod.
Bent = tuple[tuple[str, float, float], ...]


def _widen(
    robot: FlexibleRobot, root: FloatArray, bent: Bent = ()
) -> tuple[Any, dict[int, int], list[str], dict[int, _Far]]:
    """The wide model, where each of the robot's joints is in it, who has hinges, and far halves.

    Args:
        robot: whose flexible revolute joints get hinges, perpendicular to the joint's axis.
        root: (3,) m, where the root link stands; the base turns about it.
        bent: whose links bend: two hinges "bend.<joint>.1" and ".2" each.

    Returns:
        the model; its joint's number by the robot's; the names of the joints with hinges, whose
        joints are "hinge.<joint>.1" and ".2"; what is beyond the middle of a link that bends, by
        the number of its joint. The base's are "base.x" to "base.rz".
    """
    source, model = robot.rigid._model, pin.Model()
    model.gravity = source.gravity
    parent = 0
    kinds = (pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ,
             pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ)  # fmt: skip
    for i, (axis, kind) in enumerate(zip(BASE_AXES, kinds, strict=True)):
        place = pin.SE3(np.eye(3), root if i == 0 else np.zeros(3))
        parent = model.addJoint(parent, kind(), place, f"base.{axis}")
    from_root = pin.SE3(np.eye(3), -root)
    model.appendBodyToJoint(parent, from_root.act(source.inertias[0]), pin.SE3.Identity())
    where, hinges = {0: parent}, []
    bends = {source.getJointId(name): rest for name, *rest in bent}
    far: dict[int, _Far] = {}
    for i in range(1, source.njoints):
        name, place = source.names[i], source.jointPlacements[i]
        if source.parents[i] == 0:
            place = from_root * place
        at = where[source.parents[i]]
        if source.parents[i] in far:
            at, place = far[source.parents[i]].carried(at, place)
        turns, own = _axis(source.joints[i])
        if turns and name in robot.flexible_names:
            hinges.append(name)
            first, second = _perpendicular(own)
            for k, side in enumerate((first, second)):
                joint = pin.JointModelRevoluteUnaligned(side)
                at = model.addJoint(at, joint, place, f"hinge.{name}.{k + 1}")
                place = pin.SE3.Identity()
        kind = pin.JointModelRevoluteUnaligned if turns else pin.JointModelPrismaticUnaligned
        where[i] = model.addJoint(at, kind(own), place, name)
        if i not in bends:
            model.appendBodyToJoint(where[i], source.inertias[i], pin.SE3.Identity())
            continue
        end = link_end(robot, name)
        assert end is not None
        angle, apart = bends[i]
        near, beyond = _halves(source.inertias[i], end, apart)
        model.appendBodyToJoint(where[i], near, pin.SE3.Identity())
        first, second = _perpendicular(end / np.linalg.norm(end))
        cos, sin = np.cos(angle), np.sin(angle)
        at, place = where[i], pin.SE3(np.eye(3), 0.5 * end)
        for k, side in enumerate((cos * first + sin * second, cos * second - sin * first)):
            joint = pin.JointModelRevoluteUnaligned(side)
            at = model.addJoint(at, joint, place, f"bend.{name}.{k + 1}")
            place = pin.SE3.Identity()
        far[i] = _Far(at, end)
        model.appendBodyToJoint(at, beyond, far[i].back)
    return model, where, hinges, far


@dataclass(frozen=True, eq=False)
class _Far:
    """What is beyond the middle of a link that bends.

    Attributes:
        joint: number of its joint in the wide model.
        end: (3,) m, of the link, in the frame of the joint that carries it.
    """

    joint: int
    end: FloatArray

    @property
    def back(self) -> Any:
        """From the frame of the joint that carries the link to that in its middle."""
        return pin.SE3(np.eye(3), -0.5 * self.end)

    def carried(self, joint: int, place: Any) -> tuple[int, Any]:
        """What carries a place on the link, and where: unchanged on the near half.

        Args:
            joint: that carries the near half.
            place: on it.
        """
        if place.translation @ self.end > 0.5 * self.end @ self.end:
            return self.joint, self.back * place
        return joint, place


def link_end(robot: FlexibleRobot, joint: str) -> FloatArray | None:
    """Where the link that a joint carries ends, (3,) m in the joint's frame.

    That is the next joint on the way to the tool, or the tool; None where that is no way off.

    Args:
        robot: the robot.
        joint: its name.
    """
    model = robot.rigid._model
    start, tool = model.getJointId(joint), model.frames[robot.rigid.frame(robot.tool_frame)]
    place, after = tool.placement, tool.parentJoint
    while after not in (0, start):
        place, after = model.jointPlacements[after], model.parents[after]
    end = np.array(place.translation)
    return end if after == start and np.linalg.norm(end) > _SHORT else None


def _halves(whole: Any, end: FloatArray, share: float) -> tuple[Any, Any]:
    """The two halves of a link's inertia, as of a beam along `end` (3,) m, in the link's frame.

    Their centres of mass stand `share` times as far apart as those of the halves of a uniform rod
    with as large a second moment along the link; together they are the whole, whatever it is.
    """
    ten = np.asarray(whole.toDynamicParameters())
    if not ten[0] > 0.0:
        return whole, pin.Inertia.Zero()
    pseudo, along = pseudo_inertia(ten / ten[0]), end / np.linalg.norm(end)
    centre = pseudo[:3, 3]
    spread = pseudo[:3, :3] - np.outer(centre, centre)
    size = along @ spread @ along
    apart = share * np.sqrt(0.75 / size) * spread @ along if size > 0.0 else np.zeros(3)
    halves = []
    for sign in (-1.0, 1.0):
        at = centre + sign * apart
        half = np.ones((4, 4))
        half[:3, :3] = spread - np.outer(apart, apart) + np.outer(at, at)
        half[:3, 3] = half[3, :3] = at
        halves.append(pin.Inertia.FromDynamicParameters(ten_numbers(0.5 * ten[0] * half)))
    return halves[0], halves[1]


def _axis(joint: Any) -> tuple[bool, FloatArray]:
    """Whether a joint of one degree of freedom turns, and its axis in its own frame."""
    column = np.array(joint.createData().S).reshape(6)
    turns = bool(np.abs(column[3:]).max() > 0.5)
    return turns, column[3:] if turns else column[:3]


def _perpendicular(axis: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit vectors that are perpendicular to an axis and to each other."""
    helper = np.eye(3)[int(np.abs(axis).argmin())]
    first = np.cross(axis, helper)
    first /= np.linalg.norm(first)
    return first, np.cross(axis, first)


class WideChain:
    """The robot on further coordinates.

    Args:
        robot: the robot.
        bent: joints whose links bend in the middle.

    Attributes:
        coordinates: their names: the flexible joints first, then "base.x" to "base.rz",
            "hinge.<joint>.1" and ".2" for every flexible revolute joint, and "bend.<joint>.1"
            and ".2" for every link that bends.
    """

    def __init__(self, robot: FlexibleRobot, bent: Bent = ()) -> None:
        self.robot = robot
        self._bending: Recent[WideChain] = Recent(_KEPT_BENT)
        source = robot.rigid._model
        root = np.array(source.frames[robot.rigid.frame(robot.tree.root)].placement.translation)
        self._model, joints, hinges, far = _widen(robot, root, bent)
        # The base's last joint stands where the root link does.
        from_root = pin.SE3(np.eye(3), -root)
        self._frames = {}
        for frame in source.frames:
            if frame.type == pin.FrameType.BODY:
                on = frame.parentJoint
                at = joints[on], frame.placement if on else from_root * frame.placement
                self._frames[frame.name] = far[on].carried(*at) if on in far else at
        self.coordinates = (
            *robot.flexible_names,
            *(f"base.{axis}" for axis in BASE_AXES),
            *(f"hinge.{name}.{i}" for name in hinges for i in (1, 2)),
            *(f"bend.{name}.{i}" for name, *_ in bent for i in (1, 2)),
        )
        # Where the robot's own joints are in the wide model, whose joints have one number each.
        self._own = [self._model.joints[joints[i]].idx_v for i in range(1, source.njoints)]
        # (nv of the wide model, c): which joints a coordinate moves; mimics follow.
        self._columns = np.zeros((self._model.nv, len(self.coordinates)))
        n = len(robot.flexible_names)
        self._columns[self._own, :n] = robot.rigid._follow[:, robot.flexible_index]
        for column, name in enumerate(self.coordinates[n:], start=n):
            joint = self._model.joints[self._model.getJointId(name)]
            self._columns[joint.idx_v, column] = 1.0

    def bending(self, bent: Bent) -> WideChain:
        """The same chain with links that bend.

        Args:
            bent: see `Bent`.
        """
        return self._bending.get(bent, lambda: WideChain(self.robot, bent))

    def _q(self, pose: FloatArray) -> FloatArray:
        rigid, q = self.robot.rigid, np.zeros(self._model.nq)
        q[self._own] = rigid._follow @ pose + rigid._offset
        return q

    def _with(self, what: str) -> Any:
        """The wide model with other inertias: the robot's, or one link's own."""
        if what == "robot":
            return self._model
        joint, placement = self._frame(what)
        own = unit_inertia(self.robot.tree, what, None)
        model = self._model.copy()
        for i in range(model.njoints):
            model.inertias[i] = pin.Inertia.Zero()
        model.inertias[joint] = placement.act(own)
        return model

    def has_frame(self, link: str) -> bool:
        """Whether this is a link, or the point where the tool's force acts."""
        return link in self._frames

    def _frame(self, link: str) -> tuple[int, Any]:
        if link not in self._frames:
            raise InputError("no such link", value=link, choices=self._frames)
        return self._frames[link]

    def inertia(self, pose: FloatArray, what: str = "robot") -> Inertia:
        """Mass matrix and gravity about a pose (nv,), to second order.

        Args:
            pose: (nv,) rad or m.
            what: "robot", or a link's name, for what that link alone adds.

        Raises:
            InputError: no such link.
        """
        model = self._with(what)
        data, q, columns = model.createData(), self._q(pose), self._columns

        def mass(at: FloatArray) -> FloatArray:
            full = np.array(pin.crba(model, data, at)).reshape(model.nv, model.nv)
            return columns.T @ full @ columns

        def gradient(at: FloatArray) -> FloatArray:
            full = np.array(pin.computeGeneralizedGravityDerivatives(model, data, at))
            return columns.T @ full.reshape(model.nv, model.nv) @ columns

        gravity = columns.T @ np.array(pin.computeGeneralizedGravity(model, data, q))
        slope = gradient(q)
        steps = [STEP * column for column in columns.T]
        d_mass = [(mass(q + s) - mass(q - s)) / (2 * STEP) for s in steps]
        d_slope = [(gradient(q + s) - gradient(q - s)) / (2 * STEP) for s in steps]
        here = mass(q)
        if what == "robot":
            gravity, slope = self._balanced(pose, gravity, slope)
        return Inertia(here, np.array(d_mass), gravity, slope, np.array(d_slope))

    def _balanced(
        self, pose: FloatArray, gravity: FloatArray, slope: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """What gravity balancers add, which Pinocchio knows nothing of."""
        robot, n = self.robot, len(self.robot.flexible_names)
        rigid = robot.rigid.gravity_torque(pose)[robot.flexible_index]
        gravity, slope = gravity.copy(), slope.copy()
        gravity[:n] += robot.gravity_torque(pose) - rigid
        own = robot.rigid.gravity_gradient(pose)[np.ix_(robot.flexible_index, robot.flexible_index)]
        slope[:n, :n] += robot.gravity_stiffness(pose) - own
        return gravity, slope

    def swept(self, pose: FloatArray) -> Swept:
        """How whatever its links carry moves about a pose.

        Args:
            pose: (nv,) rad or m.
        """
        carrying = {joint for joint, _ in self._frames.values()}
        return Swept.of(self._model, self._columns, self._q(pose), carrying)

    def place(self, link: str) -> tuple[int, FloatArray, FloatArray]:
        """Where a link's frame is: the number of the joint that carries it, axes and origin there.

        Args:
            link: its name.

        Returns:
            the number, (3, 3) and (3,) m, in the joint's axes.

        Raises:
            InputError: no such link.
        """
        joint, placement = self._frame(link)
        return joint, np.array(placement.rotation), np.array(placement.translation)

    @property
    def order(self) -> IndexArray:
        """(c,) of the coordinates: one that carries another has the smaller number."""
        return np.argmax(self._columns != 0.0, axis=0)

    def placed(self, pose: FloatArray, link: str) -> tuple[FloatArray, FloatArray, FloatArray]:
        """How the origin of a link's frame moves, to first order, and where it is.

        Args:
            pose: (nv,) rad or m.
            link: its name.

        Returns:
            (6, c) m/rad and 1, linear, then angular, world axes; (3,) m, world; (3, 3), the
            frame's axes in the world.

        Raises:
            InputError: no such link.
        """
        joint, placement = self._frame(link)
        model = self._model
        data = model.createData()
        pin.computeJointJacobians(model, data, self._q(pose))
        full = pin.getJointJacobian(model, data, joint, pin.LOCAL_WORLD_ALIGNED)
        jacobian = np.array(full).reshape(6, model.nv) @ self._columns
        lever = data.oMi[joint].rotation @ placement.translation
        jacobian[:3] += CROSS @ lever @ jacobian[3:]
        at = data.oMi[joint] * placement
        return jacobian, np.array(at.translation), np.array(at.rotation)
