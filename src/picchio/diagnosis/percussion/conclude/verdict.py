"""What may be said of the causes that a search has found."""

from __future__ import annotations

from collections.abc import Sequence

from picchio.diagnosis.percussion.criteria.whiteness import Evidence
from picchio.diagnosis.result import BEYOND_DOUBT, MOSTLY, Cause, Verdict


def verdict_of(
    causes: Sequence[Cause],
    before: Evidence,
    after: Evidence,
    others_do_as_well: bool,
    explained: float | None,
    common: Sequence[str],
) -> Verdict:
    """The verdict.

    Args:
        causes: that stand at the end.
        before: what is left without them.
        after: what is left with them.
        others_do_as_well: whether another set of causes explains as much.
        explained: share of the held-out excess.
        common: effects that all sensors, though of different kinds, would have alike.
    """
    if not causes:
        return "nothing-wrong" if before.is_noise else "unexplained"
    if common:
        return "unexplained"
    if after.is_noise:
        if others_do_as_well:
            return "ambiguous"
        return "unexplained" if _doubted(causes) else "named"
    if may_be_partial(causes, explained) and not others_do_as_well:
        return "partial"
    return "unexplained"


def may_be_partial(causes: Sequence[Cause], explained: float | None) -> bool:
    """Whether causes may be claimed that leave more than noise."""
    mostly = explained is not None and explained >= MOSTLY
    return mostly and all(cause.confidence >= BEYOND_DOUBT for cause in causes)


def _doubted(causes: Sequence[Cause]) -> list[Cause]:
    """Of several causes, those that are not beyond doubt.

    Two or three effects of the catalogue together imitate a lot that it does not have; the last of
    them is then hardly needed. That a single one leaves noise is another matter.
    """
    if len(causes) < 2:
        return []
    return [cause for cause in causes if cause.confidence < BEYOND_DOUBT]


def why_not_claimed(causes: Sequence[Cause], common: Sequence[str]) -> str:
    """Why no cause is claimed though they leave noise."""
    if common:
        said = " and ".join(name.replace("_", " ") for name in common)
        return (
            f"{said} would explain it, but by the same amount in all sensors: then it is not they "
            "that are wrong but something before them, in the blows or in the clock that starts "
            "the records, which no known cause describes; a force sensor at the tool would tell"
        )
    doubted = _doubted(causes)
    if not doubted:
        return ""
    said = " and ".join(
        f"{cause.effect.replace('_', ' ')} ({cause.target}, confidence {cause.confidence:.2f})"
        for cause in doubted
    )
    return (
        f"{len(causes)} causes together leave nothing but noise, but {said} is not beyond doubt, "
        "and several causes are named only where each of them is: they may imitate another one "
        "that is not known"
    )


def pair_of(label: str) -> tuple[str, str]:
    """Effect and target."""
    name, _, target = label.partition(":")
    return name, target
