"""The scene as one HTML file: meshcat's viewer, the data, the controls; no network."""

from __future__ import annotations

import base64
import hashlib
import json
import zlib
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from picchio.core.provenance import package_version
from picchio.visuals.kinematics import Frame
from picchio.visuals.scene.robot.mesh import Mesh

if TYPE_CHECKING:
    from picchio.visuals.scene.scene import Scene


class Packer:
    """Collects arrays and gives references to them: [type, offset in bytes, count]."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0
        self._known: dict[tuple[str, bytes], list[Any]] = {}

    def add(self, values: ArrayLike, kind: str) -> list[Any]:
        """Put an array in, once however often it comes; `kind` is "f4", "u4", "u2" or "u1"."""
        array = np.ascontiguousarray(np.asarray(values), dtype=f"<{kind}")
        content = array.tobytes()
        fingerprint = (kind, hashlib.sha256(content).digest())
        if fingerprint in self._known:
            return self._known[fingerprint]
        reference = self._known[fingerprint] = [kind, self._size, int(array.size)]
        content += b"\0" * (-len(content) % 4)  # typed arrays must start on their own size
        self._parts.append(content)
        self._size += len(content)
        return reference

    def add_mesh(self, mesh: Mesh) -> dict[str, Any]:
        """A mesh as references; see `Mesh.exact` for how exact."""
        packed: dict[str, Any] = {
            "crease": mesh.crease, "opacity": mesh.opacity,
            "colour": mesh.colour,
        }  # fmt: skip
        vertices = np.asarray(mesh.vertices, dtype=float)
        if mesh.exact:
            packed["vertices"] = self.add(vertices, "f4")
        else:
            low = vertices.min(axis=0)
            step = float(np.ptp(vertices, axis=0).max()) / 65535 or 1.0
            packed["vertices"] = self.add(np.rint((vertices - low) / step), "u2")
            packed["low"], packed["step"] = low.tolist(), step
        packed["faces"] = self.add(mesh.faces, "u2" if len(vertices) < 65536 else "u4")
        if mesh.colours is not None:
            packed["colours"] = self.add(np.rint(mesh.colours), "u1")
        return packed

    def text(self) -> str:
        """Everything, deflated, in base64."""
        return base64.b64encode(zlib.compress(b"".join(self._parts), 9)).decode("ascii")


def script_json(value: Any) -> str:
    """JSON that cannot end the script element it stands in, whatever names are in it."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"), ensure_ascii=True)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data: blob:"
)
"""What a page may load: what is in it."""
# One scope, in this order.
_SCRIPTS = ("1-robot.js", "2-overlay.js", "3-controls.js", "4-answers.js", "5-items.js")


def page_html(package: str, scripts: Sequence[str], packer: Packer, **parts: Any) -> str:
    """A page of a robot in 3-D: the common frame, and what one kind of page has of its own.

    Args:
        package: whose folder `page_files` has `body.html`, `page.css` and the scripts.
        scripts: names of files, in order; they share one scope with `common/*.js`.
        packer: the arrays.
        **parts: "kind" (of the page, a word), "told" (of the picture, to who cannot see it),
            "data" (what the scripts read, "title" among it), "policy" (HTML of the head), and what
            the body names. Escaped where a name may be in it.

    Returns:
        HTML that loads nothing.
    """
    own = files(package) / "page_files"
    common = files("picchio.visuals.scene") / "page_files" / "common"
    code = [common / "data.js", common / "stage.js", *(own / name for name in scripts)]
    parts |= {
        "title": escape(parts["data"]["title"]),
        "version": escape(package_version()),
        "style": "".join((folder / "page.css").read_text("utf-8") for folder in (common, own)),
        "viewer": _viewer(),
        "data": script_json(parts["data"]),
        "arrays": packer.text(),
        "script": "\n".join(each.read_text("utf-8") for each in code),
    }
    for page in (own / "body.html", common / "page.html"):
        # Split at the marks rather than replaced one after another: names may look like marks.
        pieces = page.read_text("utf-8").split("@@")
        parts["body"] = "".join(parts[p] if k % 2 else p for k, p in enumerate(pieces))
    return str(parts["body"])


def scene_html(scene: Scene) -> str:
    """The page; every name in it is data, never markup or code."""
    packer = Packer()
    return page_html(
        "picchio.visuals.scene", _SCRIPTS, packer,
        kind="scene",
        told=escape(f"3-D scene of {scene.title}"),
        data=scene_data(scene, packer),
        policy=f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n',
        subtitle=escape(scene.subtitle),
        judged="".join(
            f'<p id="{name}">{escape(text)}</p>'
            for name, text in (("estimated", scene.notice), ("judged", scene.verdict))
            if text
        ),
    )  # fmt: skip


def scene_data(scene: Scene, packer: Packer) -> dict[str, Any]:
    """What the page's script reads; arrays are references into the packer."""
    motion = scene.motion
    samples = np.asarray(motion["samples"])
    return {
        "title": scene.title,
        "frames": [_frame(frame, scene.envelope.joint_names) for frame in scene.frames],
        "meshes": [packer.add_mesh(mesh) for mesh in scene.meshes],
        "items": [{**vars(item), "matrix": _matrix(item.matrix)} for item in scene.items],
        "layers": [{"id": i, "text": text, "on": on} for i, text, on in scene.layers],
        "labels": scene.labels,
        "joints": scene.joints,
        "swatches": scene.swatches,
        "scales": {layer: scale.to_dict() for layer, scale in scene.scales.items()},
        "motion": {
            "samples": packer.add(samples, "f4"),
            "count": samples.shape[2],
            **{key: motion[key] for key in ("step", "directions", "factor", "slow")},
            "tracks": [
                {**track, "samples": packer.add(track["samples"], "f4")} for track in scene.tracks
            ],
        },
        "diagnosis": scene.diagnosis,
        "playing": scene.playing,
        "camera": scene.camera.tolist(),
        "floor": scene.floor,
        "tool": scene.envelope.tool_position.tolist(),
        "chosen": scene.chosen,
    }


def _frame(frame: Frame, joints: tuple[str, ...]) -> dict[str, Any]:
    return {
        "path": frame.path,
        "matrix": _matrix(frame.matrix),
        "axis": None if frame.axis is None else frame.axis.tolist(),
        "prismatic": frame.prismatic,
        "position": frame.position,
        "follows": frame.follows.tolist() if frame.follows.any() else None,
        "joint": joints.index(frame.joint) if frame.joint in joints else None,
    }


def _matrix(matrix: Any) -> list[float]:
    """Column by column, as three.js has it."""
    return [round(float(value), 9) for value in np.asarray(matrix).T.ravel()]


def _viewer() -> str:
    """Meshcat's viewer as it is installed, MIT licence."""
    # Importing meshcat would start its server's libraries; only a file of it is wanted.
    found = find_spec("meshcat")
    assert found is not None and found.origin is not None
    source = Path(found.origin).parent / "viewer" / "dist" / "main.min.js"
    return source.read_text("utf-8").replace("</script", "<\\/script")
