"""`picchio effects`: what can be wrong with a simulation."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from picchio.cli.options import JsonOption

if TYPE_CHECKING:
    from picchio.reference.effects import EffectDescription

EPILOG = "Example: picchio effects base_compliance"
_PLACES = {
    "structure": "Structure: the robot's equations of motion",
    "nonlinear": "Nonlinear: joints and contact whose force is not in proportion",
    "blows": "Blows: what the tool really does",
    "over-time": "Over time: what changes while a campaign lasts",
    "sensor": "Sensors: how channels read",
    "motion": "Motion records: drives and encoders of a moving robot",
}


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

    screen = console()
    places = dict.fromkeys([*_PLACES, *(entry.where for entry in entries)])
    for place in places:
        rows = [(entry.name, f"{entry.meaning} [dim]({entry.target})[/dim]")
                for entry in entries if entry.where == place]  # fmt: skip
        if rows:
            screen.print(f"[bold]{_PLACES.get(place, place)}[/bold]")
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
