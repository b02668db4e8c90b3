"""The abstract's observations, and what Table 2 says of the stresses."""

from __future__ import annotations

import numpy as np

from picchio.paper.study import Study
from picchio.paper.verdict import PANEL, Finding, claim, claim_of_worlds, decided
from picchio.paper.waterfall import peak_over_amplitude
from picchio.paper.world import World
from picchio.studies.rivet.pose import ModelAtPose

_CLEARLY = 1.10
"""A difference of 10 % is one."""


@claim_of_worlds(
    "fig-13-15",
    "by what share of the largest peak stress it falls among the 15 rivets, joints 2 and 3",
    "{base} in the base world, {least} to {most} over {worlds} worlds",
    PANEL,
)
def poses(world: World) -> tuple[bool, float]:
    """The stress changes from pose to pose."""
    stress = world.rivet_stress
    span = float((1.0 - stress.min(axis=1) / stress.max(axis=1).clip(1e-12))[:, 1:].max())
    return span > 1.0 - 1.0 / _CLEARLY, span


@claim_of_worlds(
    "fig-13-15",
    "how many joints are the most stressed one somewhere: 15 rivets in three directions, and "
    "the four poses of Fig. 9",
    "{base} joints in the base world, {least} to {most} over {worlds} worlds",
)
def no_joint_always(world: World) -> tuple[bool, float]:
    """Which joint is most stressed depends on pose and direction."""
    leaders = np.unique(world.rivet_stress.argmax(axis=-1))
    on_path = np.unique(world.path_peaks.peak_deflection.argmax(axis=-1))
    count = len(np.union1d(leaders, on_path))
    return count > 1, float(count)


@claim_of_worlds(
    "fig-9",
    "at each rivet the largest over the smallest of three directions, joints 2 and 3, median",
    "a factor of {base} in the base world, {least} to {most} over {worlds} worlds; joint 1 "
    "goes down to nothing",
    PANEL,
)
def direction(world: World) -> tuple[bool, float]:
    """The direction of the force matters."""
    stress = world.rivet_stress
    ratio = float(np.median((stress.max(axis=0) / np.maximum(stress.min(axis=0), 1e-12))[:, 1:]))
    return ratio > _CLEARLY, ratio


@claim_of_worlds(
    "fig-8",
    "range of joint 2's stress over its peak, steady state, first rivet, forward",
    "{base} in the base world, {least} to {most} over {worlds} worlds (0 would be still, 2 "
    "fully reversed)",
    PANEL,
    most=24,
)
def fluctuates(world: World) -> tuple[bool, float]:
    """The stress goes up and down."""
    at = ModelAtPose(world.model, world.rivet_poses[0])
    value = at.turning_points(world.blows, None, world.printed.directions[0])[1]
    share = float(np.ptp(value) / np.abs(value).max())
    return share > 0.05, share


@claim_of_worlds(
    "fig-13-15",
    "joint 1's stress under a vertical force over the largest stress; the arm's plane holds "
    "the force, and nothing couples joint 1 to the others",
    "{most} at most, over {worlds} worlds",
)
def upward_joint_1(world: World) -> tuple[bool, float]:
    """A vertical force has no lever about a vertical axis."""
    share = float(world.rivet_stress[2, :, 0].max() / world.rivet_stress.max())
    return share < 1e-9, share


@claim_of_worlds(
    "fig-13-15",
    "the joint with the largest mean stress in each of the three directions",
    "{base} of 3 directions agree in the base world; all three in {share} of {worlds} worlds",
    PANEL,
)
def most_stressed(world: World) -> tuple[bool, float]:
    """Table 2's ranking of the joints."""
    agree = world.rivet_stress.mean(axis=1).argmax(axis=1) == world.printed.stress.argmax(axis=1)
    return bool(agree.all()), float(agree.sum())


@claim("corrections")
def peak_stress(study: Study) -> Finding:
    """Whether the peak may replace the amplitude without harm."""
    ratio = peak_over_amplitude(study.base)
    factor = ratio**study.printed.sn_curve.exponent
    return decided(
        ratio >= 1.0,
        "peak of the steady state over half its range, where the base world's stress is largest",
        f"a factor of {ratio:.3g}, which shortens the life {factor:,.0f} times: a steady part is "
        "counted as if it came and went",
        ratio,
        "a life that is too short is no harm",
    )
