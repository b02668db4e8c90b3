"""Meshes of URDFs: found, kept small, and what happens when they are missing or broken."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import picchio
from picchio.core.errors import PicchioWarning
from picchio.excitation.pulse_train import PulseTrain
from picchio.robot.urdf.addresses import resolve_mesh
from picchio.visuals.kinematics import frames, world
from picchio.visuals.scene.build import build_scene
from picchio.visuals.scene.robot.body import MOST_FACES, build_body, decimate
from picchio.visuals.scene.robot.mesh import sphere
from picchio.visuals.scene.robot.visuals import load_mesh

BLOWS = PulseTrain(300.0, 0.040, 0.004)


@pytest.mark.parametrize("name", ["ur10", "panda"])
def test_scene_is_small_and_no_mesh_is_in_it_twice(name: str) -> None:
    robot = picchio.load_robot(name)
    pose = robot.pose([0.3] * len(robot.joint_names))
    tree = frames(robot, pose)
    body = build_body(robot, pose, tree, world(tree))
    assert sum(len(body.shapes[k].faces) for _, k, _ in body.parts) <= MOST_FACES
    distinct = {shape.vertices.tobytes() for shape in body.shapes}
    assert len(distinct) == len(body.shapes)
    page = build_scene(
        robot, robot.pose([0.3] * len(robot.joint_names)), BLOWS, subdivisions=2
    ).html()
    assert len(page.encode()) < 2.5e6


def test_missing_meshes_become_bones_with_a_warning(missing_meshes: Path) -> None:
    flex = picchio.robot.loading.find.robots_folder() / "ur10" / "flex.toml"
    robot = picchio.load_robot(missing_meshes, flex=flex)
    with pytest.warns(PicchioWarning, match="drawn as a primitive") as seen:
        scene = build_scene(robot, robot.pose([0.2] * 6), BLOWS, subdivisions=2)
    told = " ".join(str(w.message) for w in seen)
    assert "forearm_link" in told
    assert "broken.stl" in told
    drawn = {item.node for item in scene.items if item.layer == "robot"}
    moving = {frame.path for frame in scene.frames if frame.axis is not None}
    assert moving <= drawn


def test_network_meshes_are_refused(tmp_path: Path) -> None:
    for address in ("http://example.org/a.stl", "https://example.org/a.stl"):
        with pytest.raises(picchio.InputError, match="not fetched"):
            resolve_mesh(address, tmp_path)
    with pytest.raises(picchio.InputError):
        resolve_mesh("package://nowhere/a.stl", tmp_path)


def test_package_is_found_above_the_urdf(tmp_path: Path) -> None:
    mesh = tmp_path / "my_robot" / "meshes" / "a.stl"
    mesh.parent.mkdir(parents=True)
    mesh.write_bytes(b"x")
    folder = tmp_path / "my_robot" / "urdf"
    folder.mkdir()
    assert resolve_mesh("package://my_robot/meshes/a.stl", folder) == mesh.resolve()


@given(st.floats(0.01, 0.5), st.integers(0, 3))
def test_decimation_moves_no_point_beyond_its_cell(cell: float, subdivisions: int) -> None:
    mesh = sphere(1.0, subdivisions=subdivisions)
    slim = decimate(mesh, cell)
    if not len(slim.faces):
        return
    distance = np.linalg.norm(slim.vertices[:, None] - mesh.vertices[None], axis=2).min(axis=1)
    assert distance.max() <= np.sqrt(3) * cell
    assert len(slim.faces) <= len(mesh.faces)
    assert slim.faces.max() == len(slim.vertices) - 1
    a, b, c = (slim.vertices[slim.faces[:, k]] for k in range(3))
    inward = np.einsum("fd,fd->f", np.cross(b - a, c - a), a + b + c) < -1e-9
    assert not inward.any() or cell > 0.2


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.zip", b"PK"),
        ("a.stl", b""),
        ("a.stl", b"solid a\nfacet normal nan nan nan\nendsolid"),
        ("a.obj", b"v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n"),
        ("a.dae", b"<COLLADA>"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 999999999\nend_header\n"),
    ],
)
def test_broken_meshes_are_told_in_one_line(tmp_path: Path, name: str, content: bytes) -> None:
    file = tmp_path / name
    file.write_bytes(content)
    with pytest.raises(picchio.InputError, match=name) as told:
        load_mesh(file)
    assert "\n" not in str(told.value)


def test_a_mesh_keeps_its_triangles(tmp_path: Path) -> None:
    file = tmp_path / "a.obj"
    file.write_text("v 0 0 0\nv 2 0 0\nv 0 3 0\nf 1 2 3\n")
    mesh = load_mesh(file)
    corners = mesh.vertices[mesh.faces[0]]
    area = 0.5 * np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0]))
    assert area == pytest.approx(3.0)
