"""`picchio annotate`: a URDF that carries its sidecar, or one line of error and no file."""

from __future__ import annotations

import numpy as np
import pytest

from picchio.cli.main import app
from picchio.core.errors import InputError
from picchio.robot.loading.load import load_robot


def run(*arguments: str) -> None:
    app(["annotate", *arguments], standalone_mode=False)


def test_writes_what_the_sidecar_says(tmp_path, arm, flex):
    out = tmp_path / "out.urdf"
    run(str(arm), "--flex", str(flex), "--out", str(out))
    one, other = load_robot(arm, flex=flex), load_robot(out)
    assert one.flexible_joints == other.flexible_joints


@pytest.mark.parametrize("name", ["ur10", "kinova", "fanuc_like_3dof"])
def test_a_robots_own_sidecar_is_the_default(tmp_path, name):
    out = tmp_path / "robot.urdf"
    run(name, "--out", str(out))
    one, other = load_robot(name), load_robot(out)
    assert one.flexible_joints == other.flexible_joints
    assert one.tool == other.tool
    pose = np.clip(0.4, one.lower, one.upper)
    np.testing.assert_array_equal(one.state(pose).jacobian, other.state(pose).jacobian)


def test_errors_leave_no_file(tmp_path, arm, write):
    out = tmp_path / "out.urdf"
    bad = write("bad.toml", 'format = "picchio-sidecar/1"\n[joint.z]\nstiffness = 1\n')
    with pytest.raises(InputError, match="no joint of this name"):
        run(str(arm), "--flex", str(bad), "--out", str(out))
    with pytest.raises(InputError, match=r"no flex\.toml of its own"):
        run(str(arm), "--out", str(out))
    with pytest.raises(InputError, match="cannot write here"):
        run("ur10", "--out", str(tmp_path / "no" / "folder.urdf"))
    assert not out.exists()
