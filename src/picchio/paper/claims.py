"""The engine of the claims: each is a number with limits, tried in one world or in many."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from picchio.paper.equations import decoupling, miner_gap, printed_total, series_gap
from picchio.paper.life import paper_lives, peak_over_amplitude, shaft_steel
from picchio.paper.printed import trials
from picchio.paper.study import Study
from picchio.paper.world import World
from picchio.studies.rivet.pose import ModelAtPose

_TELLING, _RARE = 0.75, 8
"""Share of worlds that an input must get right to decide; fewer worlds than this are rare."""


class Verdict(StrEnum):
    """The four answers."""

    HOLDS = "holds"
    CONDITIONAL = "holds only if"
    FAILS = "does not hold"
    UNKNOWN = "cannot be known"


@dataclass(frozen=True)
class Finding:
    """A claim after it was tried.

    Attributes:
        name: of the claim; page and quote: where and what the paper says.
        figure: that shows it; None for none.
        verdict: one of four.
        condition: of "holds only if".
        test: what was tried.
        decides: the number that decides, in a sentence.
        number: the same as a number; None where nothing can be computed.
    """

    name: str
    page: int
    quote: str
    figure: str | None
    verdict: Verdict
    condition: str | None
    test: str
    decides: str
    number: float | None


def plainly(value: float) -> str:
    """Three digits; rounding errors become 0."""
    return "0" if abs(value) < 1e-12 else f"{value:.3g}"


def try_claims(study: Study) -> tuple[Finding, ...]:
    """Every claim, in the order in which the paper makes them."""
    return tuple(try_claim(study, name) for name in study.printed.claims)


def try_claim(study: Study, name: str) -> Finding:
    """One claim: in every world if its number is one of a world, else once.

    To add one: its sentence in `data/paper.toml`, its limits in `data/trials.toml`, its number
    below.
    """
    claim, sentence = trials().claims[name], study.printed.claims[name]
    fields: dict[str, Any] = {"study": study, "paper": study.printed}
    worlds = study.worlds[: claim.worlds] if name in OF_WORLD else ()
    number: float | None = None
    if claim.unknown:
        verdict, condition = Verdict.UNKNOWN, ""
        fields |= OF_STUDY.get(name, lambda study: {})(study)
    elif name in OF_WORLD:
        numbers = np.array([OF_WORLD[name](world) for world in worlds], dtype=float)
        true = [claim.holds(each, study.printed) for each in numbers]
        verdict, condition = judge(worlds, true, claim.among)
        number = float(numbers[0])
        sizes = {"base": number, "least": np.nanmin(numbers), "most": np.nanmax(numbers)}
        fields |= {key: plainly(size) for key, size in sizes.items()}
        fields |= {"share": f"{100.0 * np.mean(true):.0f} %", "worlds": len(worlds)}
    else:
        fields |= OF_STUDY[name](study)
        number = float(fields["number"])
        true = [fields.get("holds", claim.holds(number, study.printed))]
        verdict, condition = judge(worlds, true)
    if claim.condition and verdict is not Verdict.FAILS:
        verdict = Verdict.CONDITIONAL
        condition = " and ".join(filter(None, (claim.condition.format(**fields), condition)))
    test, decides = claim.test.format(**fields), claim.decides.format(**fields)
    said = (name, sentence.page, sentence.quote, claim.figure or None)
    return Finding(*said, verdict, condition or None, test, decides, number)


def judge(
    worlds: Sequence[World], true: Sequence[bool] | ArrayLike, among: Sequence[str] = ()
) -> tuple[Verdict, str]:
    """A claim holds in all worlds, in none, or in some; then the input that decides is named.

    Args:
        worlds: in which it was tried.
        true: where it holds.
        among: the inputs that the claim can depend on; all if none are named.
    """
    true = np.asarray(true, dtype=bool)
    count = int(true.sum())
    if count in (0, len(true)):
        return Verdict.HOLDS if count else Verdict.FAILS, ""
    words, right = best_split(worlds, true, among)
    legend = "rare" if count < _RARE else "rule" if right >= _TELLING else "several"
    condition = (
        trials().legends[legend].format(count=count, all=len(true), words=words, right=100 * right)
    )
    return Verdict.CONDITIONAL, condition


def best_split(
    worlds: Sequence[World], true: ArrayLike, among: Sequence[str] = ()
) -> tuple[str, float]:
    """The one assumption that best separates where a claim holds.

    Returns:
        the condition in words, and the mean of the shares of true and of false worlds that it
        tells right.
    """
    true = np.asarray(true, dtype=bool)
    splits: list[tuple[str, Any]] = []
    for key, entry in trials().inputs.items():
        if among and key not in among:
            continue
        name, values = entry.called or key, np.array([getattr(w.given, key) for w in worlds])
        if entry.choices:
            splits += [(f"{name} is {c}", values == c) for c in dict.fromkeys(values.tolist())]
            continue
        levels = np.unique(values)
        for at in 0.5 * (levels[1:] + levels[:-1]):
            level = f"{at:.3g} {entry.unit}".rstrip(" –")
            splits += [(f"{name} is below {level}", values < at)]
            splits += [(f"{name} is above {level}", values > at)]
    right = [0.5 * (chosen[true].mean() + (~chosen[~true]).mean()) for _, chosen in splits]
    best = int(np.argmax(np.round(right, 12)))
    return splits[best][0], float(right[best])


# The numbers, by claim. Of a world: ------------------------------------------------------------


def _fluctuates(world: World) -> float:
    at = ModelAtPose(world.model, world.rivet_poses[0])
    value = at.turning_points(world.blows, None, world.printed.directions[0])[1]
    return float(np.ptp(value) / np.abs(value).max())


def _symmetric(world: World) -> float:
    radii = world.path_radii(np.linspace(0.0, np.pi, 180, endpoint=False))
    gap = np.abs(radii.argmax(axis=0) - radii.argmin(axis=0))[:, 1:]
    return float(np.abs(np.minimum(gap, 180 - gap) - 90).max())


def _transient(world: World) -> float:
    burst, steady = world.rivet_peaks(hits=12), world.rivet_stress
    return float((world.stress(burst.max(axis=(0, 1))) / steady.max(axis=(0, 1))).max())


def _middle(world: World) -> float:
    bend = int(world.reach.peaks["worst"][..., 2].max(axis=0).argmax())
    return float(world.reach.distance[0, bend] / world.reach.distance.max())


def _most_stressed(world: World) -> float:
    means = world.rivet_stress.mean(axis=1)
    return float((means.argmax(axis=1) == world.printed.stress.argmax(axis=1)).sum())


def _no_joint_always(world: World) -> float:
    joints = (world.rivet_stress, world.path_peaks.peak_deflection)
    return len(np.union1d(*(each.argmax(axis=-1) for each in joints)))


def _spread(peaks: Any, axis: int) -> Any:
    """Largest over smallest, where the smallest may be nothing."""
    return peaks.max(axis=axis) / np.maximum(peaks.min(axis=axis), 1e-12)


def _dominant(k: int, world: World) -> float:
    return float(world.path_peaks.peak_deflection[k].argmax()) + 1


def _off_y(world: World) -> float:
    across_plane = np.abs(world.path_peaks.direction[:, 0, 1]).min()
    return float(np.degrees(np.arccos(np.clip(across_plane, 0.0, 1.0))))


def _x_force(world: World) -> float:
    peaks = world.reach.peaks
    return float(peaks["x"][..., 0].max() / peaks["worst"][..., 0].max())


def _nearest(world: World) -> float:
    bent = world.reach.peaks["worst"][:, -1]
    return float(np.median(bent[:, 2] / bent[:, 1]))


def _poses(world: World) -> float:
    stress = world.rivet_stress
    return float((1.0 - stress.min(axis=1) / stress.max(axis=1).clip(1e-12))[:, 1:].max())


_HEIGHTS = ("top", "second", "third", "low")
OF_WORLD: dict[str, Callable[[World], Any]] = {
    "poses": _poses,
    "no_joint_always": _no_joint_always,
    "direction": lambda w: np.median(_spread(w.rivet_stress, 0)[:, 1:]),
    "fixed_direction": lambda w: np.degrees(w.rivet_peaks(hits=12).sum(axis=-1).max()),
    "transient": _transient,
    "fluctuates": _fluctuates,
    "double_ball": lambda w: w.waist.max(),
    "symmetric": _symmetric,
    "envelope_size": lambda w: _spread(w.path_peaks.peak_deflection, 0).max(),
    **{f"dominant_{at}": partial(_dominant, k) for k, at in enumerate(_HEIGHTS)},
    "direction_joint_1": _off_y,
    "direction_swings": lambda w: (np.sign(w.lean[0, 1:]) != np.sign(w.lean[-1, 1:])).sum(),
    "reach_joint_1": lambda w: abs(w.reach.top("worst", 0)[0]) / w.reach.place[..., 0].max(),
    "x_force_joint_1": _x_force,
    "reach_joint_2": lambda w: abs(w.reach.top("x", 1)[2] - w.reach.hub) / w.reach.distance.max(),
    # The arm stretched out straight up: the last turn, no bend.
    "z_force_joint_2": lambda w: w.reach.peaks["z"][-1, 0, 1] / w.reach.peaks["z"][..., 1].max(),
    "middle_joint_3": _middle,
    "nearest_joint_3": _nearest,
    "upward_joint_1": lambda w: w.rivet_stress[2, :, 0].max() / w.rivet_stress.max(),
    "most_stressed": _most_stressed,
}


# Once, with what the sentence about it needs: --------------------------------------------------


def _lives_differ(study: Study) -> dict[str, Any]:
    printed, ours = study.printed.cycles[np.isfinite(study.printed.cycles)], paper_lives(study.base)
    return {"number": ours.max() / ours.min(), "by_table": printed.max() / printed.min()}


def _mimics(study: Study) -> dict[str, Any]:
    largest, limits = study.base.sweep[1].max(axis=0), study.printed.arm.actuator_torques
    held = bool(largest[1] <= limits[1] and largest[2] <= limits[2])
    share = 100 * study.base.share_held
    return {"number": largest[1], "holds": held, "largest": largest, "share": share}


def _shaft_steel(study: Study) -> dict[str, Any]:
    steel, curve = shaft_steel(), study.printed.sn_curve
    assert steel.ultimate_shear is not None
    strength, limit = curve.a * 1000.0**curve.b, steel.ultimate_shear / 1e6
    crossing = (limit / curve.a) ** (1.0 / curve.b)
    found = {"number": strength, "holds": strength < limit, "limit": limit}
    return {**found, "crossing": crossing, "steel": steel.name}


def _curve_of_table(study: Study) -> dict[str, Any]:
    off = study.curve_of_table.over_printed
    within = bool((np.abs(np.log(off)) < math.log(1.05)).all())  # all entries to 5 %
    return {"number": off.max(), "holds": within, "least": off.min()}


def _phase(study: Study) -> dict[str, Any]:
    errors = {k: 100 * study.phase[k] for k in ("plain_error", "plain_history", "right_error")}
    return {"number": study.phase["plain_error"], "holds": errors["right_error"] < 1e-4, **errors}


def _shaft_strain(study: Study) -> dict[str, Any]:
    shafts = [joint.shaft for joint in study.base.robot.flexible_joints]
    radii, lengths = ([1e3 * getattr(s, part) for s in shafts] for part in ("radius", "length"))
    return {"number": radii[1], "thick": [2 * r for r in radii], "long": lengths}


def _total(study: Study) -> dict[str, Any]:
    rivets, joint = printed_total(study.printed)
    return {"rivets": rivets, "many": study.printed.task.hits_per_rivet * rivets, "joint": joint}


def _dominant_all(study: Study) -> dict[str, Any]:
    hits, tried = study.sequences.counts[4], len(study.sequences.agree)
    share = hits / tried
    found = {"number": share, "share": 100 * share, "holds": hits > 0}
    return {**found, "hits": hits, "tried": tried}


def _peak_stress(study: Study) -> dict[str, Any]:
    ratio = peak_over_amplitude(study.base)
    return {"number": ratio, "factor": ratio**study.printed.sn_curve.exponent}


OF_STUDY: dict[str, Callable[[Study], dict[str, Any]]] = {
    "lives_differ": _lives_differ,
    "decoupled": lambda study: {"number": decoupling(study)},
    "fourier": lambda study: {"number": series_gap(study)},
    "phase": _phase,
    "shaft_strain": _shaft_strain,
    "peak_stress": _peak_stress,
    "miner_algebra": lambda study: {"number": miner_gap(study.printed)},
    "force_level": lambda study: {"factor": 10.0 ** (1.0 / study.printed.sn_curve.exponent)},
    "dominant_all": _dominant_all,
    "shaft_steel": _shaft_steel,
    "curve_of_table": _curve_of_table,
    "mimics": _mimics,
    "total": _total,
}
