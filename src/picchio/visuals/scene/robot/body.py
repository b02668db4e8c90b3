"""The robot's body: its meshes, small enough to mail; where they are missing, a skeleton."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError, warn_user
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.visuals.kinematics import Frame
from picchio.visuals.scene.robot.mesh import Mesh, merged, rgb, rod, sphere, turned_to
from picchio.visuals.scene.robot.visuals import Visual, load_mesh, read_visuals

MOST_FACES = 60_000
"""Triangles of the whole robot."""
_BONE = "#9aa6b2"
_GUN = "#3f4a57"


def decimate(mesh: Mesh, cell: float) -> Mesh:
    """The mesh with one vertex per cell of a grid (Rossignac and Borrel, 1993).

    Triangles that collapse are dropped.

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
    return replace(mesh, vertices=vertices[used], faces=renumbered.reshape(-1, 3), colours=colours)


@dataclass(frozen=True, eq=False)
class Body:
    """What is drawn of a robot.

    Attributes:
        shapes: distinct meshes, none twice.
        parts: (link, index of its mesh, (4, 4) in the link's frame).
        reach: m, size of the robot.
    """

    shapes: list[Mesh]
    parts: list[tuple[str, int, FloatArray]]
    reach: float


def build_body(
    robot: FlexibleRobot, pose: FloatArray, frames: list[Frame], places: dict[str, FloatArray]
) -> Body:
    """Meshes and primitives of the URDF; bones for links whose mesh is missing or broken.

    Args:
        robot: the robot.
        pose: (nv,) rad or m.
        frames: its links' frames.
        places: (4, 4) world placement of every link.
    """
    visuals, broken = read_visuals(robot)
    points = np.array([place[:3, 3] for place in places.values()])
    points = np.vstack([points, [robot.state(pose).tool_position]])
    reach = float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0
    shapes: list[Mesh] = []
    parts: list[tuple[str, int, FloatArray]] = []
    known: dict[object, int] = {}
    for visual in visuals:
        if visual.link not in places:
            continue
        key = (visual.shape, visual.colour)
        if key not in known:
            try:
                shape = _shape(visual)
            except (InputError, OSError) as error:
                broken.append(visual.link)
                warn_user(f"link {visual.link!r} is drawn as a primitive: {error}")
                continue
            known[key] = len(shapes)
            shapes.append(shape)
        parts.append((visual.link, known[key], visual.matrix))
    if robot.gun is not None and parts:
        # Without meshes it gets bones like every link.
        parts.append(
            (robot.tool_point, len(shapes), turned_to(np.array(robot.tool.axis), np.zeros(3)))
        )
        shapes.append(_gun(reach))
    shapes = _slim(shapes, parts)
    seen = {link for link, _, _ in parts}
    bare = set(broken) - seen if parts else {frame.link for frame in frames}
    for link in (frame.link for frame in frames if frame.link in bare):
        bones = _bones(robot, frames, link, 0.014 * reach)
        parts.append((link, len(shapes), np.eye(4)))
        shapes.append(bones)
    return Body(shapes, parts, reach)


def _shape(visual: Visual) -> Mesh:
    if isinstance(visual.shape, Mesh):
        return visual.shape
    mesh = load_mesh(visual.shape)
    if visual.colour is not None and visual.shape.suffix.lower() == ".stl":
        # An STL has no colour of its own; other formats know better than the URDF.
        return Mesh(mesh.vertices, mesh.faces, np.tile(rgb(visual.colour), (len(mesh.vertices), 1)))
    return mesh


def _slim(shapes: list[Mesh], parts: list[tuple[str, int, FloatArray]]) -> list[Mesh]:
    """Fewer triangles until all parts together are few enough; small shapes stay as they are."""
    scale = {index: float(np.abs(matrix[:3, :3]).max()) for _, index, matrix in parts}
    used = [index for _, index, _ in parts]
    # Exporters write every triangle's corners apart: joining equal ones costs nothing.
    slim = [decimate(shape, 1e-5 / scale.get(k, 1.0)) if len(shape.faces) > 400 else shape
            for k, shape in enumerate(shapes)]  # fmt: skip
    cell = 0.0015
    while sum(len(slim[index].faces) for index in used) > MOST_FACES and cell < 0.1:
        slim = [
            decimate(shape, cell / scale.get(k, 1.0)) if len(shape.faces) > 800 else shape
            for k, shape in enumerate(slim)
        ]
        cell *= 1.4
    return slim


def _gun(reach: float) -> Mesh:
    """The body of a gun, its striking end at the origin, the rest along -z."""
    long = 0.13 * reach
    barrel = rod(
        np.array([0.0, 0.0, -long]), np.array([0.0, 0.0, -0.25 * long]), 0.021 * reach, _GUN
    )
    nose = rod(np.array([0.0, 0.0, -0.25 * long]), np.zeros(3), 0.008 * reach, _BONE)
    return merged([barrel, nose])


def _bones(robot: FlexibleRobot, frames: list[Frame], link: str, radius: float) -> Mesh:
    """A knot at the link's own joint and a rod to everything that it carries."""
    own = next(frame for frame in frames if frame.link == link)
    knot = sphere(1.7 * radius if own.axis is not None else 0.8 * radius, _BONE)
    ends = [frame.matrix[:3, 3] for frame in frames if frame.path.rpartition("/")[0] == own.path]
    if robot.tool.frame == link:
        ends.append(np.array(robot.tool.xyz))
    origin = np.zeros(3)
    rods = [rod(origin, end, radius, _BONE) for end in ends if np.linalg.norm(end) > 2.0 * radius]
    return merged([knot, *rods])
