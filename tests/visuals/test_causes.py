"""Causes on the robot: each effect has a drawing, and each drawing is where the cause sits."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import picchio
from picchio.cli.main import run
from picchio.diagnosis.result import Cause, Diagnosis, Value
from picchio.excitation.pulse_train import PulseTrain
from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.registry import catalogue
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.visuals.diagnosis_file import read_diagnosis
from picchio.visuals.kinematics import world
from picchio.visuals.scene.build import build_scene

BLOWS = PulseTrain(300.0, 0.040, 0.004)
POSE = [-0.3, 0.6, -0.5]
TARGETS = {
    "joint": "joint_2", "joint pair": "joint_2", "link": "link_2", "joint or link": "joint_3",
    "tool": "tool", "robot": "robot", "axis": "ry", "channel group": "accelerometer.tool",
}  # fmt: skip
WRONG = [
    ("no json", "not valid JSON"),
    ("[1, 2]", "an object"),
    ('{"verdict": "named"}', "picchio-diagnosis/1"),
    ('{"format": "picchio-diagnosis/2", "verdict": "named", "causes": []}', "picchio-diagnosis/2"),
    ('{"format": "picchio-diagnosis/1", "verdict": "sure", "causes": []}', "verdict"),
    ('{"format": "picchio-diagnosis/1", "verdict": "named"}', "causes"),
    ('{"format": "picchio-diagnosis/1", "verdict": "named", "causes": [{"effect": "payload"}]}',
     "causes[0].target"),
    ('{"format": "picchio-diagnosis/1", "verdict": "named", "causes": '
     '[{"effect": "gremlin", "target": "tool"}]}', "gremlin"),
    ('{"format": "picchio-diagnosis/1", "verdict": "named", "causes": '
     '[{"effect": "backlash", "target": "elbow"}]}', "elbow"),
    ('{"format": "picchio-diagnosis/1", "verdict": "named", "causes": [], "alternatives": '
     '[[{"effect": "base_compliance", "target": "w"}]]}', "rx"),
]  # fmt: skip


def named(effect: str, target: str, unit: str = "1", **values: float) -> Diagnosis:
    parameters = {name: Value(value, 0.01, unit) for name, value in values.items()}
    return Diagnosis("named", (Cause(effect, target, 0.99, parameters),))


def drawn(robot: FlexibleRobot, found: Diagnosis, layer: str = "causes", **options):
    """The scene, and its causes' meshes in world coordinates."""
    scene = build_scene(robot, POSE, BLOWS, diagnosis=found, subdivisions=1, **options)
    places = world(scene.frames)
    at = {frame.path: places[frame.link] for frame in scene.frames} | {"": np.eye(4)}
    shapes = []
    for item in scene.items:
        if item.layer == layer:
            mesh, place = scene.meshes[item.mesh], at[item.node] @ item.matrix
            moved = mesh.vertices @ place[:3, :3].T + place[:3, 3]
            shapes.append(trimesh.Trimesh(moved, mesh.faces, process=False))
    return scene, shapes


@pytest.mark.parametrize("effect", sorted(catalogue()))
def test_every_effect_has_a_drawing_and_a_label(arm: SimpleNamespace, effect: str) -> None:
    target = TARGETS[catalogue()[effect].target_kind]
    scene, shapes = drawn(arm.robot, named(effect, target))
    assert shapes
    for shape in shapes:
        assert np.isfinite(shape.vertices).all()
        assert 0.005 < shape.extents.max() < scene.reach
    (label,) = (label for label in scene.labels if label["layer"] == "causes")
    assert label["text"] == effect.replace("_", " ")
    assert [i for i, _, on in scene.layers if on] == ["causes", "robot", "tool"]
    assert not scene.playing


@pytest.mark.parametrize(
    ("effect", "target", "frame"),
    [
        ("joint_stiffness", "joint_3", "link_3"),
        ("backlash", "joint_2", "link_2"),
        ("transverse_compliance", "joint_2", "link_2"),
        ("payload", "tool", "tool"),
        ("sensor_gain", "accelerometer.link_2", "link_2"),
        ("sensor_delay", "force", "tool"),
        ("encoder_delay", "position.joint_3", "link_3"),
    ],
)
def test_it_sits_where_pinocchio_has_the_frame(arm, effect: str, target: str, frame: str) -> None:
    scene, shapes = drawn(arm.robot, named(effect, target))
    position, _ = arm.robot.frame_placement(POSE, frame)
    middle = np.mean([shape.bounds.mean(axis=0) for shape in shapes], axis=0)
    np.testing.assert_allclose(middle, position, atol=0.03 * scene.reach)
    # And it moves with that link when the arm vibrates.
    path = next(f.path for f in scene.frames if f.link == frame)
    assert {item.node for item in scene.items if item.layer == "causes"} == {path}


def test_a_spring_lies_about_the_joints_axis(arm: SimpleNamespace) -> None:
    scene, (shape,) = drawn(arm.robot, named("joint_stiffness", "joint_2"))
    position, axes = arm.robot.frame_placement(POSE, "link_2")
    axis = axes @ np.array(arm.robot.tree.joints["joint_2"].axis)
    away = shape.vertices - position
    radius = np.linalg.norm(away - np.outer(away @ axis, axis), axis=1)
    # No further in or out than the wire is thick.
    assert np.ptp(radius) <= 2.02 * 0.006 * scene.reach < 0.5 * radius.min()
    assert shape.is_watertight


def test_a_mass_is_a_ball_of_steel(arm: SimpleNamespace) -> None:
    for mass in (4.0, 20.0, -4.0):
        scene, (shape,) = drawn(arm.robot, named("payload", "tool", "kg", mass=mass))
        assert shape.volume * 7850.0 == pytest.approx(abs(mass), rel=0.06)  # 320 flat faces
        item = next(item for item in scene.items if item.layer == "causes")
        assert (scene.meshes[item.mesh].opacity < 0.5) == (mass < 0.0)
    own = arm.robot.tree.links["link_2"]
    _, (shape,) = drawn(arm.robot, named("link_mass", "link_2", scale=1.0 + 10.0 / own.mass))
    assert shape.volume * 7850.0 == pytest.approx(10.0, rel=0.06)
    position, axes = arm.robot.frame_placement(POSE, "link_2")
    np.testing.assert_allclose(shape.centroid, position + axes @ np.array(own.xyz), atol=1e-9)


def test_an_offset_points_along_the_tools_axes_and_says_its_scale(arm: SimpleNamespace) -> None:
    offset = np.array([0.02, -0.03, 0.01])
    found = named("tool_offset", "tool", "m", **dict(zip("xyz", offset, strict=True)))
    scene, shapes = drawn(arm.robot, found)
    state = arm.robot.state(POSE)
    way = shapes[1].centroid - state.tool_position  # the ball at its end
    times = np.linalg.norm(way) / np.linalg.norm(offset)
    np.testing.assert_allclose(way, times * state.tool_rotation @ offset, atol=1e-9)
    (line,) = scene.diagnosis["lines"]
    assert line["text"] == (
        f"tool offset: x 0.02, y \N{MINUS SIGN}0.03, z 0.01 m (drawn {times:.0f} times as long)"
    )


def test_the_force_is_drawn_as_stated_and_as_found(arm: SimpleNamespace) -> None:
    turn = np.array([0.3, -0.2, 0.1])
    found = named("force_direction", "tool", "rad",
                  **dict(zip(("rx", "ry", "rz"), turn, strict=True)))  # fmt: skip
    stated = np.array([0.0, 0.0, 1.0])
    _, shapes = drawn(arm.robot, found, direction=stated)
    axes = arm.robot.state(POSE).tool_rotation
    expected = axes @ Rotation.from_rotvec(turn).as_matrix() @ axes.T @ stated
    for shape, way in zip(shapes, (stated, expected), strict=True):
        # Thick and pointed at the tool, long along the direction.
        lengths = shape.vertices @ way
        assert np.ptp(lengths) == pytest.approx(
            np.linalg.norm(np.ptp(shape.vertices, axis=0)), rel=0.2
        )
        tip = shape.vertices[lengths.argmax()]
        off = tip - arm.robot.state(POSE).tool_position
        np.testing.assert_allclose(off, -np.linalg.norm(off) * way, atol=1e-9)


@pytest.mark.parametrize("axis", ["x", "y", "z", "rx", "ry", "rz"])
def test_the_bases_axis_is_seen(arm: SimpleNamespace, axis: str) -> None:
    scene, (shape,) = drawn(arm.robot, named("base_compliance", axis))
    sides = shape.extents
    k = "xyz".index(axis[-1])
    # A bar is long along its axis; a ring is flat along it.
    assert (sides.argmin() if axis.startswith("r") else sides.argmax()) == k
    word = "about" if axis.startswith("r") else "along"
    assert scene.diagnosis["lines"][0]["text"] == f"base compliance {word} {axis[-1]}"


def test_a_cable_goes_from_the_link_to_the_ground(arm: SimpleNamespace) -> None:
    scene, (shape,) = drawn(arm.robot, named("cable", "link_3"))
    position, _ = arm.robot.frame_placement(POSE, "link_3")
    away = np.linalg.norm(shape.vertices - position, axis=1)
    assert away.min() < 1e-6 * scene.reach  # the end's middle; 16-bit vertices come later
    assert shape.bounds[0, 2] == pytest.approx(0.0, abs=0.02)


class Gremlin(Effect):
    name = "gremlin"
    where = "structure"
    target_kind = "link"
    parameters = (Parameter("count", meaning="how many"),)
    meaning = "somebody else's effect"


def test_an_effect_from_elsewhere_is_drawn_by_its_kind(arm, monkeypatch) -> None:
    known = {**catalogue(), "gremlin": Gremlin}
    monkeypatch.setattr("picchio.model.effects.registry.catalogue", lambda: known)
    scene, (shape,) = drawn(arm.robot, named("gremlin", "link_2", count=3.0))
    position, axes = arm.robot.frame_placement(POSE, "link_2")
    mass = arm.robot.tree.links["link_2"]
    np.testing.assert_allclose(shape.centroid, position + axes @ np.array(mass.xyz), atol=1e-9)
    assert scene.diagnosis["lines"][0]["text"] == "gremlin of link_2: count 3"


def test_rivals_and_leads_are_layers_of_their_own(arm: SimpleNamespace) -> None:
    found = Diagnosis("ambiguous", (Cause("payload", "tool", 0.9),),
                      ((("cable", "link_3"), ("payload", "tool")),),
                      (("backlash", "joint_1"),))  # fmt: skip
    scene, _ = drawn(arm.robot, found)
    shown = {i: on for i, _, on in scene.layers}
    assert (shown["causes"], shown["alternatives"], shown["leads"]) == (True, True, False)
    assert [line["layer"] for line in scene.diagnosis["lines"]] == [
        "causes", "alternatives", "leads",
    ]  # fmt: skip
    assert scene.diagnosis["verdict"].startswith("ambiguous")
    scene, shapes = drawn(arm.robot, Diagnosis("nothing-wrong"))
    assert shapes == [] and scene.swatches == {}


def test_it_is_drawn_on_a_gun_and_on_a_slide(recoiling) -> None:
    scene = build_scene(recoiling, [*POSE], BLOWS, hits=2, subdivisions=1,
                        diagnosis=named("joint_stiffness", "gun_recoil"))  # fmt: skip
    item = next(item for item in scene.items if item.layer == "causes")
    assert item.node == scene.frames[-1].path


def test_a_file_comes_back_as_it_was_written(arm: SimpleNamespace, tmp_path: Path) -> None:
    found = Diagnosis("ambiguous", named("payload", "tool", "kg", mass=4.0).causes,
                      ((("cable", "link_3"),),), (("backlash", "joint_1"),))  # fmt: skip
    content = found.to_dict() | {"scores": [], "provenance": {}, "somebody's": 1}
    path = tmp_path / "found.json"
    path.write_text(json.dumps(content))
    assert read_diagnosis(path, arm.robot) == found
    # JSON has no infinity: null.
    content["causes"][0]["parameters"]["mass"]["value"] = None
    path.write_text(json.dumps(content))
    assert dict(read_diagnosis(path, arm.robot).causes[0].parameters) == {}


def test_view_draws_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = tmp_path / "found.json", tmp_path / "scene.html"
    path.write_text(json.dumps(named("payload", "tool", "kg", mass=4.0).to_dict()))
    assert run(["view", "fanuc_like_3dof", "--pose=-0.3,0.6,-0.5", "--diagnosis", str(path),
                "--out", str(out), "--json", "-"]) == 0  # fmt: skip
    layers = json.loads(capsys.readouterr().out)["layers"]
    assert layers[0]["id"] == "causes"
    assert "payload: mass 4 kg" in out.read_text()


@pytest.mark.parametrize(("content", "told"), WRONG)
def test_a_wrong_file_is_one_line_and_no_picture(
    content: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = tmp_path / "found.json", tmp_path / "scene.html"
    path.write_text(content)
    assert run(["view", "fanuc_like_3dof", "--pose=-0.3,0.6,-0.5", "--diagnosis", str(path),
                "--out", str(out)]) == 2  # fmt: skip
    said = capsys.readouterr()
    errors = [line for line in said.err.splitlines() if "error" in line]
    assert len(errors) == 1
    assert "found.json" in errors[0] and told in errors[0]
    assert not out.exists() and said.out == ""


def test_names_are_data(hostile_urdf: Path) -> None:
    robot = picchio.load_robot(hostile_urdf)
    target = robot.flexible_names[0]
    found = named("backlash", target, "</script><script>alert(1)</script>", gap=1e-3)
    page = build_scene(robot, [0.3, 0.3, 0.3], BLOWS, subdivisions=1, diagnosis=found).html()
    from lxml import html as lxml_html

    tree = lxml_html.fromstring(page)
    assert len(tree.xpath("//script")) == 4
    data = json.loads(tree.xpath("//script[@id='data']")[0].text)
    assert data["diagnosis"]["lines"][0]["text"].startswith(f"backlash of {target}: gap 0.001")
