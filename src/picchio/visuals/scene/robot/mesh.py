"""Triangles to draw, and the few shapes that picchio draws itself."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from picchio.core.arrays import FloatArray, IndexArray

GREY = "#b8c0c8"


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles with a colour.

    Attributes:
        vertices: (v, 3), in the mesh's own unit (m, or rad for an envelope).
        faces: (f, 3) indices.
        colours: (v, 3) 0 to 255, or None for one colour.
        colour: of the whole, "#rrggbb".
        opacity: below 1 it is drawn translucent.
        exact: keep the vertices as 32-bit floats; else 16-bit integers within the bounding cube.
        crease: degrees; edges sharper than this are drawn sharp.
    """

    vertices: FloatArray
    faces: IndexArray
    colours: FloatArray | None = None
    colour: str = GREY
    opacity: float = 1.0
    exact: bool = False
    crease: float = 40.0


def merged(meshes: list[Mesh]) -> Mesh:
    """One mesh of several opaque ones, colours kept vertex by vertex."""
    offset = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces + o for m, o in zip(meshes, offset, strict=False)]),
        np.concatenate([m.colours if m.colours is not None else _uniform(m) for m in meshes]),
    )


def moved(mesh: Mesh, matrix: FloatArray) -> Mesh:
    """The mesh after a (4, 4) transform; a mirror image keeps its outside outside."""
    vertices = mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3]
    faces = mesh.faces[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else mesh.faces
    return replace(mesh, vertices=vertices, faces=faces)


def box(size: FloatArray, colour: str = GREY) -> Mesh:
    """A box of (3,) side lengths about the origin."""
    return _shape("box", colour, extents=size)


def sphere(radius: float, colour: str = GREY, subdivisions: int = 2) -> Mesh:
    """A sphere about the origin."""
    return _shape("icosphere", colour, subdivisions=subdivisions, radius=radius)


def cylinder(radius: float, length: float, colour: str = GREY, sections: int = 40) -> Mesh:
    """A cylinder along z about the origin."""
    return _shape("cylinder", colour, radius=radius, height=length, sections=sections)


def rod(start: FloatArray, end: FloatArray, radius: float, colour: str = GREY) -> Mesh:
    """A cylinder between two points."""
    along = end - start
    mesh = cylinder(radius, float(np.linalg.norm(along)), colour)
    return moved(mesh, turned_to(along, 0.5 * (start + end)))


def arrow(length: float, radius: float, colour: str = GREY, *, head: float | None = None) -> Mesh:
    """An arrow from the origin along +z, its tip at `length`."""
    tip = min(head or 5.0 * radius, 0.7 * length)
    shaft = cylinder(radius, length - tip, colour, sections=20)
    point = _shape("cone", colour, radius=0.42 * tip, height=tip, sections=32)
    shaft.vertices[:, 2] += 0.5 * (length - tip)
    point.vertices[:, 2] += length - tip
    return merged([shaft, point])


def ring(radius: float, thickness: float, colour: str) -> Mesh:
    """A torus about z."""
    return _shape("torus", colour, major_radius=radius, minor_radius=thickness, major_sections=56,
                  minor_sections=12)  # fmt: skip


def turned_to(axis: FloatArray, position: FloatArray) -> FloatArray:
    """(4, 4) transform that takes +z to an axis and the origin to a position."""
    z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    helper = np.array([1.0, 0.0, 0.0]) if abs(z[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = np.cross(helper, z)
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    matrix[:3, 3] = position
    return matrix


def rgb(colour: str) -> FloatArray:
    """(3,) 0 to 255 of "#rrggbb"."""
    return np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)], dtype=float)


def _uniform(mesh: Mesh) -> FloatArray:
    return np.tile(rgb(mesh.colour), (len(mesh.vertices), 1))


def _shape(kind: str, colour: str, **sizes: Any) -> Mesh:
    """What trimesh makes."""
    from trimesh import creation

    made = getattr(creation, kind)(**sizes)
    return Mesh(np.array(made.vertices, dtype=float), np.array(made.faces), colour=colour)
