"""Reducers beside shafts: peak torque of gravity and blows against the catalogue."""

import numpy as np
import pytest

import picchio
from picchio.core.errors import PicchioWarning
from picchio.fatigue.reducer_library import load_reducer

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
        abs(state.gravity_torque[1]) / rated.rated_torque,
    )
    joint = found.joint("joint_2")
    assert joint.reducer_utilisation == pytest.approx(expected, rel=1e-6)
    assert joint.reducer == "RV-40E-121"
    assert np.isnan(found.joint("joint_1").reducer_utilisation)
    assert found.limiting_joint == "joint_2"
    assert any("false brinelling" in line for line in found.assumptions)


def test_a_reducer_no_catalogue_has_is_told_and_left_unchecked(tmp_path):
    robot = robot_with(tmp_path, joint_1="RV-9999")
    with pytest.warns(PicchioWarning, match=r"joint_1.*RV-9999.*unchecked"):
        found = picchio.assess(robot, picchio.task_from_dict(TASK, robot))
    assert np.isnan(found.joint("joint_1").reducer_utilisation)
    assert found.joint("joint_1").reducer == ""
