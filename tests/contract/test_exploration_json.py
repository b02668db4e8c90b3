"""`picchio-exploration/1`: the keys that others rely on, and that the file loads as JSON."""

from __future__ import annotations

import json

import pytest

import picchio

KEYS = {"format", "robot", "pose", "tool", "direction", "blows", "at_limit", "touching", "models",
        "provenance"}  # fmt: skip
JOINT = {"name", "kind", "peak_deflection", "worst_deflection", "worst_direction", "peak_torque",
         "stress", "utilisation", "drive_utilisation", "life", "life_interval"}  # fmt: skip


@pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")
@pytest.mark.parametrize("name", ["fanuc_like_3dof", "panda"])
def test_the_state_on_the_screen_has_its_keys(name: str) -> None:
    live = picchio.explore(name)
    try:
        content = json.loads(json.dumps(live.to_dict(), allow_nan=False))
    finally:
        live.close()
    assert content["format"] == "picchio-exploration/1" and set(content) >= KEYS
    model = content["models"]["nominal"]
    assert content["joints"] == model["joints"]
    assert len(model["natural_frequencies"]) == len(model["joints"])
    for joint in model["joints"]:
        assert set(joint) >= JOINT
        assert joint["life"] is None or joint["life"] == "unlimited" or joint["life"] > 0.0
    assert {"kind", "force", "period", "width", "hits"} <= set(content["blows"])
