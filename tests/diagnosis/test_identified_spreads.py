"""What identify writes: every value found has its standard deviation, as a sidecar reads it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest
import tomlkit

import picchio
from picchio.diagnosis.identify import _sidecar
from picchio.diagnosis.result import Cause, Value


def test_what_was_found_has_its_standard_deviation(tmp_path: Path) -> None:
    robot = picchio.load_robot(
        "fanuc_like_3dof",
        values={
            "joint_1": {"stiffness": 2.4e5, "stiffness_spread": 1.5},
            "joint_2": {"stiffness": 1e5, "damping_ratio": 0.03, "estimated": True},
        },
    )
    found = SimpleNamespace(
        causes=(
            Cause("joint_stiffness", "joint_2", 1.0, {"scale": Value(0.9, 0.02, "1")}),
            Cause("payload", "tool", 1.0, {"mass": Value(2.0, 0.05, "kg")}),
        ),
        nuisances={"stiffness.joint_3": Value(1.02e5, 900.0, "N*m/rad")},
    )
    table, _ = _sidecar(robot, found, "bench")  # type: ignore[arg-type]
    file = tmp_path / "flex.toml"
    file.write_text(tomlkit.dumps(table))
    spreads = picchio.load_robot("fanuc_like_3dof", flex=file).spreads
    assert spreads["stiffness.joint_2"].value == pytest.approx(9e4)
    assert spreads["stiffness.joint_2"].size == pytest.approx(0.02 / 0.9, rel=1e-3)
    assert spreads["stiffness.joint_3"].size == pytest.approx(900.0 / 1.02e5, rel=1e-3)
    assert spreads["mass.tool"].size == pytest.approx(0.025, rel=1e-3)
    # What was not measured keeps what was said of it.
    assert spreads["stiffness.joint_1"].at(1.0) == pytest.approx(3.6e5)
    assert spreads["damping_ratio.joint_2"].at(1.0) == pytest.approx(0.06)
