"""`picchio envelope` as a stranger and as a program meet it."""

import json

import pytest


def test_json_as_the_contract_has_it(picchio):
    done = picchio("envelope", "fanuc_like_3dof", "--pose=-1,0.5,0", "--json", "-")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["format"] == "picchio-envelope/1"
    assert found["robot"] == "fanuc_like_3dof"
    assert found["pose"] == [-1.0, 0.5, 0.0]
    blows = found["excitation"]
    assert blows == {"kind": "pulse_train", "force": 300, "period": 0.04, "width": 0.004} | blows
    assert len(found["natural_frequencies"]) == 3
    for joint in found["joints"]:
        assert joint["peak_deflection"] > 0
        assert sum(c * c for c in joint["worst_direction"]) == pytest.approx(1.0)


def test_the_blows_can_be_set(picchio):
    options = ("--force", "600", "--period", "0.05", "--width", "0.01", "--json", "-")
    done = picchio("envelope", "fanuc_like_3dof", "--pose=0.3,1.1,-1.0", *options)
    blows = json.loads(done.stdout)["excitation"]
    assert (blows["force"], blows["period"], blows["width"]) == (600.0, 0.05, 0.01)


def test_a_pose_by_joint_names(picchio):
    names = "joint_3=-1.0, joint_1=0.3,joint_2=1.1"
    given = [picchio("envelope", "fanuc_like_3dof", f"--pose={pose}", "--json", "-").stdout
             for pose in ("0.3,1.1,-1.0", names)]  # fmt: skip
    assert given[0] == given[1]
    some = picchio("envelope", "fanuc_like_3dof", "--pose=joint_2=1.1", "--json", "-")
    assert json.loads(some.stdout)["pose"] == [0.0, 1.1, 0.0]


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["--pose=1,2"], "3"),
        (["--pose=1,b,2"], "--pose"),
        (["--pose=joint_1=0.1,joint_1=0.2"], "the joint is given twice, got 'joint_1'"),
        (["--pose=joint_1=0.1,0.2"], "NAME=VALUE, or none, got '0.2'"),
        (["--pose=join_1=0.1"], "did you mean 'joint_1'"),
        (["--pose=joint_1=x"], "--pose joint_1"),
        (["--pose=home"], "no pose of this name, got 'home'"),
        (["--pose=1,nan,2"], "finite"),
        (["--pose=0,0,0", "--width", "0.05"], "width"),
        (["--pose=0,0,0", "--period", "-1"], "--period"),
        (["--pose=0,0,0", "--hits", "0"], "hits"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(picchio, arguments, part):
    done = picchio("envelope", "fanuc_like_3dof", *arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert part in done.stderr
