"""`picchio envelope`: what a force can do to each joint at a pose, by its direction."""

from __future__ import annotations

from typing import TYPE_CHECKING

from picchio.cli import options as typed
from picchio.cli.app import app
from picchio.cli.output import console, deliver, listed, styled
from picchio.core import spoken

if TYPE_CHECKING:
    from picchio.studies.envelopes import DirectionEnvelope


@app.command()
def envelope(
    given: typed.RobotGiven,
    *,
    pose: str | None = None,
    blows: typed.BlowsGiven,
    hits: typed.HitsOption = None,
    gravity_stiffness: typed.GravityStiffnessOption = None,
    json: typed.JsonOption = None,
) -> None:
    """The worst force direction of every joint at a pose.

    It is exact: no direction is sampled.

    Options:
        pose (Q1,Q2,...): Joint positions, rad or m: Q1,Q2,..., or NAME=VALUE,... (the rest at
            zero), or a name. The first of the robot's task if not given.
    """
    import picchio
    from picchio.robot.dynamics.pose import warn_beyond_limits

    loaded = given.load()
    at = typed.pose_given(pose) if pose else None
    found = picchio.envelope(
        loaded, at, blows.on(loaded), hits=hits, gravity_stiffness=gravity_stiffness
    )
    warn_beyond_limits(loaded, [found.pose], "the pose")
    deliver(found.to_dict(), json, lambda: _show(found))


def _show(found: DirectionEnvelope) -> None:
    from picchio.vibration.closed_form.response import described

    out = console()
    pose = ", ".join(map(spoken.number, found.pose))
    how = described(found.hits)
    out.print(styled(found.robot, f" at ({pose}), {how}"))
    out.print(f"  {found.excitation.describe()}")
    frequencies = ", ".join(map(spoken.number, found.natural_frequencies))
    out.print(f"  natural frequencies {frequencies} Hz\n")
    out.print(listed(found._listing(), "Estimated: P10 to P90" if found.estimated else ""))
    x, y, z = found.worst_tool_direction
    most = spoken.number(1e3 * found.peak_tool_displacement)
    out.print(f"The tool moves most, {most} mm, under a force along ({x:.3f}, {y:.3f}, {z:.3f}).")
