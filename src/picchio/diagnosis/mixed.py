"""Percussion and motion records of one robot: one set of causes, one verdict.

Each kind has a search of its own: blows are judged by what sensors read of the vibration, motions
by what drives and encoders read. What the two share are the causes that change the robot itself
(a payload, a joint's stiffness, play, inertia or friction):

- The motion records are searched first; percussion starts from what they claim, as far as it
  helps there, too, and the motion records are searched again where percussion finds more.
- A cause that both kinds show has one value: each kind's fit takes the other's value and spread
  into account as a Gaussian prior, so that whatever hangs together with the cause follows. That
  is the joint least-squares fit, as far as the other kind's chi-square is quadratic about its
  best value. Noise levels, nuisances and all other causes are each kind's own.
- A cause that one kind shows and the other cannot see stands by the first alone.
- Values that disagree, or a cause that the other kind's records rule out, are a contradiction:
  then nothing is claimed, and the note says what contradicts what.

A motor that is locked while the tool hits hides its rotor's inertia and the friction on its
side of the gear from percussion records: a motion may show more of these than blows do.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import chain
from typing import Any, Literal

from picchio.campaign.campaign import Campaign
from picchio.diagnosis.motion.conclude.during_blows import MotionLife, effects_during_blows
from picchio.diagnosis.motion.conclude.values import parameters
from picchio.diagnosis.motion.data.system import System
from picchio.diagnosis.motion.diagnosis import diagnose_motion, refitted
from picchio.diagnosis.motion.fit.least_squares import Fit as MotionFit
from picchio.diagnosis.motion.fit.least_squares import fit as fit_motion
from picchio.diagnosis.motion.fit.least_squares import len_of
from picchio.diagnosis.motion.fit.state import State
from picchio.diagnosis.motion.search.candidates import evidence_of
from picchio.diagnosis.percussion.conclude.causes import fitted_nuisances, fitted_values
from picchio.diagnosis.percussion.diagnosis import PercussionDiagnosis, diagnose_percussion
from picchio.diagnosis.percussion.fit.drawn import refit
from picchio.diagnosis.percussion.fit.parallel import parallel_records
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.result import (
    MOSTLY,
    VERDICTS,
    Cause,
    Diagnosis,
    Estimate,
    Gain,
    Pairs,
    Value,
    Verdict,
)
from picchio.model.effects.effect import Effect
from picchio.robot.flexible_robot import FlexibleRobot

# Values that are nearer than so many standard deviations of their difference agree, and so do
# those that are nearer than this share: nominal masses and drive constants are no better known.
_SURE = 3.0
_SYSTEMATIC = 0.05
# Rise of chi-square by which records rule a cause out: three standard deviations.
_RULED_OUT = _SURE**2
_TOGETHER = "the life above takes the causes of both kinds of records into account"

Status = Literal["both", "percussion", "motion", "drive", "contradiction"]
Values = Mapping[str, Value]


@dataclass(frozen=True)
class Comparison:
    """What both kinds of records say of a cause that both could show.

    Attributes:
        effect: its name.
        target: where.
        status: "both" agree; one alone shows it, and the other cannot see it; "drive": the motion
            shows more, on the motor's side of the gear; "contradiction".
        percussion: its values by percussion records alone; None where they do not show it.
        motion: by motion records alone.
        why: of a contradiction, a sentence.
    """

    effect: str
    target: str
    status: Status
    percussion: Values | None
    motion: Values | None
    why: str = ""

    @property
    def label(self) -> str:
        """Effect and target."""
        return f"{self.effect}:{self.target}"

    def to_dict(self) -> dict[str, Any]:
        """As in JSON."""
        found = asdict(self)
        del found["why"]
        return found


def diagnose_mixed(
    robot: FlexibleRobot,
    campaign: Campaign,
    *,
    without: Collection[str] = (),
    gravity_stiffness: bool = True,
    workers: int | None = None,
    train: Collection[str] = (),
    held_out: Collection[str] = (),
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """What the simulation gets wrong about percussion and motion records of one robot.

    Args:
        robot: as its files have it.
        campaign: records of both kinds.
        without: names of effects that must not be considered.
        gravity_stiffness: whether gravity's change with the deflection counts in percussion.
        workers: processes for the percussion records; as many as cores where None.
        train: names of motion records to fit to.
        held_out: names of motion records to judge by.
        progress: told what is being done.

    Returns:
        the diagnosis; `details` has each kind's own, "percussion" and "motion", with the shared
        causes at their common values.

    Raises:
        InputError: as `diagnose_percussion` and `diagnose_motion`.
    """
    say = progress or (lambda text: None)

    def searched(known: Sequence[Estimate] = ()) -> Diagnosis:
        return diagnose_motion(
            robot, campaign, without=without, known=known, train=train, held_out=held_out,
            progress=lambda done, total: say(f"motion records: {done} of {total}"),
        )  # fmt: skip

    motion = searched()
    percussion = diagnose_percussion(
        robot, campaign, without=without, known=list(_motion_estimates(motion).values()),
        gravity_stiffness=gravity_stiffness, workers=workers, progress=say,
    )  # fmt: skip
    with parallel_records(percussion.problem):
        more = _helps_motion(percussion, motion)
        if more:
            motion = searched(more)
        say("comparing what both kinds of records say")
        percussion, comparisons = _compared(percussion, motion)
        if not any(c.status == "contradiction" for c in comparisons):
            percussion, motion = _joined(percussion, motion, comparisons)
    return _concluded(percussion, motion, comparisons)


def _shared(kind: type[Effect]) -> bool:
    """Whether an effect acts on a robot that is hit and on one that moves."""
    return kind.motion is not Effect.motion and kind.structure is not Effect.structure


# Each kind's own values of what it claims -----------------------------------------------------


def _motion_estimates(motion: Diagnosis) -> dict[str, Estimate]:
    """Label -> a shared cause that the motion records claim, by these records alone."""
    if not motion.causes:
        return {}
    system: System = motion.details["systems"]["train"]
    state: State = motion.details["extended"]
    alone = fit_motion(system, replace(state, priors=()))
    return _estimates(
        (effect, parameters(system, alone, effect))
        for effect in alone.state.effects
        if _shared(type(effect))
    )


def _percussion_estimates(percussion: PercussionDiagnosis) -> dict[str, Estimate]:
    """Label -> a shared cause that the percussion records claim, by these records alone."""
    problem, hypothesis = percussion.problem, percussion.extended.hypothesis
    claimed = hypothesis.causes if percussion.diagnosis.causes else ()
    if not any(_shared(type(effect)) for effect in claimed):
        return {}
    alone = refit(problem, replace(hypothesis, priors=()), problem.records)
    return _estimates(
        (effect, fitted_values(problem, alone, effect))
        for effect in alone.hypothesis.causes
        if _shared(type(effect))
    )


def _estimates(valued: Iterable[tuple[Effect, Values]]) -> dict[str, Estimate]:
    """Label -> estimate, with the spreads of the parameters that were fitted."""
    found = {}
    for effect, values in valued:
        std = {n: v.std for n, v in values.items() if n in effect.values and v.std > 0.0}
        found[effect.label] = Estimate(effect, std, values)
    return found


# What one kind's records say of a cause that the other shows -------------------------------------


def _motion_gain(motion: Diagnosis, cause: Estimate) -> float:
    """Fall of chi-square in the motion records by a cause at what percussion tells of it."""
    system: System = motion.details["systems"]["train"]
    state: State = motion.details["extended"]
    if cause.effect.target not in cause.effect.applies(evidence_of(system)):
        return 0.0
    without = fit_motion(system, state)
    there = fit_motion(system, state.informed(cause.effect, cause.std))
    return _fall(system, without, there)


def _fall(system: System, before: MotionFit, after: MotionFit) -> float:
    """Of chi-square, residuals being correlated in time."""
    return 2.0 * sum(
        len_of(system, g) / before.correlation[g] * math.log(before.level[g] / after.level[g])
        for g in system.groups
        if before.level[g] > 0.0 and after.level[g] > 0.0
    )


def _helps_motion(percussion: PercussionDiagnosis, motion: Diagnosis) -> list[Estimate]:
    """Causes that percussion claims and the motion search lacks, though they help there.

    So does what motion records cannot tell from a cause of theirs: it may stand in its place.
    """
    claimed = {f"{c.effect}:{c.target}" for c in motion.causes}
    equivalent = {f"{name}:{target}" for each in motion.alternatives for name, target in each}
    return [
        cause
        for label, cause in _percussion_estimates(percussion).items()
        if label not in claimed
        and (label in equivalent or _motion_gain(motion, cause) > _RULED_OUT)
    ]


def _compared(
    percussion: PercussionDiagnosis, motion: Diagnosis
) -> tuple[PercussionDiagnosis, list[Comparison]]:
    """Comparisons with the first of percussion's equivalent sets that no motion contradicts."""
    candidates = chain([percussion], _with_alternatives(percussion))
    every = ((candidate, _comparisons(candidate, motion)) for candidate in candidates)
    first = next(every)
    agreeing = (
        found
        for found in chain([first], every)
        if not any(c.status == "contradiction" for c in found[1])
    )
    return next(agreeing, first)


def _with_alternatives(percussion: PercussionDiagnosis) -> Iterator[PercussionDiagnosis]:
    """The diagnosis with each of the alternative sets in place of the one that is claimed."""
    problem, said = percussion.problem, percussion.diagnosis
    mine = tuple((c.effect, c.target) for c in said.causes)
    for hypothesis, pairs in zip(percussion.others, said.alternatives, strict=True):
        whole = refit(problem, hypothesis, problem.records)
        sure = min(c.confidence for c in said.causes)
        tolerated = problem.campaign.tolerance.model_dump()
        causes = tuple(
            Cause(e.name, e.target, sure, fitted_values(problem, whole, e), e.tolerances(tolerated))
            for e in whole.hypothesis.causes
        )
        others = (
            percussion.extended.hypothesis,
            *(h for h in percussion.others if h != hypothesis),
        )
        sets = (mine, *(p for p in said.alternatives if p != pairs))
        yield percussion.with_fit(
            whole, others=others, diagnosis=replace(said, causes=causes, alternatives=sets)
        )


def _comparisons(percussion: PercussionDiagnosis, motion: Diagnosis) -> list[Comparison]:
    """What both kinds say of every cause that both could show and one claims."""
    blows, moves = _percussion_estimates(percussion), _motion_estimates(motion)
    beyond = {e.label for e in effects_during_blows(motion).effects}
    found = []
    for label in dict.fromkeys([*blows, *moves]):
        own, other = blows.get(label), moves.get(label)
        status: Status = "both"
        why = ""
        if own is not None and other is not None:
            status, why = _agreement(own, other, label in beyond)
        elif own is not None:
            status = "percussion"
            if _motion_gain(motion, own) < -_RULED_OUT:
                status, why = "contradiction", _ruled_out("percussion", "motion")
        elif other is not None:
            gain = _percussion_gain(percussion, other)
            status = "motion" if label in beyond else "drive"
            if gain < -_RULED_OUT and label in beyond:
                status, why = "contradiction", _ruled_out("motion", "percussion")
        name, _, target = label.partition(":")
        found.append(Comparison(
            name, target, status, own.values if own else None, other.values if other else None, why
        ))  # fmt: skip
    return found


def _ruled_out(by: str, others: str) -> str:
    return f"the {by} records show it, the {others} records rule it out"


def _percussion_gain(percussion: PercussionDiagnosis, cause: Estimate) -> float:
    """Fall of chi-square in the percussion records by a cause at what motion tells of it."""
    if cause.effect.label not in percussion.search.considered:
        return 0.0
    problem, whole = percussion.problem, percussion.extended
    informed = whole.hypothesis.informed(cause.effect, cause.std)
    return whole.cost - refit(problem, informed, problem.records).cost


def _agreement(own: Estimate, other: Estimate, beyond: bool) -> tuple[Status, str]:
    """Whether two kinds' values of one cause are one value."""
    for name in own.std.keys() & other.std.keys():
        a, b = own.values[name], other.values[name]
        apart = abs(a.value - b.value)
        allowed = max(_SURE * math.hypot(a.std, b.std),
                      _SYSTEMATIC * max(abs(a.value), abs(b.value)))  # fmt: skip
        if apart <= allowed:
            continue
        if not beyond and abs(b.value) > abs(a.value):
            return "drive", ""
        unit = "" if a.unit == "1" else f" {a.unit}"
        return "contradiction", (
            f"its {name} is {a.value:.4g} +- {a.std:.2g}{unit} by the percussion records, "
            f"{b.value:.4g} +- {b.std:.2g}{unit} by the motion records"
        )
    return "both", ""


# One value of what both show -----------------------------------------------------------------


def _joined(
    percussion: PercussionDiagnosis, motion: Diagnosis, comparisons: Sequence[Comparison]
) -> tuple[PercussionDiagnosis, Diagnosis]:
    """Both kinds' fits, each with what the other tells of the causes that they share."""
    both = {c.label for c in comparisons if c.status == "both"}
    carried = {c.label for c in comparisons if c.status == "motion"}
    moves, blows = _motion_estimates(motion), _percussion_estimates(percussion)
    problem, said = percussion.problem, percussion.diagnosis
    start = percussion.extended if said.verdict != "unexplained" else percussion.baseline
    told = [moves[label] for label in sorted((both | carried) & percussion.search.considered)]
    hypothesis = _informed(replace(start.hypothesis, priors=()), told)
    if hypothesis.priors:
        whole = refit(problem, hypothesis, problem.records)
        effects = {e.label: e for e in whole.hypothesis.causes}

        def valued(cause: Cause) -> Cause:
            label = f"{cause.effect}:{cause.target}"
            if effects[label].latent is not None:
                return cause  # its numbers are each record's own
            values = fitted_values(problem, whole, effects[label])
            return replace(cause, parameters=_widened(values, blows.get(label), moves.get(label)))

        known = [moves[label] for label in sorted(both | carried)]
        percussion = percussion.with_fit(
            whole,
            others=tuple(_informed(other, known) for other in percussion.others),
            diagnosis=replace(
                said,
                causes=tuple(valued(cause) for cause in said.causes),
                nuisances=fitted_nuisances(whole),
            ),
        )
    if both:
        motion = refitted(motion, [blows[label] for label in sorted(both)])
    return percussion, motion


def _informed(hypothesis: Hypothesis, known: Sequence[Estimate]) -> Hypothesis:
    for cause in known:
        hypothesis = hypothesis.informed(cause.effect, cause.std)
    return hypothesis


def _widened(values: Values, own: Estimate | None, other: Estimate | None) -> dict[str, Value]:
    """Spreads as wide as two kinds' values scatter (Birge, Phys. Rev. 40 (1932) 207)."""
    found = dict(values)
    if own is None or other is None:
        return found
    for name in own.std.keys() & other.std.keys():
        apart = abs(own.values[name].value - other.values[name].value)
        ratio = apart / math.hypot(own.std[name], other.std[name])
        found[name] = replace(found[name], std=found[name].std * max(1.0, ratio))
    return found


# One answer ------------------------------------------------------------------------------------


def _concluded(
    percussion: PercussionDiagnosis, motion: Diagnosis, comparisons: Sequence[Comparison]
) -> Diagnosis:
    blows = percussion.diagnosis
    both = {c.label for c in comparisons if c.status == "both"}
    contradictions = [c for c in comparisons if c.status == "contradiction"]
    causes = _together(blows.causes, motion.causes)
    labels = tuple((c.effect, c.target) for c in causes)
    blows_sets = _holding(blows.alternatives, both)
    motion_sets = _holding(motion.alternatives, both)
    verdicts: dict[str, Verdict] = {
        "percussion": _narrowed(blows, blows_sets), "motion": _narrowed(motion, motion_sets),
    }  # fmt: skip
    gain = None
    if blows.gain is not None and motion.gain is not None:
        gain = blows.gain.plus(motion.gain)
    verdict = joint_verdict(verdicts, gain, bool(causes), bool(contradictions))
    claimed = verdict in ("named", "ambiguous", "partial")
    sets = [_beside(s, labels, blows.causes) for s in blows_sets]
    sets += [_beside(s, labels, motion.causes) for s in motion_sets]
    leads = tuple(dict.fromkeys([*(() if claimed else labels), *blows.leads, *motion.leads]))
    asked = verdict not in ("nothing-wrong", "named")
    return Diagnosis(
        verdict=verdict,
        causes=causes if claimed else (),
        alternatives=tuple(dict.fromkeys(sets)) if claimed else (),
        leads=leads if verdict in ("partial", "unexplained") else (),
        nuisances={**blows.nuisances, **motion.nuisances},
        gain=gain,
        next_measurement=(blows.next_measurement or motion.next_measurement) if asked else None,
        scores=(*({"records": "percussion", **row} for row in blows.scores),
                *({"records": "motion", **row} for row in motion.scores)),
        note=_note(verdicts, verdict, contradictions, blows.note),
        kinds={
            kind: {"verdict": verdicts[kind], "gain": found.gain.to_dict() if found.gain else None}
            for kind, found in (("percussion", blows), ("motion", motion))
        },
        shared=tuple(c.to_dict() for c in comparisons),
        extra=dict(motion.extra),
        details={
            "percussion": percussion, "motion": motion, "motion_life": MotionLife(None, _TOGETHER),
            "during_blows": effects_during_blows(motion),
        },
    )  # fmt: skip


def joint_verdict(
    verdicts: Mapping[str, Verdict], gain: Gain | None, causes: bool, contradicted: bool
) -> Verdict:
    """The verdict of both kinds of records together.

    The less certain of the two, in the order nothing-wrong, named, ambiguous, partial,
    unexplained. Where one kind is unexplained and causes are claimed in the other, it is `partial`
    if these explain most of the held-out excess of all records together. A contradiction, or a
    cause that is claimed while the records of its kind are not explained, is `unexplained`.

    Args:
        verdicts: of each kind.
        gain: of all records together.
        causes: whether any cause is claimed in either kind.
        contradicted: whether the kinds contradict each other.
    """
    worst = max(verdicts.values(), key=list(VERDICTS).index)
    if contradicted:
        return "unexplained"
    if worst == "unexplained" and causes:
        explained = None if gain is None else gain.explained
        return "partial" if explained is not None and explained >= MOSTLY else "unexplained"
    return worst


def _narrowed(found: Diagnosis, sets: Sequence[Pairs]) -> Verdict:
    """A kind's verdict when the other has left these of its alternatives."""
    return "named" if found.verdict == "ambiguous" and not sets else found.verdict


def _holding(sets: Sequence[Pairs], both: set[str]) -> list[Pairs]:
    """Those sets that hold the causes which both kinds show."""
    return [s for s in sets if both <= {f"{effect}:{target}" for effect, target in s}]


def _beside(pairs: Pairs, labels: Pairs, replaced: Sequence[Cause]) -> Pairs:
    """A kind's alternative set with the causes that only the other kind has."""
    gone = {(c.effect, c.target) for c in replaced}
    return tuple(dict.fromkeys([*pairs, *(p for p in labels if p not in gone)]))


def _together(blows: Sequence[Cause], moves: Sequence[Cause]) -> tuple[Cause, ...]:
    """Each cause once: percussion's values, which hold the motion's where both show it."""
    pairs = [(c.effect, c.target) for c in moves]
    known = {pair: c for pair, c in zip(pairs, moves, strict=True) if pairs.count(pair) == 1}
    found = []
    for cause in blows:
        other = known.get((cause.effect, cause.target))
        sure = cause.confidence if other is None else max(cause.confidence, other.confidence)
        derived = {} if other is None else other.parameters
        # What follows from the values, such as a stiffness in N m/rad, follows from these.
        scale = _ratio(cause, other)
        extra = {n: Value(v.value * scale, v.std * scale, v.unit) for n, v in derived.items()
                 if n not in cause.parameters}  # fmt: skip
        found.append(replace(cause, confidence=sure, parameters={**cause.parameters, **extra}))
    mine = {(c.effect, c.target) for c in blows}
    return (*found, *(c for c in moves if (c.effect, c.target) not in mine))


def _ratio(cause: Cause, other: Cause | None) -> float:
    if other is None or "scale" not in cause.parameters or "scale" not in other.parameters:
        return 1.0
    return cause.parameters["scale"].value / other.parameters["scale"].value


def _note(
    verdicts: Mapping[str, Verdict],
    verdict: Verdict,
    contradictions: Sequence[Comparison],
    own: str,
) -> str:
    if contradictions:
        said = "; ".join(
            f"{c.effect.replace('_', ' ')} of {c.target}: {c.why}" for c in contradictions
        )
        return f"percussion and motion records contradict each other: {said}"
    if len(set(verdicts.values())) > 1 and verdict in ("partial", "unexplained"):
        return "; ".join(f"the {kind} records are {said}" for kind, said in verdicts.items())
    return own if verdict == "unexplained" else ""
