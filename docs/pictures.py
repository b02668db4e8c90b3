"""Takes the pictures of README and guides anew: `python docs/pictures.py`; needs chromium."""

from __future__ import annotations

import io
import shutil
import tempfile
import warnings
from pathlib import Path

import numpy as np
from examples import GL
from PIL import Image
from playwright.sync_api import Page, sync_playwright

import picchio
from picchio.robot.loading.find import find_robot
from picchio.studies.maps.places import plane
from picchio.visuals.report.assessment import assessment_report
from picchio.visuals.report.cover import Cover
from picchio.visuals.scene.build import build_scene
from picchio.visuals.scene.compare import compare_scene
from picchio.visuals.scene.scene import Scene
from picchio.visuals.worst_rivet import worst_rivet

HERE = Path(__file__).resolve().parent / "images"
GUN = """format = "picchio-sidecar/1"
tool = { frame = "tool", axis = [1.0, 0.0, 0.0] }
gun = { mass = 3.0, recoil_stiffness = 3e4, damping_ratio = 0.1 }
"""


def assessed(name: str):
    """A robot, its task, the assessment and its worst rivet."""
    robot = picchio.load_robot(name)
    task = picchio.load_task(robot.task_path, robot)
    found = picchio.assess(robot, task)
    return robot, task, found, worst_rivet(found, robot, task)


def own_scene(name: str) -> Scene:
    """The scene of a robot on its own task."""
    return picchio.view(name)


def bare(folder: Path) -> Scene:
    """The UR10 whose meshes are missing."""
    text = find_robot("ur10").urdf.read_text().replace("example-robot-data", "nowhere")
    (folder / "ur10.urdf").write_text(text)
    flex = find_robot("ur10").flex
    task = find_robot("ur10").task
    return picchio.view(folder / "ur10.urdf", flex=flex, task=task)


def mapped(folder: Path) -> Scene:
    """A workspace map around the 3-DoF arm."""
    robot, _, _, worst = assessed("fanuc_like_3dof")
    blows = worst.operation.excitation
    found = picchio.workspace_map(robot, plane(robot, "xz", spacing=0.1), blows, folder / "m.nc")
    return build_scene(robot, worst.pose, blows, workspace=found)


def ghosts() -> Scene:
    """Measured and simulated motion."""
    robot, _, _, worst = assessed("fanuc_like_3dof")
    operation, time = worst.operation, np.linspace(0.0, 1.0, 800)
    simulated = worst.response.deflection(time, operation.direction)
    return compare_scene(robot, worst.pose, operation.excitation, time, simulated,
                         {"joint_2": 1.6 * simulated[1]}, hits=12)  # fmt: skip


def gun(folder: Path) -> Scene:
    """A gun on its recoil spring."""
    (folder / "gun.toml").write_text(GUN)
    robot = picchio.load_robot(find_robot("fanuc_like_3dof").urdf, flex=folder / "gun.toml")
    blows = assessed("fanuc_like_3dof")[3].operation.excitation
    return build_scene(robot, [-0.3, 1.1, -1.0], blows, hits=3)


def shot(page: Page, path: Path, *, moment: float | None = None) -> Image.Image:
    """What a file looks like, once it is drawn; without a scene's panel where it is small."""
    page.goto(path.as_uri())
    if page.locator("#pane").count():
        page.wait_for_selector("html[data-ready]", timeout=120_000)
        if page.viewport_size["width"] < 1000:
            page.add_style_tag(
                content="#panel {display: none} #pane, #labels {inset: 0 !important}"
            )
            page.evaluate("dispatchEvent(new Event('resize'))")
        if moment is not None:
            page.evaluate(f"""for (const layer of ["envelope", "worst", "tool", "joints"])
              document.getElementById(`layer-${{layer}}`).click();
              const time = document.getElementById("time"); time.value = {moment};
              time.dispatchEvent(new Event("input"))""")
        page.wait_for_timeout(1500)
    return Image.open(io.BytesIO(page.screenshot())).convert("RGB")


def main() -> None:
    """Write the pictures."""
    warnings.simplefilter("ignore")
    browser_path = shutil.which("chromium") or shutil.which("google-chrome")
    with tempfile.TemporaryDirectory() as name, sync_playwright() as driver:
        folder = Path(name)
        browser = driver.chromium.launch(executable_path=browser_path, args=GL)

        def look(content: str, width: int, height: int, scale: int = 1, **options) -> Image.Image:
            (folder / "page.html").write_text(content)
            size = {"width": width, "height": height}
            with browser.new_context(viewport=size, reduced_motion="reduce",
                                     device_scale_factor=scale) as context:  # fmt: skip
                return shot(context.new_page(), folder / "page.html", **options)

        arm = own_scene("fanuc_like_3dof")
        save(look(arm.html(), 1100, 700), "scene-3dof")
        six = [own_scene("ur10"), own_scene("panda"), bare(folder), mapped(folder), ghosts(),
               gun(folder)]  # fmt: skip
        sheet = Image.new("RGB", (1500, 700))
        for k, scene in enumerate(six):
            moment = 0.05 if k == 4 else None
            small = look(scene.html(), 750, 525, moment=moment).resize((500, 350))
            sheet.paste(small, (500 * (k % 3), 350 * (k // 3)))
        save(sheet, "scenes")
        robot, task, found, _ = assessed("fanuc_like_3dof")
        cover = Cover("Riveting of a rear fuselage", "A customer", "An engineer")
        save(look(assessment_report(found, robot, task, cover=cover), 1000, 1300), "report")
        browser.close()


def save(image: Image.Image, name: str) -> None:
    """Write a picture with a palette of its own, which takes a quarter of the room."""
    seen = image.quantize(256, Image.Quantize.FASTOCTREE, dither=Image.Dither.FLOYDSTEINBERG)
    seen.save(HERE / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main()
