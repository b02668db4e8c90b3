"""The pages in a real browser, offline: they open, show what they should, and obey."""

from __future__ import annotations

import io
import re
import warnings
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

import picchio
from picchio.diagnosis.result import Cause, Diagnosis, Value
from picchio.excitation.pulse_train import PulseTrain
from picchio.studies.assessment.method_comparison import method_terms
from picchio.visuals.report.assessment import assessment_report
from picchio.visuals.report.comparison import comparison_page
from picchio.visuals.report.cover import Cover
from picchio.visuals.report.page import plain_page
from picchio.visuals.scene.build import build_scene
from picchio.visuals.scene.compare import compare_scene

from .pages import photograph, until_drawn

pytestmark = pytest.mark.slow

BLOWS = PulseTrain(50.0, 0.040, 0.004)
SEEN = 24
"""Difference of a pixel, of 255, that an eye sees."""


def picture(page: Any, keep: Path | None = None) -> np.ndarray:
    """The 3-D pane's pixels."""
    until_drawn(page)
    page.wait_for_timeout(150)
    content = photograph(page.locator("#pane"))
    if keep is not None:
        photograph(page, path=str(keep))
    return np.asarray(Image.open(io.BytesIO(content)).convert("RGB")).astype(int)


def changed(a: np.ndarray, b: np.ndarray) -> int:
    """Pixels that differ visibly."""
    return int((np.abs(a - b).max(axis=2) > SEEN).sum())


def opened(open_page: Any, path: Path, **options: Any) -> Any:
    page = open_page(path, **options)
    page.wait_for_selector("html[data-ready]", timeout=60_000)
    page.wait_for_timeout(500)
    return page


def set_range(page: Any, name: str, value: float) -> None:
    """Move a slider as a hand would."""
    page.eval_on_selector(
        f"#{name}",
        "(e, v) => { e.value = v; e.dispatchEvent(new Event('input', {bubbles: true})); }",
        value,
    )


@pytest.fixture(scope="module")
def arm_scene(arm: SimpleNamespace, tmp_path_factory: pytest.TempPathFactory) -> Path:
    operation = arm.worst.operation
    scene = build_scene(arm.robot, arm.worst.pose, operation.excitation, hits=12,
                        direction=operation.direction, assessment=arm.assessment)  # fmt: skip
    path = tmp_path_factory.mktemp("scene") / "arm.html"
    path.write_text(scene.html())
    return path


LABELS = """() => {
  const pane = document.getElementById("labels").getBoundingClientRect(), bad = [];
  const shown = [...document.querySelectorAll("#labels span")].filter((e) => !e.hidden);
  const boxes = shown.map((e) => [e.textContent, e.getBoundingClientRect()]);
  for (const [one, a] of boxes) {
    if (a.left < pane.left || a.right > pane.right || a.top < pane.top || a.bottom > pane.bottom)
      bad.push(one);
    for (const [other, b] of boxes)
      if (one < other && a.left < b.right && b.left < a.right
          && a.top < b.bottom && b.top < a.bottom)
        bad.push(`${one} / ${other}`);
  }
  const lines = [...document.querySelectorAll("#leaders line")];
  if (lines.filter((e) => e.style.display !== "none").length !== shown.length) bad.push("leaders");
  return [shown.length, bad];
}"""


def hide_labels(page: Any) -> None:
    page.add_style_tag(content="#labels { display: none; }")


def test_overlays_are_there_and_layers_switch(open_page, arm_scene, pictures) -> None:
    page = opened(open_page, arm_scene)
    everything = picture(page, pictures / "scene-fanuc_like_3dof.png")
    hide_labels(page)
    everything = picture(page)
    # An empty stage against each layer alone: something of it must be seen.
    boxes = page.locator("#layers input")
    names = [boxes.nth(k).get_attribute("id") for k in range(boxes.count())]
    for name in names:
        page.locator(f"#{name}").set_checked(False)
    empty = picture(page)
    assert changed(everything, empty) > 20_000
    least = {"layer-tool": 300, "layer-joints": 800, "layer-worst": 800}
    for name in names:
        page.locator(f"#{name}").set_checked(True)
        alone = picture(page)
        assert changed(alone, empty) > least.get(name, 500), name
        page.locator(f"#{name}").set_checked(False)
        assert changed(picture(page), empty) == 0, name


def test_envelope_is_where_the_tool_is_and_as_large_as_told(open_page, arm_scene, arm) -> None:
    page = opened(open_page, arm_scene)
    box = page.evaluate(
        """() => {
          const { made, viewer } = picchio, T = MeshCat.THREE;
          viewer.scene.updateMatrixWorld(true);
          const { object } = made.find((m) => m.item.layer === "envelope" && m.object.visible);
          const own = new T.Box3().setFromObject(object);
          const to = new T.Matrix4().copy(viewer.scene.matrixWorld).invert();
          own.applyMatrix4(to);
          return [own.min.toArray(), own.max.toArray()];
        }"""
    )
    low, high = np.array(box)
    tool = arm.robot.state(arm.worst.pose).tool_position
    np.testing.assert_allclose(0.5 * (low + high), tool, atol=1e-4)


def test_links_are_where_pinocchio_has_them(open_page, arm_scene, arm) -> None:
    page = opened(open_page, arm_scene)
    set_range(page, "time", 0.0)
    places = page.evaluate(
        """() => {
          const { viewer, data } = picchio, T = MeshCat.THREE;
          viewer.scene.updateMatrixWorld(true);
          const to = new T.Matrix4().copy(viewer.scene.matrixWorld).invert();
          return data.frames.map((f) => {
            const node = viewer.scene_tree.find(["picchio", "robot", ...f.path.split("/")]);
            return new T.Vector3().setFromMatrixPosition(node.object.matrixWorld).applyMatrix4(to)
              .toArray();
          });
        }"""
    )
    from picchio.visuals.kinematics import frames

    for frame, place in zip(frames(arm.robot, arm.worst.pose), places, strict=True):
        expected, _ = arm.robot.frame_placement(arm.worst.pose, frame.link)
        np.testing.assert_allclose(place, expected, atol=1e-6)


def test_sliders_and_choices_change_the_picture(open_page, arm_scene, pictures) -> None:
    page = opened(open_page, arm_scene)
    hide_labels(page)
    first = picture(page)
    assert changed(first, picture(page)) == 0  # nothing moves by itself
    set_range(page, "size", 2.0)
    assert changed(first, picture(page)) > 10_000
    assert "2.00" in page.locator("#size-out").inner_text()
    set_range(page, "size", 1.0)
    assert changed(first, picture(page)) == 0
    page.locator("#joint").select_option(label="joint_1")
    assert changed(first, picture(page, pictures / "scene-joint_1.png")) > 5_000
    page.locator("#joint").select_option(label="joint_2")
    set_range(page, "time", 0.02)
    moved = picture(page)
    assert changed(first, moved) > 2_000
    set_range(page, "factor", 0.6)
    assert changed(moved, picture(page)) > 2_000
    assert "200" in page.locator("#factor-out").inner_text()
    page.locator("#direction").select_option(index=2)
    page.locator("#play").click()
    page.wait_for_timeout(400)
    assert page.evaluate("picchio.state.playing")
    assert page.locator("#clock").inner_text().endswith("slow")
    # between two blows the arm comes to rest: it is looked at until a blow moves it
    assert any(changed(picture(page), first) > 500 for _ in range(20))


def test_it_can_be_used_by_keyboard(open_page, arm_scene) -> None:
    page = opened(open_page, arm_scene)
    reached = set()
    for _ in range(24):
        page.keyboard.press("Tab")
        reached.add(page.evaluate("document.activeElement.id"))
    assert {"joint", "size", "play", "direction", "factor", "layer-robot"} <= reached
    page.locator("#size").focus()
    page.keyboard.press("ArrowRight")
    assert page.evaluate("picchio.state.size") == pytest.approx(1.05)


def test_motion_is_shown_unless_it_is_unwanted(open_page, arm_scene) -> None:
    page = opened(open_page, arm_scene, reduced_motion="no-preference")
    before = page.evaluate("picchio.state.time")
    page.wait_for_function("before => picchio.state.time !== before", arg=before)  # or it fails


@pytest.mark.parametrize("name", ["ur10", "panda"])
def test_scenes_of_other_robots(open_page, tmp_path, pictures, name: str) -> None:
    robot = picchio.load_robot(name)
    task = picchio.load_task(robot.task_path, robot)
    path = tmp_path / f"{name}.html"
    path.write_text(build_scene(robot, task.operations[0].poses[0], BLOWS).html())
    page = opened(open_page, path)
    # On a telephone, too, no label covers another or leaves the picture, and each has its line.
    for width, height in ((390, 844), (1100, 700)):
        page.set_viewport_size({"width": width, "height": height})
        for _ in range(20):  # a busy machine draws late
            page.wait_for_timeout(300)
            labels, bad = page.evaluate(LABELS)
            if bad == []:
                break
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert labels > len(robot.flexible_names) and bad == []
    shown = picture(page, pictures / f"scene-{name}.png")
    page.locator("#layer-robot").set_checked(False)
    assert changed(shown, picture(page)) > 20_000


def test_a_robot_without_meshes(open_page, tmp_path, pictures, missing_meshes) -> None:
    flex = picchio.robot.loading.find.robots_folder() / "ur10" / "flex.toml"
    robot = picchio.load_robot(missing_meshes, flex=flex)
    path = tmp_path / "bare.html"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene = build_scene(robot, [0.0, -1.2, 1.6, -0.4, 1.57, 0.0], BLOWS)
    path.write_text(scene.html())
    page = opened(open_page, path)
    shown = picture(page, pictures / "scene-missing-meshes.png")
    page.locator("#layer-robot").set_checked(False)
    assert changed(shown, picture(page)) > 3_000


def test_hostile_names_do_nothing(open_page, tmp_path, hostile_urdf) -> None:
    robot = picchio.load_robot(hostile_urdf)
    path = tmp_path / "hostile.html"
    path.write_text(
        build_scene(robot, [0.3] * len(robot.joint_names), BLOWS, subdivisions=2).html()
    )
    page = opened(open_page, path)
    told = page.locator("#joint option").all_inner_texts()
    assert told == list(robot.flexible_names)
    assert page.locator("#labels span").first.inner_text().startswith(robot.flexible_names[0])


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_report_opens_unfolds_and_its_links_work(
    open_page, tmp_path, arm, arm_scene, pictures, theme: str
) -> None:
    path = tmp_path / "report.html"
    path.write_text(assessment_report(arm.assessment, arm.robot, arm.task,
                                      scene=arm_scene.read_text()))  # fmt: skip
    page = open_page(path, color_scheme=theme)
    assert "joint_2" in page.locator("#verdict").inner_text()
    photograph(page, path=str(pictures / f"report-{theme}.png"), full_page=True)
    for link in page.locator("nav a").all():
        link.click()
        assert page.evaluate("location.hash") == link.get_attribute("href")
        assert page.evaluate("document.querySelector(location.hash) !== null")
    for fold in page.locator("details").all():
        fold.locator("summary").focus()
        page.keyboard.press("Enter")
        assert fold.get_attribute("open") is not None
    frame = page.frame_locator("iframe")
    frame.locator("html[data-ready]").wait_for(timeout=60_000)
    assert frame.locator("#joint").input_value() == "1"
    # Nothing may be wider than the page.
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


@pytest.fixture(scope="module")
def pages(tmp_path_factory, arm, ur10) -> dict[str, Path]:
    """A page of every kind that people print or read on a telephone, by its kind."""
    folder = tmp_path_factory.mktemp("pages")
    logo = folder / "logo.png"
    Image.new("RGB", (240, 60), "navy").save(logo)
    cover = Cover("Riveting of the rear fuselage", "A customer", "An engineer", logo)
    other = {**arm.assessment.to_dict(), "rivets_to_failure": 1.0}
    texts = {
        "report": assessment_report(
            arm.assessment,
            arm.robot,
            arm.task,
            cover=cover,
            allowed=picchio.allowable(arm.robot, arm.task, 1e6, survival=0.99),
            terms=method_terms(arm.robot, arm.task, arm.assessment),
        ),
        "bare": assessment_report(ur10.assessment, ur10.robot, ur10.task),
        "comparison": comparison_page(picchio.compare(arm.assessment, other, ur10.assessment)),
        "plain": plain_page(picchio.robots()),
    }
    for name, text in texts.items():
        (folder / f"{name}.html").write_text(text)
    return {name: folder / f"{name}.html" for name in texts}


def test_pages_on_a_telephone(open_page, pages, pictures) -> None:
    for name, path in pages.items():
        for width in (390, 1280):
            page = open_page(path, viewport={"width": width, "height": 800})
            page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true })")
            photograph(page, path=str(pictures / f"{name}-{width}.png"), full_page=True)
            assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), name
            page.close()  # eight long pages at once were too much for a busy machine


def test_report_prints_with_page_numbers(open_page, pages, pictures) -> None:
    page = open_page(pages["report"])
    content = page.pdf(prefer_css_page_size=True)
    (pictures / "report.pdf").write_bytes(content)
    assert content.startswith(b"%PDF")
    assert 2 <= len(re.findall(rb"/Type\s*/Page\b", content)) <= 5
    page.emulate_media(media="print")
    # What is wider than the paper would be cut off: 182 mm at 96 dpi. The verdict, what lowers
    # trust, the material and the joints are on the first page: 267 mm.
    page.set_viewport_size({"width": 688, "height": 1000})
    assert page.evaluate(
        "[...document.querySelectorAll('table')].filter(t => t.offsetParent !== null)"
        ".every(t => t.scrollWidth <= 688)"
    )
    first = ("#verdict", ".cover", ".warnings", ".material")
    tops = {e: page.locator(e).first.bounding_box()["y"] for e in first}
    assert all(y < 1009 for y in tops.values()), tops
    # Green is for safe alone.
    assert "safe" in page.locator("#verdict").get_attribute("class")


def test_the_map_follows_the_joint(open_page, tmp_path, pictures, arm) -> None:
    from picchio.studies.maps.places import plane
    from picchio.studies.maps.run import workspace_map

    blows = arm.worst.operation.excitation
    workspace = workspace_map(arm.robot, plane(arm.robot, "xz", spacing=0.15), blows,
                              tmp_path / "map.nc")  # fmt: skip
    path = tmp_path / "map.html"
    path.write_text(build_scene(arm.robot, arm.worst.pose, blows, workspace=workspace).html())
    page = opened(open_page, path)
    hide_labels(page)
    for layer in ("robot", "envelope", "worst", "tool", "joints"):
        page.locator(f"#layer-{layer}").set_checked(False)
    seen, bars = [], []
    for joint in arm.robot.flexible_names:
        page.locator("#joint").select_option(label=joint)
        seen.append(picture(page, pictures / f"scene-map-{joint}.png"))
        bars.append(page.locator("#layers .bar b").last.inner_text())
    page.locator("#layer-map").set_checked(False)
    empty = picture(page)
    assert all(changed(one, empty) > 2_000 for one in seen)
    assert changed(seen[0], seen[1]) > 1_000 and changed(seen[1], seen[2]) > 500
    assert len(set(bars)) == 3


def test_two_ghosts_play_two_histories(open_page, tmp_path, pictures, arm) -> None:
    operation = arm.worst.operation
    time = np.linspace(0.0, 1.0, 800)
    simulated = arm.worst.response.deflection(time, operation.direction)
    measured = {"joint_2": 1.6 * simulated[1]}
    path = tmp_path / "ghosts.html"
    path.write_text(compare_scene(arm.robot, arm.worst.pose, operation.excitation, time, simulated,
                                  measured, hits=12).html())  # fmt: skip
    page = opened(open_page, path)
    hide_labels(page)
    for layer in ("envelope", "worst", "tool", "joints"):
        page.locator(f"#layer-{layer}").set_checked(False)
    peak = float(np.abs(simulated[1]).argmax() / time.size)
    set_range(page, "time", peak)
    both = picture(page, pictures / "scene-ghosts.png")
    page.locator("#layer-measured").set_checked(False)
    one = picture(page)
    assert changed(both, one) > 1_500
    page.locator("#layer-simulated").set_checked(False)
    assert changed(one, picture(page)) > 1_500
    # Each ghost's second joint stands where its own history has it, exaggerated.
    factor, moment = page.evaluate("[picchio.state.factor, picchio.state.time]")
    turned = page.evaluate(
        """() => picchio.data.motion.tracks.map((t) => {
          const f = picchio.data.frames.find((f) => f.follows && f.follows[1]);
          const node = picchio.viewer.scene_tree.find(["picchio", t.layer, ...f.path.split("/")]);
          const rest = picchio.viewer.scene_tree.find(["picchio", "robot", ...f.path.split("/")]);
          return rest.object.quaternion.angleTo(node.object.quaternion);
        })"""
    )
    at = np.interp(moment, time, simulated[1])
    np.testing.assert_allclose(turned, np.abs([at, 1.6 * at]) * factor, rtol=0.02)
    assert page.locator("#direction").is_hidden()


def test_causes_are_seen_and_told(open_page, tmp_path, pictures, arm) -> None:
    mass = Cause("payload", "tool", 0.99, {"mass": Value(4.0, 0.02, "kg")})
    spring = Cause("joint_stiffness", "joint_2", 0.99, {"scale": Value(0.7, 0.01, "1")})
    found = Diagnosis("ambiguous", (mass, spring), ((("cable", "link_3"),),))
    path = tmp_path / "causes.html"
    path.write_text(build_scene(arm.robot, arm.worst.pose, BLOWS, diagnosis=found).html())
    page = opened(open_page, path)
    picture(page, pictures / "scene-causes.png")
    assert page.locator("#causes li").all_inner_texts() == [
        "payload: mass 4 kg",
        "joint stiffness of joint_2: scale 0.7",
        "cable of link_3",
    ]
    labels = page.locator("#labels span:visible").all_inner_texts()
    assert labels == ["payload", "joint stiffness", "cable"]
    hide_labels(page)
    shown = picture(page)
    for layer, least in (("alternatives", 500), ("causes", 800)):
        page.locator(f"#layer-{layer}").set_checked(False)
        without = picture(page)
        assert changed(shown, without) > least, layer
        shown = without
    # It stands at rest, where Pinocchio has it, until it is played; then the causes move with it.
    where = """(layer) => {
      const { viewer, data } = picchio, { path } = data.frames.at(-1);
      const node = viewer.scene_tree.find(["picchio", layer, ...path.split("/")]).object;
      node.updateWorldMatrix(true, false);
      return node.matrixWorld.toArray();
    }"""
    rest, ghost = page.evaluate(where, "causes"), page.evaluate(where, "ghost")
    np.testing.assert_allclose(rest, ghost, atol=1e-9)
    set_range(page, "time", 0.3)
    moved = page.evaluate(where, "causes")
    np.testing.assert_allclose(moved, page.evaluate(where, "robot"), atol=1e-9)
    assert np.abs(np.subtract(moved, rest)).max() > 1e-4


def test_a_recoiling_gun_slides(open_page, tmp_path, pictures, recoiling) -> None:
    scene = build_scene(recoiling, [-0.3, 1.1, -1.0], BLOWS, hits=3, joint="gun_recoil")
    path = tmp_path / "gun.html"
    path.write_text(scene.html())
    page = opened(open_page, path)
    hide_labels(page)
    first = picture(page, pictures / "scene-gun.png")
    for layer in ("envelope", "worst", "tool", "joints"):
        page.locator(f"#layer-{layer}").set_checked(False)
    frame = next(k for k, f in enumerate(scene.frames) if f.joint == "gun_recoil")
    where = f"""() => {{
      const path = picchio.data.frames[{frame}].path.split("/");
      const node = picchio.viewer.scene_tree.find(["picchio", "robot", ...path]);
      return node.object.position.toArray();
    }}"""
    set_range(page, "time", 0.0)
    rest = np.array(page.evaluate(where))
    set_range(page, "time", 0.03)
    moved = np.array(page.evaluate(where)) - rest
    assert np.abs(moved[1:]).max() < 1e-9 < abs(moved[0])  # along the tool's axis
    assert changed(first, picture(page)) > 500


def test_a_live_viewer_has_sliders(chromium, hostile_urdf, pictures) -> None:
    """Meshcat's own server and page; names that would be markup are none there either."""
    meshcat = pytest.importorskip("meshcat")
    robot = picchio.load_robot(hostile_urdf)
    viewer = meshcat.Visualizer()
    page = chromium.new_page(viewport={"width": 1100, "height": 700})
    said: list[str] = []
    page.on("pageerror", lambda e: said.append(str(e)))
    page.on("dialog", lambda d: (said.append(d.message), d.dismiss()))

    def look(keep: str = "live.png") -> np.ndarray:
        page.wait_for_timeout(500)
        content = photograph(page, path=str(pictures / keep))
        return np.asarray(Image.open(io.BytesIO(content)).convert("RGB")).astype(int)

    try:
        build_scene(robot, [0.3, 1.1, -1.0], BLOWS, hits=3, subdivisions=3).show(viewer)
        page.goto(viewer.url())
        page.wait_for_function("window.picchio_live", timeout=60_000)
        page.evaluate("viewer.set_control_value('moment', 0)")
        page.wait_for_timeout(1000)
        seen = look()
        names = page.locator(".property-name").all_inner_texts()
        assert names[-5:] == ["joint", "size", "exaggerated", "moment", "play"]
        for control, value in (("joint", 1), ("size", 2.0), ("moment", 0.05), ("exaggerated", 0.8)):
            page.evaluate(f"viewer.set_control_value('{control}', {value})")
            now = look(f"live-{control}.png")
            assert changed(seen, now) > 500, control
            seen = now
        told = page.locator("#picchio-told").inner_text()
        assert told.startswith(robot.flexible_names[0])
    finally:
        page.close()
        viewer.window.server_proc.kill()
        viewer.window.server_proc.wait()
    assert said == []
