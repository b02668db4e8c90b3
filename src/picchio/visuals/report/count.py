"""From a count to one self-contained HTML page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from picchio.core import spoken
from picchio.ledger.result import Count
from picchio.visuals.plots.style import axes_or_new, blank_figure, look, styled
from picchio.visuals.report.page import Picture, Pictures, render

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_FEW_DAYS = 5


def count_page(found: Count, *, command: str | None = None, warnings: Sequence[str] = ()) -> str:
    """The page of a count: life used and left, by day, the worst poses, what changed.

    Args:
        found: the count.
        command: the command line that gave this.
        warnings: what was warned of on the way.

    Returns:
        the HTML.
    """
    names = found.model.robot.flexible_names
    first = found.first_to_fail
    places = [
        [", ".join(f"{v:.3f}" for v in s["pose"]),
         ", ".join(f"{v:.2f}" for v in np.round(s["direction"], 2) + 0.0),
         s["blows"], *(spoken.per_cent(v) for v in s["share"])]
        for s in found.stations()
    ]  # fmt: skip
    facts: list[list[Any]] = [
        ["Logs", found.logs],
        ["Blows", f"{found.blows:,}"],
        ["Seen, the others assumed", f"{100 * found.seen_share:.4g} %"],
        ["Pace, lately", found.pace],
        ["Logged", found.logged],
    ]
    if first is not None:
        gain = float(found.if_force(0.9)[first])
        facts.append(["Ends the life", names[first]])
        facts.append(["With blows 10 % weaker", f"{gain:.3g} times as long"])
    return render(
        "count.html.j2", robot=found.model.robot.name, headline=found._headline() + ".",
        facts=facts, life=found._listing(), pictures=_pictures(found), places=places,
        place_heads=["Pose|rad", "Force along", "Blows",
                     *(f"{name}|% of its damage" for name in names)],
        changes=[change["words"] for change in found.changes],
        refused=[list(pair) for pair in found.refused], notes=found.notes, command=command,
        warnings=list(warnings), provenance=found.origin,
    )  # fmt: skip


def _pictures(found: Count) -> list[Picture]:
    days = found.days()
    if not days:
        return []
    made = Pictures()
    return [
        made.picture(plot_life_used(found, blank_figure()), "Life used over time",
                     "Share of each joint's life that is used (Miner's sum)."),
        made.picture(plot_blows(found, blank_figure()), "Blows a day", "Blows on each day."),
    ]  # fmt: skip


@styled
def plot_life_used(found: Count, ax: Axes | None = None) -> Axes:
    """The damage of each joint over time.

    Args:
        found: the count.
        ax: where to draw.
    """
    axes = axes_or_new(ax)
    parts = found.counted.stretches
    when = np.array([part.last for part in parts]).astype("datetime64[ns]")
    done = np.array([part.damage for part in parts]) * found.counted.together
    total = 100.0 * np.cumsum(done, axis=0)
    when, total = np.append(when[:1], when), np.vstack([0.0 * total[:1], total])
    for j, name in enumerate(found.model.robot.flexible_names):
        if found.curves[j] is not None:
            axes.plot(when, total[:, j], drawstyle="steps-post", label=name, **look(j))
    axes.set_ylabel("life used, %")
    axes.set_ylim(bottom=0.0)
    axes.legend()
    _dated(axes)
    return axes


@styled
def plot_blows(found: Count, ax: Axes | None = None) -> Axes:
    """The blows on each day.

    Args:
        found: the count.
        ax: where to draw.
    """
    axes = axes_or_new(ax)
    days = found.days()
    dates = np.array([day["date"] for day in days], dtype="datetime64[D]")
    axes.bar(dates, [day["blows"] for day in days], width=0.8)
    axes.set_ylabel("blows a day")
    _dated(axes)
    if len(dates) and (dates[-1] - dates[0]).astype(int) < _FEW_DAYS:
        from matplotlib.dates import DateFormatter, DayLocator

        day = np.timedelta64(1, "D")
        axes.set_xlim(dates[0] - day, dates[0] + (_FEW_DAYS + 1) * day)
        axes.xaxis.set_major_locator(DayLocator())
        axes.xaxis.set_major_formatter(DateFormatter("%d %b"))
    return axes


def _dated(axes: Axes) -> None:
    from matplotlib.dates import AutoDateLocator, ConciseDateFormatter

    locator = AutoDateLocator(minticks=2, maxticks=7)
    axes.xaxis.set_major_locator(locator)
    axes.xaxis.set_major_formatter(ConciseDateFormatter(locator))
