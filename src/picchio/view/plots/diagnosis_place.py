"""The arm as a stick figure, with the place of a cause ringed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke
from numpy.typing import ArrayLike

from picchio.core.arrays import FloatArray
from picchio.model.effects import catalogue
from picchio.robot import FlexibleRobot
from picchio.view.plots.style import (
    BLUE,
    INK,
    MUTED,
    PAPER,
    VERMILION,
    axes_or_new,
    plain,
    styled,
)
from picchio.view.scene.kinematics import Frame, frames, world


def place_in_words(robot: FlexibleRobot, effect: str, target: str) -> str:
    """Where on the robot an effect sits, as a phrase."""
    known = catalogue().get(effect)
    kind = known.target_kind if known is not None else ""
    names = robot.flexible_names
    if target in names:
        count = len(names)
        return f"in {target}, flexible joint {names.index(target) + 1} of {count} from the base"
    if kind == "axis":
        turn = target.startswith("r")
        return f"under the base, {'about' if turn else 'along'} {target[-1]}"
    if kind == "tool":
        return f"at the tool ({robot.tool_frame})"
    if kind == "robot":
        return "in the whole arm"
    if kind == "channel group":
        return f"in the channels {target}, not in the robot"
    return f"at {target}"


@styled
def plot_place(
    robot: FlexibleRobot,
    pose: FloatArray,
    causes: Sequence[tuple[str, str]],
    ax: Axes | None = None,
    *,
    direction: ArrayLike | None = None,
) -> Axes:
    """The robot at a pose, seen from the side it spreads most, with the causes' places ringed.

    Args:
        robot: the robot.
        pose: (nv,) rad or m.
        causes: (effect, target).
        ax: where to draw.
        direction: (3,) of the blows, drawn at the tool.
    """
    ax = axes_or_new(ax)
    all_frames = frames(robot, pose)
    at = {link: matrix[:3, 3] for link, matrix in world(all_frames).items()}
    sideways = _sideways(np.array(list(at.values())))

    def seen(point: FloatArray) -> tuple[float, float]:
        return float(point @ sideways), float(point[2])

    bones = _bones(all_frames)
    for parent, frame in bones:
        (x0, z0), (x1, z1) = seen(at[parent]), seen(at[frame.link])
        ax.plot(
            (x0, x1),
            (z0, z1),
            color=MUTED,
            linewidth=5.0,
            alpha=0.55,
            solid_capstyle="round",
            zorder=1,
        )
    for frame in all_frames:
        if frame.joint in robot.flexible_names:
            ax.plot(*seen(at[frame.link]), "o", color=PAPER, markeredgecolor=INK, markersize=7,
                    markeredgewidth=1.4, zorder=3)  # fmt: skip
    base = seen(at[all_frames[0].link])
    ax.plot(*base, "s", color=MUTED, markersize=9, zorder=2)
    tip = at[robot.link_of(robot.tool_frame)]
    ax.plot(*seen(tip), ">", color=INK, markersize=6, zorder=3)
    size = max(np.ptp([seen(p) for p in at.values()], axis=0).max(), 1e-3)
    if direction is not None:
        unit = np.asarray(direction, dtype=float)
        x, z = seen(tip)
        dx, dz = seen(0.22 * size * unit / np.linalg.norm(unit))
        ax.annotate("", (x, z), xytext=(x - dx, z - dz), zorder=2,
                    arrowprops={"arrowstyle": "-|>", "color": BLUE, "linewidth": 1.6})  # fmt: skip
    across = [seen(p)[0] for p in at.values()]
    middle = 0.5 * (min(across) + max(across))
    taken: list[tuple[float, float]] = []
    for effect, target in causes:
        points = _points(robot, effect, target, all_frames, at)
        for point in points:
            ax.plot(*seen(point), "o", color="none", markeredgecolor=VERMILION, markersize=19,
                    markeredgewidth=2.4, zorder=4)  # fmt: skip
        if points:
            x, z = seen(points[-1])
            shift = sum(abs(x - a) + abs(z - b) < 0.1 * size for a, b in taken)
            taken.append((x, z))
            # On the side where there is room for it.
            side = 1 if x <= middle else -1
            ax.annotate(plain(effect.replace("_", " ")), (x, z), xytext=(15 * side, 9 - 12 * shift),
                        textcoords="offset points", ha="left" if side > 0 else "right",
                        color=VERMILION, fontsize=9, fontweight="bold", zorder=5,
                        path_effects=[withStroke(linewidth=3.0, foreground=PAPER)])  # fmt: skip
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.22)
    ax.grid(False)
    ax.set(xlabel="sideways [m]", ylabel="height [m]")
    return ax


def _sideways(points: FloatArray) -> FloatArray:
    """(3,) horizontal unit vector along which the points spread most."""
    flat = points[:, :2] - points[:, :2].mean(axis=0)
    axis = np.linalg.svd(flat)[2][0]
    axis = axis if axis[np.argmax(np.abs(axis))] > 0 else -axis
    return np.array([axis[0], axis[1], 0.0])


def _bones(all_frames: Sequence[Frame]) -> list[tuple[str, Frame]]:
    links = {frame.path: frame.link for frame in all_frames}
    parents = [(links.get(frame.path.rpartition("/")[0]), frame) for frame in all_frames]
    return [(parent, frame) for parent, frame in parents if parent is not None]


def _points(
    robot: FlexibleRobot,
    effect: str,
    target: str,
    all_frames: Sequence[Frame],
    at: dict[str, FloatArray],
) -> list[FloatArray]:
    """World positions that an effect's target stands for."""
    known = catalogue().get(effect)
    kind = known.target_kind if known is not None else ""
    joints = [at[f.link] for f in all_frames if f.joint in robot.flexible_names]
    tip = at[robot.link_of(robot.tool_frame)]
    for frame in all_frames:
        if frame.joint == target:
            return [at[frame.link]]
    if target in at and kind != "tool":
        below = [at[frame.link] for parent, frame in _bones(all_frames) if parent == target]
        return [0.5 * (at[target] + below[0])] if below else [at[target]]
    if kind == "axis":
        return [at[all_frames[0].link]]
    if kind == "robot" or target == "deflection":
        return joints
    if kind == "channel group":
        frame_name = target.partition(".")[2]
        return [at[frame_name]] if frame_name in at else [tip]
    return [tip]
