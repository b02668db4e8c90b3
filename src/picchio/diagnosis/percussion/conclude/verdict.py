"""What may be said of the causes that a search has found."""

from __future__ import annotations

import math
from collections.abc import Sequence

from picchio.diagnosis.percussion.criteria.remainder import Remainder
from picchio.diagnosis.percussion.criteria.whiteness import Evidence
from picchio.diagnosis.result import BEYOND_DOUBT, Cause, Verdict
from picchio.model.effects.registry import effect_class

# A value this many of its standard deviations from doing nothing may as well do nothing.
_UNSURE = 2.0
# What causes that are claimed in part must explain of the held-out excess, in power. Where all else
# is exact, or more is left than a remainder can be, that is of something unknown, and they may be
# no more than alike: a vibration absorber was told as a servo, which explained 0.93, a mass on a
# spring as a payload (0.94). What is correlated by 0.99 explains so much.
_NEARLY_ALL = 0.98

BeforeAndAfter = tuple[Remainder, Remainder]


def verdict_of(
    causes: Sequence[Cause],
    before: Evidence,
    after: Evidence,
    others_do_as_well: bool,
    explained: float | None,
    common: Sequence[str],
    left: BeforeAndAfter | None = None,
    improbable: bool = False,
) -> Verdict:
    """The verdict.

    Args:
        causes: that stand at the end.
        before: what is left without them.
        after: what is left with them.
        left: what is left beside noise and tolerance, without the causes and with them; None where
            nothing may be left.
        others_do_as_well: whether another set of causes explains as much.
        explained: share of the held-out excess.
        common: effects that all sensors, though of different kinds, would have alike.
        improbable: whether tolerances would have to be exceeded even with the causes.
    """
    if not causes:
        little = before.is_noise or (left is not None and left[0].within_tolerance)
        return "nothing-wrong" if little else "unexplained"
    if common:
        return "unexplained"
    if leaves_little(after, left):
        if others_do_as_well:
            return "ambiguous"
        return "unexplained" if _doubted(causes, improbable) else "named"
    if may_be_partial(causes, explained, left) and not others_do_as_well:
        return "partial"
    return "unexplained"


def leaves_little(after: Evidence, left: BeforeAndAfter | None) -> bool:
    """Whether what the causes leave is noise, or no more than a remainder that is allowed.

    Args:
        after: what is left with the causes.
        left: beside noise and tolerance, before and after; None where nothing may be left.
    """
    return after.is_noise or (left is not None and left[1].may_be_named(left[0]))


def may_be_partial(
    causes: Sequence[Cause], explained: float | None, left: BeforeAndAfter | None = None
) -> bool:
    """Whether causes may be claimed that leave more than noise.

    Args:
        causes: that stand at the end.
        explained: share of the held-out excess.
        left: as in `leaves_little`.
    """
    mostly = explained is not None and explained >= _NEARLY_ALL
    if left is not None:
        latents = [effect_class(cause.effect).latent for cause in causes]
        follows = any(latent is not None and latent.times for latent in latents)
        mostly = (mostly or left[1].is_plausible) and left[1].may_be_partial(left[0], follows)
    return mostly and all(c.confidence >= BEYOND_DOUBT and not _is_nothing(c) for c in causes)


def claimed_of(verdict: Verdict) -> bool:
    """Whether a verdict claims causes."""
    return verdict in ("named", "ambiguous", "partial")


def doubtful(causes: Sequence[Cause]) -> list[Cause]:
    """Of several causes, those not beyond doubt, and those that their spread takes to nothing.

    Args:
        causes: with their values and confidences.

    Returns:
        the most doubtful first.
    """
    found = [c for c in causes if c.confidence < BEYOND_DOUBT or _is_nothing(c)]
    return sorted(found, key=lambda c: (not _is_nothing(c), c.confidence))


def _is_nothing(cause: Cause) -> bool:
    """Whether every number of a cause is as near to doing nothing as it is unsure."""
    fitted = [
        (value, p.neutral)
        for p in effect_class(cause.effect).parameters
        if (value := cause.parameters.get(p.name)) is not None and value.std > 0.0
    ]
    # What does nothing only at infinity, such as a sensor's range, has no distance from it.
    near = (math.isfinite(n) and abs(v.value - n) <= _UNSURE * v.std for v, n in fitted)
    return bool(fitted) and all(near)


def _doubted(causes: Sequence[Cause], improbable: bool) -> list[Cause]:
    """Of the causes, those that are not beyond doubt.

    Two or three effects of the catalogue together imitate a lot that it does not have; the last of
    them is then hardly needed. That a single one leaves noise is another matter, unless tolerances
    would have to be exceeded beside it, or it is as near to nothing as it is unsure.
    """
    if len(causes) < 2 and not improbable:
        return [cause for cause in causes if _is_nothing(cause)]
    return [cause for cause in causes if cause.confidence < BEYOND_DOUBT]


def why_not_claimed(
    causes: Sequence[Cause], common: Sequence[str], improbable: bool = False
) -> str:
    """Why no cause is claimed though they leave noise."""
    if common:
        said = " and ".join(name.replace("_", " ") for name in common)
        return (
            f"{said} would explain it, but by the same amount in all sensors: then it is not they "
            "that are wrong but something before them, in the blows or in the clock that starts "
            "the records, which no known cause describes; a force sensor at the tool would tell"
        )
    doubted = _doubted(causes, improbable)
    if not doubted:
        return ""
    if len(causes) == 1:
        name, target = causes[0].effect.replace("_", " "), causes[0].target
        why = (
            "tolerances would still have to be exceeded several times"
            if improbable
            else "its value may as well be that of a robot without it"
        )
        return f"{name} ({target}) leaves nothing but noise, but {why}"
    said = " and ".join(
        f"{cause.effect.replace('_', ' ')} ({cause.target}, confidence {cause.confidence:.2f})"
        for cause in doubted
    )
    return (
        f"{len(causes)} causes together leave nothing but noise, but {said} is not beyond doubt, "
        "and several causes are named only where each of them is: they may imitate another one "
        "that is not known"
    )


def not_quiet(groups: Sequence[str]) -> str:
    """That the time before the blows was not quiet.

    Args:
        groups: whose records hold less than the noise of that time.
    """
    return (
        f"the time before the blows is louder than the noise of the records ({', '.join(groups)}): "
        "something shook the robot or the sensor then, such as the floor or a motor, and may go on"
    )


def pair_of(label: str) -> tuple[str, str]:
    """Effect and target."""
    name, _, target = label.partition(":")
    return name, target
