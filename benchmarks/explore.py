"""From a gesture to new values in the page of `picchio explore`, in headless Chromium.

    python benchmarks/explore.py [--gestures 200] [--json FILE] [--chromium PATH]

For arms of 3, 6 and 7 joints the tool is dragged and a slider moved by the browser's own events,
one every 40 ms. A gesture's time runs from the event's own time stamp to the moment at which the
table of the page holds the values that answer it; what came while another question was under way
counts from its own stamp, too. Drawing the 3-D picture is timed apart: without a graphics card it
is done in software on the same cores. So there are two rounds: one in which the page does not draw,
one in which it does, with the time from the call to the end of the frame. The load of the machine
is printed beside it.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import sync_playwright

import picchio
from picchio.core.files import atomic_write

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "visuals"))
from explore_page import WHERE, opened, until

ROBOTS = {3: "fanuc_like_3dof", 6: "ur10", 7: "panda"}
PAUSE = 40  # ms
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
         "--enable-unsafe-swiftshader", "--disable-background-networking"]  # fmt: skip


def gestures(page: Any, count: int) -> None:
    """Half of them drag the tool about a circle, half move the second joint's slider."""
    x, y = page.evaluate(WHERE, "tool")
    page.mouse.move(x, y)
    page.mouse.down()
    for k in range(count // 2):
        turn = 2.0 * np.pi * k / 50.0
        page.mouse.move(x + 60.0 * np.sin(turn), y + 40.0 * (np.cos(turn) - 1.0))
        page.wait_for_timeout(PAUSE)
    page.mouse.up()
    until(page, "picchio.idle()")
    page.locator("#joint-1").focus()
    for k in range(count - count // 2):
        page.keyboard.press("ArrowRight" if (k // 25) % 2 else "ArrowLeft")
        page.wait_for_timeout(PAUSE)
    until(page, "picchio.idle()")


def measured(browser: Any, name: str, count: int) -> dict[str, Any]:
    live = picchio.explore(name, save=os.devnull)
    page = browser.new_page(viewport={"width": 1280, "height": 900})
    said: list[str] = []
    fetched: list[str] = []
    page.on("console", lambda m: said.append(m.text))
    page.on("pageerror", lambda e: said.append(str(e)))
    page.on("request", lambda r: fetched.append(r.url))
    try:
        opened(page, live.url)
        gestures(page, 20)  # the first ones compile and load
        rounds = []
        for off in ("true", "false"):
            page.evaluate(f"picchio.pen.off = {off}; picchio.latency.length = 0; "
                          "picchio.drawn.length = 0")  # fmt: skip
            gestures(page, count)
            rounds.append(page.evaluate("[picchio.latency, picchio.drawn]"))
    finally:
        page.close()
        live.close()
    whole, drawing = (np.array([one["ms"] for one in latency]) for latency, _ in rounds)
    took = np.array([one["took"] for one in rounds[0][0]])
    outside = [url for url in fetched if not url.startswith((live.url, "data:", "blob:"))]
    return {
        "robot": name, "gestures": [len(whole), len(drawing)],
        **{f"p{q}": float(np.percentile(whole, q)) for q in (50, 90, 95, 99)},
        "server_p95": float(np.percentile(took, 95)),
        "while_drawing_p50": float(np.percentile(drawing, 50)),
        "while_drawing_p95": float(np.percentile(drawing, 95)),
        "drawing_p50": float(np.percentile(rounds[1][1], 50)),
        "drawing_p95": float(np.percentile(rounds[1][1], 95)),
        "console": said, "outside": outside, "load": os.getloadavg()[0],
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--gestures", type=int, default=200)
    parser.add_argument("--json", metavar="FILE")
    parser.add_argument("--chromium", default=shutil.which("chromium"))
    options = parser.parse_args()
    warnings.simplefilter("ignore", picchio.PicchioWarning)
    results = {}
    print("ms, from gesture to values                          |  the server | while it draws | "
          "a picture\njoints  robot            gestures   p50   p90   p95   p99 |   of it p95 | "
          "   p50     p95 |   p50   p95 | load  console  outside")  # fmt: skip
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=options.chromium, args=FLAGS)
        for joints, name in ROBOTS.items():
            r = results[str(joints)] = measured(browser, name, options.gestures)
            print(
                f"{joints:6d}  {name:16s} {r['gestures'][0]:8d} {r['p50']:5.1f} {r['p90']:5.1f} "
                f"{r['p95']:5.1f} {r['p99']:5.1f} | {r['server_p95']:11.1f} | "
                f"{r['while_drawing_p50']:6.1f} {r['while_drawing_p95']:7.1f} | "
                f"{r['drawing_p50']:5.1f} {r['drawing_p95']:5.1f} | {r['load']:4.1f} "
                f"{len(r['console']):8d} {len(r['outside']):8d}",
                flush=True,
            )
        browser.close()
    if options.json:
        with atomic_write(options.json) as stream:
            stream.write(json.dumps({"format": "picchio-benchmark/1", "explore": results}) + "\n")


if __name__ == "__main__":
    main()
