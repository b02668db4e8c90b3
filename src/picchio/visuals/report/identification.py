"""From an identification to one page: what was measured over what was fitted, joint by joint."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from picchio.diagnosis.identified import Compared, Identification
from picchio.visuals.plots.style import BLUE, INK, MUTED, VERMILION, blank_figure, plain, styled
from picchio.visuals.report.page import Pictures, capitalised, number, percent, render
from picchio.visuals.scene.portrait import plot_mode

_MOST, _MODES = 12, 6  # pictures


def identification_page(
    found: Identification, *, command: str | None = None, warnings: Sequence[str] = ()
) -> str:
    """The page of an identification.

    Args:
        found: of any method.
        command: the command line that gave this.
        warnings: what was warned of on the way.

    Returns:
        the HTML.
    """
    content = found.to_dict()
    compared = found.compared()
    # Those that fit worst are shown, in the order of the records.
    worst = sorted(range(len(compared)), key=lambda k: -compared[k].left)[:_MOST]
    pictures = Pictures()
    shown = [
        pictures.picture(
            plot_compared(compared[k]), f"{compared[k].title}: measured and fitted",
            f"{compared[k].title}: {percent(compared[k].left)} % is left",
        )
        for k in sorted(worst)
    ]  # fmt: skip
    modes = found.modes()
    drawn = [
        pictures.picture(
            plot_mode(found.robot, one.pose, one.shape),
            f"The robot at pose {one.stand}, swung to either side in the mode at "
            f"{number(one.fitted)} Hz",
            f"pose {one.stand}: {number(one.fitted)} Hz",
        )
        for one in modes[:_MODES]
    ]  # fmt: skip
    return render(
        "identification.html.j2",
        headline=capitalised(found._headline()) + ".",
        robot=found.robot.name,
        source=found.source,
        joints=found._listing(),
        reasons=[
            (joint.name, joint.stiffness.why, joint.damping_ratio.why) for joint in found.joints
        ],
        remarks=found.remarks,
        pictures=shown,
        hidden=len(compared) - len(shown),
        modes=[
            [
                str(one.stand),
                number(one.measured),
                number(one.fitted),
                percent(one.fitted / one.measured - 1.0),
                number(one.damping_ratio, 2),
                "" if math.isnan(one.mac) else f"{one.mac:.2f}",
            ]
            for one in modes
        ],
        drawn=drawn,
        poses=[[one.where, number(one.readings), percent(one.left)] for one in found.by_pose()],
        left=[[one.title, number(len(one.x)), percent(one.left)] for one in compared],
        command=command,
        warnings=[*warnings, *([found.doubt] if found.doubt else [])],
        provenance=content.get("provenance"),
    )


@styled
def plot_compared(compared: Compared, ax: Axes | None = None) -> Axes:
    """What was measured over what was fitted.

    Args:
        compared: the two.
        ax: where to draw.
    """
    axes = ax if ax is not None else blank_figure(width=4.6, height=2.7)
    if compared.lines:
        low = np.maximum(compared.measured - compared.spread, 0.3 * compared.measured)
        if compared.logarithmic:
            axes.fill_between(compared.x, low, compared.measured + compared.spread,
                              color=MUTED, alpha=0.3, linewidth=0.0)  # fmt: skip
        axes.plot(compared.x, compared.measured, color=MUTED, linewidth=3.5, alpha=0.6,
                  label="measured")  # fmt: skip
        axes.plot(compared.x, compared.fitted, color=VERMILION, linewidth=1.2, label="fitted")
        if compared.logarithmic:
            axes.set_yscale("log")
        if compared.coherence is not None:
            beside = axes.twinx()
            beside.plot(compared.x, compared.coherence, color=BLUE, linewidth=0.8, alpha=0.7)
            beside.set(ylim=(0.0, 1.02), yticks=[0.0, 1.0])
            beside.set_ylabel("coherence", color=BLUE)
            beside.grid(False)
    else:
        axes.errorbar(compared.x, compared.measured, compared.spread, fmt="o", color=INK,
                      markersize=3.5, linewidth=0.8, label="measured")  # fmt: skip
        axes.plot(compared.x, compared.fitted, "x", color=BLUE, markersize=5.0, label="fitted")
        axes.axhline(0.0, color=MUTED, linewidth=0.7)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))  # lines of the table
    axes.set(xlabel=compared.across, ylabel=compared.up, title=plain(compared.title))
    axes.legend(loc="best")
    return axes
