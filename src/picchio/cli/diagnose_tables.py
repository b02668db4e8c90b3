"""What `picchio diagnose` prints."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from picchio.diagnosis.result import Diagnosis


def show_diagnosis(found: Diagnosis, life: Mapping[str, Any] | None) -> None:
    """Print verdict, causes, gain, life and what to measure next."""
    from rich.table import Table

    from picchio.cli.output import console
    from picchio.diagnosis.alternatives import differences, in_words
    from picchio.diagnosis.result import VERDICTS
    from picchio.model.effects import effect_class
    from picchio.studies.verdict import format_count

    out = console()
    out.print(f"[bold]{found.verdict}[/bold]: {found.note or VERDICTS[found.verdict]}.")
    if found.causes:
        table = Table(box=None, pad_edge=False, header_style="dim")
        for name in ("cause", "where", "confidence", "value", "std", "unit"):
            table.add_column(name, justify="right" if name in ("value", "std") else "left")
        for cause in found.causes:
            if not cause.parameters:
                table.add_row(cause.effect, cause.target, f"{cause.confidence:.3f}")
            for i, (name, value) in enumerate(cause.parameters.items()):
                head = (
                    (cause.effect, cause.target, f"{cause.confidence:.3f}") if i == 0 else ("",) * 3
                )
                unit = "" if value.unit == "1" else value.unit
                table.add_row(*head, f"{name} {value.value:.5g}", f"{value.std:.2g}", unit)
        out.print(table)
        for name in dict.fromkeys(cause.effect for cause in found.causes):
            out.print(f"  {name}: {effect_class(name).meaning}")
    for each in differences(found):
        out.print(f"  these data cannot tell it from {in_words(each)}")
    helped = (
        "would explain it, but is not claimed" if found.note else "helped, but is not the cause"
    )
    for effect, target in found.leads:
        out.print(f"  {helped}: {effect} of {target}")
    gain = found.gain
    if gain is not None:
        count = len(gain.held_out_records)
        kept = f"{count} record" if count == 1 else f"{count} records"
        share = "" if gain.explained is None else f"; {100 * gain.explained:.1f} % explained"
        out.print(
            f"On {kept} held out the residual falls from "
            f"{100 * gain.baseline_nrmse:.3g} % to {100 * gain.extended_nrmse:.3g} % of the "
            f"signal; noise alone is {100 * gain.noise_floor_nrmse:.3g} %{share}."
        )
    if life is not None:
        _show_life(life)
        others = life.get("alternatives") or ()
        for pairs, other in zip(found.alternatives, others, strict=False):
            names = " and ".join(f"{effect} of {target}" for effect, target in pairs)
            told = other.get("why") or (
                f"rivets {format_count(other['rivets_to_failure'])}, "
                f"utilisation {100 * other['utilisation']:.4g} %"
            )
            out.print(f"  with {names} instead: {told}")
        if others:
            out.print("  until the sets are told apart, only the worst of these may be promised")
        elif found.alternatives:
            out.print(
                '  "after" is with the cause named above; with another of the sets the life is '
                "another: until they are told apart, neither may be promised"
            )
    ask = found.next_measurement
    if ask:
        direction = ", ".join(f"{c:.2f}" for c in ask.get("direction", ()))
        pose = ", ".join(f"{name} {value:.2f}" for name, value in ask.get("pose", {}).items())
        out.print(f"Measure next: {ask['why']}", highlight=False)
        if pose:
            out.print(f"  pose {pose}; force along ({direction}), {ask.get('force', 0):g} N")


def _show_life(life: Mapping[str, Any]) -> None:
    from rich.table import Table

    from picchio.cli.output import console
    from picchio.studies.verdict import format_count

    table = Table(box=None, pad_edge=False, header_style="dim", title="Life", title_justify="left")
    for name in ("joint", "rivets before", "after", "utilisation before %", "after %"):
        table.add_column(name, justify="left" if name == "joint" else "right")

    def rivets(joint: Mapping[str, Any]) -> str:
        return format_count(joint["rivets_to_failure"])

    def used(joint: Mapping[str, Any]) -> str:
        return f"{100 * joint['utilisation']:.4g}"

    def between(joint: Mapping[str, Any], key: str, show: Callable[[float], str]) -> str:
        """The interval, where it says more than the value."""
        low, high = (show(end) for end in joint.get(key, (math.nan, math.nan)))
        return "" if low == high else f"[dim]{low} to {high}[/dim]"

    before, after = life["baseline"]["joints"], life["extended"]["joints"]
    for name, old in before.items():
        sides = (old, after[name])
        table.add_row(name, *map(rivets, sides), *map(used, sides))
        spans = [between(side, "rivets_interval", format_count) for side in sides]
        spans += [
            between(side, "utilisation_interval", lambda u: f"{100 * u:.4g}") for side in sides
        ]
        if any(spans):
            table.add_row("", *spans)
    out = console()
    out.print(table)
    if "interval_level" in life:
        out.print(
            f"  [dim]{100 * life['interval_level']:g} % intervals: before, of the stated "
            "tolerance; after, of what was fitted. The material's scatter is not in them (picchio "
            "assess --uncertainty)[/dim]"
        )
