"""What `plot()` of a result draws where it is no more than columns of its table, or a record."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record
from picchio.core.errors import InputError
from picchio.core.results import TableResult
from picchio.studies.maps.result import WorkspaceMap
from picchio.studies.uncertainty.result import UncertainLife
from picchio.visuals.plots.life import plot_life_scan
from picchio.visuals.plots.style import COLOURS, axes_or_new, look, plain, styled
from picchio.visuals.plots.workspace import plot_workspace_map


@styled
def plot_columns(
    found: TableResult, ax: Axes | None = None, *, columns: Sequence[str] = ()
) -> Axes:
    """Columns of a result's table as bars, a row a group; `x_low` to `x_high` as a line on each.

    Args:
        found: the result.
        ax: where to draw.
        columns: of `to_frame()`; its `BARS` if not given.

    Returns:
        the axes.

    Raises:
        InputError: no such column.
    """
    frame = found.to_frame().replace([np.inf, -np.inf], np.nan)
    names = list(columns or found.BARS)
    for name in names:
        if name not in frame.columns:
            raise InputError(
                "no such column",
                key="columns",
                value=name,
                choices=[str(c) for c in frame.select_dtypes("number").columns],
            )
    ax = axes_or_new(ax, height=1.1 + 0.22 * max(1, len(frame)) * (1 + len(names)))
    rows = frame[::-1]
    stems = {name: name.removesuffix("_value") for name in names}
    ends = {
        name: [rows[name] - rows[f"{stem}_low"], rows[f"{stem}_high"] - rows[name]]
        for name, stem in stems.items()
        if f"{stem}_low" in frame.columns
    }
    rows[names].plot.barh(
        ax=ax, color=COLOURS[: len(names)], xerr=ends or None, width=0.7, legend=len(names) > 1
    )
    units = dict.fromkeys(found.UNITS.get(name, "\N{EN DASH}") for name in names)
    what = " and ".join(name.replace("_", " ") for name in names)
    ax.set(xlabel=f"{what} [{', '.join(units)}]", ylabel="")
    ax.grid(axis="y", visible=False)
    return ax


@styled
def plot_record(record: Record, ax: Axes | None = None, *, channels: Sequence[str] = ()) -> Axes:
    """Channels of a record over time (s), in their own unit.

    Args:
        record: a test's.
        ax: where to draw.
        channels: their names; all of the first one's unit if not given.

    Returns:
        the axes.

    Raises:
        InputError: no such channel; a record without a clock.
    """
    ax = axes_or_new(ax)
    unit = record.channel(record.channels[0]).unit
    chosen = channels or [c for c in record.channels if record.channel(c).unit == unit]
    units = dict.fromkeys(record.channel(name).unit for name in chosen)
    data = record.read(["time", *chosen])
    for k, name in enumerate(chosen):
        ax.plot(data["time"], data[name], label=plain(name), linewidth=0.9, **look(k))
    ax.set(xlabel="time [s]", ylabel=f"[{', '.join(units)}]", title=record.file)
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return ax


def plot_first_record(
    found: Any, ax: Axes | None = None, *, record: int = 0, channels: Sequence[str] = ()
) -> Axes:
    """A record of a campaign, or of what holds one; see `plot_record`.

    Args:
        found: the campaign.
        ax: where to draw.
        record: which, counted from 0.
        channels: see `plot_record`.
    """
    campaign = found if isinstance(found, Campaign) else found.campaign
    return plot_record(campaign.records[record], ax, channels=channels)


def plot_map(found: WorkspaceMap, ax: Axes | None = None, *, joint: str | None = None) -> Axes:
    """A joint's peak deflection over a map; see `plot_workspace_map`.

    Args:
        found: the map.
        ax: where to draw.
        joint: whose; the one that deflects most if not given.
    """
    return plot_workspace_map(found, joint or found.to_frame()["peak_deflection"].idxmax(), ax)


def plot_scan(found: UncertainLife, ax: Axes | None = None, *, name: str | None = None) -> Axes:
    """The life along one stiffness; see `plot_life_scan`.

    Args:
        found: the lives.
        ax: where to draw.
        name: of the stiffness, such as "stiffness.joint_2"; the first if not given.

    Raises:
        InputError: no such scan.
    """
    name = name or next(iter(found.scans), "")
    if name not in found.scans:
        raise InputError("no such scan", key="name", value=name, choices=found.scans)
    return plot_life_scan(name, found.scans[name], ax)
