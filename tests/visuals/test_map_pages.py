"""`picchio map --plot` and `--html`: drawn, small, and cut open in a browser."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from picchio.cli.main import run

from .pages import photograph, until_drawn


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("map")
    code = run(["map", "fanuc_like_3dof", "--box", "--spacing", "0.25", "--out",
                str(folder / "map.nc"), "--plot", str(folder / "map.png"), "--html",
                str(folder / "map.html"), "--workers", "1"])  # fmt: skip
    assert code == 0
    return folder


def test_a_map_is_drawn_and_its_page_is_small(drawn: Path) -> None:
    image = np.asarray(Image.open(drawn / "map.png").convert("RGB")).astype(int)
    colourful = (np.ptp(image, axis=2) > 60).mean()
    assert image.shape[0] > 2.5 * image.shape[1] * 4.4 / 6.2 and colourful > 0.1
    page = (drawn / "map.html").read_text()
    assert "workspace map" in page and len(page) < 3e6


def test_an_unknown_picture_is_refused_before_any_work(tmp_path: Path, capsys) -> None:
    assert run(["map", "fanuc_like_3dof", "--out", str(tmp_path / "m.nc"), "--plot",
                str(tmp_path / "m.bmp")]) == 2  # fmt: skip
    assert ".png" in capsys.readouterr().err and not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_map_can_be_turned_and_cut(open_page, drawn: Path, pictures) -> None:
    page = open_page(drawn / "map.html")
    page.wait_for_selector("html[data-ready]", timeout=60_000)
    for layer in ("robot", "envelope", "worst", "tool", "joints"):
        page.locator(f"#layer-{layer}").set_checked(False)
    page.add_style_tag(content="#labels { display: none; }")

    def coloured() -> int:
        until_drawn(page)
        page.wait_for_timeout(150)
        image = Image.open(io.BytesIO(photograph(page.locator("#pane")))).convert("RGB")
        return int((np.ptp(np.asarray(image).astype(int), axis=2) > 60).sum())

    whole = coloured()
    for name, value in (("cut-x-min", 0.7), ("cut-z-max", 0.5)):
        page.eval_on_selector(
            f"#{name}",
            "(e, v) => { e.value = v; e.dispatchEvent(new Event('input')); }", value,
        )  # fmt: skip
    part = coloured()
    photograph(page, path=str(pictures / "map-cut.png"))
    assert 0 < part < 0.6 * whole
    page.eval_on_selector(
        "#cut-x-min", "e => { e.value = 0; e.dispatchEvent(new Event('input')); }"
    )
    page.eval_on_selector(
        "#cut-z-max", "e => { e.value = 1; e.dispatchEvent(new Event('input')); }"
    )
    assert abs(coloured() - whole) < 0.02 * whole
