"""`picchio check`: what is in measured data, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from picchio.cli import options as typed
from picchio.cli import output
from picchio.cli.app import app
from picchio.core.errors import InputError

if TYPE_CHECKING:
    from picchio.cli.layout import FittedTable
    from picchio.measurement.quality.report import QualityReport, RecordSummary

_STYLES = {"error": "bold red", "warning": "yellow", "note": "dim"}


@app.command()
def check(
    campaign: Path,
    *,
    robot: str | None = None,
    no_robot: bool = False,
    flex: typed.FlexOption = None,
    tool: typed.ToolOption = None,
    reducers: typed.ReducersOption = None,
    keep_going: bool = False,
    gravity_stiffness: typed.GravityStiffnessOption = None,
    report: typed.ReportOption = None,
    json: typed.JsonOption = None,
) -> None:
    """What is in measured data, and what is wrong with them.

    Clipping, dropouts, spikes, drift, uneven clocks, swapped or flipped axes, hum, high-passes,
    delays, records that are too short, aliasing, repeats, and the noise of every channel. --report
    shows how a simulation of the nominal robot, with gravity's stiffness or without, differs.
    Everything is written; then the exit status is 2 where an error was found, 0 otherwise.

    Options:
        campaign (CAMPAIGN): Folder with a campaign.toml.
        robot (ROBOT): The robot that was measured, as in `picchio robots`; the campaign's own if
            not given.
        no_robot: Check without a robot: no limits and no axes.
        keep_going: Where a record cannot be read, list it and check the others.
    """
    import math

    import picchio

    if no_robot and any(given is not None for given in (robot, flex, tool, reducers)):
        raise InputError("stands against --robot, --flex, --tool and --reducers", key="--no-robot")
    loaded = picchio.load_campaign(campaign, clock_tolerance=math.inf)
    if report is not None and (no_robot or (robot or loaded.robot) is None):
        raise InputError("needs a robot", key="--report", hint="name one with --robot")
    with output.progress("records") as tell:
        found = picchio.check(
            loaded, robot, flex=flex, tool=tool, reducers=reducers or (), use_robot=not no_robot,
            keep_going=keep_going, progress=tell,
        )  # fmt: skip
    output.write_report(found, report, gravity_stiffness=gravity_stiffness)
    output.deliver(found.to_dict(), json, lambda: _show(found))
    if json == "-":  # what people would have read in the table
        for group in found.groups():
            if group[0].severity != "note":
                more = f" (and {len(group) - 1} more like it)" if len(group) > 1 else ""
                output.say_warning(f"{group[0]}{more}")
    errors = [finding for finding in found.findings if finding.severity == "error"]
    if errors:
        raise InputError(
            f"{output.count_of(len(errors), 'error')} found, first: {errors[0]}", file=campaign
        )


def _show(report: QualityReport) -> None:
    out = output.console()
    counts = {word: report.count(word) for word in _STYLES}
    wrong = ", ".join(output.count_of(n, word) for word, n in counts.items() if n)
    if not (counts["error"] or counts["warning"]):
        wrong = (f"nothing wrong was found ({counts['note']} notes): {len(report.checks)} kinds of "
                 "faults were looked for")  # fmt: skip
    name = str(report.campaign.folder or "campaign in memory")
    out.print(output.styled(f"{name}: {wrong}."))
    _show_contents(report)
    if report.findings:
        out.print(_finding_table(report))
    out.print(_channel_table(report))
    output.details()
    out.print(_record_table(report.records))
    if report.repeats:
        worst = max(report.repeats, key=lambda c: c.difference)
        out.print(
            f"{len(report.repeats)} records repeat another one; beyond the noise they differ by "
            f"{100 * np.median([c.difference for c in report.repeats]):.2g} % of the signal "
            f"(median), at worst by {100 * worst.difference:.2g} % ({worst.first} and "
            f"{worst.second}, {worst.channel}).\n"
        )


def _show_contents(report: QualityReport) -> None:
    out = output.console()
    campaign, records = report.campaign, report.records
    robot = report.robot.name if report.robot else "no robot: limits and axes are not checked"
    out.print(f"{output.count_of(len(records), 'record')}; {robot}")
    hits = [r for r in records if r.kind == "percussion"]
    motions = [r for r in records if r.kind == "motion"]
    if hits:
        poses = {tuple(r.pose.items() if isinstance(r.pose, dict) else r.pose or ()) for r in hits}
        directions = {tuple(np.round(r.direction or [], 6)) for r in hits}
        levels = sorted({r.excitation["force"] for r in hits if "force" in r.excitation})
        level = "the force recorded"
        if levels:
            level = f"{levels[0]:g}" + (f" to {levels[-1]:g}" if len(levels) > 1 else "")
            level = f"{output.count_of(len(levels), 'level')} ({level} N)"
        steady = sum(record.steady for record in campaign)
        bursts = f"{output.count_of(len(hits) - steady, 'burst')}, {steady} steady"
        told = (
            output.count_of(len(hits), "record") + f" ({bursts})",
            output.count_of(len(poses), "pose"),
            output.count_of(len(directions), "direction"),
            level,
        )
        out.print(f"  percussion: {', '.join(told)}")
    if motions:
        seconds = sum(r.end - r.start for r in motions)
        out.print(f"  motion: {output.count_of(len(motions), 'record')}, {seconds:.4g} s")
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


def _record_table(records: Sequence[RecordSummary]) -> FittedTable:
    rows = []
    for record in records:
        numbers = list(record.pose.values() if isinstance(record.pose, dict) else record.pose or [])
        along = "-" if record.direction is None else ", ".join(
            f"{c + 0.0:.2g}" for c in np.round(record.direction, 6)
        )  # fmt: skip
        rows.append((
            record.file, _done(record), ", ".join(f"{q:.3g}" for q in numbers) or "-",
            along, f"{record.start:.4g}", f"{record.end:.4g}", str(record.samples),
            f"{record.rate:.6g}", str(len(record.channels)),
        ))  # fmt: skip
    heads = ("record", "what was done", "pose\nrad, m", "force along", ">from\ns", ">to\ns",
             ">samples", ">rate\nHz", ">channels")  # fmt: skip
    return output.table(heads, rows)


def _done(record: RecordSummary) -> str:
    if record.kind == "motion":
        return "motion"
    e = record.excitation
    if "force" not in e or "period" not in e:
        return record.blows or "percussion"
    count = f"{e['hits']} x " if "hits" in e else "steady "
    return f"{count}{e['force']:.4g} N / {1e3 * e['period']:.4g} ms"


def _channel_table(report: QualityReport) -> FittedTable:
    sizes: dict[str, list[float]] = {}
    units = {}
    for record in report.records:
        for name, numbers in record.channels.items():
            sizes.setdefault(name, []).append(float(numbers["rms"]))
            units[name] = str(numbers["unit"])
    rows = []
    for name, rms in sizes.items():
        noise, ratio = report.noise.get(name), report.signal_to_noise(name)
        cells = ["-"] * 4 + [""]
        if noise is not None:
            hum = ", ".join(f"{h.amplitude:.2g} at {h.frequency:.3g} Hz" for h in noise.hum[:1])
            colour = "a rough floor" if noise.rough else "white" if noise.white else "coloured"
            cells = [f"{noise.std:.3g}", f"{100 * noise.error:.2g} %",
                     "-" if np.isnan(ratio) else f"{ratio:.0f}", hum or "-", colour]  # fmt: skip
        rows.append((name, units[name], str(len(rms)), f"{min(rms):.3g}",
                     f"{max(rms):.3g}", *cells))  # fmt: skip
    heads = ("channel", "unit", ">in records", ">RMS,\nleast", ">RMS,\nmost", ">noise\n(std)",
             ">known\nto", ">signal over\nnoise, dB", ">hum", "colour")  # fmt: skip
    return output.table(heads, rows, title="Channels and their noise")


def _finding_table(report: QualityReport) -> FittedTable:
    rows = []
    for group in [[finding] for finding in report.findings] if output.whole() else report.groups():
        worst = group[0]
        channels = sorted({f.channel for f in group if f.channel})
        files = sorted({f.record for f in group if f.record})
        where = ", ".join(channels[:2]) + (" ..." if len(channels) > 2 else "")
        if files:
            count = f"{len(files)} of {len(report.records)} records, worst {worst.record}"
            where += (": " if where else "") + (files[0] if len(files) == 1 else count)
        mark = output.styled(worst.severity, style=_STYLES[worst.severity])
        rows.append((mark, where or "campaign", worst.message, worst.advice))
    return output.table(("", "where", "what was seen", "what to do"), rows, title="What was found")
