"""Robots, an assessment, and a headless browser that reports whatever goes wrong in it."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import matplotlib
import pytest

import picchio
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.visuals.worst_rivet import worst_rivet

matplotlib.use("Agg")

HOSTILE = '<script>alert("x")</script>&\'"</script x><!--<script'
SOFTWARE_GL = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
]


@pytest.fixture(scope="session")
def arm() -> SimpleNamespace:
    """The 3-DoF arm, its task, the assessment, and its worst rivet."""
    return _assessed("fanuc_like_3dof")


@pytest.fixture(scope="session")
def ur10() -> SimpleNamespace:
    """A robot without shafts, and nothing estimated in their place."""
    return _assessed("ur10", allow_rigid=True)


def _assessed(name: str, **options: bool) -> SimpleNamespace:
    import warnings

    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        robot = picchio.load_robot(name, **options)
        task = picchio.load_task(robot.task_path, robot)
        found = picchio.assess(robot, task)
    return SimpleNamespace(
        robot=robot,
        task=task,
        assessment=found,
        worst=worst_rivet(found, robot, task),
        warnings=[str(w.message) for w in seen],
    )


@pytest.fixture(scope="session")
def hostile_urdf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The 3-DoF arm with names that would be markup or code if nobody escaped them."""
    from lxml import etree

    from picchio.robot.loading.find import find_robot

    tree = etree.parse(str(find_robot("fanuc_like_3dof").urdf))
    for element in tree.getroot().iter("link", "joint", "parent", "child"):
        for key in ("name", "link"):
            if element.get(key):
                element.set(key, f"{element.get(key)}{HOSTILE}@@data@@</title>")
    tree.getroot().set("name", f"arm{HOSTILE}")
    for element in tree.getroot().iter("{urn:picchio:1}tool"):
        for key, value in element.attrib.items():
            if key in ("frame", "link"):
                element.set(key, f"{value}{HOSTILE}@@data@@</title>")
    path = tmp_path_factory.mktemp("hostile") / "arm.urdf"
    tree.write(str(path))
    return path


@pytest.fixture(scope="session")
def recoiling(tmp_path_factory: pytest.TempPathFactory) -> FlexibleRobot:
    """The 3-DoF arm with a gun on a recoil spring."""
    from picchio.robot.loading.find import find_robot

    path = tmp_path_factory.mktemp("gun") / "gun.toml"
    path.write_text(
        'format = "picchio-sidecar/1"\n[tool]\nframe = "tool"\naxis = [1.0, 0.0, 0.0]\n'
        "[gun]\nmass = 3.0\nrecoil_stiffness = 3e4\ndamping_ratio = 0.1\n"
    )
    return picchio.load_robot(find_robot("fanuc_like_3dof").urdf, flex=path)


@pytest.fixture(scope="session")
def missing_meshes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A UR10 whose meshes are not there, but for one file that is no mesh."""
    from picchio.robot.loading.find import find_robot

    folder = tmp_path_factory.mktemp("bare")
    (folder / "broken.stl").write_bytes(b"solid nothing\nfacet normal x y z\n")
    text = find_robot("ur10").urdf.read_text()
    text = text.replace("package://example-robot-data/", "package://nowhere/")
    text = text.replace(
        "package://nowhere/robots/ur_description/meshes/ur10/visual/forearm.dae", "broken.stl"
    )
    path = folder / "ur10.urdf"
    path.write_text(text)
    return path


@pytest.fixture(scope="session")
def pictures() -> Path:
    """Where screenshots are kept to be looked at."""
    folder = Path(os.environ.get("PICCHIO_SCREENSHOTS") or "build/screenshots")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@pytest.fixture(scope="session")
def chromium() -> Iterator[Any]:
    """Debian's chromium, headless, with software GL."""
    playwright = pytest.importorskip("playwright.sync_api")
    path = next((p for name in ("chromium", "chromium-browser", "google-chrome")
                 if (p := shutil.which(name))), None)  # fmt: skip
    if path is None:
        pytest.skip("no chromium: apt-get install chromium")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=path, args=SOFTWARE_GL)
        yield browser
        browser.close()


@pytest.fixture
def open_page(chromium: Any) -> Iterator[Callable[..., Any]]:
    """Open a file; afterwards nothing may have been said on the console or been fetched."""
    contexts: list[Any] = []
    said: list[str] = []
    fetched: list[str] = []

    def open_file(path: Path, **options: Any) -> Any:
        settings = {"viewport": {"width": 1100, "height": 700}, "reduced_motion": "reduce"}
        context = chromium.new_context(**{**settings, **options})
        context.set_offline(True)
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda m: said.append(f"{m.type}: {m.text}"))
        page.on("pageerror", lambda e: said.append(f"error: {e}"))
        page.on("dialog", lambda d: (said.append(f"dialog: {d.message}"), d.dismiss()))
        page.on("request", lambda r: fetched.append(r.url))
        page.goto(path.resolve().as_uri())
        return page

    yield open_file
    for context in contexts:
        context.close()
    errors = [line for line in said if line.startswith(("error", "dialog"))]
    assert errors == []
    outside = [url for url in fetched if not url.startswith(("file:", "data:", "blob:", "about:"))]
    assert outside == []
