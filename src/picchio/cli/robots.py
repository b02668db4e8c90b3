"""`picchio robots`: the robots that can be named."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from picchio.cli.options import JsonOption

if TYPE_CHECKING:
    from picchio.robot.loading.catalogue import RobotEntry

EPILOG = "Example: picchio robots --json robots.json"


def register(app: typer.Typer) -> None:
    """Add the subcommand."""
    app.command(epilog=EPILOG)(robots)


def robots(json: JsonOption = None) -> None:
    """List the robots that can be named, and which have stiffness data."""
    from rich import box
    from rich.table import Table

    import picchio
    from picchio.cli.output import console, write_json

    found = picchio.robots()
    if json is not None:
        write_json(found.to_dict(), json)
    if json == "-":
        return
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("name", no_wrap=True)
    table.add_column("DoF", justify="right")
    table.add_column("stiffness known")
    table.add_column("source")
    for entry in found:
        table.add_row(
            entry.name,
            str(entry.dof),
            _span(entry.with_stiffness),
            entry.problem or _origin(entry),
        )
    console().print(table)


def _span(names: tuple[str, ...]) -> str:
    return (
        "-" if not names else f"{names[0]} ... {names[-1]}" if len(names) > 3 else ", ".join(names)
    )


def _origin(entry: RobotEntry) -> str:
    if entry.stiffness_source is None:
        return "-"
    marked = entry.estimated and "estimate" not in entry.stiffness_source
    return ("estimate: " if marked else "") + entry.stiffness_source
