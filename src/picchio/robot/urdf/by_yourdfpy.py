"""A URDF as `yourdfpy` holds it, once the strict reader has found nothing wrong with the file."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

from lxml import etree

from picchio.core.errors import InputError, warn_user
from picchio.robot.urdf.addresses import resolve_mesh
from picchio.robot.urdf.tree import read_origin
from picchio.robot.urdf.xml import children, parse_urdf, read_urdf_bytes

if TYPE_CHECKING:
    import yourdfpy


def as_yourdfpy(file: Path) -> yourdfpy.URDF:
    """Links, joints, meshes and collision shapes, with a trimesh scene of them.

    Args:
        file: of the URDF; meshes are found as everywhere, and a warning names each that is missing.

    Returns:
        the file's robot, apart from ours: changing it changes nothing else.

    Raises:
        InputError: what yourdfpy has no room for, such as a capsule.
    """
    import yourdfpy

    root = parse_urdf(read_urdf_bytes(file), file)
    for part in root.iter("joint", "inertial", "visual", "collision"):
        for origin in children(part, "origin"):
            xyz, rpy = read_origin(part)  # a quaternion among them
            origin.attrib.pop("quat_xyzw", None)
            for key, values in (("xyz", xyz), ("rpy", rpy)):
                origin.set(key, " ".join(repr(float(value)) for value in values))
    for part in [*root.iter("visual"), *root.iter("collision")]:
        for mesh in part.iter("mesh"):
            try:
                mesh.set("filename", str(resolve_mesh(mesh.get("filename", ""), file.parent)))
            except InputError as error:
                link = part.getparent()
                link.remove(part)
                warn_user(f"link {link.get('name')!r}: a <{part.tag}> is left out: {error}")
    try:
        return yourdfpy.URDF.load(
            io.BytesIO(etree.tostring(root)),
            filename_handler=lambda fname: fname,
            build_collision_scene_graph=True,
        )
    except Exception as error:  # whatever its parser and trimesh raise
        raise InputError(f"yourdfpy does not take it: {error}", file=file) from None
