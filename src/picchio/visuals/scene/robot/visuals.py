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
from picchio.robot.urdf.shapes import finite_numbers, load_parts, read_shape
from picchio.robot.urdf.xml import children, parse_urdf, read_urdf_bytes
from picchio.visuals.scene.robot.mesh import Mesh, merged

_GREY = "#aab2bb"


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
            except (InputError, OSError) as error:
                broken.append(name)
                warn_user(f"link {name!r} is drawn as a primitive: {error}")
    return found, broken


def load_mesh(file: Path) -> Mesh:
    """A mesh file as triangles with its own colours.

    Raises:
        InputError: as `load_parts`.
    """
    return merged([_part(part) for part in load_parts(file)])


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
    shape = read_shape(link, element, folder)
    material = children(element, "material")
    colour = None
    if material:
        colour = _colour(material[0]) or named.get(material[0].get("name", ""))
    if shape.file is not None:
        return Visual(link, shape.matrix, shape.file, colour)
    (part,) = shape.parts()
    drawn = Mesh(np.array(part.vertices), np.array(part.faces), colour=colour or _GREY)
    return Visual(link, shape.matrix, drawn, colour)


def _colour(element: etree._Element) -> str | None:
    found = children(element, "color")
    if not found:
        return None
    try:
        values = np.clip(finite_numbers(found[0].get("rgba", ""), 4)[:3], 0.0, 1.0)
    except InputError:
        return None
    return "#" + "".join(f"{round(255 * v):02x}" for v in values)
