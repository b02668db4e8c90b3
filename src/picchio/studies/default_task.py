"""The task where none is given: rivets along three axes at five poses, drawn for the robot.

Only the chain of joints decides, by its own arithmetic: no meshes, no search for a solution. So
the same robot and seed give the same poses on every machine, in a few hundredths of a second.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError, gathered
from picchio.excitation.pulse_train import USUAL_HITS
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.ik.chain import Chain, tool_chain
from picchio.studies.tasks import ASSUMED_BLOWS, FORMAT, Task, blows_of, load_task, task_from_dict

POSES = 5
TaskLike: TypeAlias = Task | str | Path | None
LIFE = 1e6  # rivets, for which the allowable force is given where nobody asks for a life

_DRAWN = 4000
_DECIMALS = 3  # of a pose, rad or m: nothing finer could differ from machine to machine
_MARGIN = 0.05  # of a joint's range, kept from either limit
_REACHED = (0.4, 0.85)  # of the largest distance: neither folded nor stretched
_APART = 0.3  # two places of the arm's axis lines, over the way along it between them
_NEAR = 0.15  # of the reach; places nearer along the arm than this are one part
_HEIGHT = 0.05  # of the reach, the tool's above the plane that the robot stands on
_AHEAD, _ASIDE = 0.25, 1.5  # in front: so much of the reach ahead, at most so many times it aside
_SINGULAR = 0.3  # the share of the poses drawn that are nearest to a singular one
_STANDING = 2  # so many of the first wishes are of how an arm can stand at all
_FEW = 25  # poses that a wish must leave, or it is given up
_SPREAD, _CLOSER = 0.5, 0.8  # of the reach, between two poses' tool points; then less and less


def default_task(robot: FlexibleRobot, *, seed: int = 0) -> Task:
    """What a robot does where nobody said: 12 blows a rivet along three axes at five poses.

    Blows of 300 N, 4 ms wide, one every 40 ms, whatever the robot: what it carries says nothing of
    the gun. The poses are drawn within the limits and kept where a robot works, as far as its
    joints alone tell: in front of it and above the plane it stands on, neither stretched nor
    folded, away from singular poses, no part near another, the tool pointing away, spread out. A
    wish that this robot's joints leave few poses for is given up. Joints that do not move the tool
    are at zero.

    Args:
        robot: it may be rigid.
        seed: of the poses.

    Returns:
        the task; its note says what it is.

    Raises:
        InputError: no joint moves the tool.
    """
    return replace(
        task_from_dict(default_task_content(robot, seed=seed), robot),
        note=f"No task was given: along x, y and z at {POSES} poses drawn with seed {seed}, with "
        "blows that are assumed (--force, --period, --width and --hits change them; picchio start "
        "writes the task as a file)",
    )


def task_of(
    robot: FlexibleRobot,
    task: TaskLike = None,
    *,
    force: float | None = None,
    period: float | None = None,
    width: float | None = None,
    hits: int | None = None,
) -> Task:
    """The task that was given, else the robot's example, else `default_task`.

    Args:
        robot: that does it.
        task: one, or its file.
        force: N, peak of one blow, in place of the example's or the default task's.
        period: s, from one blow to the next, likewise.
        width: s, of one blow, likewise.
        hits: blows a rivet takes, likewise.

    Returns:
        the task.

    Raises:
        InputError: as `load_task`, `default_task` and `blows_of`; blows beside a task.
    """
    numbers = {"force": force, "period": period, "width": width, "hits": hits}
    changed = {key: value for key, value in numbers.items() if value is not None}
    if changed and task is not None:
        key, value = next(iter(changed.items()))
        raise InputError("belongs to an answer without a task: the task has its own blows",
                         key=key, value=value)  # fmt: skip
    if isinstance(task, Task):
        return task
    path = task or robot.task_path
    work = default_task(robot) if path is None else load_task(path, robot)
    own: dict[str, Any] = {} if hits is None else {"hits_per_rivet": hits}
    if changed.keys() - {"hits"}:
        with gathered():  # the task's note says what is assumed
            own["excitation"] = blows_of(robot, force=force, period=period, width=width)
    operations = tuple(replace(one, **own) for one in work.operations)
    return replace(work, operations=operations, assumed=task is None)


def default_task_content(robot: FlexibleRobot, *, seed: int = 0) -> dict[str, Any]:
    """`default_task` as a file `picchio-task/1` has it.

    Args:
        robot: see `default_task`.
        seed: of the poses.

    Returns:
        keys and values of the file.

    Raises:
        InputError: as `default_task`.
    """
    poses = [_written(robot, pose) for pose in default_poses(robot, seed=seed)]
    return {
        "format": FORMAT,
        "hits_per_rivet": USUAL_HITS,
        "excitation": ASSUMED_BLOWS.given(),
        "operation": [
            {"name": f"along {'xyz'[k]}", "direction": np.eye(3)[k].tolist(), "poses": poses}
            for k in range(3)
        ],
    }


def default_poses(robot: FlexibleRobot, *, seed: int = 0) -> FloatArray:
    """The five poses (5, nv) of `default_task`, rad or m, to three decimals.

    Args:
        robot: see `default_task`.
        seed: of the draw.

    Returns:
        the poses, in the order in which they were drawn.

    Raises:
        InputError: no joint moves the tool.
    """
    drawn, order = _kept(robot, seed, None)
    return drawn.whole(robot, order[_spread_out(drawn.tool[order] / drawn.reach)])


def possible_poses(robot: FlexibleRobot, count: int, *, seed: int = 0) -> FloatArray:
    """Poses in which an arm can stand, as far as its joints alone tell.

    Drawn within the limits; no part of the arm near another, and none below the plane that it
    stands on, unless that leaves few. Unlike `default_poses` stretched and folded ones, too.

    Args:
        robot: see `default_task`.
        count: how many, at most 4000.
        seed: of the draw.

    Returns:
        (m, nv) rad or m, to three decimals; fewer than `count` where there are no more.

    Raises:
        InputError: no joint moves the tool.
    """
    drawn, order = _kept(robot, seed, _STANDING)
    return drawn.whole(robot, order[:count])


def _kept(robot: FlexibleRobot, seed: int, wishes: int | None) -> tuple[_Drawn, NDArray[np.intp]]:
    """Poses drawn, and which of them are as the first so many wishes (all: None) would have it."""
    chain = tool_chain(robot)
    if not len(chain.index):
        raise InputError("no joint moves the tool", key="tool", value=robot.tool_frame)
    drawn = _Drawn(chain, _draws(chain, seed), pin.rpy.rpyToMatrix(*robot.mounting.rpy))
    kept = np.ones(_DRAWN, dtype=bool)
    for wish in islice(drawn.wishes(), wishes):
        if (kept & wish).sum() >= _FEW:
            kept &= wish
    return drawn, np.flatnonzero(kept)


def _draws(chain: Chain, seed: int) -> FloatArray:
    """Positions (n, k) of the chain's coordinates, uniform within their limits and half a turn."""
    half = np.where(chain.wraps, np.pi, 1.0)
    lower, upper = chain.lower, chain.upper
    within = (lower < half) & (upper > -half)  # limits that lie a turn away stand as they are
    low = np.where(np.isfinite(lower), lower, np.minimum(-half, upper - 2.0 * half))
    high = np.where(np.isfinite(upper), upper, np.maximum(half, low + 2.0 * half))
    turns = chain.wraps & within
    low, high = (
        np.where(turns, np.maximum(low, -half), low),
        np.where(turns, np.minimum(high, half), high),
    )
    margin = _MARGIN * (high - low)
    low, high = low + margin, high - margin
    u = np.random.default_rng(seed).random((_DRAWN, len(chain.index)))
    drawn: FloatArray = (low + (high - low) * u).round(_DECIMALS) + 0.0
    return drawn


def _spread_out(tool: FloatArray) -> NDArray[np.intp]:
    """Which of n points (n, 3) to take: in their order, those that stand apart."""
    distance = _SPREAD
    while True:
        taken: list[int] = []
        for k, point in enumerate(tool):
            if all(np.linalg.norm(point - tool[m]) >= distance for m in taken):
                taken.append(k)
                if len(taken) == POSES:
                    return np.array(taken)
        distance = 0.0 if distance < 1e-3 else _CLOSER * distance


@dataclass(eq=False)
class _Drawn:
    """What the chain of joints tells of n poses.

    Args:
        chain: m joints, k coordinates.
        q: (n, k) rad or m.
        base: (3, 3), the robot's own axes in the world.
    """

    chain: Chain
    q: FloatArray
    base: FloatArray

    def __post_init__(self) -> None:
        """Forward kinematics: each joint's origin and axis, and the tool's, in the world."""
        chain = self.chain
        at = self.q @ chain.follow.T + chain.shift
        turned, place = np.tile(np.eye(3), (len(at), 1, 1)), np.zeros((len(at), 3))
        origins, axes = [], []
        for k, axis in enumerate(chain.axis):
            place = place + turned @ chain.offset[k]
            turned = turned @ chain.rotation[k]
            origins.append(place)
            axes.append(turned @ axis)
            if chain.slides[k]:
                place = place + at[:, k, None] * axes[-1]
            else:
                turned = turned @ _turn(axis, at[:, k])
        self.tool = place + turned @ chain.offset[-1]
        self.tool_axis = turned @ chain.rotation[-1] @ chain.tool_axis
        self.origins, self.axes = np.stack(origins, axis=1), np.stack(axes, axis=1)
        self.away = self.tool - self.origins[:, 0]
        self.distance = np.linalg.norm(self.away, axis=1)
        self.reach = float(self.distance.max()) or 1.0

    def wishes(self) -> Iterator[NDArray[np.bool_]]:
        """Which poses are as one would have them, (n,) each; what matters most comes first."""
        own = self.away @ self.base
        yield self.apart >= _APART
        height = (np.concatenate([self.origins[:, 1:], self.tool[:, None]], axis=1)
                  - self._foot) @ self.base[:, 2]  # fmt: skip
        yield (height > 0.0).all(axis=1) & (height[:, -1] > _HEIGHT * self.reach)
        share = self.distance / self.reach
        yield (share > _REACHED[0]) & (share < _REACHED[1])
        yield (own[:, 0] > _AHEAD * self.reach) & (np.abs(own[:, 1]) < _ASIDE * own[:, 0])
        yield self.regular > np.quantile(self.regular, _SINGULAR)
        yield (self.tool_axis * self.away).sum(axis=1) > 0.0

    def whole(self, robot: FlexibleRobot, chosen: NDArray[np.intp]) -> FloatArray:
        """Some of the poses, (m, nv): joints that do not move the tool stand at rest."""
        rest = np.clip(np.zeros(len(robot.joint_names)), robot.lower, robot.upper)
        poses = np.tile(rest, (len(chosen), 1))
        poses[:, self.chain.index] = self.q[chosen]
        return poses

    @property
    def _foot(self) -> FloatArray:
        """Where the robot stands."""
        return self.origins[0, 0] - self.chain.offset[0]

    @cached_property
    def apart(self) -> FloatArray:
        """The nearest two places of the arm, (n,), over the way along it between them."""
        line = np.concatenate([self.origins, self.tool[:, None]], axis=1)
        middle = 0.5 * (line[:, 1:] + line[:, :-1])
        places = np.empty((len(line), 2 * line.shape[1] - 1, 3))
        places[:, ::2], places[:, 1::2] = line, middle
        way = np.linalg.norm(np.diff(places, axis=1), axis=2).cumsum(axis=1)
        way = np.concatenate([np.zeros((len(way), 1)), way], axis=1)
        found = np.full(len(line), np.inf)
        for k in range(1, places.shape[1]):
            along = way[:, k, None] - way[:, :k]
            direct = np.linalg.norm(places[:, k, None] - places[:, :k], axis=2)
            ratio = np.where(along > _NEAR * self.reach, direct / np.maximum(along, 1e-9), np.inf)
            found = np.minimum(found, ratio.min(axis=1))
        return found

    @cached_property
    def regular(self) -> FloatArray:
        """How far from singular, (n,): the least singular value of the Jacobian that counts.

        Of all six directions where there are as many joints, else of as many lengths.
        """
        chain = self.chain
        slides = chain.slides[:, None]
        arms = np.where(slides, self.axes, np.cross(self.axes, self.tool[:, None] - self.origins))
        jacobian = arms / self.reach
        if len(chain.index) >= 6:
            jacobian = np.concatenate([jacobian, np.where(slides, 0.0, self.axes)], axis=2)
        jacobian = np.einsum("nmx,mk->nxk", jacobian, chain.follow)
        least: FloatArray = np.linalg.svd(jacobian, compute_uv=False)[:, -1]
        return least


def _turn(axis: FloatArray, angle: FloatArray) -> FloatArray:
    """Rotations (n, 3, 3) about a unit axis, by Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine, versine = np.sin(angle)[:, None, None], 1.0 - np.cos(angle)[:, None, None]
    turned: FloatArray = np.eye(3) + sine * cross + versine * (cross @ cross)
    return turned


def _written(robot: FlexibleRobot, pose: FloatArray) -> list[float] | dict[str, float]:
    """A pose as a file has it: a list where every joint moves the tool, else by joint name."""
    given = robot.joint_names_given
    if len(tool_chain(robot).index) == len(given):
        return [float(pose[robot.joint_names.index(name)]) for name in given]
    return {robot.joint_names[k]: float(pose[k]) for k in tool_chain(robot).index}
