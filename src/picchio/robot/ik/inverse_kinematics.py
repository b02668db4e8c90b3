"""Poses that put the tool on a point, its axis along a direction: every branch that is found.

A search from many starts that are spread evenly over the joints' ranges, the same every time.
Where the arm has more joints than the task needs (the roll about the tool's axis is always
free), solutions form curves; each curve is represented by its pose nearest to the middle of
the joints' ranges, and `picchio.robot.ik.self_motion` moves along it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from picchio.core.errors import InputError
from picchio.robot.ik.chain import Chain, tool_chain
from picchio.robot.ik.kernel import STEPS, solve_points

if TYPE_CHECKING:
    from picchio.robot.flexible_robot import FlexibleRobot

Array = NDArray[np.float64]
TOLERANCE = 1e-8
# With fewer joints the direction of the tool follows from the point.
LEAST_JOINTS_FOR_AXIS = 5


@dataclass(frozen=True, eq=False)
class Solutions:
    """Poses of many points.

    Args:
        poses: (s, nv) rad or m, sorted by point and then from the least bent to the most.
        point: (s,) index of the point each pose reaches.
        distance: (p,) m, from each point to the nearest that was reached; zero where solved.
    """

    poses: Array
    point: NDArray[np.intp]
    distance: Array


def solve(
    robot: FlexibleRobot, point: ArrayLike, *, axis: ArrayLike | None = None, seed: int = 0
) -> Solutions:
    """All branches at one point.

    Args:
        robot: the robot.
        point: (3,) m, world.
        axis: (3,) the way the tool shall point, world; any length. Left free if None, and by
            arms of fewer than five joints.
        seed: moves the starts of the search.

    Raises:
        InputError: not three finite numbers; out of reach, with the distance to the nearest
            point that can be reached; the axis cannot be had there.
    """
    target = _three(point, "point")
    solutions = solve_many(
        robot, target[None], axes=None if axis is None else _three(axis, "axis")[None], seed=seed
    )
    if len(solutions.poses):
        return solutions
    free = solutions if axis is None else solve_many(robot, target[None], seed=seed)
    if len(free.poses):
        raise InputError("the point can be reached, but not with the tool pointing this way",
                         key="point", value=target.tolist(),
                         hint=f"axis {np.asarray(axis).tolist()}")  # fmt: skip
    raise InputError(
        f"out of reach: the nearest point that robot {robot.name!r} can reach within its limits "
        f"is {float(free.distance[0]):.4g} m away",
        key="point",
        value=target.tolist(),
    )


def solve_many(
    robot: FlexibleRobot,
    points: ArrayLike,
    *,
    axes: ArrayLike | None = None,
    starts: int | None = None,
    seed: int = 0,
    scattered: bool = False,
) -> Solutions:
    """All branches at many points, in compiled code.

    Args:
        robot: the robot.
        points: (p, 3) m, world.
        axes: (p, 3) or (3,), or None to leave the tool's direction free.
        starts: how many first guesses a point gets; more find more branches. By default 64
            for up to three joints and 256 for more.
        seed: moves them.
        scattered: leave a redundant arm's solutions where the search found them, scattered
            along the self-motion, instead of moving them to the middle of the ranges.

    Raises:
        InputError: wrong shapes, not finite numbers, or no joint moves the tool.
    """
    targets = _rows(points, "points")
    chain = tool_chain(robot)
    joints = len(chain.index)
    if joints == 0:
        raise InputError("no joint moves the tool frame", key="tool", value=robot.tool_frame)
    with_axis = axes is not None and joints >= LEAST_JOINTS_FOR_AXIS
    wanted = np.zeros_like(targets)
    if axes is not None:
        wanted = _rows(axes, "axes", len(targets))
        wanted = wanted / np.linalg.norm(wanted, axis=1, keepdims=True)
    weight = max(0.3 * chain.reach, 1e-3) if with_axis else 0.0
    redundant = joints > (5 if with_axis else 3)
    lower, upper, centre = start_ranges(chain)
    guesses = _spread(starts or (64 if joints <= 3 else 256), lower, upper, seed)
    found = np.empty((len(targets), len(guesses), joints))
    errors = np.empty((len(targets), len(guesses)))
    solve_points(
        chain.tables, guesses, centre, chain.wraps, chain.lower, chain.upper, targets,
        wanted, weight, redundant and not scattered, STEPS, found, errors,
    )  # fmt: skip
    return _collect(robot, chain, centre, found, errors, 1e-2 if redundant else 1e-5)


def _collect(
    robot: FlexibleRobot, chain: Chain, centre: Array, found: Array, errors: Array, same: float
) -> Solutions:
    poses: list[Array] = []
    owner: list[int] = []
    rest = np.clip(0.0, robot.lower, robot.upper)
    for row in range(len(found)):
        good = errors[row] < TOLERANCE
        for q in _distinct(chain, centre, found[row][good], same):
            pose = rest.copy()
            pose[chain.index] = np.where(np.abs(q) < 1e-14, 0.0, q)
            poses.append(pose)
            owner.append(row)
    stacked = np.array(poses).reshape(-1, robot.rigid.nv)
    distance = np.where((errors < TOLERANCE).any(axis=1), 0.0, errors.min(axis=1))
    return Solutions(stacked, np.array(owner, dtype=np.intp), distance)


def _distinct(chain: Chain, centre: Array, candidates: Array, same: float) -> list[Array]:
    """Different poses, a full turn of a joint counting as none, the least bent first."""
    turn = 2.0 * np.pi

    def order(q: Array) -> tuple[float, list[float]]:
        # Rounded: the order must not hang on the last bit.
        return round(float(np.abs(q - centre).max()), 4), np.round(q, 4).tolist()

    def apart(q: Array, other: Array) -> float:
        gap = np.abs(q - other)
        return float(np.where(chain.wraps, np.minimum(gap, np.abs(turn - gap)), gap).max())

    kept: list[Array] = []
    for q in sorted(candidates, key=order):
        if all(apart(q, other) >= same for other in kept):
            kept.append(q)
    return kept


def start_ranges(chain: Chain) -> tuple[Array, Array, Array]:
    """Where starts are spread, at most one turn of each joint, unlimited ones about zero.

    Args:
        chain: the arm.

    Returns:
        lower and upper ends and the middle, each (k,) rad or m.
    """
    half = np.where(chain.wraps, np.pi, 1.0)
    bounded = np.isfinite(chain.lower) & np.isfinite(chain.upper)
    safe_lower = np.where(np.isfinite(chain.lower), chain.lower, 0.0)
    safe_upper = np.where(np.isfinite(chain.upper), chain.upper, 0.0)
    centre = np.where(bounded, 0.5 * (safe_lower + safe_upper), 0.0)
    centre = np.clip(centre, chain.lower, chain.upper)
    # More than a turn about the middle only repeats poses.
    lower = np.maximum(chain.lower, centre - half)
    upper = np.minimum(chain.upper, centre + half)
    return lower, upper, centre


def _spread(count: int, lower: Array, upper: Array, seed: int) -> Array:
    """(count, k) evenly spread starts, the middle first."""
    unit = spread_evenly(count, len(lower), seed)[1:]
    return np.vstack([0.5 * (lower + upper), lower + unit * (upper - lower)])


def spread_evenly(count: int, dims: int, seed: int = 0) -> Array:
    """Points that fill the unit box evenly, the same every time, the middle first.

    The additive recurrence of generalised golden ratios: M. Roberts, "The unreasonable
    effectiveness of quasirandom sequences" (2018).

    Args:
        count: how many.
        dims: of the box.
        seed: another seed continues where this one ends.

    Returns:
        (count, dims).
    """
    ratio = 2.0
    for _ in range(60):
        ratio = (1.0 + ratio) ** (1.0 / (dims + 1))
    steps = ratio ** -np.arange(1.0, dims + 1.0)
    return np.asarray((0.5 + np.outer(np.arange(count) + seed * count, steps)) % 1.0)


def _three(values: ArrayLike, key: str) -> Array:
    return _rows(np.asarray(values, dtype=object)[None], key)[0]


def _rows(values: ArrayLike, key: str, count: int | None = None) -> Array:
    try:
        rows = np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise InputError("must be numbers", key=key, value=values) from None
    if count is not None and rows.ndim == 1:
        rows = np.broadcast_to(rows, (count, *rows.shape))
    if rows.ndim != 2 or rows.shape[1] != 3 or (count is not None and len(rows) != count):
        raise InputError("must be three numbers (m, world)", key=key, value=rows.shape)
    if not np.isfinite(rows).all():
        raise InputError("must be finite", key=key, value=rows.tolist())
    if key in ("axis", "axes") and (np.linalg.norm(rows, axis=1) < 1e-9).any():
        raise InputError("a direction of length zero", key=key, value=rows.tolist())
    return np.ascontiguousarray(rows)
