"""Diagnosis of motion records: the robot moves, nothing hits."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from picchio.campaign.campaign import Campaign
from picchio.core.errors import InputError
from picchio.core.processes import one_thread
from picchio.diagnosis.motion.conclude.holdout import (
    NOISE,
    channels,
    judge,
    judged_groups,
    table,
)
from picchio.diagnosis.motion.conclude.values import correlation, nuisances, parameters
from picchio.diagnosis.motion.criteria.holdout import validate
from picchio.diagnosis.motion.criteria.score import Scorer, borne_out, necessity, passes
from picchio.diagnosis.motion.data.noise import noise_levels
from picchio.diagnosis.motion.data.split import split
from picchio.diagnosis.motion.data.system import Group, System
from picchio.diagnosis.motion.fit.instruments import instrument_shifts
from picchio.diagnosis.motion.fit.least_squares import Fit, fit
from picchio.diagnosis.motion.fit.spread import honest
from picchio.diagnosis.motion.fit.state import State, baseline
from picchio.diagnosis.motion.follow_up.advice import next_measurement
from picchio.diagnosis.motion.search.candidates import evidence_of, motion_effects
from picchio.diagnosis.motion.search.select import Step, alternatives, eliminate, select
from picchio.diagnosis.result import MOSTLY, Cause, Diagnosis, Estimate, Gain, Verdict
from picchio.model.effects.effect import Effect
from picchio.model.effects.registry import effect_class
from picchio.prediction.motion.log import read_logs
from picchio.robot.flexible_robot import FlexibleRobot

_SURE = 0.9999
Pair = tuple[str, str]


@dataclass(frozen=True, eq=False)
class _Search:
    """What a search has come from and through, whatever its last fit is.

    Attributes:
        system: the equations that are fitted to.
        judge_on: those of the records held out; the same where none is.
        before: the nominal model's fit.
        kinds: the catalogue.
        steps: its rounds.
        dropped: effects that lost on records held out, and by how much on each.
        gain: relative standard deviation of a drive's torque.
    """

    system: System
    judge_on: System
    before: Fit
    kinds: Mapping[str, type[Effect]]
    steps: list[Step]
    dropped: list[tuple[Effect, dict[str, float]]]
    gain: float


@one_thread()
def diagnose_motion(
    robot: FlexibleRobot,
    campaign: Campaign,
    *,
    without: Collection[str] = (),
    known: Sequence[Estimate] = (),
    train: Collection[str] = (),
    held_out: Collection[str] = (),
    given: Diagnosis | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Diagnosis:
    """What the simulation gets wrong about a moving robot, why, and the gain of knowing it.

    Predicted are the drives' torques (inverse dynamics of the measured motion) and, of joints
    with two encoders, the link side's angle less the motor side's. Effects are added one by one
    while stretches of the training records that were not fitted to gain; then those that are not
    needed are taken out; then those that lose on records held out.

    Args:
        robot: the nominal robot.
        campaign: its motion records; others are passed over.
        without: names of effects that must not be considered.
        known: causes that other records tell; the search starts from them, and takes out those
            that are not needed here.
        train: names of records to fit to; see `split`.
        held_out: names of records to judge by.
        given: of other motion records of this robot, such as those without a load: what it found
            is part of the robot here. Friction, which no two days have in common, is fitted anew.
        progress: told (step, steps).

    Returns:
        the diagnosis; `details` has the equations and states before and after, the steps of the
        search, a table of all channels, what instrumental variables would change of the numbers
        and, of joints whose elasticity was found, how it compares with what is documented.

    Raises:
        InputError: no motion record, a joint that the robot lacks, an unknown effect or record.
    """
    for name in without:
        effect_class(name)
    inside, outside = split(read_logs(robot, campaign), train, held_out)
    system = System(robot, inside)
    if not system.groups:
        raise InputError("the records hold no torque and no second encoder of a joint that moves",
                         file=campaign.folder)  # fmt: skip
    judge_on = System(robot, outside, system.cutoff) if outside else system
    kinds = motion_effects(without)
    start = baseline(system, campaign.tolerance.force)
    if given is not None:
        start = given.details["extended"].given()
    before = fit(system, start)
    informed = _informed(system, start, known)
    found, steps = select(system, informed, kinds, progress or (lambda done, total: None))
    dropped: list[tuple[Effect, dict[str, float]]] = []
    if outside:
        found, dropped = validate(system, judge_on, found, before.state)
        # What stood only beside a cause that is gone goes, too.
        found = eliminate(system, found) if dropped else found
    search = _Search(
        system, judge_on, before, kinds, steps, dropped, campaign.tolerance.torque_gain
    )
    return _conclude(search, fit(system, found.state))


def refitted(diagnosis: Diagnosis, known: Sequence[Estimate]) -> Diagnosis:
    """A diagnosis whose causes are fitted again, with what other records tell of their values."""
    search: _Search = diagnosis.details["search"]
    state = _informed(search.system, diagnosis.details["extended"], known)
    return _conclude(search, fit(search.system, state))


def _informed(system: System, state: State, known: Sequence[Estimate]) -> State:
    """With those of the causes that may act in these records."""
    evidence = evidence_of(system)
    for told in known:
        if told.effect.target in told.effect.applies(evidence):
            state = state.informed(told.effect, told.std)
    return state


def _conclude(search: _Search, found: Fit) -> Diagnosis:
    system, judge_on, before = search.system, search.judge_on, search.before
    noise = noise_levels(system)
    outer = {**noise, **noise_levels(judge_on)} if judge_on is not system else noise
    groups, shown = judged_groups(judge_on, found), evidence_of(system)
    gain = judge(judge_on, before.state, found.state, outer, groups, system)
    scorer = Scorer(system, found)
    sure = []
    for index, effect in enumerate(found.state.effects):
        score = necessity(scorer, index)
        if score is None or not passes(score, effect.periodic, there=True):
            score = borne_out(scorer, index, fit(system, found.state.without(index)))
        sure.append(min(_SURE, score.confidence) if score is not None else 0.5)
    rivals = alternatives(system, found, search.kinds)
    valued = zip(found.state.effects, sure, strict=True)
    found = honest(system, found, search.gain)
    causes = tuple(
        Cause(effect.name, effect.target, confidence, parameters(system, found, effect))
        for effect, confidence in sorted(valued, key=lambda each: each[0].periodic)
    )
    told = channels(table(judge_on, before.state, found.state, outer))
    verdict = _verdict(system, before, found, noise, gain)
    silent = [row["channel"] for row in told if row["verdict"] == "unexplained"]
    note = ""
    if verdict == "unexplained" and causes and 2 * len(silent) < len(told):
        # What one channel hides is no reason to doubt what explains the others.
        verdict, note = "partial", f"most channels are explained; not {', '.join(silent)}"
        causes = tuple(c for c in causes if _elsewhere(c, silent, told))
    # The search stopped where nothing more could be claimed: what helped a little then.
    leads = _leads(search, found.state)
    if verdict == "unexplained":
        causes = ()
    claimed = {(c.effect, c.target) for c in causes}
    unclaimed = [pair for pair in _labels(found.state) if pair not in claimed]
    leads = tuple(dict.fromkeys([*unclaimed, *leads]))
    sets = _alternatives(found.state, rivals) if causes else ()
    if verdict == "named" and sets:
        verdict = "ambiguous"
    return Diagnosis(
        verdict=verdict,
        causes=causes,
        alternatives=sets,
        leads=leads if verdict in ("partial", "unexplained") else (),
        nuisances=nuisances(system, found),
        gain=gain,
        next_measurement=next_measurement(system, found, noise, rivals)
        if verdict not in ("nothing-wrong", "named") else None,
        scores=tuple(
            {"step": number, "accepted": (row["effect"], row["target"]) in step.accepted, **row}
            for number, step in enumerate(search.steps, 1) for row in step.scores
        ),
        note=note,
        correlation=correlation(found),
        not_looked_for={n: why for n, k in search.kinds.items() if (why := k.why_not(shown))},
        extra={
            "not_recorded": not_recorded(system, judge_on),
            "channels": told if judge_on is not system else [],
            "stiffness": _stiffness(system, found, causes),
            "dropped": [
                {"effect": e.name, "target": e.target, "order": e.values.get("order"), "gain": gain}
                for e, gain in search.dropped
            ],
        },
        details=_details(search, found, outer),
    )  # fmt: skip


def not_recorded(*systems: System) -> dict[str, str]:
    """Joints without an angle -> in which records, where they stand, and whether that matters.

    Args:
        systems: all equations.

    Returns:
        {joint: sentence}; empty where every joint has an angle.
    """
    places: dict[str, dict[str, list[str]]] = {}
    needed = ", ".join(dict.fromkeys(joint for system in systems for joint in system.unposed))
    matters = f"the load of {needed} depends on it" if needed else "no load depends on it"
    for log in {log.file: log for system in systems for log in system.logs}.values():
        for joint, at in log.standing.items():
            where = f"it stands at {at:.4g} by the record's `pose`"
            if joint in log.unknown:
                where = f"taken to stand at 0 ({matters}): say where as `pose` of the record"
            places.setdefault(joint, {}).setdefault(where, []).append(log.file)
    return {
        joint: "; ".join(f"no angle in {', '.join(files)}: {at}" for at, files in found.items())
        for joint, found in places.items()
    }


def _verdict(system: System, before: Fit, found: Fit, noise: Mapping[Group, float],
             gain: Gain) -> Verdict:  # fmt: skip
    if not found.state.effects:
        quiet = _quiet(before, noise, judged_groups(system, before))
        return "nothing-wrong" if quiet else "unexplained"
    if _quiet(found, noise, judged_groups(system, found)) and (
        gain.extended_nrmse <= NOISE * gain.noise_floor_nrmse
    ):
        return "named"
    explained = gain.explained
    return "partial" if explained is not None and explained >= MOSTLY else "unexplained"


def _elsewhere(cause: Cause, silent: Collection[str], told: Sequence[Mapping[str, Any]]) -> bool:
    """Whether a cause acts in a channel that is explained; what is no joint's acts in all."""
    own = {row["channel"] for row in told if row["channel"].partition(".")[2] == cause.target}
    return not own or not own <= set(silent)


def _quiet(found: Fit, noise: Mapping[Group, float], groups: Sequence[Group]) -> bool:
    return all(found.level[g] <= NOISE * noise[g] for g in groups)


def _labels(state: State) -> list[Pair]:
    return [(e.name, e.target) for e in state.effects]


def _leads(search: _Search, state: State) -> tuple[Pair, ...]:
    claimed = set(_labels(state))
    last = next((s for s in reversed(search.steps) if s.scores), None)
    rows = last.scores if last is not None else ()
    helped = [(r["effect"], r["target"]) for r in rows if r["gain"] > 1.0 and r["admissible"]]
    every = [*((e.name, e.target) for e, _ in search.dropped), *helped]
    return tuple(dict.fromkeys(p for p in every if p not in claimed))[:8]


def _alternatives(state: State, alike: Mapping[int, Sequence[Pair]]) -> tuple[
        tuple[Pair, ...], ...]:  # fmt: skip
    labels = _labels(state)
    return tuple(
        tuple(dict.fromkeys(other if i == index else label for i, label in enumerate(labels)))
        for index, others in alike.items() for other in others
    )  # fmt: skip


def _details(search: _Search, found: Fit, noise: Mapping[Group, float]) -> dict[str, Any]:
    system, judge_on, before = search.system, search.judge_on, search.before
    inner = {**noise, **{g: noise.get(g, 1.0) for g in system.groups}}
    return {
        "steps": [vars(step) for step in search.steps],
        "train": table(system, before.state, found.state, inner),
        "held_out": table(judge_on, before.state, found.state, noise),
        "instruments": instrument_shifts(system, found),
        "systems": {"train": system, "held_out": judge_on},
        "search": search,
        "baseline": before.state,
        "extended": found.state,
    }


def _stiffness(system: System, found: Fit, causes: tuple[Cause, ...]) -> dict[str, Any]:
    """Joint -> stiffness found, documented, and what it would be with delays not accounted for."""
    springs = [c for c in causes if "stiffness" in c.parameters]
    if not springs:
        return {}
    late = [i for i, e in enumerate(found.state.effects) if e.late]
    other = found.state
    for i in reversed(late):
        other = other.without(i)
    without = fit(system, other) if late else found
    scale = {e.target: e.values["scale"] for e in without.state.effects
             if "scale" in e.inverse}  # fmt: skip
    documented = dict(zip(system.robot.flexible_names, system.robot.stiffness, strict=True))
    return {
        c.target: {
            "found": float(c.parameters["stiffness"].value),
            "documented": float(documented[c.target]),
            "ratio": c.parameters["scale"].value,
            "ratio_without_delay": scale[c.target],
        }
        for c in springs
    }
