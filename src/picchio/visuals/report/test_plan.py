"""From planned tests to a sheet to print: what to do, with a picture of the robot in each pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from picchio.core import spoken
from picchio.core.arrays import FloatArray
from picchio.diagnosis.planning.choose import Chosen
from picchio.diagnosis.planning.kind import along, angles
from picchio.diagnosis.planning.plan import PlannedTests
from picchio.visuals.plots.style import BLUE, VERMILION
from picchio.visuals.report.page import Picture, Pictures, number, render
from picchio.visuals.scene.portrait import Arrow, ArrowKind, plot_pose

_HEADS = {
    "static": ("no.", "load", "read along", "force| N", "reading| mm"),
    "frf": ("no.", "hammer", "accelerometer along", "file"),
}
_DONE = {"static": ("pull", "gauge"), "frf": ("hit", "sensor")}


@dataclass(frozen=True)
class _Stop:
    """One pose of the sheet: its picture, how it is set, and what is done there."""

    title: str
    picture: Picture
    pose: list[tuple[str, str]]
    heads: tuple[str, ...]
    rows: list[list[str]]


def plan_page(
    found: PlannedTests, *, command: str | None = None, warnings: Sequence[str] = ()
) -> str:
    """The sheet of planned tests.

    Args:
        found: the plan.
        command: the command line that gave this.
        warnings: what was warned of on the way.

    Returns:
        the HTML.
    """
    pictures, stops, first = Pictures(), [], 1
    places = groupby(found.records, key=lambda one: (one.candidate.place, one.candidate.kind))
    for turn, (_, group) in enumerate(places, start=1):
        records = list(group)
        stops.append(_stop(found, pictures, turn, first, records))
        first += len(records)
    now, then = found.widths
    tracked = any(one.candidate.reads is None for one in found.records)
    return render(
        "test_plan.html.j2",
        headline=found._headline() + ".",
        found=found,
        stops=stops,
        minutes=number(found.seconds / 60.0, 2),
        tracked=tracked,
        kinds={one.candidate.kind for one in found.records},
        factors_of=found._factors(),
        factors=(spoken.factor(now), spoken.factor(then)),
        next_command=found.next_command("FOLDER"),
        command=command,
        warnings=warnings,
        provenance=found.to_dict()["provenance"],
    )


def _stop(
    found: PlannedTests, pictures: Pictures, turn: int, first: int, records: Sequence[Chosen]
) -> _Stop:
    arrows: dict[tuple[object, ...], Arrow] = {}
    rows = []
    pulls = np.array([record.candidate.direction for record in records])
    for k, record in enumerate(records, start=first):
        one = record.candidate
        loads, reads = _DONE[one.kind]
        static = one.kind == "static"
        told: list[tuple[str, FloatArray, ArrowKind, str]] = [
            (loads, one.direction, "leaves" if static else "comes", VERMILION)
        ]
        if one.reads is not None:
            # Where fewer pulls are in the way; which way counts is in the table.
            side = 1.0 if (pulls @ one.reads).max() < (-pulls @ one.reads).max() else -1.0
            told.append((reads, side * one.reads, "line", BLUE))
        for word, way, kind, colour in told:
            key = (word, *np.round(way, 6).tolist())
            before = arrows.get(key)
            label = f"{word} {k}" if before is None else f"{before.label}, {k}"
            arrows[key] = Arrow(way, label, kind, colour)
        reading = "x, y, z" if one.reads is None else along(one.reads)
        reading += f" on {one.frame}" if one.frame else ""
        if static:
            rows.append([str(k), f"{number(one.force, 3)} N along {along(one.direction)}", reading,
                         "", ""])  # fmt: skip
        else:
            file = found.files[k - 1]
            rows.append([str(k), f"hit along {along(one.direction)}", reading, file])
    pose = records[0].candidate.pose
    setting = [(name, f"{number(x, 5)} {'°' if unit == 'deg' else unit}")
            for name, (x, unit) in angles(found.robot, pose).items()]  # fmt: skip
    said = "; ".join(f"{arrow.label} along {along(arrow.direction)}"
                     for arrow in arrows.values())  # fmt: skip
    axes = plot_pose(found.robot, pose, list(arrows.values()))
    picture = pictures.picture(axes, f"The robot at pose {turn}: {said}", "")
    axes.figure.clear()
    return _Stop(f"Pose {turn}", picture, setting, _HEADS[records[0].candidate.kind], rows)
