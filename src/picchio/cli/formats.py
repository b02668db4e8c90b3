"""`picchio formats`: every file format with all its keys."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from picchio.cli.options import JsonOption

if TYPE_CHECKING:
    from picchio.reference.formats import FileFormat, Key

EPILOG = "Example: picchio formats task"


def register(app: typer.Typer) -> None:
    """Add the subcommand."""
    app.command(epilog=EPILOG)(formats)


def formats(
    name: Annotated[
        str | None, typer.Argument(metavar="[NAME]", help="One format, with all its keys.")
    ] = None,
    json: JsonOption = None,
) -> None:
    """List the files that picchio reads and writes, or show one with every key."""
    import picchio
    from picchio.cli.output import write_json

    found = picchio.formats(name)
    if json is not None:
        write_json(found.to_dict(), json)
    if json == "-":
        return
    if name is not None:
        _show(found.formats[0])
    else:
        _list(found.formats)


def _list(entries: tuple[FileFormat, ...]) -> None:
    from rich.markup import escape

    from picchio.cli.output import console, definitions

    screen = console()
    for role, title in (("input", "What you write"), ("output", "What picchio writes")):
        screen.print(f"[bold]{title}[/bold]")
        screen.print(
            definitions(
                (
                    e.name,
                    escape(
                        f"{e.meaning}\n{e.kind}; {e.format + '; ' if e.format else ''}{e.command}"
                    ),
                )
                for e in entries
                if e.role == role
            )
        )
    screen.print("`picchio formats NAME` prints every key of one.")


def _show(entry: FileFormat) -> None:
    from rich.markup import escape

    from picchio.cli.output import console, definitions
    from picchio.reference.formats import sections

    screen = console()
    screen.print(f"[bold]{entry.name}[/bold]: {escape(entry.meaning)}")
    screen.print(escape("; ".join(x for x in (entry.kind, entry.format, entry.command) if x)))
    for table, keys in sections(entry).items():
        if table:
            screen.print(f"[bold]{escape(_heading(table, entry.kind))}[/bold]")
        screen.print(
            definitions(
                (
                    escape(key.path.rpartition(".")[2] if table else key.path),
                    escape(_text(key, entry.role)),
                )
                for key in keys
            )
        )


def _heading(table: str, kind: str) -> str:
    """The table as TOML would write it; as a path elsewhere."""
    if kind != "TOML":
        return table
    plain = table.replace("[]", "")
    return f"[[{plain}]]" if table.endswith("[]") else f"[{plain}]"


def _text(key: Key, role: str) -> str:
    parts = [key.type]
    if key.unit:
        parts.append("pure number" if key.unit == "1" else key.unit)
    if role == "input":
        needed = "required" if key.required else "optional"
        parts.append(f"default {key.default}" if key.default else needed)
    elif not key.required:
        parts.append("not always there")
    return f"{'; '.join(parts)}\n{key.meaning}"
