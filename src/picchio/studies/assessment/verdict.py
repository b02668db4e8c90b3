"""What an assessment comes to: safe, limited, fails or cannot be told; by what, and how surely.

This is the one place that judges. Terminal, JSON, report, scene and notebook show what stands here.

The order of the statuses is that of the harm of a wrong promise. A part beyond its limit `fails`
(the shaft at its yield strength, the reducer at a limit of its catalogue, a shaft that breaks in
its first rivet). Otherwise, inputs that contradict each other, a joint of which no part is known,
or a limit that is kept only at exactly the stated rate of the blows, mean that it `cannot-be-told`.
Otherwise a shaft with a finite life makes it `limited`, and only then it is `safe`.

Where a value of the robot has a spread, a part is judged by what 90 % of the drawn cases bear: a
shaft by the P10 of its life, a limit by the P10 of its margin. A limit that the stated values keep
and more than 10 % of the cases exceed means that it `cannot-be-told`. What stands on picchio's own
estimate of the drives is never promised: it is "probably safe", and `--strict` does not pass it.

The margin is allowable over actual of the governing part, so below 1 it fails. A finite life has
none: its stress is above the endurance limit and that is no failure. It is held against a wanted
life instead (`picchio.allowable`), which gives the factor by which the force may grow.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from picchio.core import spoken
from picchio.robot.joint import is_drive

if TYPE_CHECKING:
    from picchio.studies.assessment.result import Assessment, JointLife, OperationResult

Status = Literal["safe", "limited", "fails", "cannot-be-told"]
Governor = Literal["shaft", "reducer", "yield", "resonance", "input"]

# A shaft that disagrees with its joint's stiffness by more than this is told; a softer one cannot
# be.
SHAFT_TOLERANCE = 0.05
# A peak that grows by more than this when the blows come 5 % faster or slower is a resonance's.
RATE_STEP = 0.05
MUCH_GROWTH = 1.25


@dataclass(frozen=True)
class NotAssessed:
    """What a verdict does not cover.

    Attributes:
        joint: its name.
        part: "shaft", "reducer", "yield"; "joint" where it was left rigid; "effort limit" where
            the URDF's was not believed.
        why: in words.
    """

    joint: str
    part: str
    why: str


@dataclass(frozen=True)
class Verdict:
    """The result of an assessment in a few words.

    Attributes:
        status: "safe" (no part of a flexible joint reaches its limit, and every life is unlimited),
            "limited" (a finite life), "fails" (a limit is exceeded) or "cannot-be-told".
        governed_by: shaft (fatigue), reducer (a limit of its catalogue), yield (the shaft's static
            strength), resonance or input.
        joint: that governs.
        margin: allowable over actual of the governing part, at the stated values; below 1 it fails;
            NaN where there is none: of a finite life, and where nothing can be told.
        margin_interval: its P10 and P90 where a value of the robot has a spread; None otherwise.
        reasons: everything that lowers trust, a sentence each.
        operation: where the governing part fares worst.
        pose: index of the pose there, from 0.
        limit: that the governing part is nearest to, in words.
        headline: the verdict as sentences.
        estimated: it rests on what drives like these probably bear, which nobody measured.
        covers: the parts that were looked at in every joint: "shaft", "reducer" (or what stands
            in for it, the drive as a whole).
        not_assessed: every part and joint that was not looked at.
    """

    status: Status
    governed_by: Governor
    joint: str
    margin: float
    reasons: tuple[str, ...]
    operation: str
    pose: int
    limit: str
    headline: str
    margin_interval: tuple[float, float] | None = None
    estimated: bool = False
    covers: tuple[str, ...] = ()
    not_assessed: tuple[NotAssessed, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """As plain values; the pose counted from 1, as text and tables do."""
        return vars(self) | {"pose": self.pose + 1}

    @property
    def promised(self) -> bool:
        """Whether it is safe by values that somebody stands for."""
        return self.status == "safe" and not self.estimated


class _Part(NamedTuple):
    """What may fail in a joint, how near that is, and where."""

    governor: Governor
    joint: JointLife
    margin: float
    limit: str
    operation: str
    pose: int
    share: tuple[float, float] | None  # P10 and P90 of actual over allowable

    @property
    def interval(self) -> tuple[float, float] | None:
        """Of the margin."""
        return self.share and (_inverse(self.share[1]), _inverse(self.share[0]))

    @property
    def sure_margin(self) -> float:
        """That 90 % of the cases exceed."""
        return self.margin if self.interval is None else min(self.margin, self.interval[0])

    @property
    def name(self) -> str:
        what = self.joint.drive if self.governor == "reducer" else "shaft"
        return f"{what} of {self.joint.name}"

    @property
    def fatigue(self) -> bool:
        """Whether its limit is that of many cycles."""
        return self.limit == _ALLOWABLE

    @property
    def over(self) -> bool:
        """Whether it is beyond its limit; where that is an estimate, in 90 % of the cases."""
        guess = self.governor == "reducer" and not self.joint.reducer
        surely = self.interval[1] if guess and self.interval else self.margin
        return max(surely, self.margin) < 1.0

    @property
    def used(self) -> str:
        share = spoken.likely(self.share) if self.share else spoken.per_cent(1.0 / self.margin)
        return f"{share} % of its {self.limit}"

    @property
    def margin_at_other_rates(self) -> float:
        """With the blows 5 % faster or slower, where that makes the peak much higher."""
        joint, growth = self.joint, self.joint.rate_sensitivity
        if not growth > MUCH_GROWTH:
            return self.margin
        share = {  # of the vibration in the load; gravity does not grow
            "shaft": 1.0,
            "yield": joint.peak_shear_stress / joint.peak_total_stress,
            "reducer": joint.peak_torque / (joint.peak_torque + joint.gravity_torque),
        }[self.governor if not self.fatigue else "shaft"]
        return self.margin / (1.0 + (growth - 1.0) * min(share, 1.0))


def judge(found: Assessment) -> Verdict:
    """The verdict of an assessment.

    Args:
        found: its joints and operations, and what its run found to doubt.

    Returns:
        the verdict; its reasons name every other part that fails or wears, what was not assessed,
        every doubt and every warning.
    """
    parts = [part for k, j in enumerate(found.joints) for part in _parts(k, j, found.operations)]
    worst = sorted(parts, key=lambda part: part.sure_margin)
    over = sorted((p for p in parts if p.over), key=lambda part: part.margin)
    unsure = [part for part in worst if part.sure_margin < 1.0 and not part.over]
    wearing = sorted((p for p in parts if _wears(p)), key=lambda part: part.joint.sure_life)
    contrary = [p for p in parts if p.joint.shaft_ratio < 1.0 - SHAFT_TOLERANCE]
    contrary.sort(key=lambda part: part.joint.shaft_ratio)
    told = {part.joint.name for part in parts}
    unknown = [j for j in found.joints if is_drive(j.name) and j.name not in told]
    unknown.sort(key=lambda joint: -joint.peak_deflection)
    guess = bool(found.notice)
    out = [one for one in found.left_out if one.moves_tool]
    gaps = tuple(_gaps(found))
    covers = tuple(part for part in _PARTS if found.joints and not _lacking(gaps, part))
    near = [part for part in worst if part.margin_at_other_rates < 1.0]
    wrong = found.impossible
    risk_first = bool(unsure) and not (wrong or over or contrary or unknown or out)
    reasons = [*wrong, *map(_failure, over[not wrong :]), *_risks(unsure[risk_first:])]
    # What an estimated drive survives is an interval in the table, and there are many of them.
    reasons += [_wear(part) for part in wearing if not part.joint.estimated_drive]
    reasons += _told_gaps(gaps, [joint.name for joint in found.joints])
    reasons += found.reducer_warnings
    reasons += found.doubts
    reasons += found.warnings

    def made(status: Status, text: str, governor: Governor, joint: JointLife, part: _Part | None,
             margin: float = math.nan) -> Verdict:  # fmt: skip
        operation, pose = (part.operation, part.pose) if part else (
            joint.worst_operation, joint.worst_pose)  # fmt: skip
        told = tuple(dict.fromkeys(line for line in reasons if line not in text))
        word = "Probably safe" if guess and status == "safe" else _SAID[status]
        if status in ("safe", "limited"):
            text = f"{_covered(found, gaps, wearing)}. {text}"
        headline = f"{word}. {text}" + "." * (text[-1] not in ".?")
        limit = part.limit if part else ""
        # Only of a part that is judged by its margin.
        ends = part.interval if part and not math.isnan(margin) else None
        return Verdict(status, governor, joint.name, margin, told, operation, pose, limit, headline,
                       ends, guess, covers, gaps)  # fmt: skip

    if wrong:
        joint = worst[0].joint if worst else found.joints[0]
        return made("cannot-be-told", f"The URDF cannot be right: {wrong[0]}", "input", joint, None)
    if over:
        part = over[0]
        return made("fails", _failure(part), part.governor, part.joint, part, part.margin)
    if contrary:
        part = contrary[0]
        text = f"{part.joint.name}: the shaft, by G Jp / l, {softer(part.joint.shaft_ratio)}"
        return made("cannot-be-told", text, "input", part.joint, part)
    if out:
        names = f"{', '.join(one.joint for one in out)} {'was' if len(out) == 1 else 'were'}"
        of_rest = _of_the_rest([*wearing, *worst])
        return made("cannot-be-told", f"{names} left out, though the blows load it all; {of_rest}",
                    "input", worst[0].joint if worst else found.joints[0], None)  # fmt: skip
    if unknown:
        text = _unknown(unknown, [*wearing, *worst], whole=len(unknown) == len(found.joints))
        return made("cannot-be-told", text, "input", unknown[0], None)
    if unsure:
        part = unsure[0]
        text = _risk(part)
        return made("cannot-be-told", text, part.governor, part.joint, part, part.margin)
    if near:
        part = near[0]
        text = (
            f"The {part.name} is beyond its {part.limit} as soon as the blows come "
            f"{100 * RATE_STEP:g} % faster or slower: at a resonance its peak grows "
            f"{part.joint.rate_sensitivity:.3g} times"
        )
        return made("cannot-be-told", text, "resonance", part.joint, part)
    if wearing:
        part = wearing[0]
        return made("limited", _life(part), part.governor, part.joint, part)
    part = worst[0]
    return made("safe", _closest(worst), part.governor, part.joint, part, part.margin)


_ALLOWABLE = "allowable"
_SAID: dict[Status, str] = {
    "safe": "Safe", "limited": "Limited", "fails": "Fails", "cannot-be-told": "Cannot be told",
}  # fmt: skip


def softer(ratio: float) -> str:
    """What is wrong with a shaft that is softer than its joint, in words.

    Args:
        ratio: its own stiffness over the joint's, below 1.
    """
    return (
        f"is {1.0 / ratio:.3g} times softer than the joint it is a part of, which cannot be: "
        "radius, length or stiffness is wrong"
    )


def _parts(k: int, joint: JointLife, operations: tuple[OperationResult, ...]) -> Iterator[_Part]:
    """The parts of the joint in column k that were assessed."""

    def largest(column: str) -> tuple[str, int]:
        tops = [np.nan_to_num(getattr(op, column)[:, k], nan=-1.0) for op in operations]
        best = int(np.argmax([top.max() for top in tops]))
        return operations[best].name, int(tops[best].argmax())

    if joint.sn_curve and math.isfinite(joint.utilisation):
        # A finite life has no margin, unless it ends in its first rivet.
        margin = min(_inverse(joint.utilisation), math.inf)
        if math.isfinite(joint.sure_life):
            margin = joint.life if joint.life < 1.0 else math.inf
        place = joint.worst_operation, joint.worst_pose
        share = joint.intervals.get("utilisation") if math.isfinite(margin) else None
        governor: Governor = "shaft" if joint.worn == "shaft" else "reducer"
        yield _Part(governor, joint, margin, _ALLOWABLE, *place, share)
    if math.isfinite(joint.yield_utilisation):
        place = largest("peak_total_stress")
        share = joint.intervals.get("yield_utilisation")
        margin = _inverse(joint.yield_utilisation)
        yield _Part("yield", joint, margin, "yield strength", *place, share)
    if joint.drive and math.isfinite(joint.reducer_utilisation):
        limit, place = joint.reducer_governed_by, largest("reducer_utilisation")
        share = joint.intervals.get("reducer_utilisation")
        yield _Part("reducer", joint, _inverse(joint.reducer_utilisation), limit, *place, share)


def _inverse(used: float) -> float:
    return 1.0 / used if used > 0.0 else math.inf


def _wears(part: _Part) -> bool:
    return part.fatigue and part.joint.life >= 1.0 and part.joint.sure_life < math.inf


def _failure(part: _Part) -> str:
    joint = part.joint
    if part.fatigue:
        return f"The {part.name} breaks in its first rivet"
    some = f" (80 % of the drawn cases are at {part.used})" if " to " in part.used else ""
    if part.governor == "yield":
        stress = joint.peak_total_stress / 1e6
        return (
            f"Gravity and blows take the shaft of {joint.name} to {stress:.4g} MPa in shear, and "
            f"it yields at {stress * part.margin:.4g} MPa{some}: no fatigue life holds there"
        )
    return (
        f"Gravity and blows take the {part.name} to {1.0 / part.margin:.3g} times its "
        f"{part.limit}{some}: no life can be promised there"
    )


def _risk(part: _Part) -> str:
    keeps = "stays within" if part.margin >= 1.0 else "exceeds"
    values = "the most likely values" if part.joint.estimated else "the stated values"
    return (
        f"At {values} the {part.name} {keeps} its {part.limit}, but these are uncertain: it is at "
        f"{part.used} in 80 % of the cases, and above that in 10 %"
    )


def _risks(parts: list[_Part]) -> Iterator[str]:
    """The risks of several parts, one sentence where they share a limit."""
    by_limit: dict[tuple[Governor, str], list[_Part]] = {}
    for part in parts:
        by_limit.setdefault((part.governor, part.limit), []).append(part)
    for (_, limit), those in by_limit.items():
        if len(those) == 1:
            yield _risk(those[0])
            continue
        told = ", ".join(f"{part.name} ({part.used.partition(' % ')[0]} %)" for part in those)
        yield f"10 % of the cases or more are beyond the {limit} of {told}"


def _life(part: _Part) -> str:
    return f"The robot survives {part.joint.told_life} rivets; {part.joint.name} fails first"


def _wear(part: _Part) -> str:
    return f"the {part.name} survives {part.joint.told_life} rivets"


def _closest(worst: list[_Part]) -> str:
    first = worst[0]
    text = f"The {first.name} comes closest to a limit, at {first.used}"
    fatigue = next((part for part in worst if part.fatigue), first)
    if fatigue is first:
        return text
    who = "it" if fatigue.name == first.name else f"the {fatigue.name}"
    return f"{text}; in fatigue {who} is at {fatigue.used}"


def _unknown(unknown: list[JointLife], known: list[_Part], *, whole: bool) -> str:
    if whole:
        return (
            "No joint has a shaft or a reducer, so no life can be given; state them in the sidecar"
        )
    names = ", ".join(joint.name for joint in unknown)
    return f"Neither a shaft nor a reducer is given for {names}; {_of_the_rest(known)}"


def _of_the_rest(known: list[_Part]) -> str:
    """How the parts fare that were looked at, the worst of them first."""
    if not known:
        return "of the other joints no shaft and no reducer is known"
    first = known[0]
    rest = _wear(first) if _wears(first) else f"the {first.name} is at {first.used}"
    return f"of the others {rest}"


_PARTS = ("shaft", "reducer")


def _gaps(found: Assessment) -> Iterator[NotAssessed]:
    """What was not looked at."""
    for joint in found.joints:
        if not is_drive(joint.name):
            continue
        if joint.worn != "shaft":
            yield NotAssessed(joint.name, "shaft", "none given")
        elif math.isnan(joint.yield_utilisation):
            why = "its S-N curve gives no static strength, or its vibration does not end"
            yield NotAssessed(joint.name, "yield", why)
        if not joint.drive:
            yield NotAssessed(joint.name, "reducer", "none given")
        elif math.isnan(joint.reducer_utilisation):
            yield NotAssessed(joint.name, "reducer", "its vibration from rest does not end")
    for out in found.left_out:
        yield NotAssessed(out.joint, "joint", f"left rigid: it {out.why}")
    for name, why in found.refused.items():
        yield NotAssessed(name, "effort limit", f"not believed: {why}")


def _lacking(gaps: tuple[NotAssessed, ...], part: str) -> list[str]:
    """The joints of which a part was not looked at."""
    return [gap.joint for gap in gaps if gap.part == part]


def _told_gaps(gaps: tuple[NotAssessed, ...], joints: list[str]) -> Iterator[str]:
    """What was not looked at of these joints or others, a line for each kind and reason."""
    said: dict[tuple[str, str], list[str]] = {}
    for gap in gaps:
        said.setdefault((gap.part, gap.why), []).append(gap.joint)
    for (part, why), names in said.items():
        told = ", ".join(names)
        if part == "joint":
            yield f"{told}: {why}"
        elif part == "effort limit":
            yield f"the effort limit of {told} is {why}"
        else:
            where = spoken.those(names, joints)
            yield f"{part}{'s' * (part in _PARTS)} not checked in {where}: {why}"


def _covered(found: Assessment, gaps: tuple[NotAssessed, ...], wearing: list[_Part]) -> str:
    """What the verdict is about, and what it is not: "Shafts: unlimited life; ..."."""
    told = []
    worn = {part.joint.worn for part in wearing}
    for part in _PARTS:
        lacking = _lacking(gaps, part)
        guess = part == "reducer" and any(joint.estimated_drive for joint in found.joints)
        name = "drives (estimated)" if guess else f"{part}s"
        ends = ("drive" if guess else part) in worn
        held = "within their limits" if part == "reducer" and not guess else "unlimited life"
        state = "a finite life" if ends else held
        if len(lacking) == sum(is_drive(joint.name) for joint in found.joints):
            if part == "shaft" and any(joint.estimated_drive for joint in found.joints):
                continue  # the drive as a whole is judged
            state = "not checked"
        elif lacking:
            state += f" (not checked in {', '.join(lacking)})"
        told.append(f"{name}: {state}")
    text = "; ".join(told)
    return text[:1].upper() + text[1:]
