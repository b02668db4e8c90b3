"""Claims of the paper, their verdicts, and the number that decides each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from picchio.paper.assumptions import INPUTS
from picchio.paper.world import World

if TYPE_CHECKING:
    from picchio.paper.study import Study

BLOWS = ("period", "duty", "damping_ratio", "inertia_about", "elbow")
PATH = (*BLOWS, "path_x")
PANEL = (*BLOWS, "pitch", "panel_x", "panel_y", "panel_z")
"""The inputs that claims on the reach, on the vertical path and on the rivets depend on."""

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
    """The result of testing a claim.

    Attributes:
        verdict: one of four.
        test: what was tried.
        decides: the number that decides, in a sentence.
        number: the same as a number; None where nothing can be computed.
        condition: of "holds only if".
    """

    verdict: Verdict
    test: str
    decides: str
    number: float | None = None
    condition: str = ""


Test = Callable[["Study"], Finding]


@dataclass(frozen=True)
class Claim:
    """A sentence of the paper and how it is tried.

    Attributes:
        name: the key under which the sentence and its page stand in `data/paper.toml`.
        figure: of the page that shows it, such as "fig-10"; empty for none.
        test: from a study to a finding.
    """

    name: str
    figure: str
    test: Test


CLAIMS: dict[str, Claim] = {}


def claim(figure: str = "", name: str = "") -> Callable[[Test], Test]:
    """A decorator that registers the test of a claim.

    Args:
        figure: of the page that shows it; empty for none.
        name: the claim's; the test's own if empty.
    """

    def register(test: Test) -> Test:
        key = name or test.__name__
        if key in CLAIMS:
            raise ValueError(f"the claim {key!r} is tried twice")
        CLAIMS[key] = Claim(key, figure, test)
        return test

    return register


Holds = Callable[[World], tuple[bool, float]]


def claim_of_worlds(
    figure: str, test: str, says: str, among: Sequence[str] = (), most: int | None = None
) -> Callable[[Holds], Holds]:
    """A decorator that registers a claim to be tried in every world, see `across`.

    Args:
        figure: of the page that shows it; empty for none.
        test: what is tried.
        says: what decides, with fields.
        among: the inputs that the claim can depend on; all if none are named.
        most: how many worlds to try at most.
    """

    def register(holds: Holds) -> Holds:
        name = holds.__name__
        claim(figure, name)(lambda study: across(study.worlds[:most], holds, test, says, among))
        return holds

    return register


def decided(
    true: bool, test: str, decides: str, number: float | None = None, condition: str = ""
) -> Finding:
    """A claim that no assumption touches; true under a condition where one is given."""
    verdict = Verdict.FAILS if not true else Verdict.CONDITIONAL if condition else Verdict.HOLDS
    return Finding(verdict, test, decides, number, condition if true else "")


def unknown(test: str, decides: str) -> Finding:
    """A claim that the printed data cannot decide."""
    return Finding(Verdict.UNKNOWN, test, decides)


def across(
    worlds: Sequence[World],
    holds: Holds,
    test: str,
    says: str,
    among: Sequence[str] = (),
) -> Finding:
    """Try a claim in every world: it holds in all, in none, or in some.

    Args:
        worlds: the first is the base.
        holds: of a world: whether the claim is true there, and the number it rests on.
        test: what is tried.
        says: a sentence with fields {base}, {least}, {most} for the number, {share} for the
            percentage of worlds in which it holds, and {worlds}, how many there were.
        among: the inputs that the claim can depend on; all if none are named.
    """
    tried = [holds(world) for world in worlds]
    true = np.array([bool(t) for t, _ in tried])
    numbers = np.array([number for _, number in tried], dtype=float)
    count = int(true.sum())
    decides = says.format(
        base=plainly(numbers[0]),
        least=plainly(np.nanmin(numbers)),
        most=plainly(np.nanmax(numbers)),
        share=f"{100.0 * true.mean():.0f} %",
        worlds=len(worlds),
    )
    if count == len(worlds):
        return Finding(Verdict.HOLDS, test, decides, float(numbers[0]))
    if count == 0:
        return Finding(Verdict.FAILS, test, decides, float(numbers[0]))
    words, right = best_split(worlds, true, among)
    spoken = f"true in {count} of {len(worlds)} worlds"
    if count < _RARE:
        condition = (
            f"several inputs match, which is rare: {spoken}, too few for a rule "
            f"(nearest to one: {words})"
        )
    elif right >= _TELLING:
        condition = f"{words} (right for {100 * right:.0f} % of the worlds; {spoken})"
    else:
        condition = (
            f"several inputs match: {spoken}, and no single input decides "
            f"(best: {words}, {100 * right:.0f} %)"
        )
    return Finding(Verdict.CONDITIONAL, test, decides, float(numbers[0]), condition)


def plainly(value: float) -> str:
    """Three digits; rounding errors become 0."""
    return "0" if abs(value) < 1e-12 else f"{value:.3g}"


def best_split(worlds: Sequence[World], true: Any, among: Sequence[str] = ()) -> tuple[str, float]:
    """The one assumption that best separates where a claim holds.

    Returns:
        the condition in words, and the mean of the shares of true and of false worlds that it
        tells right.
    """
    true = np.asarray(true, dtype=bool)
    splits: list[tuple[str, Any]] = []
    for entry in INPUTS:
        if among and entry.name not in among:
            continue
        name = _NAMES.get(entry.name, entry.name)
        values = np.array([getattr(world.given, entry.name) for world in worlds])
        if entry.choices:
            splits += [(f"{name} is {c}", values == c) for c in dict.fromkeys(values.tolist())]
            continue
        levels = np.unique(values)
        for at in 0.5 * (levels[1:] + levels[:-1]):
            level = f"{at:.3g} {entry.unit}".rstrip(" –")
            splits += [(f"{name} is below {level}", values < at),
                       (f"{name} is above {level}", values > at)]  # fmt: skip
    best = ("", 0.0)
    for words, chosen in splits:
        right = 0.5 * (chosen[true].mean() + (~chosen[~true]).mean())
        if right > best[1] + 1e-12:
            best = (words, float(right))
    return best


_NAMES = {
    "period": "the blows' period T",
    "duty": "the duty T_d / T",
    "damping_ratio": "the damping ratio",
    "inertia_about": "the point of Table 1's inertias",
    "path_x": "x of the vertical path",
    "elbow": "the elbow",
    "pitch": "the rivets' pitch",
    "panel_x": "x of the panel",
    "panel_y": "y of the panel",
    "panel_z": "z of the panel",
}
