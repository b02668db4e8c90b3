"""The scene's data: exact envelopes, Pinocchio's frames, names that are only data."""

from __future__ import annotations

import base64
import json
import re
import zlib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lxml import html as lxml_html

import picchio
from picchio.excitation.pulse_train import HalfSineTrain, PulseTrain
from picchio.studies.envelopes import envelope as envelope_of
from picchio.studies.envelopes import icosphere
from picchio.visuals.kinematics import frames, world
from picchio.visuals.scene.build import build_scene
from picchio.visuals.scene.compare import compare_scene
from picchio.visuals.scene.live import controls
from picchio.visuals.scene.page import script_json
from picchio.visuals.scene.robot.mesh import arrow, turned_to

BLOWS = PulseTrain(300.0, 0.040, 0.004)


@pytest.fixture(scope="module")
def scene(arm: SimpleNamespace):
    operation = arm.worst.operation
    return build_scene(arm.robot, arm.worst.pose, operation.excitation, hits=12,
                       direction=operation.direction, assessment=arm.assessment,
                       subdivisions=3)  # fmt: skip


def unpack(page: str):
    """The page's data, and a function that reads its arrays, as the script does."""
    tree = lxml_html.fromstring(page)
    data = json.loads(tree.xpath("//script[@id='data']")[0].text)
    packed = zlib.decompress(base64.b64decode(tree.xpath("//script[@id='arrays']")[0].text))

    def array(reference):
        kind, offset, count = reference
        return np.frombuffer(packed, dtype=f"<{kind}", count=count, offset=offset)

    return data, array


@pytest.mark.parametrize("blows", [BLOWS, HalfSineTrain(200.0, 0.03, 0.006)])
@pytest.mark.parametrize("hits", [None, 1, 12])
@pytest.mark.parametrize("name", ["fanuc_like_3dof", "ur10"])
def test_surface_is_the_support_function(name: str, hits: int | None, blows) -> None:
    robot = picchio.load_robot(name)
    pose = np.random.default_rng(3).uniform(-1.5, 1.5, len(robot.joint_names))
    envelope = envelope_of(picchio.Model(robot), pose, blows, hits=hits)
    vertices, _ = envelope.surfaces(3)
    directions, _ = icosphere(3)
    radius = np.linalg.norm(vertices, axis=2)
    rows = np.random.default_rng(0).choice(len(directions), 25, replace=False)
    # One direction after the other, by another way than the surface's own.
    peaks = [envelope.response.peaks(n) for n in directions[rows]]
    exact = np.array([[abs(peak.value) for peak in row] for row in peaks]).T
    moving = envelope.peak_deflection > 1e-12
    np.testing.assert_allclose(radius[moving][:, rows], exact[moving], rtol=1e-6, atol=1e-15)
    np.testing.assert_allclose(vertices, directions * radius[..., None], atol=1e-15)
    largest = radius.max(axis=1)[moving]
    # No direction is further than 5 degrees from a vertex.
    assert (largest <= envelope.peak_deflection[moving] * (1 + 1e-9)).all()
    assert (largest >= envelope.peak_deflection[moving] * np.cos(np.radians(5.0))).all()


def test_page_holds_the_same_surface(scene) -> None:
    data, array = unpack(scene.html())
    surfaces, _ = scene.envelope.surfaces(3)
    for item in data["items"]:
        if item["layer"] != "envelope":
            continue
        mesh = data["meshes"][item["mesh"]]
        shown = array(mesh["vertices"]).reshape(-1, 3)
        expected = surfaces[item["joint"]]
        size = np.linalg.norm(expected, axis=1)
        assert (np.linalg.norm(shown - expected, axis=1) <= 1e-6 * size).all()
        matrix = np.array(item["matrix"]).reshape(4, 4).T
        np.testing.assert_allclose(matrix[:3, 3], scene.envelope.tool_position, atol=1e-8)


def test_every_array_is_in_it_once_and_every_mesh_used(scene) -> None:
    data, array = unpack(scene.html())
    keys = ("vertices", "faces", "colours")
    references = {tuple(mesh[key]) for mesh in data["meshes"] for key in keys if key in mesh}
    assert len({(kind, array((kind, *at)).tobytes()) for kind, *at in references}) == len(
        references
    )
    assert {item["mesh"] for item in data["items"]} == set(range(len(data["meshes"])))


def test_motion_is_the_response(scene) -> None:
    data, array = unpack(scene.html())
    motion = data["motion"]
    samples = array(motion["samples"]).reshape(3, 3, motion["count"])
    time = np.arange(motion["count"]) * motion["step"]
    np.testing.assert_allclose(
        samples, scene.envelope.response.unit_deflection(time), atol=1e-6 * np.abs(samples).max()
    )


@pytest.mark.parametrize("name", ["fanuc_like_3dof", "ur10", "panda", "kinova", "tiago"])
def test_frames_are_pinocchios(name: str) -> None:
    robot = picchio.load_robot(name)
    rng = np.random.default_rng(1)
    for _ in range(3):
        pose = rng.uniform(-1.0, 1.0, len(robot.joint_names))
        places = world(frames(robot, pose))
        for link in list(places)[:: max(1, len(places) // 12)]:
            position, rotation = robot.frame_placement(pose, link)
            np.testing.assert_allclose(places[link][:3, 3], position, atol=1e-9)
            np.testing.assert_allclose(places[link][:3, :3], rotation, atol=1e-9)


def test_deflections_move_the_joints_that_follow() -> None:
    robot = picchio.load_robot("panda")
    found = {
        frame.joint: frame for frame in frames(robot, robot.pose([0.1] * len(robot.joint_names)))
    }
    for j, name in enumerate(robot.flexible_names):
        assert found[name].follows[j] == 1.0
        assert found[name].follows.sum() == 1.0


def test_names_are_data(hostile_urdf: Path) -> None:
    robot = picchio.load_robot(hostile_urdf)
    page = build_scene(
        robot, robot.pose([0.3] * len(robot.joint_names)), BLOWS, subdivisions=1
    ).html()
    tree = lxml_html.fromstring(page)
    assert len(tree.xpath("//script")) == 4
    data, _ = unpack(page)
    assert [joint["name"] for joint in data["joints"]] == list(robot.flexible_names)
    assert page.count('<script>alert("x")') == 0
    assert "<script>" in tree.xpath("//h1")[0].text_content()
    paths = " ".join(frame["path"] for frame in data["frames"])
    assert re.fullmatch(r"[a-z0-9/ ]+", paths)


def test_nothing_is_fetched(scene) -> None:
    page = scene.html()
    shell = re.sub(r"<script>/\*!?.*?</script>", "", page, flags=re.DOTALL)
    assert not re.search(r"""(?:src|href)\s*=\s*["']?(?:https?:)?//""", shell)
    assert "default-src 'none'" in page
    assert "connect-src" not in page  # so falls back to none: nothing can be fetched


def test_pose_direction_and_joint_are_checked(arm: SimpleNamespace) -> None:
    with pytest.raises(picchio.InputError, match="joint_9"):
        build_scene(arm.robot, arm.worst.pose, BLOWS, joint="joint_9", subdivisions=1)
    with pytest.raises(picchio.InputError):
        build_scene(arm.robot, [0.0], BLOWS)
    with pytest.raises(picchio.InputError, match="direction"):
        build_scene(arm.robot, arm.worst.pose, BLOWS, direction=[0, 0, 0], subdivisions=1)


@given(st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-3))
def test_arrows_point_where_they_should(axis: tuple[float, ...]) -> None:
    matrix = turned_to(np.array(axis), np.array([1.0, 2.0, 3.0]))
    pin.SE3(matrix)  # refuses what is no rotation
    tip = arrow(2.0, 0.1).vertices[:, 2].max()
    place = matrix @ [0, 0, tip, 1]
    np.testing.assert_allclose(place[:3], [1, 2, 3] + 2.0 * np.array(axis) / np.linalg.norm(axis))
    assert np.linalg.det(matrix[:3, :3]) == pytest.approx(1.0)


def test_the_map_is_a_layer_coloured_by_peak(arm: SimpleNamespace) -> None:
    import xarray

    places = np.array([[1.0, 0.0, 0.5], [1.2, 0.0, 0.5], [1.4, 0.0, 0.5]])
    peak = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [2.0, 2.0, 2.0]]) * 1e-3
    names = list(arm.robot.flexible_names)
    workspace = xarray.Dataset(
        {"position": (("point", "xyz"), places), "peak_deflection": (("point", "joint"), peak)},
        coords={"joint": names},
    )
    workspace.attrs["hits"] = 12
    scene = build_scene(arm.robot, arm.worst.pose, BLOWS, workspace=workspace, subdivisions=1)
    assert "12 hits from rest" in next(text for name, text, _ in scene.layers if name == "map")
    assert "steady state" in scene.subtitle
    mesh = scene.meshes[next(item.mesh for item in scene.items if item.layer == "map")]
    grains = mesh.vertices.reshape(3, -1, 3)
    np.testing.assert_allclose(grains.mean(axis=1), places, atol=1e-12)
    colours = mesh.colours.reshape(3, -1, 3)[:, 0]
    assert [scene.scales["map"].colour(v) for v in (0.0, 1.0, 2.0)] == [
        "#" + "".join(f"{round(c):02x}" for c in row) for row in colours
    ]
    assert len({tuple(row) for row in colours}) == 3


class Recorder:
    """Takes a viewer's calls and keeps them by path."""

    def __init__(self, path: str = "", calls: dict | None = None) -> None:
        self.path, self.calls = path, {} if calls is None else calls

    def __getitem__(self, path: str) -> Recorder:
        return Recorder(f"{self.path}/{path.strip('/')}", self.calls)

    def __getattr__(self, name: str):
        return lambda *given: self.calls.setdefault((self.path, name), []).append(given)


def test_a_live_viewer_gets_the_same_things(scene) -> None:
    viewer = Recorder()
    assert scene.show(viewer) is viewer
    sent = {path: given for (path, name), given in viewer.calls.items() if name == "set_object"}
    assert len(sent) == len(scene.items)
    number = next(k for k, item in enumerate(scene.items) if item.layer == "envelope")
    ((geometry, material),) = sent[f"/picchio/envelope/item{number}"]
    surfaces, _ = scene.envelope.surfaces(3)
    np.testing.assert_allclose(geometry.vertices, surfaces[0], rtol=1e-6, atol=1e-12)
    assert material.opacity < 1.0
    hidden = [path for (path, name), given in viewer.calls.items()
              if name == "set_property" and ("visible", False) in given]  # fmt: skip
    assert len([path for path in hidden if path.startswith("/picchio/envelope/")]) == 2
    # The tool's frame, multiplied up its path, is where Pinocchio has it.
    place = np.eye(4)
    frame = next(f for f in scene.frames if f.link == "tool")
    steps = frame.path.split("/")
    for k in range(2, len(steps) + 1):
        ((matrix,),) = viewer.calls[(f"/picchio/robot/{'/'.join(steps[:k])}", "set_transform")]
        place = place @ matrix
    np.testing.assert_allclose(place[:3, 3], scene.envelope.tool_position, atol=1e-9)


@given(
    st.dictionaries(st.text(), st.text() | st.sampled_from(["</script x", "<!--<script", "]]>"]))
)
def test_json_in_a_script_can_never_end_it(value: dict[str, str]) -> None:
    text = script_json(value)
    assert json.loads(text) == value
    assert not set(text) & set("<>&\u2028\u2029")


def test_the_gun_is_a_frame_of_its_own(recoiling) -> None:
    assert recoiling.flexible_names[-1] == "gun_recoil"
    for recoil in (0.0, 0.02):
        pose = recoiling.pose(
            {"joint_1": 0.4, "joint_2": 0.9, "joint_3": -1.1, "gun_recoil": recoil}
        )
        tree = frames(recoiling, pose)
        place = world(tree)[recoiling.tool_point]
        np.testing.assert_allclose(place[:3, 3], recoiling.state(pose).tool_position, atol=1e-12)
    gun = tree[-1]
    assert gun.prismatic and gun.follows.tolist() == [0.0, 0.0, 0.0, 1.0]
    scene = build_scene(recoiling, pose, BLOWS, hits=2, subdivisions=1)
    drawn = [item for item in scene.items if item.node == gun.path]
    assert {item.layer for item in drawn} == {"robot", "joints"}
    assert any("gun_recoil" in label["text"] for label in scene.labels)


def test_two_histories_are_played_as_given(arm: SimpleNamespace) -> None:
    time = np.linspace(0.0, 0.5, 200)
    simulated = arm.worst.response.deflection(time, [0, 0, 1])
    measured = {"joint_3": np.where(time < 0.4, simulated[2], np.nan)}
    scene = compare_scene(arm.robot, arm.worst.pose, BLOWS, time, simulated, measured,
                          hits=12, subdivisions=1)  # fmt: skip
    data, array = unpack(scene.html())
    first, second = (array(t["samples"]).reshape(3, -1) for t in data["motion"]["tracks"])
    np.testing.assert_allclose(first, simulated, rtol=1e-6, atol=1e-12)
    assert not second[:2].any()
    np.testing.assert_allclose(second[2], np.nan_to_num(measured["joint_3"]), rtol=1e-6, atol=1e-12)
    assert {"simulated", "measured"} <= {layer["id"] for layer in data["layers"]}
    for wrong in ({"elbow": simulated[0]}, simulated[:2], {"joint_1": time[:5]}):
        with pytest.raises(picchio.InputError, match="measured"):
            compare_scene(arm.robot, arm.worst.pose, BLOWS, time, simulated, wrong)
    with pytest.raises(picchio.InputError, match="time"):
        compare_scene(arm.robot, arm.worst.pose, BLOWS, time[::-1], simulated, measured)


def test_live_controls_carry_names_as_data_only(hostile_urdf: Path) -> None:
    robot = picchio.load_robot(hostile_urdf)
    scene = build_scene(robot, [0.3] * len(robot.joint_names), BLOWS, subdivisions=1)
    first, *others = controls(scene)
    assert [c["name"] for c in (first, *others)] == [
        "joint",
        "size",
        "exaggerated",
        "moment",
        "play",
    ]
    text = first["callback"].partition("JSON.parse(")[2].partition(");\n")[0]
    data = json.loads(json.loads(text))
    assert data["told"][0].startswith(robot.flexible_names[0])
    assert {item["joint"] for item in data["items"]} == {0, 1, 2}
    samples = np.frombuffer(base64.b64decode(data["motion"]["samples"]), "<f4").reshape(3, -1)
    along = scene.motion["directions"][0]["along"]
    expected = np.einsum("ndk,d->nk", scene.motion["samples"], along)
    np.testing.assert_allclose(samples, expected, rtol=1e-6, atol=1e-12)
