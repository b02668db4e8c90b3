"""Time plots that zoom: channels of records over each other, in a page that needs no network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files

import numpy as np
from markupsafe import Markup, escape

from picchio.core.arrays import FloatArray
from picchio.visuals.plots.diagnosis import AFTER, BEFORE
from picchio.visuals.plots.style import GREEN, PURPLE
from picchio.visuals.scene.page import Packer, script_json

MOST = 400_000
"""Values of one figure: about 1 MB of the page; channels beyond are left out, and told."""


_COLOURS = ("currentColor", BEFORE["color"], AFTER["color"], GREEN, PURPLE)  # as plots have them


@dataclass(frozen=True, eq=False)
class Trace:
    """One channel of one record.

    Attributes:
        record: its name.
        channel: its name.
        unit: of the values, as they are drawn.
        time: (m,) s, ascending.
        lines: {name: (m,)}, such as "measured", "before" and "after".
    """

    record: str
    channel: str
    unit: str
    time: FloatArray
    lines: Mapping[str, FloatArray]


def traces_html(traces: Sequence[Trace], title: str, *, most: int = MOST) -> Markup:
    """A figure with a choice of record and channel, zoom, values under the pointer, downloads.

    Args:
        traces: the one that is shown first comes first; of too many the last are left out.
        title: what it shows, in words.
        most: values at most.

    Returns:
        the figure and the script that draws it; nothing without traces. Values are exact to
        1/65535 of a line's range.
    """
    packer = Packer()
    kept: list[dict[str, object]] = []
    spent = 0
    for trace in traces:
        spent += len(trace.time) * len(trace.lines)
        if kept and spent > most:
            break
        kept.append({
            "record": trace.record, "channel": trace.channel, "unit": trace.unit,
            "time": packer.add(trace.time, "f4"),
            "lines": [_packed(packer, name, line) for name, line in trace.lines.items()],
        })  # fmt: skip
    if not kept:
        return Markup("")
    left = len(traces) - len(kept)
    note = f" The last {left} of {len(traces)} channels are not in this page." if left else ""
    script = (files("picchio.visuals.report") / "page_files" / "trace.js").read_text("utf-8")
    content = script_json({"title": title, "traces": kept, "colours": _COLOURS})
    return Markup(
        '<figure class="wide trace screen-only"><div class="tools"></div><div class="drawn"></div>'
        f"<figcaption>{escape(title)}. Drag along the time to zoom, double-click for all of it; "
        f"the wheel zooms, too.{note}</figcaption>"
        f'<script type="application/json">{content}</script>'
        f'<script type="text/plain">{packer.text()}</script></figure><script>{script}</script>'
    )


def _packed(packer: Packer, name: str, line: FloatArray) -> dict[str, object]:
    """A line in 16 bits between its least and largest value; gaps are the last code."""
    values = np.asarray(line, dtype=float)
    good = np.isfinite(values)
    low = float(values[good].min()) if good.any() else 0.0
    step = float(np.ptp(values[good])) / 65534 if good.any() else 0.0
    code = np.where(good, np.rint((np.nan_to_num(values) - low) / (step or 1.0)), 65535)
    return {"name": name, "low": low, "step": step, "values": packer.add(code, "u2")}
