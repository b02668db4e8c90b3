"""`picchio count`: the damage that logs show, added to a ledger; what is left."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from picchio.cli import options as typed
from picchio.cli import output
from picchio.cli.app import app
from picchio.core import spoken
from picchio.core.errors import InputError
from picchio.robot.annotations.flexibility import estimate_notice

if TYPE_CHECKING:
    from picchio.ledger.result import Count
    from picchio.studies.tasks import Task


@app.command()
def count(
    given: typed.RobotGiven,
    *,
    ledger: Path,
    log: list[Path] | None = None,
    mapping: Path | None = None,
    task: typed.TaskOption = None,
    sn_curve: typed.SNCurveOption = None,
    watch: bool = False,
    every: Annotated[float, typer.Option(min=0.1)] = 10.0,
    hours_per_day: float | None = None,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    report: typed.ReportOption = None,
    json: typed.JsonOption = None,
) -> None:
    """What the blows in a robot's logs did to it, and the life left.

    A log that is counted twice counts once; order and cuts of the logs do not matter. Where no log
    shows blows they are those of the task, at the tool's trigger or the task's poses.

    Options:
        ledger (LEDGER): The robot's ledger; made where it is missing.
        log (FOLDER): Logs: a folder, or a file; may be repeated. Without it: what the ledger holds.
        mapping (FILE): What the logs' series are (TOML, see `picchio formats mapping`);
            mapping.toml in the folder if not given.
        watch: Go on counting what arrives, until Ctrl-C.
        every (S): How often --watch looks, s.
        hours_per_day (H): How long the robot works a day, h: with it, dates follow from hours.
        seed (N): Random seed of the draws.
    """
    import picchio
    from picchio.studies.default_task import task_of

    if watch and not log:
        raise InputError("needs a folder to watch", key="--log")
    with output.notice_first(json):
        loaded = given.load()
    output.to_write(ledger, "--ledger", added_to=True)
    before: list[tuple[str, int, int]] | None = None
    while True:
        now = _listing(log or [])
        if now != before:
            before = now
            try:
                with output.progress("logs") as tick:
                    found = picchio.count(loaded, log or None, ledger, mapping=mapping, task=task,
                                          sn_curve=sn_curve, seed=seed,
                                          hours_per_day=hours_per_day, progress=tick)  # fmt: skip
            except InputError as error:
                if not watch or not _in_any(error.file, log or []):
                    raise
                output.say_warning(f"nothing is counted yet: {error}")  # it may be written just now
            else:
                output.write_report(found, report)

                def show(found: Count = found) -> None:
                    if notice := estimate_notice(loaded.name, loaded.origins):
                        output.console().print(f"{notice}.\n", style="bold yellow")
                    _show(found, task_of(loaded, task))

                output.deliver(found.to_dict(arrays=True), json, show)
        if not watch:
            return
        time.sleep(every)


def _in_any(file: str | Path | None, logs: list[Path]) -> bool:
    """Whether a file is one of the logs, or lies in a folder of them."""
    if file is None:
        return False
    found = Path(file).resolve()
    return any(found == log.resolve() or log.resolve() in found.parents for log in logs)


def _listing(logs: list[Path]) -> list[tuple[str, int, int]]:
    """Names, sizes and times of the files that are there."""
    files = [p for log in logs for p in (log.rglob("*") if log.is_dir() else [log]) if p.is_file()]
    stats = [(str(p), p.stat()) for p in files]
    return sorted((name, stat.st_size, stat.st_mtime_ns) for name, stat in stats)


def _show(found: Count, task: Task) -> None:
    out = output.console()
    forces = {operation.excitation.peak_force for operation in task.operations}
    force = spoken.between((min(forces), max(forces)))
    out.print(
        output.styled(
            found.model.robot.name,
            f": {found.blows} blows in {output.count_of(found.logs, 'log')} of {found.logged}; "
            + (
                "all of them seen"
                if found.seen_share == 1.0
                else f"{'no force' if not found.seen_share else 'not every force'} recorded, the "
                f"task's {force} N assumed"
            ),
        )
    )
    end = found.first_to_fail
    if end is not None:
        name = found.model.robot.flexible_names[end]
        gain = float(found.if_force(0.9)[end])
        longer = f" With blows 10 % weaker it would last {gain:.3g} times as long."
        out.print(f"{name} ends the life, at {found.pace}.{longer}")
        if found.blows_a_day is None:
            out.print("Less than a day was logged: --hours-per-day H gives dates.")
    elif found.blows:
        out.print("Every life is unlimited: no blow damages a shaft or a drive.")
    if blow := found.counted.usual_blow:
        rate = "" if blow["rate"] is None else f", {blow['rate']:.3g} a second"
        peak, width, samples = (blow[key] or 0.0 for key in ("force", "width", "samples"))
        wide = f"{1e3 * width:.3g} ms wide ({samples:.3g} samples)"
        out.print(f"Blows as seen: {spoken.number(peak)} N, {wide}{rate}, in the mean.")
    for change in found.changes:
        out.print(output.styled("changed: ", change["words"], style="bold yellow"))
    out.print(output.listed(found._listing()))
    for name, why in found.refused:
        out.print(output.styled(f"not counted: {name}", f": {why}", style="bold yellow"))
    for note in found.notes:
        out.print(f"  - {note}")
    output.details()
    places = found.stations()
    if places and end is not None:
        places = sorted(places, key=lambda s: -float(s["share"][end]))[:3]
        shares = ", ".join(
            f"{100 * s['share'][end]:.3g} % at ({_angles(s['pose'])})" for s in places
        )
        out.print(f"Where it comes from: {shares}.")
    alike: dict[tuple[str, ...], list[str]] = {}
    for name in found.added:
        told = [line.partition(", measured")[0] for line in found.detected[name]]
        own = [line for line in told if not line.startswith(("begins", *"0123456789"))]
        alike.setdefault(tuple(own), []).append(name)
    for first, *others in alike.values():
        out.print(f"counted {first}: {'; '.join(found.detected[first])}")
        if others:
            ends = " to ".join(dict.fromkeys([others[0], others[-1]]))
            out.print(f"counted {ends}: {output.count_of(len(others), 'log')} like it")
    if found.known:
        out.print(f"{output.count_of(len(found.known), 'log')} counted before")


def _angles(pose: np.ndarray) -> str:
    return ", ".join(f"{value:.3g}" for value in pose)
