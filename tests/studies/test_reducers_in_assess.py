"""Reducers beside shafts: peak torque of gravity and blows against the catalogue."""

import numpy as np
import pytest

import picchio
from picchio.cli.life.assess import show
from picchio.core.errors import PicchioWarning
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
    found = picchio.assess(robot, picchio.task_from_dict(table, robot))
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
    show(found, tmp_path / "task.toml")
    said = " ".join(capsys.readouterr().out.split())
    assert "RV-20E-121" in said and "repeated peak torque" in said
    for line in joint.reducer_warnings:
        assert f"joint_2: {line.removeprefix('RV-20E-121: ')}" in said


def test_a_reducer_no_catalogue_has_is_told_and_left_unchecked(tmp_path):
    robot = robot_with(tmp_path, joint_1="RV-9999")
    with pytest.warns(PicchioWarning, match=r"joint_1.*RV-9999.*unchecked"):
        found = picchio.assess(robot, picchio.task_from_dict(TASK, robot))
    assert np.isnan(found.joint("joint_1").reducer_utilisation)
    assert found.joint("joint_1").reducer == ""
