"""One search: sets of causes are fitted, and all stand in one table with their evidence.

Near the truth slopes promise what each candidate gains; far from it, where what is never exact is
strained, every candidate is tried by itself on the first tenth of a second, with springs, damping
and force beside it, and the best are fitted on growing windows. None of that decides: it only says
what to fit next.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from picchio.core.errors import InputError
from picchio.diagnosis.evidence.arrow import reduce
from picchio.diagnosis.evidence.estimate import (
    FAILED,
    Fit,
    estimate,
    objective,
    scaled,
    squares_of,
    standardised,
)
from picchio.diagnosis.evidence.table import Table, labels_of
from picchio.diagnosis.evidence.verdict import LEFT, Judged, judge
from picchio.diagnosis.percussion.likelihood.causes import Cause, candidate_starts
from picchio.diagnosis.percussion.likelihood.percussion import Data, Percussion
from picchio.diagnosis.percussion.posterior.drawn import drawn_candidates, missing_blows
from picchio.diagnosis.percussion.posterior.screening import screen, times
from picchio.diagnosis.percussion.search.candidates import all_candidates
from picchio.model.effects.scales import Scales

WINDOWS = (0.1, 0.3, None)
"""s: numbers that are far off turn phases by cycles, and are sought on growing windows."""
# Effort, not verdicts: how many are looked at further.
_NEAR, _LIGHT, _RACE = 5, 16, 6
_SIZES = (0.5, 1.0, 2.0, 4.0)
_log = logging.getLogger("picchio.diagnosis")


@dataclass(eq=False)
class Search:
    """A search for what explains a campaign's percussion records.

    Attributes:
        data: the records.
        scales: of what size effects are tried.
        without: names of effects that are not considered.
        most: causes at once.
    """

    data: Data
    scales: Scales
    without: frozenset[str] = frozenset()
    most: int = 3
    table: Table = field(init=False)

    def __post_init__(self) -> None:
        self.table = Table(len(self.kinds))

    @cached_property
    def kinds(self) -> list[tuple]:
        """Every (effect, target) that may be at work."""
        return all_candidates(self.data.problem, self.without)

    @cached_property
    def starts(self) -> dict[str, list[Cause]]:
        """Candidates without numbers of single records, at all sizes at which they are tried."""
        found = {}
        for kind, target in self.kinds:
            if kind.latent is None:
                tolerance = self.data.problem.campaign.tolerance
                found[f"{kind.name}:{target}"] = candidate_starts(
                    kind, target, self.scales, tolerance
                )
        return {label: own for label, own in found.items() if own}

    @property
    def price(self) -> float:
        """nats, of a cause: the log of how many there may be."""
        return math.log(max(self.table.candidates, 1))

    # Fits ----------------------------------------------------------------------------------------

    def fit(
        self,
        causes: Sequence[Cause],
        start: Fit | None = None,
        windows: Sequence[float | None] = (None,),
        penalty: float = 0.0,
    ) -> Fit | None:
        """A set's fit, kept in the table; None where it leads to no model.

        Args:
            causes: at the values where to begin.
            start: a fit at whose other numbers to begin; the stated ones where None.
            windows: s, up to when; one after the other.
            penalty: nats, see `Fit.penalty`.
        """
        found = start
        try:
            for end in windows:
                likelihood = Percussion(self.data, tuple(causes), end=end)
                at = likelihood.start(found.at, found.likelihood) if found else likelihood.start()
                rough = end is not None
                found = estimate(likelihood, at, tolerance=1.0 if rough else 0.05,
                                 renewals=4 if rough else 10)  # fmt: skip
        except FAILED as error:
            _log.debug("%s: %s", [cause.label for cause in causes], error)
            return None
        assert found is not None
        found = self.table.keep(replace(found, penalty=penalty))
        _log.debug("fit %s: score %.1f, left %.4f", sorted(labels_of(found)),
                   self.table.score(found), float(found.objective.sizes.max()))  # fmt: skip
        return found

    def strained(self, fit: Fit) -> bool:
        """Whether what is never exact is farther off than chance allows, or more is left.

        Only whether to look farther depends on it.

        Args:
            fit: of a set of causes.
        """
        z = standardised(fit.likelihood.prior, fit.at).shared
        free = z.size - float(np.trace(fit.covariance))
        beyond = float(z @ z) > free + 4.0 * math.sqrt(2.0 * free)
        return bool(fit.objective.sizes.max() > 0.5 * LEFT or beyond or np.abs(z).max() > 4.0)

    @staticmethod
    def causes_of(fit: Fit) -> tuple[Cause, ...]:
        """A fit's causes at its values.

        Args:
            fit: of a set of causes.
        """
        own = fit.likelihood.causes
        effects = fit.likelihood.effects_at(fit.at)[-len(own) :] if own else ()
        return tuple(replace(c, effect=e) for c, e in zip(own, effects, strict=True))

    # Steps ---------------------------------------------------------------------------------------

    def near(self, fit: Fit) -> list[Fit]:
        """Fits with one more cause, by what slopes promise.

        Args:
            fit: about which.

        Returns:
            those that could be fitted.
        """
        last = max(r.setup.samples.last for r in self.data.records)
        promises = screen(fit, self.starts, min(0.6, last), self.price)
        _log.debug("promised: %s", ", ".join(f"{p.label} {p.gain:.0f}" for p in promises[:8]))
        causes = self.causes_of(fit)
        chosen = [p.cause for p in promises[:_NEAR] if p.gain > 0.0]
        for gain, cause in drawn_candidates(fit, self.kinds, self.scales):
            if gain > self.price:
                chosen.append(cause)
        return self._all(((*causes, cause), fit, (None,)) for cause in chosen)

    def far(self, fit: Fit) -> list[Fit]:
        """Fits with one more cause from the stated numbers, where those of the fit are strained.

        Args:
            fit: that is strained.

        Returns:
            those that could be fitted.
        """
        causes = self.causes_of(fit)
        have = {cause.label for cause in causes}
        few = self.data.only(self.data.one_a_pose)
        scanned = self._scan(few, causes, [label for label in self.starts if label not in have])
        light = []
        for _, cause in scanned[:_LIGHT]:
            likelihood = _light(few, (*causes, cause))
            try:
                found = estimate(likelihood, likelihood.start(), tolerance=2.0, renewals=3, steps=5)
            except FAILED:
                continue
            light.append(found)
        light.sort(key=lambda one: one.objective.value)
        _log.debug(
            "light: %s",
            ", ".join(
                f"{one.likelihood.causes[-1].label} {one.objective.value:.0f}" for one in light[:8]
            ),
        )
        return self._race(light[:_RACE])

    def _scan(
        self, few: Data, causes: tuple[Cause, ...], labels: Sequence[str]
    ) -> list[tuple[float, Cause]]:
        """Each candidate at its best size, springs, damping and force moved with it by slopes."""
        light = _light(few, causes)
        at = light.start()
        slopes = light.linearised(at)
        found = []
        for label in labels:
            tried = []
            for cause in self.starts[label]:
                sizes: Iterable[float] = (1.0,)
                if any(n.amount for n in cause.numbers):
                    both = len(self.starts[label]) == 1 and all(
                        n.low < 0.0 for n in cause.numbers if n.amount
                    )
                    sizes = (*(-s for s in _SIZES if both), *_SIZES)
                tried += [times(cause, s) if s != 1.0 else cause for s in sizes]
            values = []
            for cause in tried:
                more = _light(few, (*causes, cause))
                try:
                    residuals = more.residuals(more.start(at, light))
                except FAILED:
                    continue
                then = objective(light, at, squares_of(residuals))
                grams = scaled(slopes.grams(residuals), light.group_of, light.prior.std)
                system = reduce(grams, light.group_of, then.weights, standardised(light.prior, at))
                gain = 0.5 * float(system.pull @ np.linalg.solve(system.precision, system.pull))
                values.append((then.value - gain, cause))
            if values:
                found.append(min(values, key=lambda one: one[0]))
        return sorted(found, key=lambda one: one[0])

    def _race(self, runners: Sequence[Fit]) -> list[Fit]:
        """Fits of the runners' sets on growing windows; those far behind are left."""
        field_ = list(runners)
        for end in WINDOWS:
            ran = []
            for one in field_:
                likelihood = Percussion(self.data, one.likelihood.causes, end=end)
                try:
                    at = likelihood.start(one.at, one.likelihood)
                    ran.append(estimate(likelihood, at, tolerance=1.0 if end else 0.05,
                                        renewals=4 if end else 10))  # fmt: skip
                except FAILED:
                    continue
            ran.sort(key=lambda one: -one.evidence)
            field_ = [one for one in ran if one.evidence > ran[0].evidence - 200.0][: _RACE // 2]
        return [self.table.keep(one) for one in field_]

    def _all(
        self, sets: Iterable[tuple[Sequence[Cause], Fit | None, Sequence[float | None]]]
    ) -> list[Fit]:
        found = [self.fit(causes, start, windows) for causes, start, windows in sets]
        return [one for one in found if one is not None]

    def _missing(self, fit: Fit) -> list[Fit]:
        """The fit in which blows are missing, found again until they stay the same."""
        found: list[Fit] = []
        cause, count = missing_blows(fit, self.kinds)
        for _ in range(3):
            if cause is None:
                break
            penalty = count * math.log(max(r.setup.blows.start.size for r in self.data.records))
            rest = [c for c in self.causes_of(fit) if c.label != cause.label]
            windows = WINDOWS if not found else (None,)
            one = self.fit((*rest, cause), found[-1] if found else None, windows, penalty)
            if one is None:
                break
            found.append(one)
            again, count = missing_blows(one, self.kinds)
            if again is None or again.effect.hidden == cause.effect.hidden:
                break
            cause = again
        return found

    def run(self) -> Judged:
        """The verdict.

        Raises:
            InputError: no model at the stated values.
        """
        now = self.fit((), windows=WINDOWS)
        if now is None:
            raise InputError("no model that can be computed at the stated values")
        for _ in range(self.most):
            tried = self.near(now) if now.objective.sizes.max() < 5.0 * LEFT else []
            if self.strained(max([now, *tried], key=self.table.score)):
                tried += self._missing(now)
            if self.strained(max([now, *tried], key=self.table.score)):
                tried += self.far(now)
            best = max([now, *tried], key=self.table.score)
            if best is now:
                break
            now = best
        self._dropped(self.table.best)
        return judge(self.table)

    def _dropped(self, fit: Fit) -> None:
        """Fits without each of the causes, as long as fewer do better."""
        while len(labels_of(fit)) > 1:
            for cause in self.causes_of(fit):
                rest = [c for c in self.causes_of(fit) if c.label != cause.label]
                if frozenset(c.label for c in rest) not in self.table.fits:
                    self.fit(rest, fit)
            if self.table.best is fit:
                return
            fit = self.table.best


def _light(few: Data, causes: Sequence[Cause]) -> Percussion:
    """Begin of some records with springs, damping and force free, all else as stated."""
    return Percussion(few, tuple(causes), end=WINDOWS[0], light=True)
