"""Claims about Fig. 9: the envelopes over all force directions on a vertical path."""

from __future__ import annotations

from functools import partial

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.paper.dominance import search_dominance
from picchio.paper.study import Study
from picchio.paper.verdict import PATH, Finding, Verdict, across, claim, claim_of_worlds
from picchio.paper.world import World

_PINCHED = 0.2
"""A double ball is as thin as this, or thinner, across its waist over its length."""
_SQUARE = 5.0
"""Degrees that count as perpendicular."""


def waist(world: World) -> FloatArray:
    """(4 poses, 3 joints): an envelope's least radius in the arm's plane over its largest.

    0 for two balls that touch: a deflection with one direction of its own.
    """
    radii = world.path_radii(np.linspace(0.0, np.pi, 36, endpoint=False))
    found = radii.min(axis=0) / radii.max(axis=0).clip(1e-30)
    # Joint 1 answers to the force across the arm's plane alone.
    found[:, 0] = radii[:, :, 0].max(axis=0) / world.path_peaks.peak_deflection[:, 0]
    return np.asarray(found)


def lean(world: World) -> FloatArray:
    """(4 poses, 3 joints) degrees from +x to +z of the worst direction, in [-90, 90]."""
    n = world.path_peaks.direction
    return np.asarray(np.degrees(np.arctan2(n[..., 2] * np.sign(n[..., 0]), np.abs(n[..., 0]))))


@claim_of_worlds(
    "fig-9",
    "waist over length of every envelope (joint 1's is a double ball exactly); below "
    f"{_PINCHED:g} it looks like one",
    "joints 2 and 3: {base} in the base world, {least} to {most} over {worlds} worlds",
    PATH,
    most=64,
)
def double_ball(world: World) -> tuple[bool, float]:
    """How near an envelope is to two touching balls."""
    worst = float(waist(world).max())
    return worst < _PINCHED, worst


@claim_of_worlds(
    "fig-9",
    "angle between the directions of the largest and the least deflection of joints 2 and 3, "
    f"less 90°; up to {_SQUARE:g}° counts as perpendicular (to the arm's plane all of them "
    "are symmetric)",
    "{base}° away in the base world, {least}° to {most}° over {worlds} worlds",
    PATH,
    most=24,
)
def symmetric(world: World) -> tuple[bool, float]:
    """Whether the force that does least is square to the one that does most."""
    radii = world.path_radii(np.linspace(0.0, np.pi, 180, endpoint=False))
    gap = np.abs(radii.argmax(axis=0) - radii.argmin(axis=0))[:, 1:]
    away = float(np.abs(np.minimum(gap, 180 - gap) - 90).max())
    return away <= _SQUARE, away


@claim_of_worlds(
    "fig-9",
    "largest over smallest envelope of a joint among the four poses",
    "a factor of {base} in the base world, {least} to {most} over {worlds} worlds",
    PATH,
)
def envelope_size(world: World) -> tuple[bool, float]:
    """The envelopes grow and shrink along the path."""
    peaks = world.path_peaks.peak_deflection
    ratio = float((peaks.max(axis=0) / peaks.min(axis=0)).max())
    return ratio > 1.1, ratio


def _dominant(k: int, study: Study) -> Finding:
    """Which joint has the largest envelope at the k-th height from the top."""
    wanted = study.printed.task.dominant_joints[k]

    def dominates(world: World) -> tuple[bool, float]:
        joint = int(world.path_peaks.peak_deflection[k].argmax()) + 1
        return joint == wanted, float(joint)

    return across(
        study.worlds, dominates,
        f"the joint with the largest envelope at z = {study.printed.task.path_heights[k]:g} m, "
        "over all directions",
        f"joint {{base}} in the base world; joint {wanted} in {{share}} of {{worlds}} worlds",
        PATH,
    )  # fmt: skip


for _k, _name in enumerate(("dominant_top", "dominant_second", "dominant_third", "dominant_low")):
    claim("fig-9", _name)(partial(_dominant, _k))


@claim("dominance")
def dominant_all(study: Study) -> Finding:
    """All four at once; searched for, since it is rare."""
    found = search_dominance(study)
    return Finding(
        Verdict.CONDITIONAL if found.hits else Verdict.FAILS,
        f"the joint with the largest envelope at all four heights, in {found.tried} worlds",
        f"{found.hits} of {found.tried} worlds ({100 * found.hits / found.tried:.2g} %) have the "
        "paper's sequence",
        found.hits / found.tried,
        found.words,
    )


@claim_of_worlds(
    "fig-9",
    "angle between joint 1's worst direction and y at the four poses",
    "{most}° at most over {worlds} worlds",
    PATH,
)
def direction_joint_1(world: World) -> tuple[bool, float]:
    """Joint 1's worst direction is across the arm's plane."""
    across_plane = np.abs(world.path_peaks.direction[:, 0, 1]).min()
    off = float(np.degrees(np.arccos(np.clip(across_plane, 0.0, 1.0))))
    return off < 1e-3, off


@claim_of_worlds(
    "fig-9",
    "whether the worst directions of joints 2 and 3 lean to different sides at the top and at "
    "the bottom of the path",
    "{base} of 2 joints in the base world; both in {share} of {worlds} worlds",
    PATH,
)
def direction_swings(world: World) -> tuple[bool, float]:
    """The worst directions of joints 2 and 3 swing through the vertical."""
    # From leaning one way to leaning the other: the sign of the lean changes, top to bottom.
    tilt = lean(world)[:, 1:]
    changes = np.sign(tilt[0]) != np.sign(tilt[-1])
    return bool(changes.all()), float(changes.sum())
