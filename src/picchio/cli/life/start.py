"""`picchio start`: a sidecar of estimates and a first task, where only a URDF is known."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from picchio.cli.app import app
from picchio.cli.options import ClassOption, JsonOption, PayloadOption, ReachOption, ToolOption
from picchio.cli.output import console, count_of, deliver, styled, table, to_write
from picchio.core.errors import InputError

if TYPE_CHECKING:
    from picchio.robot.annotations.sidecar import JointEntry
    from picchio.studies.start import Start

_NAMED = 6  # rigid joints of one reason


@app.command()
def start(
    robot: str,
    *,
    tool: ToolOption = None,
    payload: PayloadOption = None,
    reach: ReachOption = None,
    drive_class: ClassOption = None,
    reducers: Annotated[list[str] | None, typer.Option("--reducer")] = None,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    out: Path = Path(),
    force: bool = False,
    json: JsonOption = None,
) -> None:
    """Write estimates of a robot's drives and a first task to edit.

    Stiffness, damping and strength of the drives come from the URDF's masses, levers and limits,
    each with its spread and its reason.

    Options:
        robot (ROBOT): A URDF, or a name from `picchio robots`.
        reducers (JOINT=NAME): A joint's reducer, by its catalogue name; may be repeated.
        seed (N): Random seed of the task's poses.
        out (FOLDER): Where the two files go; it must exist.
        force: Write over files that exist.
    """
    import picchio

    named: dict[str, str] = {}
    for text in reducers or ():
        joint, equals, name = (part.strip() for part in text.partition("="))
        if not equals or not joint or not name:
            raise InputError("must be JOINT=NAME", key="--reducer", value=text)
        if joint in named:
            raise InputError("the joint is given twice", key="--reducer", value=joint)
        named[joint] = name
    found = picchio.start(
        robot, tool=tool, payload=payload, reach=reach, drive_class=drive_class, reducers=named,
        seed=seed,
    )  # fmt: skip
    for name in found.names:
        to_write(out / name, "--out")
    found.save(out, force=force)
    deliver(found.to_dict(), json, lambda: _show(found, out))


def _range(entry: JointEntry, key: str, scale: float = 1.0) -> str:
    """Where nine cases of ten lie; a number without a spread as it is."""
    from picchio.robot.estimate.template import likely, told_range

    value, spread = getattr(entry, key), getattr(entry, f"{key}_spread", None)
    if value is None:
        return "its curve" if key == "stiffness" and entry.stiffness_curve else "-"
    return told_range(likely(scale * value, spread)) if spread else f"{scale * value:.3g}"


def _show(found: Start, out: Path) -> None:
    from picchio.robot.estimate.template import likely, told_range

    screen = console()
    screen.print(
        styled(found.robot, f": {count_of(len(found.sidecar.joint), 'drive')} estimated from "
               "the URDF. Nothing was measured.")
    )  # fmt: skip
    rows = []
    for name, entry in found.sidecar.joint.items():
        bears = entry.strength
        peak = "-"
        if bears is not None:
            spread = bears.model_dump()["repeated_peak_torque_spread"]
            torque = bears.repeated_peak_torque
            peak = told_range(likely(torque, spread)) if spread else f"{torque:g}, {entry.reducer}"
        rows.append((
            name,
            _range(entry, "stiffness"),
            _range(entry, "damping_ratio", 100.0),
            peak,
        ))  # fmt: skip
    heads = ("joint", ">stiffness\nN m/rad", ">damping\n%", ">repeated peak\ntorque, N m")
    screen.print(table(heads, rows, title="Where nine cases of ten lie"))
    for reason, joints in found.rigid.items():
        more = f" and {len(joints) - _NAMED} more" if len(joints) > _NAMED else ""
        screen.print(f"  - Left rigid: {', '.join(joints[:_NAMED])}{more}: it {reason}.")
    if found.known:
        every = len(found.known) == len(found.sidecar.joint)
        screen.print(
            f"  - What its own files say of {'each joint' if every else ', '.join(found.known)} "
            "stands; only the rest is estimated."
        )
    blows = found.task["excitation"]
    screen.print(
        f"  - The task: {count_of(found.task['hits_per_rivet'], 'blow')} a rivet of "
        f"{blows['force']:g} N, {1e3 * blows['width']:g} ms wide, every "
        f"{1e3 * blows['period']:g} ms, along x, y and z at five poses drawn with seed "
        f"{found.seed}."
    )
    screen.print("\nEdit both files where you know better. Then:")
    screen.print(styled(f"  {found.next_command(out)}"), soft_wrap=True)  # in one line, to copy
