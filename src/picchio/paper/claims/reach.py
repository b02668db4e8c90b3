"""Claims about Fig. 10: where each joint suffers most in the arm's plane."""

from __future__ import annotations

import numpy as np

from picchio.paper.claims.registry import claim
from picchio.paper.study import Study
from picchio.paper.verdict import REACH, Finding, Verdict, across
from picchio.paper.world import World

_AT_THE_END = 0.95
"""Of the largest reach: from there on the arm counts as fully extended."""
_NONE = 1e-6


@claim("reach_joint_1", "fig-10")
def reach_joint_1(study: Study) -> Finding:
    """Over all directions, joint 1's worst place."""

    def far(world: World) -> tuple[bool, float]:
        reach = study.reach(world)
        share = float(abs(reach.top(reach.worst, 0)[0]) / reach.place[..., 0].max())
        return share > _AT_THE_END, share

    return across(
        study.worlds, far,
        "horizontal distance of joint 1's largest deflection (worst direction) over the full "
        f"horizontal reach; {_AT_THE_END:g} and more is the end",
        "{base} in the base world, {least} to {most} over {worlds} worlds",
        REACH,
    )  # fmt: skip


@claim("x_force_joint_1", "x-force")
def x_force_joint_1(study: Study) -> Finding:
    """An x-force in the x-z plane points at joint 1's axis."""

    def loads(world: World) -> tuple[bool, float]:
        reach = study.reach(world)
        share = float(reach.along["x"][..., 0].max() / reach.worst[..., 0].max())
        return share > _NONE, share

    return across(
        study.worlds, loads,
        "joint 1's largest deflection under a force along x, anywhere in the x–z plane, over that "
        "under the worst direction (which is y)",
        "{most} at most over {worlds} worlds: the force points at the joint's axis",
        REACH,
    )  # fmt: skip


@claim("reach_joint_2", "rings")
def reach_joint_2(study: Study) -> Finding:
    """Joint 2's worst place, over all directions and for a force along x."""

    def vertical(world: World) -> tuple[bool, float]:
        reach = study.reach(world)
        peaks = reach.worst[..., 1]
        # Whether up or down beats straight out by anything at all.
        ends, out = max(peaks[0].max(), peaks[-1].max()), peaks[len(peaks) // 2].max()
        return bool(ends > 1.001 * out), float(ends / out)

    def vertical_x(world: World) -> tuple[bool, float]:
        reach = study.reach(world)
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
        REACH,
    )  # fmt: skip
    words = "the force is along x" + (f" and {along.condition}" if along.condition else "")
    return _limited(along, words)


@claim("z_force_joint_2", "z-force")
def z_force_joint_2(study: Study) -> Finding:
    """A z-force at full vertical reach goes through joint 2's axis."""

    def loads(world: World) -> tuple[bool, float]:
        reach = study.reach(world)
        along = reach.along["z"][..., 1]
        # The arm stretched out straight up: the last turn, no bend.
        share = float(along[-1, 0] / along.max())
        return share > 0.5, share

    return across(
        study.worlds, loads,
        "joint 2's deflection under a force along z, arm straight up, over the largest anywhere",
        "{most} at most over {worlds} worlds: the force passes through the joint's axis",
        REACH,
    )  # fmt: skip


@claim("middle_joint_3", "fig-10")
def middle_joint_3(study: Study) -> Finding:
    """Joint 3's worst place, over all directions."""

    def middle(world: World) -> tuple[bool, float]:
        reach = study.reach(world)
        place = int(reach.worst[..., 2].max(axis=0).argmax())
        share = float(reach.distance[0, place] / reach.distance.max())
        return share < _AT_THE_END, share

    return across(
        study.worlds, middle,
        "distance from joint 2 of joint 3's largest deflection (worst direction) over the full "
        f"reach; below {_AT_THE_END:g} the arm is not fully extended",
        "{base} in the base world, {least} to {most} over {worlds} worlds; the map is rings",
        REACH,
    )  # fmt: skip


@claim("nearest_joint_3", "fig-10")
def nearest_joint_3(study: Study) -> Finding:
    """Whether joint 3 deflects more than joint 2 where the arm is bent."""

    def absorbs(world: World) -> tuple[bool, float]:
        bent = study.reach(world).worst[:, -1]
        ratio = float(np.median(bent[:, 2] / bent[:, 1]))
        return ratio > 1.0, ratio

    return across(
        study.worlds, absorbs,
        "joint 3's over joint 2's largest deflection where the arm is bent as far as it may",
        "{base} in the base world, {least} to {most} over {worlds} worlds; above 1 in {share}",
        REACH,
    )  # fmt: skip


def _limited(found: Finding, words: str) -> Finding:
    """A finding that is true under a condition at best."""
    if found.verdict is Verdict.FAILS:
        return found
    return Finding(Verdict.CONDITIONAL, found.test, found.decides, found.number, words)
