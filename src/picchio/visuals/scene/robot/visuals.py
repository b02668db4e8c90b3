"""The visuals of a URDF's links: primitives and meshes, read only for drawing."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError, warn_user
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.loading.find import resolve_package
from picchio.robot.urdf.xml import children, parse_urdf, read_urdf_bytes
from picchio.visuals.kinematics import placement
from picchio.visuals.scene.robot.mesh import Mesh, box, cylinder, merged, sphere

_MOST_BYTES = 64 << 20
_GREY = "#aab2bb"
_FORMATS = (".dae", ".stl", ".obj", ".ply", ".off", ".glb", ".gltf", ".3mf")


@dataclass(frozen=True, eq=False)
class Visual:
    """One drawable thing of a link.

    Attributes:
        link: whose it is.
        matrix: (4, 4) in the link's frame, scale included.
        shape: the mesh file, or a primitive.
        colour: of the URDF, or None for the mesh's own.
    """

    link: str
    matrix: FloatArray
    shape: Path | Mesh
    colour: str | None


def read_visuals(robot: FlexibleRobot) -> tuple[list[Visual], list[str]]:
    """Everything visible, and the links of which a part cannot be found (with a warning each)."""
    root = parse_urdf(read_urdf_bytes(robot.source), robot.source)
    named = {
        element.get("name", ""): colour
        for element in children(root, "material")
        if (colour := _colour(element)) is not None
    }
    found: list[Visual] = []
    broken: list[str] = []
    for link in children(root, "link"):
        name = link.get("name", "")
        for element in children(link, "visual"):
            try:
                found.append(_visual(name, element, named, robot.source.parent))
            except (InputError, ValueError, OSError) as error:
                broken.append(name)
                warn_user(f"link {name!r} is drawn as a primitive: {error}")
    return found, broken


def load_mesh(file: Path) -> Mesh:
    """A mesh file as triangles with its own colours.

    Raises:
        InputError: an unknown format, unreadable, empty, not finite, or above 64 MiB.
    """
    import trimesh

    if file.suffix.lower() not in _FORMATS:
        raise InputError("unknown mesh format", file=file, value=file.suffix, choices=_FORMATS)
    if file.stat().st_size > _MOST_BYTES:
        raise InputError("the mesh is above 64 MiB", file=file)
    try:
        meshes = [
            _part(part)
            for part in trimesh.load_scene(file).dump()
            if isinstance(part, trimesh.Trimesh) and len(part.faces)
        ]
    except Exception as error:  # trimesh raises whatever its parsers do
        raise InputError(f"is not a readable mesh: {error}", file=file) from None
    if not meshes or not all(np.isfinite(mesh.vertices).all() for mesh in meshes):
        raise InputError("holds no finite triangles", file=file)
    return merged(meshes)


def _part(part: Any) -> Mesh:
    colour = np.array([170.0, 178.0, 187.0])
    material = getattr(part.visual, "material", None)
    if material is not None and getattr(material, "main_color", None) is not None:
        colour = np.asarray(material.main_color[:3], dtype=np.float64)
    elif part.visual.kind in ("face", "vertex"):
        colour = np.asarray(part.visual.main_color[:3], dtype=np.float64)
    vertices = np.array(part.vertices, dtype=np.float64)
    return Mesh(vertices, np.array(part.faces), np.tile(colour, (len(vertices), 1)))


def _visual(link: str, element: etree._Element, named: dict[str, str], folder: Path) -> Visual:
    geometry = children(element, "geometry")
    shapes = [shape for shape in (geometry[0] if geometry else ()) if isinstance(shape.tag, str)]
    if not shapes:
        raise InputError("a <visual> has no <geometry>", key=f"link {link}")
    matrix = _origin(element)
    material = children(element, "material")
    colour = None
    if material:
        colour = _colour(material[0]) or named.get(material[0].get("name", ""))
    shape, kind = shapes[0], shapes[0].tag
    if kind == "mesh":
        scale = _numbers(shape.get("scale", "1 1 1"), 3)
        file = resolve_mesh(shape.get("filename", ""), folder)
        return Visual(link, matrix @ np.diag([*scale, 1.0]), file, colour)
    paint = colour or _GREY
    if kind == "box":
        mesh = box(_numbers(shape.get("size", ""), 3), paint)
    elif kind == "cylinder":
        radius, length = (_numbers(shape.get(key, ""), 1)[0] for key in ("radius", "length"))
        mesh = cylinder(float(radius), float(length), paint)
    elif kind == "sphere":
        mesh = sphere(float(_numbers(shape.get("radius", ""), 1)[0]), paint, 3)
    else:
        raise InputError("unknown shape", key=f"link {link}", value=kind,
                         choices=("box", "cylinder", "sphere", "mesh"))  # fmt: skip
    return Visual(link, matrix, mesh, colour)


def resolve_mesh(address: str, folder: Path) -> Path:
    """The file behind a mesh address of a URDF in `folder`.

    Raises:
        InputError: not a local file, or not there.
    """
    if address.startswith(("http:", "https:", "ftp:")):
        raise InputError("meshes are not fetched from the network", value=address)
    if address.startswith("package://"):
        try:
            return resolve_package(address)
        except InputError:
            # A checkout keeps its packages above its URDF.
            inside = address.removeprefix("package://")
            for above in folder.resolve().parents:
                for path in (above / inside, above / inside.partition("/")[2]):
                    if path.is_file():
                        return path
            raise
    path = folder / address.removeprefix("file://")
    if not path.is_file():
        raise InputError("no such mesh file", value=address)
    return path


def _origin(element: etree._Element) -> FloatArray:
    found = children(element, "origin")
    if not found:
        return np.eye(4)
    xyz = _numbers(found[0].get("xyz", "0 0 0"), 3)
    return placement(xyz, _numbers(found[0].get("rpy", "0 0 0"), 3))


def _numbers(text: str, count: int) -> FloatArray:
    values = np.array([float(part) for part in text.split()])
    if values.shape != (count,) or not np.isfinite(values).all():
        raise InputError(f"needs {count} finite numbers", value=text)
    return values


def _colour(element: etree._Element) -> str | None:
    found = children(element, "color")
    if not found:
        return None
    try:
        values = np.clip(_numbers(found[0].get("rgba", ""), 4)[:3], 0.0, 1.0)
    except (InputError, ValueError):
        return None
    return "#" + "".join(f"{round(255 * v):02x}" for v in values)
