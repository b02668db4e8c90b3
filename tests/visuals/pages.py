"""What several tests do with pages."""

from __future__ import annotations

import base64
import json
import re
import time
import zlib
from typing import Any

import numpy as np

_TRACES = re.compile(
    r'<figure class="wide trace.*?<script type="application/json">(?P<json>.*?)</script>'
    r'<script type="text/plain">(?P<arrays>.*?)</script></figure><script>.*?</script>',
    re.DOTALL,
)


def without_traces(page: str) -> str:
    """A page without picchio's own plots that zoom: no other script may be in it."""
    return _TRACES.sub("", page)


def traces_in(page: str) -> list[dict[str, Any]]:
    """What the plots that zoom hold: record, channel, unit, time (m,), lines {name: (m,)}."""
    found = []
    for match in _TRACES.finditer(page):
        buffer = zlib.decompress(base64.b64decode(match["arrays"]))

        def array(reference: list[Any], buffer: bytes = buffer) -> np.ndarray:
            kind, offset, count = reference
            return np.frombuffer(buffer, f"<{kind}", count, offset).astype(float)

        for trace in json.loads(match["json"])["traces"]:
            lines = {}
            for line in trace["lines"]:
                code = array(line["values"])
                values = line["low"] + line["step"] * code
                lines[line["name"]] = np.where(code == 65535, np.nan, values)
            found.append(trace | {"time": array(trace["time"]), "lines": lines})
    return found


def until_drawn(page: Any) -> None:
    """Wait until what came before is seen: a browser hands on moves of the mouse with the
    next picture, and a busy machine draws few of them a second."""
    page.evaluate("""async () => {
      for (let i = 0; i < 3; i++) await new Promise(requestAnimationFrame);
    }""")


def photograph(seen: Any, **options: Any) -> bytes:
    """A screenshot of a page or of a part of it: a busy browser may first be unable to take one."""
    for attempt in range(3):
        try:
            return bytes(seen.screenshot(**options))
        except Exception as error:
            if attempt == 2 or "Unable to capture" not in str(error):
                raise
            time.sleep(1.0)
    raise AssertionError
