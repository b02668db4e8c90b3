"""What identify writes: every value found has its standard deviation, as a sidecar reads it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import tomlkit

import picchio
from picchio.campaign.tables import Tolerance
from picchio.diagnosis.identify import _sidecar
from picchio.diagnosis.result import Cause, Correlation, Value


def test_what_was_found_has_its_standard_deviation(tmp_path: Path) -> None:
    gun = tmp_path / "gun.toml"  # its spring is a joint that the URDF does not have
    gun.write_text('format = "picchio-sidecar/1"\n[gun]\nmass = 1.5\nrecoil_stiffness = 3e4\n')
    robot = picchio.load_robot(
        "fanuc_like_3dof",
        flex=gun,
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
        nuisances={
            "stiffness.joint_1": Value(2.3e5, 2e4, "N*m/rad"),  # as the tolerance has it
            "stiffness.joint_3": Value(1.02e5, 900.0, "N*m/rad"),
            "damping_ratio": Value(0.033, 0.001, "1"),
        },
        correlation=Correlation.of(
            [
                ("joint_stiffness", "joint_2", "scale"),
                ("joint_stiffness", "joint_3", "scale"),
                ("modal_damping", "robot", "scale"),
                ("force_amplitude", "robot", "scale"),
            ],
            np.array(
                [[4e-4, -9e-5, 0, 0], [-9e-5, 8.1e-5, 0, 0], [0, 0, 9e-4, 0], [0, 0, 0, 1e-4]]
            ),
        ),
    )
    table, _ = _sidecar(robot, found, "bench", Tolerance())  # type: ignore[arg-type]
    file = tmp_path / "flex.toml"
    file.write_text(tomlkit.dumps(table))
    known = picchio.load_robot("fanuc_like_3dof", flex=file)
    assert known.gun == robot.gun
    spreads = known.spreads
    assert spreads["stiffness.joint_2"].value == pytest.approx(9e4)
    assert spreads["stiffness.joint_2"].size == pytest.approx(0.02 / 0.9, rel=1e-3)
    assert spreads["stiffness.joint_3"].size == pytest.approx(900.0 / 1.02e5, rel=1e-3)
    assert spreads["mass.tool"].size == pytest.approx(0.025, rel=1e-3)
    # What was not measured keeps what was said of it.
    assert spreads["stiffness.joint_1"].at(1.0) == pytest.approx(3.6e5)
    # One factor on all damping ratios was fitted: they hang together wholly.
    ratios = [f"damping_ratio.joint_{k}" for k in (1, 2, 3)]
    assert [spreads[name].size for name in ratios] == pytest.approx([0.001 / 0.033] * 3, rel=1e-3)
    together = known.posterior.among(ratios)
    assert np.array(together.correlation) == pytest.approx(np.ones((3, 3)))
    pair = known.posterior.among(["stiffness.joint_2", "stiffness.joint_3"])
    assert pair.correlation[0][1] == pytest.approx(-0.5)
    assert "mass.tool" in known.posterior.names
