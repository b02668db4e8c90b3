"""The scene in a running meshcat viewer, the page's sliders included.

Meshcat's JavaScript knows `set_control`, its Python server does not. But the server hands on, and
replays to whoever comes later, the content of any message that is addressed as `set_property`.
"""

from __future__ import annotations

import base64
import json
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.visuals.kinematics import joint_motion
from picchio.visuals.scene.robot.mesh import Mesh, rgb

if TYPE_CHECKING:
    from picchio.visuals.scene.scene import Item, Scene

_SINGLE = ("envelope", "worst", "map")
"""Layers of which one joint is shown at a time."""
_GROWING = ("envelope", "worst")


def send(scene: Scene, viewer: Any) -> None:
    """Draw a scene in a `meshcat.Visualizer`, under /picchio; layers are its folders.

    Sliders choose the joint, the envelope's size and how much the vibration is exaggerated. The
    ghosts of a comparison are on the page only.

    Args:
        scene: what to draw.
        viewer: `meshcat.Visualizer()` or anything that takes the same calls.
    """
    from meshcat.geometry import MeshLambertMaterial, TriangularMeshGeometry

    root = viewer["picchio"]
    root.delete()
    for layer in ("robot", "joints", *scene.swatches):
        for frame in scene.frames:
            root[layer][frame.path].set_transform(frame.matrix @ joint_motion(frame))
    for number, item in enumerate(scene.items):
        mesh = scene.meshes[item.mesh]
        path = _path(item, number)
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
    place = _turned(scene.camera[0])
    viewer["/Cameras/default/rotated/<object>"].set_property("position", place)
    for side, colour in (("top", [0.98, 0.985, 0.99]), ("bottom", [0.87, 0.9, 0.93])):
        viewer["/Background"].set_property(f"{side}_color", colour)
    if hasattr(getattr(viewer, "window", None), "zmq_socket"):
        import umsgpack  # type: ignore[import-untyped]

        for control in controls(scene):
            viewer.window.zmq_socket.send_multipart(
                [b"set_property", b"/meshcat/picchio", umsgpack.packb(control)]
            )
            viewer.window.zmq_socket.recv()


def controls(scene: Scene) -> list[dict[str, Any]]:
    """Meshcat's `set_control` messages: the first brings the script that all of them call."""
    template = (files("picchio.visuals.scene") / "page_files" / "live.js").read_text("utf-8")
    # A string within a script within a message: JSON twice, so that names stay data. No name
    # goes into a control's own, which meshcat writes as HTML.
    data = json.dumps(json.dumps(_data(scene), separators=(",", ":"), allow_nan=False))
    head, _, tail = template.partition("@@data@@")
    script = head + data + tail.replace("@@control@@", "joint")
    n = len(scene.joints)
    found: list[dict[str, Any]] = [
        {"name": "joint", "callback": script, "value": scene.chosen + 1, "min": 1, "max": n,
         "step": 1},
        {"name": "size", "value": 1.0, "min": 0.2, "max": 3.0, "step": 0.05},
        {"name": "exaggerated", "value": 0.0, "min": -1.0, "max": 1.0, "step": 0.02},
        {"name": "moment", "value": 0.0, "min": 0.0, "max": 1.0, "step": 0.001},
        {"name": "play"},
    ]  # fmt: skip
    for control in found:
        control["type"] = "set_control"
        control.setdefault("callback", f"(value) => window.picchio_live.{control['name']}(value)")
    return found


def _data(scene: Scene) -> dict[str, Any]:
    """What the script works on."""
    motion = scene.motion
    along = np.asarray(motion["directions"][0]["along"])
    samples = np.einsum("ndk,d->nk", motion["samples"], along).astype("<f4")
    return {
        "chosen": scene.chosen,
        "playing": scene.playing,
        "target": _turned(scene.camera[1]),
        "layers": ["robot", "joints", *scene.swatches],
        "told": [joint["text"] for joint in scene.joints],
        "items": [
            {"path": _path(item, number).split("/"), "joint": item.joint,
             "grows": item.layer in _GROWING, "matrix": item.matrix.T.ravel().tolist()}
            for number, item in enumerate(scene.items)
            if item.layer in _SINGLE
        ],
        "frames": [
            {"path": frame.path.split("/"), "matrix": frame.matrix.T.ravel().tolist(),
             "axis": frame.axis.tolist(), "prismatic": frame.prismatic,
             "position": frame.position, "follows": frame.follows.tolist()}
            for frame in scene.frames
            if frame.axis is not None and frame.follows.any()
        ],
        "motion": {"samples": base64.b64encode(samples.tobytes()).decode("ascii"),
                   "count": samples.shape[1],
                   **{key: motion[key] for key in ("step", "slow", "factor")}},
    }  # fmt: skip


def _turned(point: FloatArray) -> list[float]:
    """A point (3,) as meshcat's camera has it, whose y axis is up."""
    x, y, z = (float(c) for c in point)
    return [x, z, -y]


def _path(item: Item, number: int) -> str:
    return "/".join(part for part in (item.layer, item.node, f"item{number}") if part)


def _colours(mesh: Mesh, item: Item) -> FloatArray:
    """(v, 3) 0 to 1."""
    if item.colour is None and mesh.colours is not None:
        return np.asarray(mesh.colours / 255.0)
    return np.tile(rgb(item.colour or mesh.colour) / 255.0, (len(mesh.vertices), 1))
