"""Where a map is drawn: points in space, or poses in joint space, in a fixed order."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.core.files import read_columns, regular_file
from picchio.robot.flexible_robot import FlexibleRobot

PLANES = ("xy", "xz", "yz")
_AXES = "xyz"
_MOST_STEPS = 10**6
_MOST_BYTES = 256 << 20


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
    robot: FlexibleRobot,
    name: str = "xz",
    *,
    at: float = 0.0,
    spacing: float | None = None,
    bounds: ArrayLike | None = None,
) -> Grid:
    """The points on a plane through the workspace.

    Args:
        robot: whose reach gives the bounds where none are given.
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
    low, high = reach_box(robot)
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
        raise InputError(f"must be one positive number or {nv}", key="joint-grid", value=counts)
    if max(each) > _MOST_STEPS:
        raise InputError(f"at most {_MOST_STEPS} a joint", key="joint-grid", value=counts)
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
    """Points on a mesh's surface, about `spacing` m apart, with the normals of its faces.

    Each triangle is cut until its sides are no longer than the spacing, and its pieces' middles
    are taken: the same points every time, and each face has at least one.

    Args:
        path: STL, OBJ, PLY or whatever else trimesh reads; coordinates in m, world.
        spacing: m.

    Raises:
        InputError: no file, no mesh, more points than a map may have.
    """
    import trimesh

    if not (math.isfinite(spacing) and spacing > 0.0):
        raise InputError("must be positive", key="spacing", value=spacing)
    file = regular_file(path, limit=_MOST_BYTES)
    try:
        mesh = trimesh.load_mesh(file)
    except Exception as error:  # each format's reader raises what it likes
        raise InputError(f"cannot be read as a mesh: {error}", file=path) from None
    if not len(getattr(mesh, "faces", ())):
        raise InputError("holds no surface", file=path)
    if float(mesh.area) / spacing**2 > _MOST_STEPS:
        raise InputError("too many points on this surface", key="spacing", value=spacing)
    corners = np.asarray(mesh.triangles, dtype=float)
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).max(axis=1)
    middles, normals = [], []
    for triangle, normal, longest in zip(corners, mesh.face_normals, sides, strict=True):
        if not np.linalg.norm(normal) > 0.5:  # a triangle without area has no normal
            continue
        # n^2 equal pieces, by the lattice of their barycentric coordinates.
        n = max(1, math.ceil(longest / spacing))
        i, j = np.mgrid[0:n, 0:n]
        up = i + j < n
        down = i + j < n - 1
        corner = np.stack([i, j], axis=-1)
        share = np.concatenate([corner[up] + 1.0 / 3.0, corner[down] + 2.0 / 3.0]) / n
        first, second = triangle[1] - triangle[0], triangle[2] - triangle[0]
        middles.append(triangle[0] + share[:, :1] * first + share[:, 1:] * second)
        normals.append(np.tile(normal, (len(share), 1)))
    if not middles:
        raise InputError("holds no surface", file=path)
    return Listed("point", np.concatenate(middles), np.concatenate(normals))


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
