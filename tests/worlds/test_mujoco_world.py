"""Two worlds that share no mechanics tell the same story."""

import numpy as np
import pytest

from worlds import campaign
from worlds.errors import KEYS
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


@pytest.mark.parametrize(
    ("name", "causes", "bound"),
    [
        ("fanuc_like_3dof", [("link_mass", "link_3", {"scale": 1.15})], 2e-6),
        ("ur10", [("payload", "tool", {"mass": 1.0})], 1e-3),
        ("kinova_gen3", [], 1e-3),
    ],
)
def test_the_worlds_agree_when_both_are_a_little_wrong(name, causes, bound):
    """Every error but those that move the blows' edges off MuJoCo's steps."""
    only = tuple(key for key in KEYS if key not in ("rise_time", "blow_time"))
    data = {}
    for engine in ("arm", "mujoco"):
        _, truth = campaign.make(
            name, seed=7, causes=causes, engine=engine, mismatch=2.0, only=only, **SHORT
        )
        data[engine] = truth["clean"][0]
    exact = campaign.make(name, seed=7, causes=causes, **SHORT)[1]["clean"][0]
    for group, one in data["arm"].items():
        size = np.sqrt(np.mean(one**2))
        error = np.sqrt(np.mean((one - data["mujoco"][group]) ** 2)) / size
        apart = np.sqrt(np.mean((one - exact[group]) ** 2)) / size
        print(f"{name} {group}: {error:.1e}, without errors {apart:.1e}")
        assert error < bound and apart > 10.0 * bound


def test_what_mujoco_cannot_do_is_refused():
    assert "backlash" not in EFFECTS
    with pytest.raises(ValueError, match="backlash"):
        campaign.make(causes=[("backlash", "joint_1", {"gap": 1e-4})], engine="mujoco", **SHORT)
    with pytest.raises(ValueError, match="begin and end on a step"):
        campaign.make(engine="mujoco", mismatch=1.0, **SHORT)
