"""`picchio robots` and `picchio annotate`: robots that can be named, and one as a URDF."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from picchio.cli.app import app
from picchio.cli.options import FlexOption, JsonOption, RobotArgument, output
from picchio.cli.output import console, deliver, table

if TYPE_CHECKING:
    from picchio.robot.loading.catalogue import RobotEntry, RobotList


@app.command(epilog="Example: picchio robots --json robots.json")
def robots(json: JsonOption = None) -> None:
    """List the robots that can be named, and their stiffness data."""
    import picchio

    found = picchio.robots()
    deliver(found.to_dict(), json, lambda: _show(found))


@app.command(epilog="Example: picchio annotate ur10 --flex my_ur10.toml --out robot.urdf")
def annotate(
    robot: RobotArgument,
    out: Annotated[Path, output("--out", "FILE", "Where the URDF goes.")],
    flex: FlexOption = None,
    json: JsonOption = None,
) -> None:
    """Write a URDF with a sidecar's values as annotations.

    Everything else stays as it is. Mesh files are not copied.
    """
    import picchio

    made = picchio.annotate(robot, flex=flex)
    made.save(out)
    deliver(made.to_dict(), json, lambda: console().print(made._headline()))


def _show(found: RobotList) -> None:
    rows = []
    for entry in found:
        joints = entry.with_stiffness
        span = f"{joints[0]} ... {joints[-1]}" if len(joints) > 3 else ", ".join(joints) or "-"
        rows.append((entry.name, str(entry.dof), span, entry.problem or _origin(entry)))
    console().print(table(("name", ">DoF", "stiffness known", "source"), rows))


def _origin(entry: RobotEntry) -> str:
    if entry.stiffness_source is None:
        return "-"
    marked = entry.estimated and "estimate" not in entry.stiffness_source
    return ("estimate: " if marked else "") + entry.stiffness_source
