"""Fewer triangles by merging vertices that share a cell of a grid (Rossignac and Borrel, 1993)."""

from __future__ import annotations

import numpy as np

from picchio.view.scene.mesh import Mesh


def decimate(mesh: Mesh, cell: float) -> Mesh:
    """The mesh with one vertex a cell; triangles that collapse are dropped.

    Args:
        mesh: any triangles.
        cell: edge of the grid's cubes, in the mesh's unit; no vertex moves further than its
            diagonal.

    Returns:
        vertices at the mean of those they replace.
    """
    if not len(mesh.faces):
        return mesh
    low = mesh.vertices.min(axis=0)
    key = np.floor((mesh.vertices - low) / cell).astype(np.int64)
    span = key.max(axis=0) + 1
    flat = (key[:, 0] * span[1] + key[:, 1]) * span[2] + key[:, 2]
    # Parts of different colours stay apart.
    if mesh.colours is not None:
        shade = np.unique(mesh.colours.astype(int), axis=0, return_inverse=True)[1].ravel()
        flat = flat * (int(shade.max()) + 1) + shade
    _, home = np.unique(flat, return_inverse=True)
    home = home.ravel()
    count = np.bincount(home).astype(float)
    vertices = np.column_stack([np.bincount(home, mesh.vertices[:, k]) / count for k in range(3)])
    faces = home[mesh.faces]
    alive = (
        (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    )
    faces = faces[alive]
    # One triangle where several fell on each other; the turn (inside, outside) is kept.
    first = np.argmin(faces, axis=1)
    canonical = np.take_along_axis(faces, (first[:, None] + np.arange(3)) % 3, axis=1)
    faces = np.unique(canonical, axis=0) if len(canonical) else canonical
    used, renumbered = np.unique(faces, return_inverse=True)
    colours = None
    if mesh.colours is not None:
        kept = np.column_stack([np.bincount(home, mesh.colours[:, k]) / count for k in range(3)])
        colours = kept[used]
    return Mesh(
        vertices[used], renumbered.reshape(-1, 3), colours, mesh.colour, mesh.opacity, mesh.exact,
        mesh.crease,
    )  # fmt: skip
