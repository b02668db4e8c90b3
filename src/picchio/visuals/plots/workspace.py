"""The workspace map: where the blows deflect a joint most."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from picchio.studies.maps.result import WorkspaceMap
from picchio.visuals.plots.style import CMAP, axes_or_new, plain, styled
from picchio.visuals.workspace import best_branch, spacing

if TYPE_CHECKING:
    import xarray


@styled
def plot_workspace_map(
    workspace: WorkspaceMap | xarray.Dataset, joint: str, ax: Axes | None = None
) -> Axes:
    """Peak deflection of a joint (mrad) over the plane that the map spans (m).

    Of several poses that reach a place the one with the smallest peak counts. A map of a box is
    seen along its shortest side, the smallest peak in front.

    Args:
        workspace: of `picchio.workspace_map`, or its dataset.
        joint: whose peak.
        ax: where to draw.

    Raises:
        InputError: an unknown joint, a map without values.
    """
    places, peak = best_branch(workspace, joint)
    ax = axes_or_new(ax, width=5.6, height=4.4)
    spread = np.ptp(places, axis=0)
    across, up = sorted(np.argsort(spread)[1:])
    order = np.argsort(-peak)
    step = spacing(places)
    ax.set_aspect("equal")
    margin = 0.8 * step
    ax.set_xlim(places[:, across].min() - margin, places[:, across].max() + margin)
    ax.set_ylim(places[:, up].min() - margin, places[:, up].max() + margin)
    ax.set(xlabel=f"{'xyz'[across]} [m]", ylabel=f"{'xyz'[up]} [m]",
           title=f"Peak deflection of {plain(joint)}, by place")  # fmt: skip
    # Squares that touch: the marker's size is in points, the map's spacing in metres.
    wide = ax.get_window_extent().width / (ax.get_xlim()[1] - ax.get_xlim()[0])
    size = 72.0 / ax.figure.dpi * wide * step * 0.8
    shown = ax.scatter(places[order, across], places[order, up], c=peak[order] * 1e3, s=size**2,
                       marker="s", cmap=CMAP, vmin=0.0, linewidths=0)  # fmt: skip
    bar = ax.figure.colorbar(shown, ax=ax, shrink=0.85, pad=0.02)
    bar.set_label("peak deflection [mrad]")
    bar.outline.set_visible(False)  # type: ignore[operator]
    return ax
