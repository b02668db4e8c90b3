"""The direction envelope in a plane: the paper's double ball, cut."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from matplotlib.axes import Axes

from picchio.core import spoken
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.robot.units import labelled
from picchio.studies.envelopes import DirectionEnvelope, Quantity
from picchio.visuals.plots.style import (
    INK,
    MUTED,
    axes_or_new,
    look,
    plain,
    styled,
)

Plane = Literal["xy", "xz", "yz"]
PLANES: tuple[Plane, ...] = ("xy", "xz", "yz")
# The factor, and a turning joint's unit.
_UNITS = {"deflection": ("mrad", 1e3), "torque": ("N m", 1.0), "stress": ("MPa", 1e-6)}


def cut_directions(plane: Plane, count: int = 180) -> tuple[FloatArray, FloatArray]:
    """Angles (count,) rad over half a turn and unit vectors (count, 3) in a world plane.

    Raises:
        InputError: an unknown plane.
    """
    if plane not in PLANES:
        raise InputError("unknown plane", key="plane", value=plane, choices=PLANES)
    angle = np.linspace(0.0, np.pi, count, endpoint=False)
    directions = np.zeros((count, 3))
    directions[:, "xyz".index(plane[0])] = np.cos(angle)
    directions[:, "xyz".index(plane[1])] = np.sin(angle)
    return angle, directions


@styled
def plot_polar_envelope(
    envelope: DirectionEnvelope,
    plane: Plane = "xz",
    ax: Axes | None = None,
    *,
    joints: Sequence[str] | None = None,
    quantity: Quantity = "deflection",
    count: int = 180,
) -> Axes:
    """The peak of each joint by the force's direction within a plane through the tool.

    Args:
        envelope: at a pose.
        plane: of the world axes; the first is at 0 degrees, the second at 90.
        ax: polar axes.
        joints: names; all if not given.
        quantity: "deflection" (mrad, mm), "torque" (N m, N) or "stress" (MPa).
        count: directions over half a turn; the other half is its mirror image.

    Where values are estimates, the line is of the most likely ones, and the legend tells the range
    of the largest peak in 80 % of the drawn cases.

    Raises:
        InputError: an unknown plane, joint or quantity.
    """
    ax = axes_or_new(ax, width=5.4, height=4.2, polar=True)
    angle, directions = cut_directions(plane, count)
    support, ends = envelope.support(directions, quantity), envelope.peak_interval(quantity)
    unit, factor = _UNITS[quantity]
    units = [kind.of(unit) for kind in envelope.units]
    unit, names = labelled(units, map(plain, envelope.joint_names))
    for name in joints or envelope.joint_names:
        if name not in envelope.joint_names:
            raise InputError("no such joint", key="joints", value=name,
                             choices=envelope.joint_names)  # fmt: skip
        j = envelope.joint_names.index(name)
        if not np.isfinite(support[j]).all():
            continue
        radius = np.concatenate([support[j], support[j], support[j][:1]]) * factor
        turn = np.concatenate([angle, angle + np.pi, [2 * np.pi]])
        style = look(j)
        told = names[j]
        if envelope.estimated:
            told += f"\n{spoken.between([float(f'{end * factor:.2g}') for end in ends[j]])}"
        ax.plot(turn, radius, label=told, **style)
        ax.fill(turn, radius, color=style["color"], alpha=0.10)
    title = f"Peak {quantity} by force direction, {plane} plane [{unit}]"
    if envelope.estimated:
        title += "\nestimated; in numbers: 80 % ranges"
    ax.set_title(title, pad=18)
    ax.set_xticks(np.arange(8) * np.pi / 4,
                  [f"+{plane[0]}", "45°", f"+{plane[1]}", "135°", f"−{plane[0]}", "225°",
                   f"−{plane[1]}", "315°"], color=INK)  # fmt: skip
    ax.tick_params(axis="y", labelsize=7.5, labelcolor=MUTED)
    ax.set_rlabel_position(22.5)  # type: ignore[attr-defined]
    ax.spines["polar"].set_color(MUTED)
    ax.spines["polar"].set_alpha(0.4)
    ax.set_rgrids(_rings(float(ax.get_rmax())))  # type: ignore[attr-defined]
    ax.legend(loc="upper left", bbox_to_anchor=(1.12, 1.02))
    if (engine := ax.figure.get_layout_engine()) is not None:
        engine.set(w_pad=0.14)  # type: ignore[call-arg]
    return ax


def _rings(largest: float) -> FloatArray:
    """Three to five round radii for the grid."""
    if not largest > 0.0:
        return np.array([1.0])
    step = 10.0 ** np.floor(np.log10(largest))
    step *= next(m for m in (0.2, 0.25, 0.5, 1.0, 2.0) if largest / (m * step) < 5.5)
    return np.arange(1, int(largest / step) + 1) * step
