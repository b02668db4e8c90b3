"""The scene in a running meshcat viewer: the same things, without the page's own controls."""

from __future__ import annotations

from typing import Any

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.view.scene.kinematics import joint_motion
from picchio.view.scene.mesh import Mesh, rgb
from picchio.view.scene.scene import Scene

_SINGLE = ("envelope", "worst")
"""Layers of which one joint is shown at a time."""


def send(scene: Scene, viewer: Any) -> None:
    """Draw a scene in a `meshcat.Visualizer`, under /picchio; layers are its folders.

    Args:
        scene: what to draw.
        viewer: `meshcat.Visualizer()` or anything that takes the same calls.
    """
    from meshcat.geometry import MeshLambertMaterial, TriangularMeshGeometry

    root = viewer["picchio"]
    root.delete()
    for layer in ("robot", "joints"):
        for frame in scene.frames:
            root[layer][frame.path].set_transform(frame.matrix @ joint_motion(frame))
    for number, item in enumerate(scene.items):
        mesh = scene.meshes[item.mesh]
        path = "/".join(part for part in (item.layer, item.node, f"item{number}") if part)
        geometry = TriangularMeshGeometry(
            mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32), _colours(mesh, item)
        )
        material = MeshLambertMaterial(
            color=0xFFFFFF,
            vertexColors=True,
            opacity=mesh.opacity,
            transparent=mesh.opacity < 1.0,
            side=2,
            depthWrite=mesh.opacity >= 1.0,
        )
        root[path].set_object(geometry, material)
        root[path].set_transform(item.matrix)
        if item.layer in _SINGLE and item.joint != scene.chosen:
            root[path].set_property("visible", False)
    for layer, _, shown in scene.layers:
        root[layer].set_property("visible", shown)
    # meshcat's camera has its y axis up.
    x, y, z = scene.camera[0]
    viewer["/Cameras/default/rotated/<object>"].set_property("position", [x, z, -y])


def _colours(mesh: Mesh, item: Any) -> FloatArray:
    """(v, 3) 0 to 1."""
    if item.colour is None and mesh.colours is not None:
        return np.asarray(mesh.colours / 255.0)
    return np.tile(rgb(item.colour or mesh.colour) / 255.0, (len(mesh.vertices), 1))
