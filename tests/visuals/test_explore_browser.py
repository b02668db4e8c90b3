"""`picchio explore` in a real browser: dragged, clicked, exported; nothing is said or fetched."""

from __future__ import annotations

import csv
import io
import xml.etree.ElementTree as ET
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
import pytest
from PIL import Image

import picchio

from .explore_page import drag, opened, settled, until
from .pages import photograph

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")]


@pytest.fixture
def page_of(chromium: Any, tmp_path: Path) -> Any:
    """`page_of(robot, **options)`: the page and the explorer; afterwards all was quiet."""
    made: list[Any] = []
    said: list[str] = []
    fetched: list[str] = []

    def open_robot(robot: Any, *, viewport: tuple[int, int] = (1280, 900), **options: Any) -> Any:
        live = picchio.explore(robot, save=tmp_path / "kept.toml", **options)
        page = chromium.new_page(viewport={"width": viewport[0], "height": viewport[1]})
        made.append((live, page))
        page.on("console", lambda m: said.append(f"{m.type}: {m.text}"))
        page.on("pageerror", lambda e: said.append(f"error: {e}"))
        page.on("request", lambda r: fetched.append(r.url))
        page.on("websocket", lambda w: fetched.append(w.url.replace("ws://", "http://")))
        return opened(page, live.url), live

    yield open_robot
    for live, page in made:
        page.close()
        live.close()
    assert [line for line in said if line.startswith("error")] == []
    own = tuple(live.url for live, _ in made)
    assert [url for url in fetched if not url.startswith((*own, "data:", "blob:"))] == []
    assert any(url.endswith("/live") for url in fetched)


def test_drag_slide_click_and_export(page_of, pictures, tmp_path) -> None:
    page, live = page_of("ur10")
    first = settled(page)
    before = page.locator("#joints").inner_text()
    drag(page, "tool", (30.0, -60.0))
    moved = settled(page)
    assert moved["tool"][2] > first["tool"][2] + 0.05
    assert page.locator("#joints").inner_text() != before
    assert not np.allclose(moved["pose"], first["pose"])
    wide = page.evaluate("(t => [t.scrollWidth, t.parentElement.clientWidth])(joints)")
    assert wide[0] <= wide[1]  # the life, at the table's end, can be seen
    # What stands in the page is what the method says there.
    row = page.locator("#joints tbody tr").nth(1).locator("td").all_inner_texts()
    stated = picchio.assess(live.session.robot, live.task, uncertainty=False).operations[0]
    assert float(row[1]) == pytest.approx(1e3 * stated.peak_deflection[0, 1], rel=6e-3)
    drag(page, "tail", (-40.0, 70.0))
    turned = settled(page)
    assert not np.allclose(turned["direction"], moved["direction"], atol=0.05)
    assert np.linalg.norm(turned["direction"]) == pytest.approx(1.0)
    page.eval_on_selector(
        "#joint-1", "e => { e.value = -1.1; e.dispatchEvent(new Event('input')); }"
    )
    assert settled(page)["pose"][1] == pytest.approx(-1.1, abs=2e-3)
    page.locator("#force").focus()
    page.keyboard.press("ArrowRight")
    assert settled(page)["blows"]["force"] == first["blows"]["force"] + 1.0
    page.locator("#joints tbody tr").nth(2).click()
    page.locator("#worst").click()
    worst = settled(page)
    joint = worst["models"]["nominal"]["joints"][2]
    assert worst["joint"] == 2
    assert joint["peak_deflection"] == pytest.approx(joint["worst_deflection"], rel=1e-6)
    page.locator("#write").click()
    until(page, "document.getElementById('written').textContent.includes('1 pose')")
    written = picchio.load_task(tmp_path / "kept.toml", live.session.robot).operations[0]
    np.testing.assert_allclose(written.poses[0], worst["pose"], atol=1e-8)
    page.wait_for_timeout(1500)
    photograph(page, path=str(pictures / "explore-ur10.png"))
    files = {}
    for name in ("png", "svg", "csv", "toml"):
        with page.expect_download() as download:
            page.locator(f"#{name}").click()
        files[name] = Path(download.value.path()).read_bytes()
    image = np.asarray(Image.open(io.BytesIO(files["png"])).convert("RGB"))
    assert image.shape[0] > 600 and len(np.unique(image.reshape(-1, 3), axis=0)) > 200
    drawing = ET.fromstring(files["svg"])
    texts = [e.text for e in drawing.iter("{http://www.w3.org/2000/svg}text")]
    assert any("elbow_joint" in (text or "") for text in texts)
    rows = list(csv.DictReader(io.StringIO(files["csv"].decode())))
    assert len(rows) == 6
    assert float(rows[2]["peak_deflection [rad]"]) == pytest.approx(joint["peak_deflection"])
    (tmp_path / "task.toml").write_bytes(files["toml"])
    exported = picchio.load_task(tmp_path / "task.toml", live.session.robot).operations[0]
    np.testing.assert_allclose(exported.direction, worst["direction"], atol=1e-8)


def test_limits_are_told_and_a_phone_has_room(page_of, pictures) -> None:
    from picchio.model.effects.registry import from_dict

    robot = picchio.load_robot("fanuc_like_3dof")
    heavy = from_dict({"effect": "payload", "target": "tool", "parameters": {"mass": 8.0}}, robot)
    page, live = page_of(picchio.Model(robot).with_effects([heavy]), viewport=(390, 844))
    both = settled(page)["models"]
    assert both["nominal"]["natural_frequencies"] > both["extended"]["natural_frequencies"]
    assert page.locator("#joints tbody tr").count() == 6
    page.locator("#tool-0").fill("9")
    page.locator("#tool-0").press("Enter")
    told = settled(page)
    assert "short of that place" in page.locator("#state").inner_text()
    assert live.session.robot.limit_violations(told["pose"]) == []
    width = page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
    assert width[0] <= width[1]
    page.wait_for_timeout(1500)
    photograph(page, path=str(pictures / "explore-phone.png"))
    live.close()
    until(page, "document.getElementById('state').textContent.includes('has ended')")


@pytest.mark.parametrize("viewport", [(390, 800), (1280, 900)], ids=["phone", "desk"])
def test_a_cell_whose_kernel_has_ended_shows_the_robot_and_why(
    chromium, pictures, tmp_path, viewport
) -> None:
    live = picchio.explore("ur10", save=tmp_path / "kept.toml")
    cell = tmp_path / "cell.html"
    cell.write_text(f"<!DOCTYPE html><html><body>{live._repr_html_()}</body></html>")
    # A notebook is a page of this machine: no other may frame it.
    files = partial(SimpleHTTPRequestHandler, directory=tmp_path)
    notebook = ThreadingHTTPServer(("127.0.0.1", 0), files)
    Thread(target=notebook.serve_forever, daemon=True).start()
    address = f"http://127.0.0.1:{notebook.server_port}/cell.html"
    width, height = viewport
    page = chromium.new_page(viewport={"width": width, "height": height})
    page.goto(address)
    (inside,) = (frame for frame in page.frames if frame.url == live.url)
    inside.locator("html[data-ready]").wait_for(state="attached", timeout=120_000)
    assert inside.locator("h1").inner_text() == "ur10"
    live.close()
    page.close()
    page = chromium.new_page(viewport={"width": width, "height": height})
    page.goto(address, wait_until="domcontentloaded")
    page.locator("object img").wait_for(state="visible")
    assert page.locator("object a").get_attribute("href") == live.url
    assert page.evaluate("document.querySelector('img').naturalWidth") > 300
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    photograph(page, path=pictures / f"explore-cell-ended-{width}.png")
    page.close()
    notebook.shutdown()
