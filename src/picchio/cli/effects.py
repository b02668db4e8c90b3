"""`picchio effects`: what can be wrong with a simulation."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from picchio.cli.options import JsonOption

if TYPE_CHECKING:
    from picchio.reference.effects import EffectDescription

EPILOG = "Example: picchio effects base_compliance"


def register(app: typer.Typer) -> None:
    """Add the subcommand."""
    app.command(epilog=EPILOG)(effects)


def effects(
    name: Annotated[
        str | None, typer.Argument(metavar="[NAME]", help="One effect, in full.")
    ] = None,
    json: JsonOption = None,
) -> None:
    """List the effects that can be put into a model, or show one with its parameters."""
    import picchio
    from picchio.cli.output import write_json

    found = picchio.effects(name)
    if json is not None:
        write_json(found.to_dict(), json)
    if json == "-":
        return
    if name is not None:
        _show(found.effects[0])
    else:
        _list(found.effects)


def _list(entries: tuple[EffectDescription, ...]) -> None:
    from picchio.cli.output import console, definitions
    from picchio.reference.effects import by_place

    screen = console()
    for heading, group in by_place(entries).items():
        screen.print(f"[bold]{heading}[/bold]")
        rows = [(entry.name, f"{entry.meaning} [dim]({entry.target})[/dim]") for entry in group]
        screen.print(definitions(rows))
    screen.print("In brackets: what the effect acts on. `picchio effects NAME` shows one in full.")


def _show(entry: EffectDescription) -> None:
    from rich.markup import escape

    from picchio.cli.output import console, definitions
    from picchio.reference.effects import shown_bounds, shown_unit, target_meaning

    screen = console()
    screen.print(f"[bold]{entry.name}[/bold]: {entry.meaning}")
    screen.print(escape(entry.detail))
    facts = [("where", entry.where), ("target", target_meaning(entry.target))]
    if entry.drawn:
        facts.append(("drawn", f"{entry.drawn}; another in every record"))
    if entry.source:
        facts.append(("source", entry.source))
    screen.print(definitions(facts))
    screen.print("[bold]Parameters[/bold]")
    screen.print(
        definitions(
            (
                p.name,
                f"{shown_unit(p.unit)}; {shown_bounds(p)}; no effect at {p.neutral:g}\n{p.meaning}",
            )
            for p in entry.parameters
        )
    )
    screen.print("[bold]Example[/bold], in a picchio-model/1 or picchio-plan/1 file")
    screen.print("\n" + escape(entry.example), soft_wrap=True)
