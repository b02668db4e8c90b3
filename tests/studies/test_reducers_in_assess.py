"""Reducers beside shafts: peak torque of gravity and blows against the catalogue."""

import re

import numpy as np
import pytest

import picchio
from picchio.cli.life.assess import show
from picchio.core.errors import InputError
from picchio.robot.drives.reducer import load_reducer

TASK = {
    "hits_per_rivet": 12,
    "excitation": {"kind": "pulse_train", "force": 300.0, "period": 0.04, "width": 0.004},
    "operation": [{"name": "up", "direction": [0, 0, 1], "poses": [[0.3, 0.2, -0.4]]}],
}


def robot_with(tmp_path, **reducers):
    lines = ['format = "picchio-sidecar/1"']
    for joint, name in reducers.items():
        lines += [f"[joint.{joint}]", f'reducer = "{name}"']
    sidecar = tmp_path / "flex.toml"
    sidecar.write_text("\n".join(lines))
    return picchio.load_robot("fanuc_like_3dof", flex=sidecar)


@pytest.fixture
def plain_urdf(tmp_path, repository):
    """The example arm without annotations: every joint rigid."""
    text = (repository / "robots/fanuc_like_3dof/robot.urdf").read_text()
    path = tmp_path / "plain.urdf"
    path.write_text(re.sub(r"<picchio:[^>]*/>", "", text))
    return path


def test_peak_torque_of_gravity_and_blows_against_the_limits(tmp_path):
    robot = robot_with(tmp_path, joint_2="RV-40E-121")
    task = picchio.task_from_dict(TASK, robot)
    found = picchio.assess(robot, task)
    pose = robot.pose([0.3, 0.2, -0.4])
    state = robot.state(pose)
    modes = picchio.modal_analysis(picchio.Model(robot).linear_system(pose))
    response = picchio.response_from_rest(modes, task.operations[0].excitation, 12)
    time = np.linspace(0, response.horizon, 200_001)
    swing = 1e5 * response.deflection(time, [0, 0, 1])[1]
    # Gravity is held by the spring: link side down, torque on the joint -g.
    largest = np.abs(swing - state.gravity_torque[1]).max()
    rated = load_reducer("RV-40E")
    expected = max(
        largest / rated.repeated_peak_torque,
        largest / rated.momentary_peak_torque,
    )
    joint = found.joint("joint_2")
    assert joint.reducer_utilisation == pytest.approx(expected, rel=1e-6)
    assert joint.reducer == "RV-40E-121"
    assert np.isnan(found.joint("joint_1").reducer_utilisation)
    assert found.limiting_joint == "joint_2"
    assert any("false brinelling" in line for line in found.assumptions)


@pytest.mark.parametrize(
    ("peak", "held", "binds", "share", "exceeded"),
    [
        # RV-40E by the catalogue: rated 412, repeated peaks 1029, momentary peaks 2058 N m.
        (900.0, 300.0, "repeated peak torque", 900.0 / 1029.0, 0),
        (500.0, 453.2, "repeated peak torque", 500.0 / 1029.0, 0),
        (2469.6, 453.2, "repeated peak torque", 2.4, 2),
    ],
)
def test_the_limit_that_binds(peak, held, binds, share, exceeded):
    check = load_reducer("RV-40E-121").check_blows(peak, held)
    assert check.governing.name == binds
    assert check.governing.share == pytest.approx(share)
    assert len(check.warnings) == 1 + exceeded


def test_the_task_s_largest_torques_count(tmp_path, capsys):
    robot = robot_with(tmp_path, joint_2="RV-20E-121")
    table = TASK | {
        "operation": [
            {"name": "up", "direction": [0, 0, 1], "poses": [[0.3, 0.2, -0.4], [0.3, 0.9, -1.0]]},
            {"name": "out", "direction": [1, 0, 0], "poses": [[0.0, 0.0, 0.0]]},
        ]
    }
    task = picchio.task_from_dict(table, robot)
    found = picchio.assess(robot, task)
    joint = found.joint("joint_2")
    per_pose = [op.reducer_utilisation[:, 1].max() for op in found.operations]
    assert joint.reducer_utilisation == max(per_pose)
    # The outstretched arm: gravity and blows are beyond what repeated peaks may be, 412 N m.
    torque = max(op.reducer_torque[:, 1].max() for op in found.operations)
    assert joint.reducer_governed_by == "repeated peak torque"
    assert joint.reducer_utilisation == pytest.approx(torque / 412.0)
    text = "\n".join(joint.reducer_warnings)
    assert "false brinelling" in text and f"({torque / 412.0:.2f} times)" in text
    content = found.to_dict()
    told = {j["name"]: j for j in content["joints"]}
    assert told["joint_2"]["reducer_governed_by"] == "repeated peak torque"
    governing = told["joint_2"]["reducer_limits"][0]
    assert governing["limit"] == 412.0 and governing["torque"] == torque
    for name, op in zip(("up", "out"), content["operations"], strict=True):
        assert op["name"] == name
        for k, share in enumerate(op["reducer_utilisation"]):
            assert op["reducer_governed_by"][k] == ["", "repeated peak torque", ""]
            assert op["reducer_limit"][k][1] == 412.0
            assert share[1] == pytest.approx(op["reducer_torque"][k][1] / 412.0)
    assert tuple(told["joint_2"]["reducer_warnings"]) == joint.reducer_warnings
    without = found.joint("joint_1")
    assert (without.reducer_governed_by, without.reducer_warnings) == ("", ())
    show(found, task)
    said = " ".join(capsys.readouterr().out.split())
    assert "RV-20E-121" in said and "repeated peak torque" in said
    for line in joint.reducer_warnings:
        assert f"joint_2: {line.removeprefix('RV-20E-121: ')}" in said


def test_the_risk_of_false_brinelling_is_a_class_with_its_indicators(tmp_path):
    robot = robot_with(tmp_path, joint_2="CSG-45-100-2UH", joint_3="RV-40E-121")
    table = TASK | {
        "operation": [
            {"name": "up", "direction": [0, 0, 1], "poses": [[0.3, 0.2, -0.4], [0.3, 0.9, -1.0]]}
        ]
    }
    found = picchio.assess(robot, picchio.task_from_dict(table, robot))
    told = {j["name"]: j["false_brinelling"] for j in found.to_dict()["joints"]}
    assert told["joint_1"] is None
    assert told["joint_3"]["risk"] == "not known" and told["joint_3"]["ratio"] is None
    two, up = told["joint_2"], found.operations[0]
    assert two["risk"] == "low"
    assert two["travel"] == pytest.approx(up.swing[:, 1].max() * 0.111 / 4.0)
    assert two["pose"] == 1 + int(up.swing[:, 1].argmax())  # poses are counted from 1
    assert two["cycles"] == up.swing_cycles[:, 1].max() >= 12
    assert up.swing[two["pose"] - 1, 1] > up.rest_peak_deflection[two["pose"] - 1, 1]
    said = "\n".join(found.reducer_warnings)
    assert "joint_2: risk of false brinelling of the output bearing: low" in said
    ranked = found.to_dict()["false_brinelling"]
    assert [entry["joint"] for entry in ranked] == ["joint_2"] * 2 + ["joint_3"] * 2
    assert ranked[0]["ratio"] == two["ratio"] > ranked[1]["ratio"] > 0.0
    still = picchio.assess(robot, picchio.task_from_dict(TASK, robot))
    assert still.joint("joint_2").false_brinelling.risk == "high"


def test_a_reducer_no_catalogue_has_is_an_error_that_names_close_ones(tmp_path):
    match = r"flex\.toml: joint\.joint_1\.reducer: no such reducer, got 'RV-90E'.*RV-80E"
    with pytest.raises(InputError, match=match):
        robot_with(tmp_path, joint_1="RV-90E")


def test_a_reducer_s_name_brings_its_stiffness_curve(tmp_path, plain_urdf):
    sidecar = tmp_path / "alone.toml"
    head = 'format = "picchio-sidecar/1"\n[joint.joint_2]\nreducer = "CSG-25-100"\n'
    sidecar.write_text(head)
    robot = picchio.load_robot(plain_urdf, flex=sidecar, tool="tool")
    (joint,) = robot.flexible_joints
    assert joint.stiffness_curve == load_reducer("CSG-25-100").stiffness_curve
    assert joint.damping_ratio == 0.03
    assert "CHA" in robot.origins["joint_2.stiffness_curve"]
    found = picchio.assess(robot, picchio.task_from_dict(TASK, robot))
    said = "\n".join(found.assumptions)
    assert "joint_2: stiffness is that of the reducer alone" in said
    assert "damping ratio 0.03 is assumed" in said
    sidecar.write_text(head + "stiffness = 5e4\n")
    (joint,) = picchio.load_robot(plain_urdf, flex=sidecar, tool="tool").flexible_joints
    assert (joint.stiffness, joint.stiffness_curve) == (5e4, None)
    assert joint.reducer.name == "CSG-25-100"
    sidecar.write_text(head.replace("CSG-25-100", "RV-20E"))
    with pytest.raises(InputError, match=r"no stiffness of this reducer.*give the joint a stiff"):
        picchio.load_robot(plain_urdf, flex=sidecar, tool="tool")


def test_a_reducer_turns_and_a_slide_does_not(tmp_path, plain_urdf):
    slide = tmp_path / "slide.urdf"
    slide.write_text(plain_urdf.read_text().replace('"revolute"', '"prismatic"'))
    sidecar = tmp_path / "flex.toml"
    sidecar.write_text(
        'format = "picchio-sidecar/1"\n[joint.joint_1]\nstiffness = 1e6\nreducer = "CSG-25-100"\n'
    )
    with pytest.raises(InputError, match=r"prismatic joint has no torsion reducer"):
        picchio.load_robot(slide, flex=sidecar, tool="tool")


def test_catalogues_of_one_s_own(tmp_path, in_process):
    mine = tmp_path / "mine.toml"
    mine.write_text(
        'format = "picchio-reducers/1"\nmanufacturer = "Me"\nkind = "cycloidal"\n'
        'source = "a test"\n[[reducer]]\nname = "X-1"\nrated_torque = 100\n'
        "repeated_peak_torque = 2500\nmomentary_peak_torque = 5000\nstiffness = 3e5\n"
    )
    flex = tmp_path / "flex.toml"
    flex.write_text('format = "picchio-sidecar/1"\n[joint.joint_2]\nreducer = "X-1"\n')
    robot = picchio.load_robot("fanuc_like_3dof", flex=flex, reducers=mine)
    assert {joint.reducer.name for joint in robot.flexible_joints if joint.reducer} == {"X-1"}
    assert mine in robot.files
    command = ["envelope", "fanuc_like_3dof", "--pose=0,0.5,-0.8", "--flex", flex]
    refused = in_process(*command)
    assert refused.returncode == 2
    assert "no such reducer, got 'X-1'" in refused.stderr
    assert in_process(*command, "--reducers", mine).returncode == 0
