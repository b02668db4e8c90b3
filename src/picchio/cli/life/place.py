"""`picchio place`: where to put the work so that the robot lasts longest."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from picchio.cli import options as typed
from picchio.cli import output
from picchio.cli.app import app
from picchio.core import spoken
from picchio.robot.annotations.flexibility import estimate_notice

if TYPE_CHECKING:
    from picchio.studies.placement.result import Placement


@app.command()
def place(
    given: typed.RobotGiven,
    *,
    task: typed.TaskOption = None,
    move: str | None = None,
    period_range: str | None = None,
    margin: float = 0.0,
    off: float = 0.05,
    placements: int = 400,
    sn_curve: typed.SNCurveOption = None,
    self_collision: Annotated[bool, typer.Option("--self-collision/--no-self-collision")] = True,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    out: Annotated[Path | None, typed.output("--out")] = None,
    json: typed.JsonOption = None,
) -> None:
    """Where to put the work so that the robot lasts longest.

    The poses are chosen with the place, and the hit rate where a range of periods is given.

    Options:
        move (X,Y,Z,HEADING): How far the work may go each way, m, m, m and deg; 0 for not at all.
            Half the arm's reach and 180 if not given.
        period_range (LOW,HIGH): Periods that the tool can be set to, s; the task's own if not
            given.
        margin (M): Every rivet stays in reach when the work stands so far aside, m.
        off (M): Tell what it costs to miss the best place by so much, m.
        placements (N): Placements within reach to try all over, before searching locally.
        self_collision: Whether poses whose links touch are refused.
        seed (N): Random seed of the search.
        out (FILE): Write the task with the work moved (TOML).
    """
    import picchio
    from picchio.studies.default_task import task_of
    from picchio.studies.placement.file import write_task
    from picchio.studies.placement.work import Work

    far = None if move is None else typed.numbers(move, "--move", 4)
    if far is not None:
        far[3] = math.radians(far[3])
    rates = None if period_range is None else typed.numbers(period_range, "--period-range", 2)
    with output.notice_first(json):
        loaded = given.load()
    work = task_of(loaded, task)
    with output.progress("steps of the search") as tick:
        found = picchio.place(
            loaded,
            work,
            move=far,
            period_range=None if rates is None else (rates[0], rates[1]),
            placements=placements,
            off=off,
            margin=margin,
            sn_curve=sn_curve,
            self_collision=self_collision,
            seed=seed,
            progress=tick,
        )
    if out is not None:
        write_task(found, Work.of(loaded, work), work, out)

    def show_all() -> None:
        for line in filter(None, (estimate_notice(loaded.name, loaded.origins), work.note)):
            output.console().print(f"{line}.\n", style="bold yellow")
        _show(found, off)

    output.deliver(found.to_dict(), json, show_all)


def _show(found: Placement, off: float) -> None:
    out = output.console()
    # Zeros are added for the sake of their sign.
    x, y, z = found.best.spot.move[:3].round(3) + 0.0
    heading = round(math.degrees(found.best.spot.move[3]), 2) + 0.0
    out.print(output.styled(f"{found.robot}: {_gain(found)}"))
    if found.moved:
        out.print(
            f"  work: shift by ({x:.3f}, {y:.3f}, {z:.3f}) m, turn by {heading:.2f} deg "
            "about the vertical through its middle"
        )
        bx, by, bz = found.best.base_position.round(3) + 0.0
        turned = round(math.degrees(found.best.base_heading), 2) + 0.0
        out.print(f"  or base: to ({bx:.3f}, {by:.3f}, {bz:.3f}) m, turned by {turned:.2f} deg")
        if found.best.spot.period is not None:
            out.print(f"  a blow every {1e3 * found.best.spot.period:.4g} ms")
    else:
        out.print("  nothing better than where the work is now was found")
    title = "At the stated values, which are uncertain" if found.sure else ""
    out.print(output.listed(found._listing(), title))
    if found.moved and found.explained():
        out.print(found.explained())
    if found.sure:
        out.print(found.sure.words())
    out.print(_cost_of_off(found, off))
    if found.by_effort:
        out.print("Utilisation: torque over the URDF's effort limit; no shaft or reducer is known.")
    out.print(
        f"{found.placements} placements tried all over, {found.reached} of them within reach; "
        f"{found.nearby} more near the best."
    )
    out.print(f"Self-collisions: {found.self_collision}.")


def _gain(found: Placement) -> str:
    gain, life = found.utilisation_gain, found.life_gain
    way, times = ("falls", gain) if gain >= 1.0 else ("rises", 1.0 / gain)
    utilisation = f"the highest utilisation {way} {spoken.number(times)} times"
    if math.isnan(life):
        return f"Gain: every life is unlimited; {utilisation}."
    if math.isinf(life):
        return f"Gain: the life becomes unlimited; {utilisation}."
    return f"Gain: the weakest joint lives {spoken.number(life)} times as long; {utilisation}."


def _cost_of_off(found: Placement, off: float) -> str:
    beside = f"{100 * off:g} cm beside the best place"
    lost = [o for o in found.off if not o.reached]
    near = [o for o in found.off if o.reached]
    parts = []
    if near:
        least = min(o.rivets_to_failure for o in near)
        if math.isfinite(least):
            share = least / found.best.rivets_to_failure
            parts.append(f"the life is at worst {share:.3g} times as long")
        most = max(o.utilisation for o in near) / max(found.best.utilisation, 1e-300)
        parts.append(f"the utilisation at worst {spoken.number(most)} times as high")
    if lost:
        ways = ", ".join(
            f"{'+' if c > 0 else '-'}{axis}"
            for o in lost
            for axis, c in zip("xyz", o.shift, strict=True)
            if c
        )
        parts.append(f"not every rivet can be reached towards {ways} (--margin asks for room)")
    return f"{beside[0].upper()}{beside[1:]}: {'; '.join(parts)}."
