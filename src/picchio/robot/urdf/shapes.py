"""The shapes of a URDF's links, to draw or to weigh: primitives and mesh files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from lxml import etree
from numpy.typing import ArrayLike

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.core.files import regular_file
from picchio.robot.urdf.addresses import resolve_mesh
from picchio.robot.urdf.tree import MOVABLE, UrdfTree, read_origin
from picchio.robot.urdf.xml import children

_MOST_BYTES = 64 << 20
_FORMATS = (".dae", ".stl", ".obj", ".ply", ".off", ".glb", ".gltf", ".3mf")
# The attributes that give a primitive its size, and how many numbers each holds.
_ROUND = {"radius": 1, "length": 1}
_SIZES = {"box": {"size": 3}, "cylinder": _ROUND, "capsule": _ROUND, "sphere": {"radius": 1}}


@dataclass(frozen=True, eq=False)
class Shape:
    """One `<visual>` or `<collision>` of a link.

    Attributes:
        link: whose it is.
        matrix: (4, 4) in the link's frame, a mesh's scale included.
        kind: "box", "cylinder", "capsule", "sphere" or "mesh".
        size: m: three edges; radius and length along z, a capsule's without its round ends;
            radius; nothing of a mesh.
        file: the mesh's, or None.
    """

    link: str
    matrix: FloatArray
    kind: str
    size: tuple[float, ...]
    file: Path | None

    def parts(self) -> list[Any]:
        """Its trimesh meshes, in its own frame.

        Raises:
            InputError: as `load_parts`.
        """
        from trimesh import creation

        if self.file is not None:
            return load_parts(self.file)
        size = dict(zip(("radius", "height"), self.size, strict=False))
        match self.kind:
            case "box":
                return [creation.box(extents=self.size)]
            case "cylinder":
                return [creation.cylinder(**size, sections=40)]
            case "capsule":
                return [creation.capsule(**size)]
        return [creation.icosphere(**size, subdivisions=3)]


def read_shape(link: str, element: etree._Element, folder: Path) -> Shape:
    """The shape of a `<visual>` or `<collision>`.

    Args:
        link: whose it is.
        element: of the URDF.
        folder: the URDF's, for relative mesh addresses.

    Raises:
        InputError: no geometry, an unknown one, bad numbers, or no such mesh file.
    """
    key = f"link {link}"
    geometry = children(element, "geometry")
    found = [shape for shape in (geometry[0] if geometry else ()) if isinstance(shape.tag, str)]
    if not found:
        raise InputError(f"a <{element.tag}> has no <geometry>", key=key)
    matrix = origin(element)
    shape, kind = found[0], str(found[0].tag)
    if kind == "mesh":
        scale = finite_numbers(shape.get("scale", "1 1 1"), 3)
        file = resolve_mesh(shape.get("filename", ""), folder)
        return Shape(link, matrix @ np.diag([*scale, 1.0]), kind, (), file)
    if kind not in _SIZES:
        raise InputError("unknown shape", key=key, value=kind, choices=(*_SIZES, "mesh"))
    size = [finite_numbers(shape.get(name, ""), count) for name, count in _SIZES[kind].items()]
    return Shape(link, matrix, kind, tuple(np.concatenate(size).tolist()), None)


def load_parts(file: Path) -> list[Any]:
    """A mesh file's trimesh meshes.

    Args:
        file: of a known format, at most 64 MiB.

    Raises:
        InputError: missing, an unknown format, above 64 MiB, unreadable, without a triangle, or
            with a corner that is not finite or not there.
    """
    import trimesh

    if file.suffix.lower() not in _FORMATS:
        raise InputError("unknown mesh format", file=file, value=file.suffix, choices=_FORMATS)
    regular_file(file, limit=_MOST_BYTES)
    try:
        every = trimesh.load_scene(file).dump()
        parts = [p for p in every if isinstance(p, trimesh.Trimesh) and len(p.faces)]
        # An index beyond the vertices is an error here, not where the corner is used; so is a
        # vertex of two coordinates.
        corners = [np.asarray(part.vertices[part.faces]) for part in parts]
        finite = all(c.shape[1:] == (3, 3) and np.isfinite(c).all() for c in corners)
    except Exception as error:  # trimesh raises whatever its parsers do
        raise InputError(f"is not a readable mesh: {error}", file=file) from None
    if not parts or not finite:
        raise InputError("holds no finite triangles", file=file)
    return parts


def placement(xyz: ArrayLike, rpy: ArrayLike) -> FloatArray:
    """(4, 4) of a URDF origin: fixed-axis roll, pitch, yaw.

    Args:
        xyz: (3,) m.
        rpy: (3,) rad.
    """
    matrix = np.eye(4)
    matrix[:3, :3] = pin.rpy.rpyToMatrix(np.asarray(rpy, dtype=float))
    matrix[:3, 3] = xyz
    return matrix


def link_ends(tree: UrdfTree, tool: str) -> FloatArray:
    """(n, 3) m, where each link of the arm ends: the next joint, or the tool, in the link's frame.

    Args:
        tree: of the robot.
        tool: the frame whose chain of joints counts.
    """
    ends: list[FloatArray] = []
    matrix = None
    for joint in tree.chain(tool):
        step = placement(joint.xyz, joint.rpy)
        matrix = step if matrix is None else matrix @ step
        if joint.type in MOVABLE and joint.mimic is None:
            ends.append(matrix[:3, 3])
            matrix = np.eye(4)
    # Before the first joint stands the base.
    last = np.zeros(3) if matrix is None else matrix[:3, 3]
    return np.array([*ends[1:], last]).reshape(-1, 3)


def origin(element: etree._Element) -> FloatArray:
    """(4, 4) of an element's `<origin>`; the identity where it has none.

    Args:
        element: of the URDF.

    Raises:
        InputError: as `read_origin`.
    """
    return placement(*read_origin(element))


def finite_numbers(text: str, count: int) -> FloatArray:
    """Numbers (count,) from an attribute.

    Args:
        text: separated by white space.
        count: how many there must be.

    Raises:
        InputError: not finite, or not as many.
    """
    try:
        values = np.array([float(part) for part in text.split()])
    except ValueError:
        values = np.empty(0)
    if values.shape != (count,) or not np.isfinite(values).all():
        raise InputError(f"needs {count} finite numbers", value=text)
    return values
