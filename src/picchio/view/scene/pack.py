"""Arrays as one compressed block of text that the page unpacks."""

from __future__ import annotations

import base64
import hashlib
import json
import zlib
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from picchio.view.scene.mesh import Mesh


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
            "crease": mesh.crease, "opacity": mesh.opacity, "colour": mesh.colour,
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
