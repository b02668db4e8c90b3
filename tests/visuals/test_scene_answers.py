"""Scenes that answer: a joint, a rivet, a ball, the axes; and that they stay small."""

from __future__ import annotations

import io
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

from picchio.visuals.scene.build import build_scene

from .pages import photograph, until_drawn

MOST = 3e6  # bytes

# Where the middle of an item is seen, in pixels.
SEEN = """(chosen) => {
  const { made, viewer } = picchio, T = MeshCat.THREE, box = document.getElementById("pane")
    .getBoundingClientRect();
  const { object } = made.filter(({ item }) => item.layer === chosen[0])[chosen[1]];
  object.updateWorldMatrix(true, false);
  viewer.camera.updateMatrixWorld();  // the view may not have been drawn yet
  const at = new T.Box3().setFromObject(object).getCenter(new T.Vector3()).project(viewer.camera);
  return [box.left + ((at.x + 1) / 2) * box.width, box.top + ((1 - at.y) / 2) * box.height];
}"""


@pytest.fixture(scope="module")
def scene(arm: SimpleNamespace) -> Any:
    operation = arm.worst.operation
    return build_scene(arm.robot, arm.worst.pose, operation.excitation, hits=12,
                       direction=operation.direction, assessment=arm.assessment)  # fmt: skip


def test_what_a_click_tells_is_what_was_assessed(scene, arm) -> None:
    assert len(scene.html()) < MOST
    rivets = [item for item in scene.items if item.layer.startswith("rivets")]
    assert len(rivets) == sum(len(op.poses) for op in arm.assessment.operations)
    first = arm.assessment.operations[0]
    told = {row[0]: row[1] for row in rivets[0].told}
    assert told["operation"].startswith(first.name)
    numbers = [float(x) for x in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", told["pose"])]
    np.testing.assert_allclose(numbers, first.poses[0], atol=5e-4)
    use = np.fmax(first.utilisation[0], first.reducer_utilisation[0])
    assert float(told["utilisation"].split()[0]) == pytest.approx(100 * np.nanmax(use), rel=5e-3)
    for k, joint in enumerate(arm.robot.flexible_joints):
        rows = {row[0]: row for row in scene.joints[k]["card"]["rows"]}
        assert rows["stiffness"][1].startswith(f"{joint.stiffness:.4g}")
        assert rows["stiffness"][2] == arm.robot.origins[f"{joint.name}.stiffness"]
        peak = float(rows["worst peak here"][1].split()[0]) * 1e-3
        assert peak == pytest.approx(scene.envelope.peak_deflection[k], rel=5e-3)
    # One bar where joints and rivets are coloured by the same thing.
    assert set(scene.scales) == {"joints"}


def test_the_shares_of_a_joints_rivets_add_up_to_all_of_it(arm) -> None:
    from dataclasses import replace

    from picchio.visuals.scene.cards import rivet_card

    rng = np.random.default_rng(5)
    # Damage in one joint alone, so that every rivet speaks of it.
    spent = [rng.uniform(1e-9, 1e-7, len(op.poses)) for op in arm.assessment.operations]
    operations = tuple(
        replace(op, damage_per_rivet=np.outer(own, [0.0, 1.0, 0.0]), rivets=2.0 + k)
        for k, (op, own) in enumerate(zip(arm.assessment.operations, spent, strict=True))
    )
    found = replace(arm.assessment, operations=operations)
    shares = []
    for op in operations:
        for i in range(len(op.poses)):
            row = next(r[1] for r in rivet_card(found, op, i) if r[0] == "share")
            assert row.endswith("of the damage of joint_2 on this task")
            shares.append(float(row.split()[0]))
    assert sum(shares) == pytest.approx(100.0, rel=0.01)


@pytest.mark.slow
def test_clicks_and_hovers_are_answered(open_page, scene, tmp_path: Path, pictures) -> None:
    path = tmp_path / "scene.html"
    path.write_text(scene.html())
    page = open_page(path, accept_downloads=True)
    page.wait_for_selector("html[data-ready]", timeout=60_000)
    for layer in ("envelope", "worst", "robot"):
        page.locator(f"#layer-{layer}").set_checked(False)
    until_drawn(page)
    at = page.evaluate(SEEN, ["rivets-1", 0])
    page.mouse.click(*at)
    assert page.locator("#card-title").inner_text() == "Rivet"
    assert "pose" in page.locator("#card-rows").inner_text()
    page.locator("#layer-robot").set_checked(True)
    page.evaluate("document.getElementById('card').hidden = true")
    # The pixel of a link: it speaks of the joint that moves it.
    last = page.evaluate("picchio.made.filter((m) => m.item.layer === 'robot').length") - 1
    page.mouse.click(*page.evaluate(SEEN, ["robot", last // 2]))
    title = page.locator("#card-title").inner_text()
    assert title in scene.envelope.joint_names
    assert page.locator("#joint option:checked").inner_text() == title
    assert "robot.urdf" in page.locator("#card-rows").inner_text()
    points = page.locator("#card-plot polyline").get_attribute("points").split()
    assert len(points) == scene.motion["samples"].shape[2]
    photograph(page, path=str(pictures / "scene-card.png"))
    page.locator("#layer-envelope").set_checked(True)
    page.locator("#joint").select_option(label="joint_2")
    page.locator("[data-view=x]").click()
    until_drawn(page)
    x, y = page.evaluate(SEEN, ["envelope", 1])
    told = ""
    for aside in (18, 30, 45, 60):
        page.mouse.move(x + aside, y + aside)
        until_drawn(page)
        if page.locator("#value").is_visible():
            told = page.locator("#value").inner_text()
            break
    name, value, way = re.fullmatch(r"(\S+): (\S+) mrad along \((.*)\)", told).groups()
    direction = np.array([float(c) for c in way.split(",")])
    direction /= np.linalg.norm(direction)
    exact = 1e3 * scene.envelope.support(direction)[1, 0]
    assert name == "joint_2" and float(value) == pytest.approx(exact, rel=0.03)
    camera = page.evaluate("picchio.viewer.camera.position.toArray()")
    page.locator("[data-view=home]").click()
    assert page.evaluate("picchio.viewer.camera.position.toArray()") != camera
    with page.expect_download() as download:
        page.locator("#png").click()
    image = np.asarray(Image.open(io.BytesIO(Path(download.value.path()).read_bytes())))
    assert image.shape[0] > 400 and image.std() > 5


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")
@pytest.mark.parametrize("name", ["ur10", "panda"])
def test_scenes_of_large_robots_stay_small(name: str) -> None:
    import picchio

    assert len(picchio.view(name).html()) < MOST
