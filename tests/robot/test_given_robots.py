"""What goes wherever a robot goes, and robots changed in Python: the same numbers each way."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy

import picchio

ARM = "fanuc_like_3dof"
POSE = [0.3, 1.1, -1.0]
NAMES = {"ur3_robot": [0.0, -1.2, 1.8, -0.6, 1.57, 0.0], "panda": [0.0] * 7, ARM: POSE}


@pytest.fixture
def urdf() -> Path:
    return picchio.load_robot(ARM).source


@pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")
@pytest.mark.parametrize("name", NAMES)
def test_every_way_to_give_a_robot_gives_the_same_rigid_robot(name: str) -> None:
    plain = picchio.load_robot(name)
    model = pin.buildModelFromUrdf(str(plain.source))
    mass = np.array(plain.rigid.mass_matrix(plain.pose(np.full(len(plain.joint_names), 0.2))))
    ways: list[Any] = [
        plain.source,
        str(plain.source),
        plain,
        (model, plain.source),
        (pin.RobotWrapper(model), str(plain.source)),
        yourdfpy.URDF.load(str(plain.source), load_meshes=False, build_scene_graph=False),
    ]
    for way in ways:
        found = picchio.load_robot(way)
        at = found.pose(np.full(len(found.joint_names), 0.2))
        bare = found.with_payload(plain.tool.mass, com=plain.tool.com, inertia=plain.tool.inertia)
        assert found.joint_names == plain.joint_names
        np.testing.assert_allclose(bare.rigid.mass_matrix(at), mass, rtol=1e-9, atol=1e-12)


@pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")
@pytest.mark.parametrize("name", NAMES)
def test_yourdfpy_puts_every_link_where_picchio_does(name: str) -> None:
    robot = picchio.load_robot(name)
    held = robot.urdf
    pose = robot.pose(np.linspace(0.01, 0.04, len(robot.joint_names)))
    held.update_cfg(dict(zip(robot.joint_names, pose, strict=True)))
    base, turned = robot.frame_placement(pose, held.base_link)
    for link in held.link_map:
        at, rotation = robot.frame_placement(pose, link)
        seen = held.get_transform(link)
        np.testing.assert_allclose(turned @ seen[:3, 3] + base, at, atol=1e-9)
        np.testing.assert_allclose(turned @ seen[:3, :3], rotation, atol=1e-9)
    drawn = [v for link in held.link_map.values() for v in link.visuals]
    assert len(held.scene.geometry) >= len(drawn) > 0
    again = picchio.load_robot(held)
    assert again.joint_names == robot.joint_names


def test_what_yourdfpy_gets_has_quaternions_turned_and_no_capsule(tmp_path: Path) -> None:
    shape = "<visual><origin {}/><geometry>{}</geometry></visual>"
    text = picchio.load_robot(ARM).source.read_text()
    turned = shape.format('quat_xyzw="0 0 0.6 0.8"', '<box size="1 1 1"/>')
    round_ends = shape.format("", '<capsule radius="0.1" length="1"/>')
    for name, part in (("turned", turned), ("capsule", round_ends)):
        more = (
            f'<link name="more">{part}</link><joint name="on" type="fixed">'
            '<parent link="link_1"/><child link="more"/></joint></robot>'
        )
        (tmp_path / f"{name}.urdf").write_text(text.replace("</robot>", more))
    (box,) = picchio.load_robot(tmp_path / "turned.urdf").urdf.link_map["more"].visuals
    np.testing.assert_allclose(box.origin[:2, 0], [1 - 2 * 0.36, 2 * 0.48], atol=1e-9)
    with pytest.raises(picchio.InputError, match=r"capsule\.urdf.*yourdfpy"):
        _ = picchio.load_robot(tmp_path / "capsule.urdf").urdf
    lost = shape.format("", '<mesh filename="lost.stl"/>')
    more = f'<link name="more">{lost}</link><joint name="on" type="fixed">'
    more += '<parent link="link_1"/><child link="more"/></joint></robot>'
    (tmp_path / "lost.urdf").write_text(text.replace("</robot>", more))
    robot = picchio.load_robot(tmp_path / "lost.urdf")
    with pytest.warns(picchio.PicchioWarning, match=r"link 'more': a <visual> is left out.*lost"):
        assert robot.urdf.link_map["more"].visuals == []


def test_a_name_goes_where_a_robot_goes() -> None:
    robot = picchio.load_robot(ARM)
    task = picchio.load_task(robot.task_path, ARM)
    assert picchio.assess(ARM).to_dict() == picchio.assess(robot, task_of(robot)).to_dict()
    blows = picchio.PulseTrain(300.0, 0.04, 0.004)
    for found, same in [
        (picchio.envelope(ARM, POSE), picchio.envelope(robot, POSE, blows)),
        (picchio.allowable(ARM, task, 1e5), picchio.allowable(robot, robot.task_path, 1e5)),
        (picchio.envelope(ARM), picchio.envelope(ARM, task.operations[0].poses[0])),
        (picchio.compare(ARM, robot), picchio.compare(robot, ARM)),
    ]:
        assert (
            found.to_frame().equals(same.to_frame())
            if hasattr(found, "to_frame")
            else (found.to_dict()["results"] == same.to_dict()["results"] == [])
        )
    modes = picchio.modal_analysis(ARM, POSE)
    assert modes.natural_frequencies == pytest.approx(
        picchio.modal_analysis(picchio.Model(robot).linear_system(POSE)).natural_frequencies
    )
    rest, burst = (
        picchio.response_from_rest(modes),
        picchio.response_from_rest(modes, picchio.PulseTrain(300.0, 0.040, 0.004), hits=12),
    )
    at = np.linspace(0.0, 1.0, 50)
    np.testing.assert_array_equal(rest.unit_deflection(at), burst.unit_deflection(at))


def task_of(robot: picchio.FlexibleRobot) -> Any:
    from picchio.studies.default_task import task_of as own

    return own(robot)


@pytest.mark.parametrize(
    ("given", "what"),
    [
        (3, "is no robot, got 'int'"),
        (None, "is no robot"),
        (("ur10",), "is no robot"),
        ((None, "/nowhere.urdf"), "no such file"),
    ],
)
def test_what_is_no_robot_is_refused(given: Any, what: str) -> None:
    with pytest.raises(picchio.InputError, match=what):
        picchio.load_robot(given)


@pytest.mark.parametrize("change", ["mass", "place", "root"])
def test_a_model_that_is_not_its_urdfs_is_refused_by_joint(urdf: Path, change: str) -> None:
    model = pin.buildModelFromUrdf(str(urdf))
    if change == "mass":
        own = model.inertias[2]
        model.inertias[2] = pin.Inertia(own.mass + 1.0, own.lever, own.inertia)
    elif change == "place":
        model.jointPlacements[2] = pin.SE3(np.eye(3), np.ones(3))
    else:
        model = pin.buildModelFromUrdf(str(urdf), pin.JointModelFreeFlyer())
    with pytest.raises(picchio.InputError, match="root_joint" if change == "root" else "joint_2"):
        picchio.load_robot((model, urdf))


def test_joints_are_a_table_and_a_mapping() -> None:
    joints = picchio.load_robot(ARM).joints
    assert list(joints) == ["joint_1", "joint_2", "joint_3"]
    assert joints["joint_2"].stiffness == joints.to_frame().loc["joint_2", "stiffness"] == 1e5
    assert "joint_9" not in joints
    with pytest.raises(picchio.InputError, match="no such joint, got 'joint_9'"):
        joints["joint_9"]
    rigid = picchio.load_robot("emps", allow_rigid=True).joints
    assert np.isinf(rigid["slide"].stiffness) or rigid["slide"].stiffness > 0


def test_other_stiffness_and_payload_are_those_of_a_sidecar(tmp_path: Path) -> None:
    robot = picchio.load_robot(ARM)
    changed = robot.with_stiffness(joint_1=1e5).with_payload(5.0, com=(0.0, 0.0, 0.1))
    flex = tmp_path / "flex.toml"
    own = (robot.source.parent / "flex.toml").read_text()
    flex.write_text(own.replace("[tool]", "[tool]\nmass = 5.0\ncom = [0.0, 0.0, 0.1]"))
    written = picchio.load_robot(robot.source, flex=flex, values={"joint_1": {"stiffness": 1e5}})
    one, other = picchio.envelope(changed, POSE), picchio.envelope(written, POSE)
    np.testing.assert_allclose(one.peak_deflection, other.peak_deflection, rtol=1e-12)
    assert robot.stiffness[0] == 2.4e5 and robot.tool.mass != 5.0  # the first one is as it was
    again = pickle.loads(pickle.dumps(changed)).with_stiffness({"joint_3": 7e4})
    assert again.stiffness.tolist() == [1e5, 1e5, 7e4] and again.tool.mass == 5.0
    assert changed.origins["joint_1.stiffness"] == changed.origins["tool.mass"] == "argument"


@pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")
@pytest.mark.parametrize("name", ["ur3_robot", "ur10", "panda"])
def test_what_is_given_is_known_and_other_estimates_stay(name: str) -> None:
    robot = picchio.load_robot(name)
    joint = robot.flexible_names[2]
    changed = robot.with_stiffness({joint: 1.2e4})
    others = np.arange(len(robot.stiffness)) != 2
    assert changed.stiffness[2] == 1.2e4
    assert changed.stiffness[others].tolist() == robot.stiffness[others].tolist()
    assert f"stiffness.{joint}" not in changed.spreads and not changed.joints[joint].estimated
    kept = {one for one in robot.spreads if one != f"stiffness.{joint}"}
    assert {one for one in changed.spreads if one.startswith("stiffness")} <= kept
    assert robot.with_payload(3.0).stiffness.tolist() == robot.stiffness.tolist()


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (lambda r: r.with_stiffness(joint_9=1e4), "no joint of this name, got 'joint_9'"),
        (lambda r: r.with_stiffness(joint_1=-1.0), "joint_1.stiffness"),
        (lambda r: r.with_payload(-1.0), "tool.mass"),
        (lambda r: r.with_payload(0.0, com=(1.0, 0.0, 0.0)), "needs a mass"),
    ],
)
def test_values_that_cannot_be_are_refused(change: Any, what: str) -> None:
    with pytest.raises(picchio.InputError, match=what):
        change(picchio.load_robot(ARM))


def test_a_saved_model_keeps_what_was_given_in_python(tmp_path: Path) -> None:
    from picchio.robot.loading.saved_model import saved_model_text

    robot = picchio.load_robot(ARM).with_stiffness(joint_1=1e5).with_payload(4.0)
    text = saved_model_text(ARM, [], **robot.again.keywords)
    (tmp_path / "model.toml").write_text(text)
    found = picchio.load_robot(tmp_path / "model.toml")
    assert found.stiffness[0] == 1e5 and found.tool.mass == 4.0
    assert found.with_payload(2.0).tool.mass == 2.0
