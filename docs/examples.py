"""The gallery's examples: run one, and keep the picture that it draws.

python docs/examples.py docs/gallery/01_life.py life.png
"""

from __future__ import annotations

import io
import os
import runpy
import shutil
import sys
import tempfile
import warnings
from pathlib import Path

import matplotlib

EXAMPLES = Path(__file__).resolve().parent / "gallery"
GL = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


def draw(example: Path, picture: Path) -> None:
    """Run an example in an empty folder; its picture is its figure, or the scene that it wrote."""
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        plt.close("all")
        os.chdir(folder)
        try:
            runpy.run_path(str(example))
            pages = list(Path(folder).glob("*.html"))
            if plt.get_fignums():
                plt.gcf().savefig(picture, dpi=150, bbox_inches="tight")
            elif pages:
                photograph(pages[0], picture)
            else:
                raise SystemExit(f"{example.name} draws nothing")
            if empty(picture):
                raise SystemExit(f"{example.name} draws an empty picture")
        finally:
            os.chdir(before)
            plt.close("all")


def empty(picture: Path) -> bool:
    """Whether a picture is tiny, or one grey all over."""
    import numpy as np
    from PIL import Image

    pixels = np.asarray(Image.open(picture).convert("L"), float)
    return min(pixels.shape) < 300 or pixels.std() < 5.0


def photograph(page: Path, picture: Path, width: int = 1000, height: int = 640) -> None:
    """What a page looks like in a browser, once its scene is drawn."""
    from PIL import Image
    from playwright.sync_api import sync_playwright

    browser_path = shutil.which("chromium") or shutil.which("google-chrome")
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=browser_path, args=GL)
        size = {"width": width, "height": height}
        window = browser.new_page(viewport=size, reduced_motion="reduce")
        window.goto(page.resolve().as_uri())
        if window.locator("#pane").count():
            window.wait_for_selector("html[data-ready]", timeout=120_000)
        window.wait_for_timeout(1500)
        image = Image.open(io.BytesIO(window.screenshot())).convert("RGB")
        browser.close()
    image.quantize(256, Image.Quantize.FASTOCTREE).save(picture, optimize=True)


if __name__ == "__main__":
    draw(Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve())
