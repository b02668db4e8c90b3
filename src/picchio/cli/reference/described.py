"""`picchio effects` and `picchio formats`: what can be written where."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from picchio.cli.app import app
from picchio.cli.options import JsonOption
from picchio.cli.output import console, definitions, deliver, show_all, styled

if TYPE_CHECKING:
    from picchio.reference.effects import EffectDescription
    from picchio.reference.formats import FileFormat, Key


@app.command()
def effects(
    name: str | None = None,
    *,
    json: JsonOption = None,
) -> None:
    """List the effects that a model may have, or show one in full.

    Options:
        name (NAME): Show one effect in full.
    """
    import picchio

    show_all(True)  # a reference is read whole
    found = picchio.effects(name)
    one, every = partial(_show_effect, found.effects[0]), partial(_list_effects, found.effects)
    deliver(found.to_dict(), json, one if name else every)


@app.command()
def formats(
    name: str | None = None,
    *,
    json: JsonOption = None,
) -> None:
    """List the files that picchio reads and writes, or one's keys.

    Options:
        name (NAME): Show one format with all its keys.
    """
    import picchio

    show_all(True)
    found = picchio.formats(name)
    one, every = partial(_show_format, found.formats[0]), partial(_list_formats, found.formats)
    deliver(found.to_dict(), json, one if name else every)


def _list_effects(entries: tuple[EffectDescription, ...]) -> None:
    from rich.text import Text

    from picchio.reference.effects import by_place

    screen = console()
    for heading, group in by_place(entries).items():
        screen.print(heading, style="bold")
        rows = [
            (entry.name, Text.assemble(f"{entry.meaning} ", (f"({entry.target})", "dim")))
            for entry in group
        ]
        screen.print(definitions(rows))
    screen.print("In brackets: what the effect acts on. `picchio effects NAME` shows one in full.")


def _show_effect(entry: EffectDescription) -> None:
    from picchio.reference.effects import shown_bounds, shown_unit, target_meaning

    screen = console()
    screen.print(styled(entry.name, f": {entry.meaning}"))
    screen.print(entry.detail)
    facts = [("where", entry.where), ("target", target_meaning(entry.target))]
    if entry.drawn:
        facts.append(("drawn", f"{entry.drawn}; another in every record"))
    if entry.source:
        facts.append(("source", entry.source))
    screen.print(definitions(facts))
    screen.print("Parameters", style="bold")
    screen.print(
        definitions(
            (
                p.name,
                f"{shown_unit(p.unit)}; {shown_bounds(p)}; no effect at {p.neutral:g}\n{p.meaning}",
            )
            for p in entry.parameters
        )
    )
    screen.print(styled("Example", ", in a picchio-model/1 or picchio-plan/1 file"))
    screen.print("\n" + entry.example, soft_wrap=True)


def _list_formats(entries: tuple[FileFormat, ...]) -> None:
    screen = console()
    for role, title in (("input", "What you write"), ("output", "What picchio writes")):
        screen.print(title, style="bold")
        rows = []
        for e in entries:
            if e.role == role:
                facts = "; ".join(fact for fact in (e.kind, e.format, e.command) if fact)
                rows.append((e.name, f"{e.meaning}\n{facts}"))
        screen.print(definitions(rows))
    screen.print("`picchio formats NAME` prints every key of one.")


def _show_format(entry: FileFormat) -> None:
    from picchio.reference.formats import sections

    screen = console()
    screen.print(styled(entry.name, f": {entry.meaning}"))
    screen.print("; ".join(x for x in (entry.kind, entry.format, entry.command) if x))
    for section, keys in sections(entry).items():
        if section:
            screen.print(_heading(section, entry.kind), style="bold")
        rows = [
            (key.path.rpartition(".")[2] if section else key.path, _text(key, entry.role))
            for key in keys
        ]
        screen.print(definitions(rows))


def _heading(section: str, kind: str) -> str:
    """The table as TOML would write it; as a path elsewhere."""
    if kind != "TOML":
        return section
    plain = section.replace("[]", "")
    return f"[[{plain}]]" if section.endswith("[]") else f"[{plain}]"


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
