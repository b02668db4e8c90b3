"""Robots that other packages hold: a `yourdfpy.URDF`, and a Pinocchio model beside its URDF."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import pinocchio as pin
from lxml import etree

from picchio.core.errors import InputError
from picchio.core.files import temporary_folder
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.loading.find import typed_name

if TYPE_CHECKING:
    import yourdfpy

RobotLike: TypeAlias = (
    "str | Path | FlexibleRobot | yourdfpy.URDF | tuple[pin.Model | pin.RobotWrapper, str | Path]"
)
"""What goes wherever a robot goes; see `picchio.load_robot`."""


def named(robot: RobotLike) -> str | Path:
    """The name or file by which a robot can be found.

    Args:
        robot: a name or path, or what another package holds.

    Raises:
        InputError: no robot at all; a Pinocchio model that is not its URDF's.
    """
    if isinstance(robot, (str, Path)):
        return robot
    if isinstance(robot, FlexibleRobot):
        return typed_name(robot.name, robot.source)
    if isinstance(robot, tuple) and len(robot) == 2:
        _check_same(robot[0], Path(robot[1]))
        return robot[1]
    package = sys.modules.get("yourdfpy")  # whoever holds one has imported it
    if package is not None and isinstance(robot, package.URDF):
        return _written(robot)
    raise InputError(
        "is no robot",
        key="ROBOT",
        value=type(robot).__name__,
        choices=[
            "a name",
            "a path",
            "a loaded robot",
            "a yourdfpy.URDF",
            "(a Pinocchio model, its URDF's path)",
        ],
    )


def _written(urdf: yourdfpy.URDF) -> Path:
    """A `yourdfpy.URDF` as a file that lasts as long as this process, its meshes by their paths."""
    root = urdf.write_xml().getroot()
    for mesh in root.iter("mesh"):
        mesh.set("filename", str(Path(mesh.get("filename")).absolute()))
    for joint in root.iter("joint"):  # yourdfpy writes all of a joint but what it mimics
        if (mimic := urdf.joint_map[joint.get("name")].mimic) is not None:
            urdf._write_mimic(joint, mimic)
    name = "".join(c if c.isalnum() or c in "-_" else "_" for c in root.get("name") or "") or "it"
    file = temporary_folder() / f"{name}.urdf"
    file.write_bytes(etree.tostring(root, xml_declaration=True, encoding="utf-8"))
    return file


def _check_same(model: Any, urdf: Path) -> None:
    """Refuse a Pinocchio model (or what has one as its `model`) that is not the URDF's."""
    if not urdf.is_file():
        raise InputError("no such file", file=urdf)
    given, own = getattr(model, "model", model), pin.buildModelFromUrdf(str(urdf))
    names, expected = list(given.names), list(own.names)
    if names != expected:
        odd = next((n for n in [*names, *expected] if (n in names) != (n in expected)), names[-1])
        raise InputError(
            "only one of the Pinocchio model and its URDF has this joint here",
            file=urdf,
            key="joint",
            value=odd,
            hint="give the model as `pinocchio.buildModelFromUrdf` makes it",
        )
    for what in ("jointPlacements", "inertias"):
        for name, one, other in zip(names, getattr(given, what), getattr(own, what), strict=True):
            if not one.isApprox(other, 1e-6):
                raise InputError(
                    f"the Pinocchio model has other {what} than its URDF",
                    file=urdf,
                    key="joint",
                    value=name,
                    hint="change masses with [link.NAME] of a sidecar",
                )
