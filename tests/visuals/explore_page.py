"""The page of `picchio explore` in a browser: opened, dragged, moved; used by benchmarks, too."""

from __future__ import annotations

import time
from typing import Any

WHERE = """(name) => {
  const { parts, viewer } = picchio, box = document.getElementById("pane").getBoundingClientRect();
  parts[name].updateWorldMatrix(true, false);
  const at = new MeshCat.THREE.Vector3().setFromMatrixPosition(parts[name].matrixWorld)
    .project(viewer.camera);
  return [box.left + ((at.x + 1) / 2) * box.width, box.top + ((1 - at.y) / 2) * box.height];
}"""


def until(page: Any, expression: str, seconds: float = 60.0) -> None:
    """Wait until something holds; the page's policy forbids Playwright's own way of asking."""
    end = time.monotonic() + seconds
    while not page.evaluate(expression):
        assert time.monotonic() < end, expression
        page.wait_for_timeout(10)


def opened(page: Any, url: str) -> Any:
    """The page, once it shows numbers."""
    page.goto(url)
    page.wait_for_selector("html[data-ready]", timeout=120_000)
    until(page, "picchio.balls > 0")
    return page


def settled(page: Any) -> dict[str, Any]:
    """The numbers, once no question is under way."""
    until(page, "picchio.idle()")
    found: dict[str, Any] = page.evaluate("picchio.values()")
    return found


def drag(page: Any, name: str, way: tuple[float, float], steps: int = 8) -> None:
    """Drag a handle ("tool", "tail") as a hand would, (x, y) pixels."""
    x, y = page.evaluate(WHERE, name)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + way[0], y + way[1], steps=steps)
    page.mouse.up()
