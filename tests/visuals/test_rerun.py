"""The Rerun recording, read back by Rerun's own reader."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import picchio
from picchio.cli.main import run
from picchio.visuals.scene.build import build_scene
from picchio.visuals.scene.recording import write_recording


@pytest.fixture(scope="module")
def scene(arm: SimpleNamespace):
    op = arm.worst.operation
    return build_scene(arm.robot, arm.worst.pose, op.excitation, hits=12, direction=op.direction,
                       subdivisions=1)  # fmt: skip


def test_what_is_recorded_is_the_motion_of_the_arm(scene, arm, tmp_path: Path) -> None:
    chunk = pytest.importorskip("rerun.chunk")
    path = write_recording(scene, tmp_path / "out.rrd")
    assert [p.name for p in tmp_path.iterdir()] == ["out.rrd"]
    found = {c.entity_path.lstrip("/"): c for c in chunk.RrdReader(str(path)).stream()}
    op = arm.worst.operation
    # By the closed form, at times of its own.
    response = picchio.response_from_rest(
        picchio.modal_analysis(picchio.Model(arm.robot).linear_system(arm.worst.pose)),
        op.excitation, hits=12,
    )  # fmt: skip
    for j, name in enumerate(arm.robot.flexible_names):
        table = found[f"deflection/{name}"].to_record_batch().to_pandas()
        when = table["time"].to_numpy().astype("timedelta64[ns]").astype(float) * 1e-9
        column = next(c for c in table.columns if "scalars" in c.lower())
        values = np.array([row[0] for row in table[column]])
        exact = 1e3 * response.deflection(when, op.direction)[j]
        np.testing.assert_allclose(values, exact, atol=1e-6 * (1.0 + np.abs(exact).max()))
    moving = [c for path, c in found.items() if path.startswith("robot") and not c.is_static]
    assert len(moving) == 3 and all(c.num_rows == len(when) for c in moving)
    assert sum("shape" in path for path in found) == sum(i.layer == "robot" for i in scene.items)


def test_without_rerun_the_extra_is_named(monkeypatch, tmp_path: Path, capsys) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert run(["view", "fanuc_like_3dof", "--pose=0,0,0", "--rerun",
                str(tmp_path / "out.rrd")]) == 2  # fmt: skip
    assert "picchio[rerun]" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
