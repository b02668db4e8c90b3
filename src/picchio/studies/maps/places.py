"""Where a map is drawn: points in space, or poses in joint space, in a fixed order."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from picchio.core.arrays import FloatArray, IndexArray
from picchio.core.errors import InputError
from picchio.core.tables import read_columns
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.loading.load import load_robot
from picchio.robot.loading.objects import RobotLike
from picchio.robot.urdf.shapes import load_parts

PLANES = ("xy", "xz", "yz")
_AXES = "xyz"
_MOST_STEPS = 10**6
# Points on a surface: candidates for one, and the least distance in spacings that makes about one
# point a square of the spacing.
_MOST_ON_SURFACE = 100_000
_CANDIDATES = 32
_CLOSEST = 0.91
_SAME_SIDE = -0.5  # cosine of the angle between the normals
_R2 = (0.7548776662466927, 0.5698402909980532)
_SWEEP = np.array([0.62, 0.47, 0.63])  # no direction that a part is likely to have


@dataclass(frozen=True, eq=False)
class Grid:
    """A regular grid that is never held in memory as a whole: rows are made when asked for.

    Attributes:
        kind: "point" (m, world) or "pose" (rad or m).
        axes: one array a column; the last varies fastest.
    """

    kind: str
    axes: tuple[FloatArray, ...]

    def __len__(self) -> int:
        return math.prod(len(axis) for axis in self.axes)

    def rows(self, first: int, last: int) -> FloatArray:
        """Rows first to last - 1 as (k, columns).

        Args:
            first: index.
            last: index after the last.

        Returns:
            coordinates in m, or joint positions in rad or m.
        """
        index = np.unravel_index(np.arange(first, last), [len(axis) for axis in self.axes])
        return np.stack([axis[i] for axis, i in zip(self.axes, index, strict=True)], axis=1)

    def describe(self) -> dict[str, object]:
        """What makes two grids the same."""
        return {"kind": self.kind, "axes": [axis.tolist() for axis in self.axes]}


@dataclass(frozen=True, eq=False)
class Listed:
    """Points or poses in a list.

    Attributes:
        kind: "point" or "pose".
        values: (k, 3) m, or (k, nv) rad or m.
        normals: (k, 3) or None, of the surface at each point.
    """

    kind: str
    values: FloatArray
    normals: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.values)

    def rows(self, first: int, last: int) -> FloatArray:
        """Rows first to last - 1."""
        return self.values[first:last]

    def describe(self) -> dict[str, object]:
        """What makes two lists the same."""
        normals = None if self.normals is None else self.normals.tolist()
        return {"kind": self.kind, "values": self.values.tolist(), "normals": normals}


Places = Grid | Listed


def plane(
    robot: RobotLike,
    name: str = "xz",
    *,
    at: float = 0.0,
    spacing: float | None = None,
    bounds: ArrayLike | None = None,
) -> Grid:
    """The points on a plane through the workspace.

    Args:
        robot: whose reach gives the bounds where none are given; as `load_robot` takes it.
        name: "xy", "xz" or "yz".
        at: m, where the plane cuts the third axis.
        spacing: m; a fiftieth of the width if not given.
        bounds: (low, high, low, high) in m along the plane's two axes.

    Raises:
        InputError: an unknown plane; position, bounds or spacing that make no grid.
    """
    if name not in PLANES:
        raise InputError("unknown plane", key="plane", value=name, choices=PLANES)
    if not math.isfinite(at):
        raise InputError("must be a finite number", key="at", value=at)
    first, second = (_AXES.index(letter) for letter in name)
    low, high = reach_box(load_robot(robot))
    own = (low[first], high[first], low[second], high[second])
    limits = _limits(own if bounds is None else bounds, 4)
    step = (limits[1] - limits[0]) / 50 if spacing is None else float(spacing)
    axes = [np.array([float(at)])] * 3
    axes[first] = _steps(limits[0], limits[1], step)
    axes[second] = _steps(limits[2], limits[3], step)
    return Grid("point", tuple(axes))


def box(robot: FlexibleRobot, *, spacing: float, bounds: ArrayLike | None = None) -> Grid:
    """Points in a box; bounds are (x low, x high, y low, y high, z low, z high) in m."""
    low, high = reach_box(robot)
    limits = _limits(np.stack([low, high], axis=1).ravel() if bounds is None else bounds, 6)
    return Grid("point", tuple(_steps(limits[2 * k], limits[2 * k + 1], spacing) for k in range(3)))


def _limits(bounds: ArrayLike, count: int) -> FloatArray:
    limits = np.asarray(bounds, dtype=float)
    if limits.shape != (count,) or not np.isfinite(limits).all():
        raise InputError(f"must be {count} numbers in metres", key="bounds", value=bounds)
    return limits


def joint_grid(robot: FlexibleRobot, counts: int | list[int]) -> Grid:
    """Poses on a regular grid over the joints' ranges; continuous joints make one turn.

    Args:
        robot: the robot.
        counts: how many positions each joint takes, one number or one for each joint.
    """
    nv = len(robot.joint_names)
    each = [counts] * nv if isinstance(counts, int) else list(counts)
    if len(each) != nv or min(each) < 1:
        raise InputError(f"must be one positive number or {nv}", key="joint_grid", value=counts)
    if max(each) > _MOST_STEPS:
        raise InputError(f"at most {_MOST_STEPS} a joint", key="joint_grid", value=counts)
    axes = []
    for low, high, count in zip(robot.lower, robot.upper, each, strict=True):
        if not np.isfinite([low, high]).all():
            low, high = -np.pi, np.pi - 2.0 * np.pi / count
        middle = 0.5 * (low + high)
        axes.append(np.linspace(low, high, count) if count > 1 else np.array([middle]))
    return Grid("pose", tuple(axes))


def points_from_csv(path: str | Path) -> Listed:
    """Points from columns `x [m]`, `y [m]`, `z [m]`, and normals from `nx`, `ny`, `nz` if given.

    Raises:
        InputError: a missing column, or a cell that is no finite number, with its line.
    """
    rows = read_columns(path, ("x [m]", "y [m]", "z [m]"), ("nx", "ny", "nz"))
    if not rows:
        raise InputError("holds no point", file=path)
    table = np.array(rows)
    return Listed("point", table[:, :3], table[:, 3:] if table.shape[1] > 3 else None)


def surface(path: str | Path, *, spacing: float) -> Listed:
    """Points spread evenly over a mesh's surface, with the normals of its faces.

    About one point a square of the spacing, each at least `_CLOSEST` of the spacing away from
    every other on the same side of the surface, however the mesh is cut into triangles; the same
    points every time.

    Args:
        path: STL, OBJ, PLY or another mesh that a URDF may name; m, world.
        spacing: m.

    Raises:
        InputError: no file, no mesh, more points than a map may have.
    """
    if not (math.isfinite(spacing) and spacing > 0.0):
        raise InputError("must be positive", key="spacing", value=spacing)
    corners = np.concatenate([np.asarray(part.triangles) for part in load_parts(Path(path))])
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice = np.linalg.norm(cross, axis=1)
    area = 0.5 * float(twice.sum())
    if not (math.isfinite(area) and area > 0.0):
        raise InputError("holds no surface", file=path)
    if area / spacing**2 > _MOST_ON_SURFACE:
        raise InputError(
            f"{area / spacing**2:.3g} points on this surface of {area:.4g} m^2; at most "
            f"{_MOST_ON_SURFACE}",
            file=path,
            key="spacing",
            value=spacing,
        )
    # Candidates in proportion to the area, evenly within each triangle (Roberts' R2 sequence).
    i = np.arange(max(_CANDIDATES * math.ceil(area / spacing**2), 64))
    ends = np.cumsum(twice) / twice.sum()
    face = np.minimum(np.searchsorted(ends, (i + 0.5) / i.size), len(twice) - 1)
    first, second = np.mod(0.5 + np.outer(_R2, i), 1.0)
    beyond = first + second > 1.0
    first, second = np.where(beyond, [1.0 - first, 1.0 - second], [first, second])
    origin, along, across = corners[face].swapaxes(0, 1)
    points = origin + first[:, None] * (along - origin) + second[:, None] * (across - origin)
    normals = cross[face] / twice[face, None]
    kept = _apart(points, normals, _CLOSEST * spacing)
    return Listed("point", points[kept], normals[kept])


def _apart(points: FloatArray, normals: FloatArray, least: float) -> IndexArray:
    """Which of many points to take so that none is nearer than `least` to another, and none fits.

    They are taken as a front sweeps over them, which packs them more evenly than chance. Points
    on opposite sides of a thin sheet do not count as near.
    """
    from scipy.spatial import cKDTree

    tree = cKDTree(points)
    free = np.ones(len(points), dtype=bool)
    kept = []
    for k in np.argsort(points @ _SWEEP, kind="stable"):
        if free[k]:
            near = np.array(tree.query_ball_point(points[k], least))
            free[near[normals[near] @ normals[k] > _SAME_SIDE]] = False
            kept.append(k)
    return np.sort(kept)


def reach_box(robot: FlexibleRobot) -> tuple[FloatArray, FloatArray]:
    """Corners (3,), (3,) in m of a box that holds every point the tool can reach."""
    from picchio.robot.ik.chain import tool_chain

    chain = tool_chain(robot)
    travel = np.where(chain.wraps, 0.0, np.maximum(np.abs(chain.lower), np.abs(chain.upper)))
    radius = chain.reach + float(travel[np.isfinite(travel)].sum())
    return chain.offset[0] - radius, chain.offset[0] + radius


def _steps(low: float, high: float, step: float) -> FloatArray:
    if not (np.isfinite([low, high]).all() and high >= low):
        raise InputError("bounds must ascend", key="bounds", value=[float(low), float(high)])
    if not (math.isfinite(step) and step > 0):
        raise InputError("must be positive", key="spacing", value=float(step))
    if (high - low) / step > _MOST_STEPS:
        raise InputError(
            f"{(high - low) / step:.3g} points along one axis are too many",
            key="spacing",
            value=float(step),
        )
    return low + step * np.arange(int(np.floor((high - low) / step + 1e-9)) + 1)
