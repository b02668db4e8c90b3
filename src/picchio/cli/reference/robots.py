"""`picchio robots` and `picchio annotate`: robots that can be named, and one as a URDF."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from picchio.cli.app import app
from picchio.cli.options import FlexOption, JsonOption, RobotArgument, output
from picchio.cli.output import console, deliver, show_all, table, whole

if TYPE_CHECKING:
    from picchio.robot.loading.catalogue import RobotEntry, RobotList


@app.command()
def robots(
    *,
    every: Annotated[bool, typer.Option("--all")] = False,
    json: JsonOption = None,
) -> None:
    """List the robots that can be named, arms with data first.

    Options:
        every: All of them, with their sources.
    """
    import picchio

    found = picchio.robots()
    show_all(every or whole())
    deliver(found.to_dict(), json, lambda: _show(found))


@app.command()
def annotate(
    robot: RobotArgument,
    *,
    out: Annotated[Path, output("--out")],
    flex: FlexOption = None,
    json: JsonOption = None,
) -> None:
    """Write a URDF with a sidecar's values as annotations.

    Everything else stays as it is. Mesh files are not copied.

    Options:
        out (FILE): Where the URDF goes.
    """
    import picchio

    made = picchio.annotate(robot, flex=flex)
    made.save(out)
    deliver(made.to_dict(), json, lambda: console().print(made._headline()))


_ARM = range(3, 9)  # joints of an arm; more are two arms, a hand or a walker
_BRIEF = 36  # characters of a source in a list


def _show(found: RobotList) -> None:
    arms = sorted(found, key=lambda entry: (not entry.stiffness_source, entry.dof not in _ARM))
    rows = []
    for entry in arms:
        joints, source = entry.with_stiffness, entry.problem or _origin(entry)
        if not whole():  # its first words, in one line
            source = textwrap.shorten(source, _BRIEF, placeholder=" ...")
        span = f"{len(joints)} of {len(entry.flexible)}" if joints else "-"
        rows.append((entry.name, str(entry.dof), span, source))
    out = console()
    known = sum(bool(entry.stiffness_source) for entry in arms)
    out.print(f"{len(rows)} robots, {known} with stiffness data; --all lists all of them.")
    out.print(table(("name", ">DoF", ">stiffness\nknown", "source"), rows))


def _origin(entry: RobotEntry) -> str:
    if entry.stiffness_source is None:
        return "-"
    marked = entry.estimated and "estimate" not in entry.stiffness_source
    return ("estimate: " if marked else "") + entry.stiffness_source
