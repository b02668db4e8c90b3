"""A workspace map as something to draw: one value a place, of its best branch."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.studies.maps.result import WorkspaceMap

if TYPE_CHECKING:
    import xarray


def dataset_of(workspace: WorkspaceMap | xarray.Dataset) -> xarray.Dataset:
    """The dataset of a map."""
    return workspace.dataset if isinstance(workspace, WorkspaceMap) else workspace


def best_branch(
    workspace: WorkspaceMap | xarray.Dataset, joint: str, variable: str = "peak_deflection"
) -> tuple[FloatArray, FloatArray]:
    """Every place of a map once, with the smallest value over the poses that reach it.

    Args:
        workspace: of `picchio.workspace_map`, or its dataset.
        joint: whose value.
        variable: of dimensions (point, joint).

    Returns:
        positions (p, 3) m and values (p,) in the map's unit; places with no value are left out.

    Raises:
        InputError: an unknown joint, a map without any value.
    """
    workspace = dataset_of(workspace)
    names = [str(name) for name in workspace["joint"].values]
    if joint not in names:
        raise InputError("no such joint in the map", key="joint", value=joint, choices=names)
    position = np.asarray(workspace["position"].values, dtype=float)
    values = np.asarray(workspace[variable].values, dtype=float)[:, names.index(joint)]
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
