"""The workspace map: one value a place, of its best branch, and where blows deflect most."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.robot.units import units_of
from picchio.studies.maps.result import WorkspaceMap, joint_kinds, response_of
from picchio.studies.maps.stored import values_of
from picchio.visuals.plots.style import CMAP, HATCH, PAPER, STYLE, axes_or_new, plain, styled

if TYPE_CHECKING:
    import xarray

_TALL = 4  # joints: more in one column make a picture that no screen shows


def dataset_of(workspace: WorkspaceMap | xarray.Dataset) -> xarray.Dataset:
    """The dataset of a map."""
    return workspace.dataset if isinstance(workspace, WorkspaceMap) else workspace


def best_branch(
    workspace: WorkspaceMap | xarray.Dataset, joint: str
) -> tuple[FloatArray, FloatArray]:
    """Every place of a map once, with the smallest peak over the poses that reach it.

    Args:
        workspace: of `picchio.workspace_map`, or its dataset.
        joint: whose peak deflection.

    Returns:
        positions (p, 3) m and peaks (p,) rad or m; places with no value are left out.

    Raises:
        InputError: an unknown joint, a map without any value.
    """
    workspace = dataset_of(workspace)
    names = [str(name) for name in values_of(workspace, "joint", 1)]
    if joint not in names:
        raise InputError("no such joint in the map", key="joint", value=joint, choices=names)
    position = np.asarray(values_of(workspace, "position", 2), dtype=float)
    values = np.asarray(values_of(workspace, "peak_deflection", 2), dtype=float)
    values = values[:, names.index(joint)]
    known = np.isfinite(values) & np.isfinite(position).all(axis=1)
    if not known.any():
        raise InputError("the map has no value for this joint", key="joint", value=joint)
    places, home = np.unique(np.round(position[known], 9), axis=0, return_inverse=True)
    best = np.full(len(places), np.inf)
    np.minimum.at(best, home.ravel(), values[known])
    return places, best


def spacing(places: FloatArray) -> float:
    """m, from a place to its nearest neighbour, the median over the places."""
    from scipy.spatial import cKDTree

    if len(places) < 2:
        return 0.1
    distance, _ = cKDTree(places).query(places, k=2)
    return float(np.median(distance[:, 1]))


def workspace_figure(workspace: WorkspaceMap | xarray.Dataset) -> Figure:
    """A map of every joint, below each other; of many joints in two columns.

    Args:
        workspace: of `picchio.workspace_map`, or its dataset.

    Returns:
        the figure, to be saved.

    Raises:
        InputError: a map without values.
    """
    names = [str(name) for name in dataset_of(workspace)["joint"].values]
    with mpl.rc_context(STYLE):  # type: ignore[arg-type]
        columns = 1 if len(names) < _TALL else 2
        rows = -(-len(names) // columns)
        figure = Figure(figsize=(6.2 * columns, 4.4 * rows), layout="constrained")
        room = figure.subplots(rows, columns, squeeze=False).ravel()
        for name, ax in zip(names, room, strict=False):
            plot_workspace_map(workspace, name, ax)
        for ax in room[len(names) :]:
            ax.remove()
    return figure


@styled
def plot_workspace_map(
    workspace: WorkspaceMap | xarray.Dataset, joint: str, ax: Axes | None = None
) -> Axes:
    """The peak deflection of a joint (mrad, mm) over the plane that the map spans (m).

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
    found = dataset_of(workspace)
    names = [str(name) for name in found["joint"].values]
    unit = units_of(joint_kinds(found)[names.index(joint)]).small
    ax = axes_or_new(ax, width=5.6, height=4.4)
    spread = np.ptp(places, axis=0)
    across, up = sorted(np.argsort(spread)[1:])
    order = np.argsort(-peak)
    step = spacing(places)
    ax.set_aspect("equal")
    margin = 0.8 * step
    ax.set_xlim(places[:, across].min() - margin, places[:, across].max() + margin)
    ax.set_ylim(places[:, up].min() - margin, places[:, up].max() + margin)
    estimated = "; estimated, at the most likely values" if found.attrs.get("estimated") else ""
    ax.set(xlabel=f"{'xyz'[across]} [m]", ylabel=f"{'xyz'[up]} [m]",
           title=f"{plain(joint)}: peak deflection by place\n"
           f"{response_of(found)}{estimated}")  # fmt: skip
    # Squares that touch: the marker's size is in points, the map's spacing in metres.
    wide = ax.get_window_extent().width / (ax.get_xlim()[1] - ax.get_xlim()[0])
    size = 72.0 / ax.figure.dpi * wide * step * 0.8
    shown = ax.scatter(places[order, across], places[order, up], c=peak[order] * 1e3, s=size**2,
                       marker="s", cmap=CMAP, vmin=0.0, linewidths=0)  # fmt: skip
    if estimated:
        ax.add_patch(Rectangle((0, 0), 1, 1, transform=ax.transAxes, fill=False, hatch=HATCH,
                               edgecolor=PAPER, linewidth=0.0, alpha=0.35))  # fmt: skip
    bar = ax.figure.colorbar(shown, ax=ax, pad=0.02)
    bar.set_label(f"peak deflection [{unit}]")
    bar.outline.set_visible(False)  # type: ignore[operator]
    return ax
