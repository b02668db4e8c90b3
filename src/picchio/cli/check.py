"""`picchio check`: what is in measured data, and what is wrong with them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from picchio.cli.options import FlexOption, JsonOption, ToolOption

if TYPE_CHECKING:
    from rich.console import Console

    from picchio.measurement.quality.check import Finding
    from picchio.measurement.quality.report import QualityReport, RecordSummary


# What `picchio check` prints for people.

_MOST_RECORDS = 16
_STYLES = {"error": "bold red", "warning": "yellow", "note": "dim"}
_NUMBER = re.compile(r"[-+]?\d[\d.]*(e[-+]?\d+)?")


def show(report: QualityReport, *, verbose: bool = False) -> None:
    """Everything, in the order in which one wants to know it."""
    from picchio.cli.output import console

    out = console()
    _head(out, report)
    _records(out, report.records, verbose)
    _channels(out, report)
    _repeats(out, report)
    _findings(out, report, verbose)


def grouped(findings: Sequence[Finding]) -> list[tuple[Finding, list[Finding]]]:
    """The same thing seen in several records: the worst of them, and all."""
    groups: dict[tuple[str, ...], list[Finding]] = {}
    for finding in findings:
        pattern = _NUMBER.sub("#", finding.message)
        channel = re.sub(r"\.[xyz]$", "", finding.channel or "")
        if finding.check == "length":
            channel = ""
        groups.setdefault((finding.check, finding.severity, channel, pattern), []).append(finding)
    return [(max(g, key=lambda f: abs(f.value or 0.0)), g) for g in groups.values()]


def warning_lines(report: QualityReport) -> list[str]:
    """One line a group of errors or warnings, for stderr."""
    lines = []
    for worst, group in grouped(report.findings):
        if worst.severity != "note":
            more = f" (and {len(group) - 1} more like it)" if len(group) > 1 else ""
            lines.append(f"{worst}{more}")
    return lines


def _head(out: Console, report: QualityReport) -> None:
    from rich.markup import escape

    campaign, records = report.campaign, report.records
    name = str(campaign.folder) if campaign.folder is not None else "campaign in memory"
    robot = report.robot.name if report.robot else "no robot: limits and axes are not checked"
    out.print(f"[bold]{escape(name)}[/bold]: {_many(len(records), 'record')}; {escape(robot)}")
    hits = [r for r in records if r.kind == "percussion"]
    motions = [r for r in records if r.kind == "motion"]
    if hits:
        poses = {tuple(r.pose.items() if isinstance(r.pose, dict) else r.pose or ()) for r in hits}
        directions = {tuple(np.round(r.direction or [], 6)) for r in hits}
        levels = sorted({r.excitation["force"] for r in hits if "force" in r.excitation})
        level = (
            f"{levels[0]:g}" + (f" to {levels[-1]:g}" if len(levels) > 1 else "") if levels else "?"
        )
        steady = sum("hits" not in r.excitation for r in hits)
        out.print(
            f"  percussion: {_many(len(hits), 'record')} ({_many(len(hits) - steady, 'burst')}, "
            f"{steady} steady), {_many(len(poses), 'pose')}, "
            f"{_many(len(directions), 'direction')}, {_many(len(levels), 'level')} ({level} N)"
        )
    if motions:
        seconds = sum(r.end - r.start for r in motions)
        out.print(f"  motion: {_many(len(motions), 'record')}, {seconds:.4g} s")
    rates = sorted({round(r.rate, 2) for r in records})
    if rates:
        out.print(f"  sampled at {', '.join(f'{rate:g}' for rate in rates[:6])} Hz")
    times = sorted(r.time for r in records if r.time)
    if times:
        out.print(f"  taken from {times[0]} to {times[-1]}")
    warm = [r.temperature for r in records if r.temperature is not None]
    if warm:
        out.print(f"  at {min(warm):g} to {max(warm):g} degC")
    out.print()


def _many(count: int, word: str) -> str:
    return f"{count} {word}{'' if count == 1 else 's'}"


def _records(out: Console, records: Sequence[RecordSummary], verbose: bool) -> None:
    from rich import box
    from rich.markup import escape
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("record", no_wrap=True)
    table.add_column("what was done", no_wrap=True)
    table.add_column("pose\nrad, m")
    table.add_column("force along")
    for name in ("from\ns", "to\ns", "samples", "rate\nHz", "channels"):
        table.add_column(name, justify="right")
    shown = records if verbose else records[:_MOST_RECORDS]
    for record in shown:
        numbers = list(record.pose.values() if isinstance(record.pose, dict) else record.pose or [])
        pose = ", ".join(f"{q:.3g}" for q in numbers) or "-"
        along = "-" if record.direction is None else ", ".join(
            f"{c + 0.0:.2g}" for c in np.round(record.direction, 6)
        )  # fmt: skip
        table.add_row(
            escape(record.file), _done(record), pose, along, f"{record.start:.4g}",
            f"{record.end:.4g}", str(record.samples), f"{record.rate:.6g}",
            str(len(record.channels)),
        )  # fmt: skip
    out.print(table)
    if len(shown) < len(records):
        out.print(f"... and {len(records) - len(shown)} more: --verbose lists them.\n")


def _done(record: RecordSummary) -> str:
    if record.kind == "motion":
        return "motion"
    e = record.excitation
    if "force" not in e or "period" not in e:
        return record.blows or "percussion"
    count = f"{e['hits']} x " if "hits" in e else "steady "
    return f"{count}{e['force']:.4g} N / {1e3 * e['period']:.4g} ms"


def _channels(out: Console, report: QualityReport) -> None:
    from rich import box
    from rich.markup import escape
    from rich.table import Table

    table = Table(title="Channels and their noise", title_justify="left", box=box.SIMPLE_HEAD,
                  pad_edge=False)  # fmt: skip
    for name in ("channel", "unit"):
        table.add_column(name, no_wrap=True)
    for name in ("in records", "RMS,\nleast", "RMS,\nmost", "noise\n(std)", "known\nto",
                 "signal over\nnoise, dB", "hum"):  # fmt: skip
        table.add_column(name, justify="right")
    table.add_column("colour")
    names: dict[str, list[float]] = {}
    units = {}
    for record in report.records:
        for name, numbers in record.channels.items():
            names.setdefault(name, []).append(float(numbers["rms"]))
            units[name] = str(numbers["unit"])
    for name, sizes in names.items():
        noise = report.noise.get(name)
        cells = ["-"] * 4 + [""]
        if noise is not None:
            size = float(np.sqrt(np.mean(np.square(sizes))))
            ratio = 20.0 * np.log10(size / noise.std) if noise.std > 0.0 and size > 0.0 else np.inf
            hum = ", ".join(f"{h.amplitude:.2g} at {h.frequency:.3g} Hz" for h in noise.hum[:1])
            colour = "a rough floor" if noise.rough else "white" if noise.white else "coloured"
            cells = [f"{noise.std:.3g}", f"{100 * noise.error:.2g} %",
                     f"{ratio:.0f}" if np.isfinite(ratio) else "-", hum or "-", colour]  # fmt: skip
        table.add_row(escape(name), units[name], str(len(sizes)), f"{min(sizes):.3g}",
                      f"{max(sizes):.3g}", *cells)  # fmt: skip
    out.print(table)


def _repeats(out: Console, report: QualityReport) -> None:
    if not report.repeats:
        return
    worst = max(report.repeats, key=lambda c: c.difference)
    out.print(
        f"{len(report.repeats)} records repeat another one; beyond the noise they differ by "
        f"{100 * np.median([c.difference for c in report.repeats]):.2g} % of the signal "
        f"(median), at worst by {100 * worst.difference:.2g} % ({worst.first} and {worst.second}, "
        f"{worst.channel}).\n"
    )


def _findings(out: Console, report: QualityReport, verbose: bool) -> None:
    from rich import box
    from rich.markup import escape
    from rich.table import Table

    errors, warnings = report.count("error"), report.count("warning")
    if report.findings:
        table = Table(title="What was found", title_justify="left", box=box.SIMPLE_HEAD,
                      pad_edge=False, show_lines=False)  # fmt: skip
        table.add_column("", no_wrap=True)
        for name in ("where", "what was seen", "what to do"):
            table.add_column(name, overflow="fold")
        groups = [(f, [f]) for f in report.findings] if verbose else grouped(report.findings)
        for worst, group in groups:
            channels = sorted({f.channel for f in group if f.channel})
            files = sorted({f.record for f in group if f.record})
            where = ", ".join(channels[:2]) + (" ..." if len(channels) > 2 else "")
            if files:
                count = f"{len(files)} of {len(report.records)} records, worst {worst.record}"
                where += (": " if where else "") + (files[0] if len(files) == 1 else count)
            style = _STYLES[worst.severity]
            table.add_row(f"[{style}]{worst.severity}[/{style}]", escape(where or "campaign"),
                          escape(worst.message), escape(worst.advice))  # fmt: skip
        out.print(table)
    if errors or warnings:
        counts = ((errors, "error"), (warnings, "warning"), (report.count("note"), "note"))
        words = [_many(n, word) for n, word in counts if n]
        out.print(", ".join(words) + ".")
    else:
        out.print(f"Nothing wrong was found ({report.count('note')} notes): "
                  f"{len(report.checks)} kinds of faults were looked for.")  # fmt: skip


EPILOG = "Example: picchio check measurements/ --robot fanuc_like_3dof --json check.json"


def register(app: typer.Typer) -> None:
    """Add the subcommand."""
    app.command(epilog=EPILOG)(check)


def check(
    campaign: Annotated[
        Path,
        typer.Argument(metavar="CAMPAIGN", help="Folder with a campaign.toml.", show_default=False),
    ],
    robot: Annotated[
        str | None,
        typer.Option(
            "--robot", metavar="ROBOT", help="A name or a URDF; the campaign's own if not given."
        ),
    ] = None,
    no_robot: Annotated[
        bool, typer.Option("--no-robot", help="Leave out what needs a robot.")
    ] = False,
    flex: FlexOption = None,
    tool: ToolOption = None,
    keep_going: Annotated[
        bool,
        typer.Option("--keep-going", help="List records that cannot be read, check the others."),
    ] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Every record, and every finding on its own.")
    ] = False,
    gravity_stiffness: Annotated[
        bool,
        typer.Option(
            "--gravity-stiffness/--no-gravity-stiffness",
            help="Of the report's simulation: add gravity's stiffness dg/dq to the springs'.",
        ),
    ] = True,
    report: Annotated[
        Path | None,
        typer.Option(
            "--report", metavar="OUT.html", help="How the simulation differs, one page to read."
        ),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Check measured data: what is in a campaign, and what is wrong with it.

    Clipping, dropouts, spikes, drift, uneven clocks, swapped or flipped axes, hum, high-passes,
    delays, records that are too short, aliasing, repeats, and the noise of every channel.
    """
    import math

    import picchio
    from picchio.cli.output import (
        check_target,
        command_line,
        progress,
        said_warnings,
        say_warning,
        write_json,
    )
    from picchio.core.errors import InputError

    if no_robot and (robot is not None or flex is not None or tool is not None):
        raise InputError("stands against --robot, --flex and --tool", key="--no-robot")
    loaded = picchio.load_campaign(campaign, clock_tolerance=math.inf)
    if report is not None and (no_robot or (robot or loaded.robot) is None):
        raise InputError("needs a robot", key="--report", hint="name one with --robot")
    for target in (json, report):
        check_target(target, [robot, flex, *loaded.files])
    with progress("records") as tell:
        found = picchio.check(
            loaded, robot, flex=flex, tool=tool, use_robot=not no_robot, keep_going=keep_going,
            progress=tell,
        )  # fmt: skip
    if report is not None:
        picchio.report(
            found,
            command=command_line(),
            warnings=said_warnings(),
            gravity_stiffness=gravity_stiffness,
        ).save(report)
    if json is not None:
        write_json(found.to_dict(), json)
    if json != "-":
        show(found, verbose=verbose)
    else:
        for line in warning_lines(found):
            say_warning(line)
