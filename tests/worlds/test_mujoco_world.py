"""Two worlds that share no mechanics tell the same story."""

import numpy as np
import pytest

from worlds import campaign
from worlds.mujoco_world import EFFECTS

SENSORS = ("accelerometer", "deflection", "velocity", "acceleration", "displacement", "force")
SHORT = {"records": 1, "hits": 4, "ring": 0.15, "sensors": SENSORS, "quiet": 0.02}
TOGETHER = [
    ("payload", "tool", {"mass": 1.0}),
    ("tool_offset", "tool", {"x": 0.01, "y": -0.02, "z": 0.03}),
    ("modal_damping", "robot", {"scale": 1.9}),
]


@pytest.mark.parametrize(
    ("name", "causes", "bound"),
    [
        ("fanuc_like_3dof", [], 2e-6),
        ("fanuc_like_3dof", [("payload", "tool", {"mass": 4.0})], 2e-6),
        ("fanuc_like_3dof", [("link_mass", "link_3", {"scale": 1.15})], 2e-6),
        ("fanuc_like_3dof", [("joint_inertia", "joint_2", {"inertia": 3.0})], 2e-6),
        ("fanuc_like_3dof", [("hardening", "joint_2", {"cubic": 5e10})], 2e-6),
        ("fanuc_like_3dof", [("joint_damping", "joint_3", {"damping": 90.0})], 2e-6),
        ("fanuc_like_3dof", [("mount_resonance", "accelerometer.tool", {
            "frequency": 90.0, "damping_ratio": 0.05})], 1e-4),
        ("ur10", TOGETHER, 1e-3),
        ("kinova_gen3", TOGETHER, 1e-3),
    ],
)  # fmt: skip
def test_the_worlds_agree(name, causes, bound):
    """Fast wrists: MuJoCo's step is the coarser one there."""
    data = {}
    for engine in ("arm", "mujoco"):
        _, truth = campaign.make(name, seed=7, causes=causes, engine=engine, **SHORT)
        data[engine] = truth["clean"]
    for group in data["arm"][0]:
        one, other = (
            np.concatenate([record[group] for record in data[engine]])
            for engine in ("arm", "mujoco")
        )
        error = np.sqrt(np.mean((one - other) ** 2) / np.mean(one**2))
        print(f"{name} {group}: {error:.1e}")
        assert error < bound


def test_what_mujoco_cannot_do_is_refused():
    assert "backlash" not in EFFECTS
    with pytest.raises(ValueError, match="backlash"):
        campaign.make(causes=[("backlash", "joint_1", {"gap": 1e-4})], engine="mujoco", **SHORT)
