"""`picchio assess` end to end on every robot that is shipped, with its own sidecar and task."""

import json
import math
import subprocess
import sys

import pytest

from picchio.robot.loading.find import shipped_robots

MAIN = "from picchio.cli.main import main; main()"
WANTED = {"ur5", "ur10", "panda", "kinova", "xarm7", "z1", "tiago", "talos_left_arm"}


def test_the_robots_that_must_work_are_there():
    assert set(shipped_robots()) >= WANTED | {"fanuc_like_3dof"}


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(shipped_robots()))
def test_every_shipped_robot_is_assessed(name, tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", MAIN, "assess", name, "--json", "-"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["joints"]
    for joint in found["joints"]:
        assert math.isfinite(joint["peak_deflection"])
        # Millimetres at the tool and tenths of degrees at the joints, not more: sane stiffness.
        assert 0 <= joint["peak_deflection"] < 0.05
    for operation in found["operations"]:
        for row in operation["natural_frequencies"]:
            assert row == sorted(row)
            assert 0.5 < row[0] < 200
    assert found["origins"]
