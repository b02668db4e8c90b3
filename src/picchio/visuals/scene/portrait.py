"""The robot at a pose with its rivets, drawn without a browser: for reports on paper."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from numba import njit
from numpy.typing import ArrayLike

from picchio.core.arrays import FloatArray
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.studies.assessment.result import Assessment
from picchio.visuals.kinematics import frames, world
from picchio.visuals.plots.style import (
    BLUE,
    INK,
    MUTED,
    VERMILION,
    axes_or_new,
    look,
    plain,
    styled,
)
from picchio.visuals.scene.robot.body import build_body
from picchio.visuals.scene.robot.mesh import Mesh, moved, rgb

_PIXELS = 1400  # along the longer side of the picture, before it is halved
_MARGIN = 0.06
_SWING = 0.2  # rad or m, of the joint that moves most in a mode


class View(NamedTuple):
    """An orthographic camera.

    Attributes:
        axes: (3, 3) right, up and towards the eye, in the world.
    """

    axes: FloatArray

    @classmethod
    def of_arm(cls, base: FloatArray, tool: FloatArray) -> View:
        """From the side of the arm, a little from above, as the 3-D scene has it at first.

        Args:
            base: (3,) m, world.
            tool: (3,) m, likewise.
        """
        out = (tool - base)[:2]
        heading = np.arctan2(out[1], out[0]) if np.linalg.norm(out) > 1e-6 else 0.0
        eye = np.array([np.cos(heading - 1.05), np.sin(heading - 1.05), 0.42])
        eye /= np.linalg.norm(eye)
        right = np.cross([0.0, 0.0, 1.0], eye)
        right /= np.linalg.norm(right)
        return cls(np.stack([right, np.cross(eye, right), eye]))

    def seen(self, points: FloatArray) -> FloatArray:
        """Points as the camera has them.

        Args:
            points: (..., 3) m, world.

        Returns:
            (..., 3) m: right, up and nearness.
        """
        return points @ self.axes.T


@styled
def plot_robot(
    robot: FlexibleRobot, pose: ArrayLike, assessment: Assessment, ax: Axes | None = None
) -> Axes:
    """The robot at a pose, the task's rivets, and the way the tool is pushed in each operation.

    Args:
        robot: the robot; its meshes are read.
        pose: (nv,) rad or m.
        assessment: of the task.
        ax: where to draw.

    Returns:
        the Axes, metres to the right and up in the picture.
    """
    axes, view, tool, reach = _drawn_robot(robot, pose, axes_or_new(ax, width=5.0, height=3.6))
    for k, operation in enumerate(assessment.operations):
        at = view.seen(operation.tool_position)
        colour = look(k)["color"]
        axes.scatter(at[:, 0], at[:, 1], s=9, color=colour, zorder=3, label=plain(operation.name))
        along = 0.16 * reach * view.seen(operation.direction)[:2]
        tip = view.seen(tool)[:2] if len(at) == 0 else at[:, :2].mean(axis=0)
        axes.annotate(
            "", xy=(tip[0], tip[1]), xytext=(tip[0] - along[0], tip[1] - along[1]), zorder=4,
            arrowprops={"arrowstyle": "-|>", "color": colour, "linewidth": 1.6},
        )  # fmt: skip
    _finished(axes, view, tool, reach)
    if len(assessment.operations) > 1:
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, markerscale=1.6,
                    labelcolor=INK)  # fmt: skip
    return axes


ArrowKind = Literal["leaves", "comes", "line"]


class Arrow(NamedTuple):
    """An arrow at the tool.

    Attributes:
        direction: (3,) unit, world.
        label: at its end.
        kind: whether it leaves the tool, comes to it, or is a line from it.
        colour: of it.
    """

    direction: FloatArray
    label: str
    kind: ArrowKind
    colour: str


@styled
def plot_pose(
    robot: FlexibleRobot, pose: ArrayLike, arrows: Sequence[Arrow] = (), ax: Axes | None = None
) -> Axes:
    """The robot at a pose, what pulls or hits its tool, and along what an instrument reads.

    Args:
        robot: the robot; its meshes are read.
        pose: (nv,) rad or m.
        arrows: at the tool.
        ax: where to draw.

    Returns:
        the Axes, metres to the right and up in the picture.
    """
    axes, view, tool, reach = _drawn_robot(robot, pose, axes_or_new(ax, width=4.0, height=3.2))
    at = view.seen(tool)[:2]
    ends = []
    for arrow in arrows:
        side = -1.0 if arrow.kind == "comes" else 1.0
        along = side * 0.22 * reach * view.seen(arrow.direction)[:2]
        head = "-" if arrow.kind == "line" else "-|>" if arrow.kind == "leaves" else "<|-"
        axes.annotate(
            "", xy=tuple(at + along), xytext=tuple(at), zorder=6,
            arrowprops={"arrowstyle": head, "color": arrow.colour, "linewidth": 1.8},
        )  # fmt: skip
        far = at + 1.18 * along
        # What comes to the eye has no length: its name stands beside the tool.
        far = far + (0.0 if np.linalg.norm(along) > 0.05 * reach else 0.05 * reach)
        ends += [at + along, far]
        axes.text(
            float(far[0]), float(far[1]), arrow.label, color=arrow.colour, fontsize=9,
            ha="center", va="center", fontweight="bold", zorder=7,
        )  # fmt: skip
    _finished(axes, view, tool, reach, np.array(ends).reshape(-1, 2))
    return axes


def plot_standing(
    robot: FlexibleRobot, ax: Axes | None = None, *, pose: ArrayLike | str | None = None
) -> Axes:
    """The robot at a pose.

    Args:
        robot: the robot; its meshes are read.
        ax: where to draw.
        pose: (nv,) rad or m, or a name; zeros, or what is nearest within the limits, if not given.
    """
    rest = np.clip(np.zeros(len(robot.joint_names)), robot.lower, robot.upper)
    return plot_pose(robot, robot.pose(rest if pose is None else pose), (), ax)


@styled
def plot_mode(
    robot: FlexibleRobot, pose: ArrayLike, shape: FloatArray, ax: Axes | None = None
) -> Axes:
    """The robot at a pose, and its chain swung to either side of it in a mode.

    Args:
        robot: the robot; its meshes are read.
        pose: (nv,) rad or m.
        shape: (nv,) of the joints, the largest by one.
        ax: where to draw.

    Returns:
        the Axes, metres to the right and up in the picture.
    """
    axes, view, tool, reach = _drawn_robot(robot, pose, axes_or_new(ax, width=3.4, height=3.0))
    checked = robot.pose(pose)
    links = [robot.tree.root]
    links += [joint.child for joint in robot.tree.chain(robot.link_of(robot.tool_frame))]
    ends = []
    for side, colour, dashes in (
        (0.0, MUTED, "-"),
        (_SWING, VERMILION, "-"),
        (-_SWING, BLUE, "--"),
    ):
        at = checked + side * shape
        places = world(frames(robot, at))
        points = [places[link][:3, 3] for link in links] + [robot.state(at).tool_position]
        seen = view.seen(np.array(points))
        ends.append(seen[:, :2])
        axes.plot(seen[:, 0], seen[:, 1], color=colour, linestyle=dashes, linewidth=2.0,
                  marker="o", markersize=3.0, zorder=4)  # fmt: skip
    _finished(axes, view, tool, reach, np.concatenate(ends))
    return axes


def _drawn_robot(
    robot: FlexibleRobot, pose: ArrayLike, axes: Axes
) -> tuple[Axes, View, FloatArray, float]:
    """Its picture on axes; the camera, the tool's place (3,) m, and the robot's size, m."""
    checked = robot.pose(pose)
    tree = frames(robot, checked)
    places = world(tree)
    body = build_body(robot, checked, tree, places)
    base, tool = places[tree[0].link][:3, 3], robot.state(checked).tool_position
    view = View.of_arm(base, tool)
    parts = [moved(body.shapes[k], places[link] @ matrix) for link, k, matrix in body.parts]
    image, extent = _picture(parts, view)
    axes.imshow(image, extent=extent, interpolation="antialiased", zorder=1)
    return axes, view, tool, body.reach


def _finished(
    axes: Axes, view: View, tool: FloatArray, reach: float, ends: FloatArray | None = None
) -> None:
    """Mark the tool, and show how long something is in place of axes.

    Args:
        axes: with the robot on them.
        view: the camera.
        tool: (3,) m, world.
        reach: of the robot, m.
        ends: (k, 2) m, of what else must be in the picture: Matplotlib leaves out arrows beyond.
    """
    spot = view.seen(tool)
    axes.plot(spot[0], spot[1], "o", markersize=7, fillstyle="none", color=INK, zorder=5)
    if ends is not None and len(ends):
        axes.plot(ends[:, 0], ends[:, 1], linestyle="none")
    axes.margins(_MARGIN)
    axes.set_aspect("equal")
    axes.grid(False)
    axes.set_axis_off()
    _scale_bar(axes, reach)


def _scale_bar(axes: Axes, reach: float) -> None:
    """How long something round is, as there are no axes."""
    length = 10.0 ** np.floor(np.log10(0.5 * reach))
    right, bottom = axes.get_xlim()[1], axes.get_ylim()[0]
    axes.plot([right - length, right], [bottom, bottom], color=MUTED, linewidth=2.0)
    axes.text(right, bottom, f"\n{length:g} m", color=MUTED, fontsize=8, ha="right", va="center")


def _picture(parts: list[Mesh], view: View) -> tuple[FloatArray, tuple[float, float, float, float]]:
    """Meshes in world coordinates as an image (rows, columns, 4), and where its sides are, m."""
    corners = np.concatenate([view.seen(part.vertices)[part.faces] for part in parts])
    paint = np.concatenate([_paint(part) for part in parts])
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    # Lit from the upper left, both sides of a face alike: exporters disagree on which is outside.
    light = np.array([-0.4, 0.6, 0.7]) / np.linalg.norm([-0.4, 0.6, 0.7])
    paint = paint * (0.45 + 0.55 * np.abs(normal @ light))[:, None]
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    scale = (_PIXELS - 3) / float(max(high[0] - low[0], high[1] - low[1], 1e-9))
    rows, columns = (2 * (int(np.ceil((high[k] - low[k]) * scale)) // 2 + 1) for k in (1, 0))
    placed = np.append((corners[..., :2] - low[:2]) * scale, corners[..., 2:], axis=2)
    drawn = _drawn(placed, paint, 2e-4 * float(np.linalg.norm(high - low)), rows, columns)
    # Four pixels to one: smooth edges.
    alpha = drawn[..., 3:].reshape(rows // 2, 2, columns // 2, 2, 1)
    colour = drawn[..., :3].reshape(rows // 2, 2, columns // 2, 2, 3)
    weight = np.maximum(alpha.sum(axis=(1, 3)), 1.0)
    image = np.concatenate([(colour * alpha).sum(axis=(1, 3)) / weight, alpha.mean(axis=(1, 3))], 2)
    right, top = low[0] + columns / scale, low[1] + rows / scale
    return image[::-1], (float(low[0]), float(right), float(low[1]), float(top))


def _paint(mesh: Mesh) -> FloatArray:
    """(f, 3) 0 to 1: a face's colour."""
    if mesh.colours is None:
        return np.tile(np.asarray(rgb(mesh.colour), dtype=float) / 255.0, (len(mesh.faces), 1))
    return np.asarray(mesh.colours, dtype=float)[mesh.faces].mean(axis=1) / 255.0


@njit(cache=True)
def _drawn(corners, paint, tie, rows, columns):  # type: ignore[no-untyped-def]
    """Triangles (f, 3, 3), in pixels and nearness, on an image (rows, columns, 4).

    A pixel keeps the nearest; of what is nearer by less than `tie`, the last: marks lie on faces.
    """
    image = np.zeros((rows, columns, 4))
    nearest = np.full((rows, columns), -np.inf)
    for f in range(len(corners)):
        ax, ay, az = corners[f, 0, 0], corners[f, 0, 1], corners[f, 0, 2]
        bx, by, bz = corners[f, 1, 0], corners[f, 1, 1], corners[f, 1, 2]
        cx, cy, cz = corners[f, 2, 0], corners[f, 2, 1], corners[f, 2, 2]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area == 0.0:
            continue
        for row in range(int(min(ay, by, cy)), min(int(max(ay, by, cy)) + 1, rows)):
            for column in range(int(min(ax, bx, cx)), min(int(max(ax, bx, cx)) + 1, columns)):
                x, y = column + 0.5, row + 0.5
                b = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / area
                c = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / area
                if b < 0.0 or c < 0.0 or b + c > 1.0:
                    continue
                near = az + b * (bz - az) + c * (cz - az)
                if near > nearest[row, column] - tie:
                    nearest[row, column] = max(near, nearest[row, column])
                    for k in range(3):
                        image[row, column, k] = paint[f, k]
                    image[row, column, 3] = 1.0
    return image
