"""A URDF as `yourdfpy` holds it, once the strict reader has found nothing wrong with the file."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

from lxml import etree

from picchio.core.errors import InputError
from picchio.robot.urdf.addresses import resolve_mesh
from picchio.robot.urdf.tree import read_origin
from picchio.robot.urdf.xml import parse_urdf, read_urdf_bytes

if TYPE_CHECKING:
    import yourdfpy


def as_yourdfpy(file: Path) -> yourdfpy.URDF:
    """Links, joints, meshes and collision shapes, with a trimesh scene of them.

    Args:
        file: of the URDF; meshes are found as everywhere, those that are missing are left out.

    Returns:
        the file's robot, apart from ours: changing it changes nothing else.

    Raises:
        InputError: what yourdfpy has no room for, such as a capsule.
    """
    import yourdfpy

    root = parse_urdf(read_urdf_bytes(file), file)
    for origin in root.iter("origin"):
        xyz, rpy = read_origin(origin.getparent())  # a quaternion among them
        origin.attrib.pop("quat_xyzw", None)
        for key, values in (("xyz", xyz), ("rpy", rpy)):
            origin.set(key, " ".join(repr(float(value)) for value in values))
    for part in [*root.iter("visual"), *root.iter("collision")]:
        for mesh in part.iter("mesh"):
            try:
                mesh.set("filename", str(resolve_mesh(mesh.get("filename", ""), file.parent)))
            except InputError:
                part.getparent().remove(part)
    try:
        return yourdfpy.URDF.load(
            io.BytesIO(etree.tostring(root)),
            filename_handler=lambda fname: fname,
            build_collision_scene_graph=True,
        )
    except Exception as error:  # whatever its parser and trimesh raise
        raise InputError(f"yourdfpy does not take it: {error}", file=file) from None
