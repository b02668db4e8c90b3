"""What yields under a static load: readings as a function of the springs, in closed form.

The motor sides stand still and the links turn by x from where they rest under gravity. With the
force F at a point that moves with the Jacobian J, the equilibrium about the unloaded pose is

    (K + dg/dq - d(J^T F)/dq) x = J^T F,

and a point that is seen moves by J_s x and, to second order, half of x^T (dJ_s/dq) x. Without the
last two terms on the left this is the conservative congruence transformation's compliance J K^-1
J^T (Chen and Kao, IJRR 19 (2000) 835, doi:10.1177/02783640022067201). In a chain of joints dJ/dq is
closed: the coordinate i, which carries j, turns j's column, w_i x v_j.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from picchio.campaign.loadings import Loadings, Reading
from picchio.campaign.tables import Tolerance
from picchio.core.arrays import FloatArray, IndexArray
from picchio.core.errors import InputError
from picchio.diagnosis.stiffness.prior import Spring
from picchio.model.expansion import WideChain
from picchio.robot.dynamics.statics import stiffness_at_torque
from picchio.robot.flexible_robot import FlexibleRobot

_TURN, _SHIFT = 1e-4, 1e-3  # rad and m, of the differences
_ZERO = 0.01  # m or rad: a set's zero may be anything


@dataclass(frozen=True, eq=False)
class Columns:
    """How m loadings push and are seen, by c coordinates.

    Attributes:
        push: (m, 6, c) of the force's point: linear, then angular, world axes.
        sight: (m, s, 6, c) of the s points that are seen, likewise.
    """

    push: FloatArray
    sight: FloatArray

    def take(self, index: Sequence[int]) -> Columns:
        """Those of some coordinates.

        Args:
            index: which.
        """
        return Columns(self.push[..., index], self.sight[..., index])


@dataclass(frozen=True, eq=False)
class Table:
    """The m loadings of one record, ready to be predicted.

    Attributes:
        file: the record's name.
        names: (c,) of the coordinates, the n flexible joints first.
        order: (c,) of two coordinates the one with the smaller number carries the other.
        force: (m, 3) N, world.
        columns: at the poses as told.
        changed: by name of a number that is never exact: the columns with it off by its step.
        step: of every number that is never exact, its standard deviation in such steps.
        unit: of each of them the step, SI.
        own_step: likewise, of what is drawn for each loading anew.
        seen: (r,) of each reading, which point it is of; -1 of a joint's deflection.
        axes: (m, r, 3) along which it reads, world.
        turned: (r,) of each reading, the coordinate that it is the deflection of; -1 of the others.
        values: (m, r) m or rad.
        groups: (r,) the name of what each reading is read with.
        gravity: (m, n, n) N m/rad, dg/dq.
        spring: (m, n) N m/rad or N/m, the nominal stiffness at each loading.
        set: (m,) whose zero a row shares; -1 of its own.
        slack: (m, n) by what share of its play each joint turns under the load.
    """

    file: str
    names: tuple[str, ...]
    order: IndexArray
    force: FloatArray
    columns: Columns
    changed: Mapping[str, Columns]
    step: Mapping[str, float]
    unit: Mapping[str, float]
    own_step: Mapping[str, float]
    seen: IndexArray
    axes: FloatArray
    turned: IndexArray
    values: FloatArray
    groups: tuple[str, ...]
    gravity: FloatArray
    spring: FloatArray
    set: IndexArray
    slack: FloatArray

    def __len__(self) -> int:
        return len(self.values)

    always: ClassVar[tuple[Spring, ...]] = ()
    """Springs that no such table is without."""

    @property
    def zero(self) -> FloatArray:
        """(r,) m or rad, what a zero that nobody knows may be."""
        return np.full(self.values.shape[1], _ZERO)

    @property
    def lever(self) -> float:
        """m, how far from the base the loads act, about: what turning adds over moving."""
        turns = [self.names.index(f"base.{axis}") for axis in ("rx", "ry", "rz")]
        arms = np.linalg.norm(self.columns.push[:, :3][..., turns], axis=(1, 2))
        return float(np.median(arms) / np.sqrt(2.0))

    def ways(self, coordinate: str) -> FloatArray:
        """(m, 3) how the force's point moves with a coordinate.

        Args:
            coordinate: its name.
        """
        return self.columns.push[:, :3, self.names.index(coordinate)]

    def yields(self, active: Sequence[int], stiffness: FloatArray, *,
               gravity: bool = True, known: Yield | None = None) -> Yield:  # fmt: skip
        """See `yields`.

        Args:
            active: (q,) the coordinates that yield, the n joints first.
            stiffness: (m, q) N m/rad or N/m, at each loading.
            gravity: whether gravity's change with the deflection counts.
            known: for springs not far off.

        Returns:
            values and derivatives.
        """
        return yields(self, active, stiffness, gravity=gravity, known=known)

    def play(self, joint: int) -> FloatArray:
        """(m, r) what the readings show of one radian or metre of play in a joint.

        Args:
            joint: its number.
        """
        sight = _sight(self, [joint], self.columns.take([joint]))[..., 0]
        return sight * self.slack[:, joint, None]


@dataclass(frozen=True, eq=False)
class Yield:
    """What springs of given stiffness make of a table's loadings.

    Attributes:
        values: (m, r) m or rad, predicted.
        by_spring: (m, r, q) their derivative by the logarithm of each coordinate's stiffness.
        by_step: name -> (m, r), what one step of a number that is never exact adds.
        own: (m, r, o) what a standard deviation adds of each number drawn for a loading anew.
        torque: (m, q) N m or N, of the load, in each coordinate.
    """

    values: FloatArray
    by_spring: FloatArray
    by_step: Mapping[str, FloatArray]
    own: FloatArray
    torque: FloatArray


def make_table(
    robot: FlexibleRobot, chain: WideChain, loadings: Loadings, tolerance: Tolerance
) -> Table:
    """A record's loadings, with all that a prediction needs at their poses.

    Args:
        robot: flexible.
        chain: of this robot.
        loadings: as read.
        tolerance: how exact poses, forces and places are.

    Raises:
        InputError: a joint or frame that the robot has not.
    """
    size = len(loadings)
    for name in loadings.pose:
        if name not in robot.joint_names:
            raise InputError("the robot has no joint of this name", file=loadings.file,
                             key=f"pose.{name}", value=name,
                             choices=robot.joint_names)  # fmt: skip
    poses = np.array([
        robot.pose({joint: float(x[row]) for joint, x in loadings.pose.items()})
        for row in range(size)
    ])  # fmt: skip
    for reading in loadings.readings:
        if reading.joint is not None and reading.joint not in robot.flexible_names:
            raise InputError("is no flexible joint of the robot", file=loadings.file,
                             key=reading.name, value=reading.joint,
                             choices=robot.flexible_names)  # fmt: skip
        if reading.frame is not None:
            robot.link_of(reading.frame)
    if loadings.force is not None:
        force = loadings.force
    else:
        assert loadings.weight is not None
        down = np.array(robot.mounting.gravity, dtype=float)
        if not np.linalg.norm(down) > 0.0:
            raise InputError("weights need a direction down: the sidecar's gravity is zero",
                             file=loadings.file, key="weight")  # fmt: skip
        force = loadings.weight[:, None] * down / np.linalg.norm(down)

    nothing = np.zeros(3)
    columns = _columns(robot, chain, loadings, poses, nothing, nothing)

    def at(where: FloatArray, push: FloatArray, dial: FloatArray) -> Columns:
        return _columns(robot, chain, loadings, where, push, dial, columns)

    changed, step, unit, own = {}, {}, {}, {}
    for k, joint in enumerate(robot.joint_names):
        if tolerance.pose <= 0.0 and tolerance.pose_repeat <= 0.0:
            break
        name = f"pose.{joint}"
        changed[name] = at(poses + _TURN * np.eye(poses.shape[1])[k], nothing, nothing)
        step[name], unit[name] = tolerance.pose / _TURN, _TURN
        own[name] = tolerance.pose_repeat / _TURN
    for k, axis in enumerate("xyz"):
        name = f"tool_point.{axis}"
        changed[name] = at(poses, _SHIFT * np.eye(3)[k], nothing)
        step[name], unit[name] = tolerance.tool_point / _SHIFT, _SHIFT
        if tolerance.sensor_position > 0.0 and any(r.name == "dial" for r in loadings.readings):
            changed[f"sensor_position.{axis}"] = at(poses, nothing, _SHIFT * np.eye(3)[k])
            name = f"sensor_position.{axis}"
            step[name], unit[name] = tolerance.sensor_position / _SHIFT, _SHIFT
    plain = {f"sensor_angle.{axis}": tolerance.sensor_angle for axis in "xyz"}
    plain |= {key: getattr(tolerance, key) for key in ("static_force", "gravity_stiffness")}
    step |= plain
    unit |= dict.fromkeys(plain, 1.0)
    own["direction"] = tolerance.direction
    n = len(robot.flexible_names)
    gravity = np.array([robot.gravity_torque(pose) for pose in poses])
    load = np.einsum("mrc,mr->mc", columns.push[:, :3, :n], force)
    seen, turned, groups = [], [], []
    for k, reading in enumerate(loadings.readings):
        count = reading.values.shape[1]
        seen += [-1 if reading.joint else k] * count
        turned += [robot.flexible_names.index(reading.joint) if reading.joint else -1] * count
        groups += [reading.name.partition(".")[0]] * count
    rows = loadings.set
    numbers = np.full(size, -1) if rows is None else np.unique(rows, return_inverse=True)[1]
    alone = np.bincount(numbers + 1)[numbers + 1] < 2  # a set of one row has its own zero
    axes = [np.zeros((size, 1, 3)) if r.axes is None else r.axes for r in loadings.readings]
    return Table(
        loadings.file, (*chain.coordinates, *_bends(robot)),
        np.append(chain.order, chain.order.max() + 1 + np.arange(len(_bends(robot)))),
        force, columns, changed,
        step, unit,
        {name: size for name, size in own.items() if size > 0.0},
        np.array(seen), np.concatenate(axes, axis=1), np.array(turned),
        np.concatenate([reading.values for reading in loadings.readings], axis=1), tuple(groups),
        np.array([robot.gravity_stiffness(pose) for pose in poses]),
        # On a curve the slope halfway to the loaded torque stands for the chord.
        stiffness_at_torque(robot.flexible_joints, gravity - 0.5 * load),
        np.where(alone, -1, numbers), _crossed(gravity, load),
    )  # fmt: skip


def _crossed(gravity: FloatArray, load: FloatArray) -> FloatArray:
    """(m, n) the share of its play through which a load (m, n) takes a joint that gravity holds.

    A joint lies against one flank under gravity's torque, and on the other one once the load
    turns the torque; one that gravity does not hold stands in the middle.
    """
    held = np.where(np.abs(gravity) > 1e-3 * np.abs(gravity).max(), np.sign(gravity), 0.0)
    after = np.where(load == 0.0, held, np.sign(gravity - load))
    return 0.5 * (held - after)


class Stand:
    """A robot at one pose: how points of it move with all coordinates.

    Attributes:
        tool: the link that carries it.
        bends: names of the hinges' coordinates, behind the chain's.

    Args:
        robot: flexible.
        chain: of this robot.
        pose: (nv,) rad or m.
        bends: whether the hinges within links are wanted, last.
    """

    def __init__(
        self, robot: FlexibleRobot, chain: WideChain, pose: FloatArray, bends: bool
    ) -> None:
        self.robot, self.chain, self.pose = robot, chain, pose
        self.tool = robot.link_of(robot.tool_frame)
        self._known: dict[str, tuple[FloatArray, FloatArray, FloatArray]] = {}
        self.hinges = self._hinges() if bends else []
        self.bends = _bends(robot) if bends else []

    def place(self, link: str) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Jacobian, position and axes of a link's frame.

        Args:
            link: its name.

        Returns:
            see `WideChain.placed`.
        """
        if link not in self._known:
            self._known[link] = self.chain.placed(self.pose, link)
        return self._known[link]

    def of(self, link: str, shift: FloatArray) -> FloatArray:
        """The Jacobian (6, c) of a point in a link's frame.

        Args:
            link: its name.
            shift: (3,) m.
        """
        jacobian, origin, turn = self.place(link)
        lever = turn @ shift
        body = self.tool if link == self.robot.tool_point else link
        carriers = {joint.name for joint in self.robot.tree.chain(body)}
        bent = np.zeros((6, 2 * len(self.hinges)))
        for k, (joint, middle, across) in enumerate(self.hinges):
            if joint in carriers:
                bent[3:, 2 * k : 2 * k + 2] = across
                arm = origin + lever - middle
                bent[:3, 2 * k : 2 * k + 2] = np.cross(across, arm, axisa=0, axisc=0)
        return np.concatenate([moved(jacobian, lever), bent], axis=1)

    def at_tool(self, point: FloatArray | None, shift: FloatArray) -> FloatArray:
        """The same of a point told in the tool frame, or else where the sidecar has the force.

        Args:
            point: (3,) m; None for that of the sidecar.
            shift: (3,) m, from there.
        """
        if point is None:
            return self.of(self.robot.tool_point, shift)
        return self.of(self.tool, point + shift)

    def _hinges(self) -> list[tuple[str, FloatArray, FloatArray]]:
        """Each joint, its link's middle (3,) m, and the two ways (3, 2) across that link.

        The link reaches to the next of these joints, the last one's to the tool.
        """
        joints = _turning(self.robot)
        ends = [self.place(self.robot.tree.joints[joint].child)[1] for joint in joints]
        ends.append(self.place(self.robot.tool_point)[1])
        found = []
        for joint, near, far in zip(joints, ends[:-1], ends[1:], strict=True):
            length = float(np.linalg.norm(far - near))
            way = (far - near) / length if length > 1e-6 else np.array([0.0, 0.0, 1.0])
            across = np.linalg.svd(way[None])[2][1:].T
            found.append((joint, 0.5 * (near + far), across))
        return found


def _turning(robot: FlexibleRobot) -> list[str]:
    return [joint.name for joint in robot.flexible_joints if joint.kind == "revolute"]


def _bends(robot: FlexibleRobot) -> list[str]:
    """The hinges in the middle of the links that flexible revolute joints carry, two each."""
    return [f"bend.{joint}.{k}" for joint in _turning(robot) for k in (1, 2)]


def _columns(
    robot: FlexibleRobot,
    chain: WideChain,
    loadings: Loadings,
    poses: FloatArray,
    push: FloatArray,
    dial: FloatArray,
    near: Columns | None = None,
) -> Columns:
    """The Jacobians at poses (m, nv), force and dial shifted by (3,) m in the tool frame.

    The hinges within links are as at the poses nearby, where these are given.
    """
    pushed, seen = [], []
    c = len(chain.coordinates)

    def see(stand: Stand, reading: Reading, row: int) -> FloatArray:
        if reading.joint is not None:
            return np.zeros((6, c + 2 * len(stand.hinges)))
        if reading.frame is not None:
            return stand.of(robot.link_of(reading.frame), np.zeros(3))
        return stand.at_tool(None if reading.point is None else reading.point[row], dial)

    for row, pose in enumerate(poses):
        stand = Stand(robot, chain, pose, near is None)
        point = None if loadings.point is None else loadings.point[row]
        pushed.append(stand.at_tool(point, push))
        seen.append([see(stand, reading, row) for reading in loadings.readings])
    found = Columns(np.array(pushed), np.array(seen))
    if near is None:
        return found
    return Columns(
        np.concatenate([found.push, near.push[..., c:]], axis=-1),
        np.concatenate([found.sight, near.sight[..., c:]], axis=-1),
    )


def moved(jacobian: FloatArray, lever: FloatArray) -> FloatArray:
    """The Jacobian (6, c) of another point of the same body.

    Args:
        jacobian: (6, c) linear, then angular, world axes.
        lever: (3,) m, world, to the point.
    """
    found = jacobian.copy()
    found[:3] += np.cross(jacobian[3:], lever, axisa=0, axisc=0)
    return found


def yields(table: Table, active: Sequence[int], stiffness: FloatArray, *,
           gravity: bool = True, known: Yield | None = None) -> Yield:  # fmt: skip
    """What a table's readings are, and how they change, for given springs.

    Args:
        table: the loadings.
        active: (q,) the coordinates that yield, the n joints first.
        stiffness: (m, q) N m/rad or N/m, at each loading.
        gravity: whether gravity's change with the deflection counts.
        known: for springs not far off; what numbers that are never exact add is taken from it.

    Returns:
        values and derivatives.
    """
    base = table.columns.take(active)
    n = table.gravity.shape[1]
    inverse, turn, torque = _equilibrium(table, active, base, stiffness, gravity)
    sight = _sight(table, active, base)
    values = np.einsum("mrq,mq->mr", sight, turn) + _second(table, active, base, turn)
    through = sight @ inverse
    by_spring = -through * (stiffness * turn)[:, None, :]
    if known is not None:
        return replace(known, values=values, by_spring=by_spring, torque=torque)
    by_step: dict[str, FloatArray] = {}
    own: list[FloatArray] = []
    if table.changed:
        other = Columns(
            np.stack([one.push[..., active] for one in table.changed.values()]),
            np.stack([one.sight[..., active] for one in table.changed.values()]),
        )
        _, at, _ = _equilibrium(table, active, other, stiffness, gravity)
        moved_to = np.einsum("...rq,...q->...r", _sight(table, active, other), at)
        moved_to += _second(table, active, other, at) - values
        for name, difference in zip(table.changed, moved_to, strict=True):
            if name in table.step:
                by_step[name] = difference
            if name in table.own_step:
                own.append(table.own_step[name] * difference)
    by_step["static_force"] = np.einsum("mrq,mq->mr", through, torque)
    if gravity:
        pull = np.einsum("mij,mj->mi", table.gravity, turn[:, :n])
        by_step["gravity_stiffness"] = -np.einsum("mrq,mq->mr", through[..., :n], pull)
    moved_by = np.einsum("msdq,mq->msd", base.sight[:, :, :3], turn)
    for k, axis in enumerate("xyz"):
        unit = np.eye(3)[k]
        swung = np.cross(unit, moved_by)[:, table.seen]
        along = np.einsum("mrd,mrd->mr", table.axes, swung) * (table.seen >= 0)
        by_step[f"sensor_angle.{axis}"] = along
        if "direction" in table.own_step:
            aside = np.einsum("mrq,mr->mq", base.push[:, :3], np.cross(unit, table.force))
            own.append(table.own_step["direction"] * np.einsum("mrq,mq->mr", through, aside))
    drawn = np.stack(own, axis=-1) if own else np.zeros((*values.shape, 0))
    return Yield(values, by_spring, by_step, drawn, torque)


def _crossed_with(a: FloatArray, b: FloatArray) -> FloatArray:
    """The cross products of vectors along the last but one axis, which NumPy's takes long for."""
    ax, ay, az = a[..., 0, :], a[..., 1, :], a[..., 2, :]
    bx, by, bz = b[..., 0, :], b[..., 1, :], b[..., 2, :]
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-2)


def _equilibrium(
    table: Table, active: Sequence[int], columns: Columns, stiffness: FloatArray, gravity: bool
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(..., q, q) compliance, (..., q) deflection, (..., q) torque of the load."""
    n = table.gravity.shape[1]
    linear, angular = columns.push[..., :3, :], columns.push[..., 3:, :]
    torque = np.einsum("...rq,...r->...q", linear, table.force)
    # F . (w_i x v_j) = w_i . (v_j x F) of the coordinate i that carries j.
    across = _crossed_with(linear, table.force[:, :, None])
    turned = angular.swapaxes(-1, -2) @ across
    order = table.order[list(active)]
    carries = order[:, None] <= order[None, :]
    matrix = -np.where(carries, turned, turned.swapaxes(-1, -2))
    index = np.arange(len(active))
    matrix[..., index, index] += stiffness
    if gravity:
        matrix[..., :n, :n] += table.gravity
    inverse = np.linalg.inv(matrix)
    return inverse, np.einsum("...ij,...j->...i", inverse, torque), torque


def _sight(table: Table, active: Sequence[int], columns: Columns) -> FloatArray:
    """(..., r, q) what each reading shows of each coordinate."""
    seen = columns.sight[..., table.seen, :3, :]
    found = np.einsum("mrd,...mrdq->...mrq", table.axes, seen)
    for row, coordinate in enumerate(table.turned):
        if coordinate >= 0:
            found[..., row, :] = np.asarray(active) == coordinate
    return found


def _second(table: Table, active: Sequence[int], columns: Columns, turn: FloatArray) -> FloatArray:
    """(..., r) half of x^T (dJ/dq) x of each reading."""
    order = np.argsort(table.order[list(active)], kind="stable")
    each = columns.sight[..., order] * turn[..., None, None, order]
    turns = each[..., 3:, :]
    before = np.cumsum(turns, axis=-1) - 0.5 * turns  # all that carry it, and half of itself
    moves = _crossed_with(before, each[..., :3, :]).sum(axis=-1)
    seen = moves[..., table.seen, :]
    return np.einsum("mrd,...mrd->...mr", table.axes, seen) * (table.seen >= 0)
