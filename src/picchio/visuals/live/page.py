"""The page of an exploration: meshcat's viewer, the robot's body, the controls."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np

from picchio.robot.annotations.flexibility import estimate_notice
from picchio.studies.envelopes import icosphere
from picchio.visuals.kinematics import frames, world
from picchio.visuals.live.session import COARSE, FINE, Session
from picchio.visuals.scene.overlay import Scale, ring_radius
from picchio.visuals.scene.page import Packer, _matrix, page_html
from picchio.visuals.scene.robot.body import build_body
from picchio.visuals.scene.robot.mesh import ring, turned_to

_SCRIPTS = ("1-parts.js", "2-talk.js", "3-hands.js", "4-panel.js", "5-keep.js")


def live_html(session: Session) -> str:
    """The page; every name in it is data, never markup or code.

    Args:
        session: its robot's meshes are read here.

    Returns:
        HTML that needs nothing but itself and the server's socket.
    """
    packer = Packer()
    data = _data(session, packer)
    return page_html(
        "picchio.visuals.live", _SCRIPTS, packer,
        kind="explore",
        told=escape(f"3-D robot {session.robot.name}: drag the tool or the arrow"),
        data=data,
        policy="",  # the server's, which names its own socket
        notice=escape(data["notice"]),
    )  # fmt: skip


def _data(session: Session, packer: Packer) -> dict[str, Any]:
    robot, pose = session.robot, session.place.pose
    tree = frames(robot, pose)
    places = world(tree)
    body = build_body(robot, pose, tree, places)
    nodes: list[dict[str, Any]] = []
    names = {frame.link: k for k, frame in enumerate(tree)}
    for frame in tree:
        moved = frame.axis is not None and frame.joint in robot.tree.joints
        row, shift = robot.rigid.followed(str(frame.joint)) if moved else (np.zeros(0), 0.0)
        nodes.append({
            "parent": next((k for k, other in enumerate(tree)
                            if other.path == frame.path.rpartition("/")[0]), None),
            "matrix": _matrix(frame.matrix), "prismatic": frame.prismatic,
            "axis": frame.axis.tolist() if moved and frame.axis is not None else None,
            "row": row.tolist(), "shift": shift,
        })  # fmt: skip
    items = [{"mesh": k, "frame": names[link], "matrix": _matrix(matrix)}
             for link, k, matrix in body.parts]  # fmt: skip
    meshes = [packer.add_mesh(shape) for shape in body.shapes]
    rings: list[dict[str, Any] | None] = []
    by_joint = {frame.joint: frame for frame in tree}
    for name in robot.flexible_names:
        own = by_joint.get(name)
        if own is None or own.axis is None:
            rings.append(None)
            continue
        meshes.append(packer.add_mesh(ring(ring_radius(own, body), 0.012 * body.reach, "#888888")))
        rings.append({"mesh": len(meshes) - 1, "frame": names[own.link],
                      "matrix": _matrix(turned_to(own.axis, np.zeros(3)))})  # fmt: skip
    spheres = {}
    for fineness in (COARSE, FINE):
        corners, faces = icosphere(fineness)
        spheres[fineness] = {
            "vertices": packer.add(corners, "f4"),
            "faces": packer.add(faces, "u4"),
        }
    lower = np.where(np.isfinite(robot.lower), robot.lower, -np.pi)
    upper = np.where(np.isfinite(robot.upper), robot.upper, np.pi)
    points = np.array([place[:3, 3] for place in places.values()])
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    view = np.array([0.55, -1.0, 0.5])
    eye = middle + 2.1 * body.reach * view / np.linalg.norm(view)
    return {
        "title": robot.name,
        "notice": estimate_notice(robot.name, robot.origins),
        "frames": nodes, "meshes": meshes, "items": items, "rings": rings, "spheres": spheres,
        "reach": body.reach,
        "camera": [eye.tolist(), middle.tolist()],
        "floor": {"cell": 0.1 * body.reach, "squares": 24, "at": [0.0, 0.0, float(points[0][2])]},
        "joints": [{"name": name, "lower": float(low), "upper": float(high),
                    "unit": "m" if _slides(robot, name) else "rad"}
                   for name, low, high in zip(robot.joint_names, lower, upper, strict=True)],
        "flexible": [{"name": j.name, "small": j.units.small} for j in robot.flexible_joints],
        "models": list(session.studies),
        "slow": [name for name, study in session.studies.items() if not study.fast],
        "aims": session.follower.aims,
        "collisions": session.why_none,
        "file": session.file.name,
        "colours": Scale("utilisation", "%", 100.0).to_dict()["colours"],
    }  # fmt: skip


def _slides(robot: Any, name: str) -> bool:
    joint = robot.tree.joints.get(name)
    return joint is None or joint.type == "prismatic"
