"""Claims about Fig. 10: where each joint suffers most in the arm's plane."""

from __future__ import annotations

import dataclasses

import numpy as np

from picchio.paper.study import Study
from picchio.paper.verdict import BLOWS, Finding, Verdict, across, claim, claim_of_worlds
from picchio.paper.world import World

_AT_THE_END = 0.95
"""Of the largest reach: from there on the arm counts as fully extended."""
_NONE = 1e-6


@claim_of_worlds(
    "fig-10",
    "horizontal distance of joint 1's largest deflection (worst direction) over the full "
    f"horizontal reach; {_AT_THE_END:g} and more is the end",
    "{base} in the base world, {least} to {most} over {worlds} worlds",
    BLOWS,
)
def reach_joint_1(world: World) -> tuple[bool, float]:
    """Over all directions, joint 1's worst place."""
    reach = world.reach
    share = float(abs(reach.top(reach.worst, 0)[0]) / reach.place[..., 0].max())
    return share > _AT_THE_END, share


@claim_of_worlds(
    "x-force",
    "joint 1's largest deflection under a force along x, anywhere in the x–z plane, over that "
    "under the worst direction (which is y)",
    "{most} at most over {worlds} worlds: the force points at the joint's axis",
    BLOWS,
)
def x_force_joint_1(world: World) -> tuple[bool, float]:
    """An x-force in the x-z plane points at joint 1's axis."""
    reach = world.reach
    share = float(reach.along["x"][..., 0].max() / reach.worst[..., 0].max())
    return share > _NONE, share


@claim("rings")
def reach_joint_2(study: Study) -> Finding:
    """Joint 2's worst place, over all directions and for a force along x."""

    def vertical(world: World) -> tuple[bool, float]:
        peaks = world.reach.worst[..., 1]
        # Whether up or down beats straight out by anything at all.
        ends, out = max(peaks[0].max(), peaks[-1].max()), peaks[len(peaks) // 2].max()
        return bool(ends > 1.001 * out), float(ends / out)

    def vertical_x(world: World) -> tuple[bool, float]:
        reach = world.reach
        top = reach.top(reach.along["x"], 1)
        share = float(abs(top[2] - reach.hub) / reach.distance.max())
        return share > _AT_THE_END, share

    worst = across(study.worlds, vertical, "", "{base}")
    along = across(
        study.worlds, vertical_x,
        "joint 2's largest deflection at the up and low end over that at the horizontal end, in "
        "the worst direction; and where an x-force deflects it most",
        f"worst direction: a ratio of {worst.decides}, so its map is rings and no end is worse "
        "than another; "
        "x-force: at {base} of the vertical reach in the base world, at the end in {share} of "
        "{worlds} worlds",
        BLOWS,
    )  # fmt: skip
    if along.verdict is Verdict.FAILS:
        return along
    words = "the force is along x" + (f" and {along.condition}" if along.condition else "")
    return dataclasses.replace(along, verdict=Verdict.CONDITIONAL, condition=words)


@claim_of_worlds(
    "z-force",
    "joint 2's deflection under a force along z, arm straight up, over the largest anywhere",
    "{most} at most over {worlds} worlds: the force passes through the joint's axis",
    BLOWS,
)
def z_force_joint_2(world: World) -> tuple[bool, float]:
    """A z-force at full vertical reach goes through joint 2's axis."""
    along = world.reach.along["z"][..., 1]
    # The arm stretched out straight up: the last turn, no bend.
    share = float(along[-1, 0] / along.max())
    return share > 0.5, share


@claim_of_worlds(
    "fig-10",
    "distance from joint 2 of joint 3's largest deflection (worst direction) over the full "
    f"reach; below {_AT_THE_END:g} the arm is not fully extended",
    "{base} in the base world, {least} to {most} over {worlds} worlds; the map is rings",
    BLOWS,
)
def middle_joint_3(world: World) -> tuple[bool, float]:
    """Joint 3's worst place, over all directions."""
    reach = world.reach
    place = int(reach.worst[..., 2].max(axis=0).argmax())
    share = float(reach.distance[0, place] / reach.distance.max())
    return share < _AT_THE_END, share


@claim_of_worlds(
    "fig-10",
    "joint 3's over joint 2's largest deflection where the arm is bent as far as it may",
    "{base} in the base world, {least} to {most} over {worlds} worlds; above 1 in {share}",
    BLOWS,
)
def nearest_joint_3(world: World) -> tuple[bool, float]:
    """Whether joint 3 deflects more than joint 2 where the arm is bent."""
    bent = world.reach.worst[:, -1]
    ratio = float(np.median(bent[:, 2] / bent[:, 1]))
    return ratio > 1.0, ratio
