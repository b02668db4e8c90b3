"""Effects as a vector of unknowns: transforms, bounds, and what is known beforehand."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from picchio.campaign.tables import Tolerance
from picchio.core.arrays import FloatArray
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.fit.known import NOTHING, Known, known_of
from picchio.model.effects.effect import Effect
from picchio.model.effects.evidence import Evidence
from picchio.model.effects.registry import catalogue
from picchio.robot.flexible_robot import FlexibleRobot

# Nominal values within so many standard deviations are nuisances, not causes: the largest of 80
# passes that in 1 % of campaigns. Where all else is stated as exact, what is beyond two of them is
# told apart from everything else, and counts.
TOLERATED = 3.8
_AMONG_EXACT = 2.0
FITTED = ("stiffness", "damping_ratio", "force")
# A value so near to an end of what is tolerated, transformed, stands at it.
AT_END = 1e-6
_STEP_LOG = 1e-3
_STEP_LINEAR = 1e-2


@dataclass(frozen=True)
class Unknown:
    """One number of one effect, as the fit sees it: u = log(value) or value / scale.

    Attributes:
        effect: which of the effects.
        name: its parameter.
        logarithmic: the transform.
        scale: of a linear one.
        lower, upper: bounds of u.
        prior: (mean, standard deviation) of u, or None.
    """

    effect: int
    name: str
    logarithmic: bool
    scale: float
    lower: float
    upper: float
    prior: tuple[float, float] | None = None

    def value(self, u: float) -> float:
        """The parameter's value.

        Args:
            u: the transformed unknown.
        """
        return math.exp(u) if self.logarithmic else u * self.scale

    def coordinate(self, value: float) -> float:
        """The transformed unknown `u` of a value.

        Args:
            value: of the parameter.
        """
        return math.log(value) if self.logarithmic else value / self.scale

    def slope(self, u: float) -> float:
        """The derivative of the parameter's value by `u`.

        Args:
            u: the transformed unknown.
        """
        return math.exp(u) if self.logarithmic else self.scale

    def is_inside(self, u: float) -> bool:
        """Whether it is free to move either way.

        Args:
            u: the transformed unknown.
        """
        return self.lower + AT_END < u < self.upper - AT_END

    @property
    def step(self) -> float:
        """For differences."""
        return _STEP_LOG if self.logarithmic else _STEP_LINEAR


def nuisances(robot: FlexibleRobot, recorded: bool = False) -> tuple[Effect, ...]:
    """What is never quite as stated, in the order of `[tolerance]`: stiffness of joints, ...

    Args:
        robot: the robot.
        recorded: whether the force of every record was read, no blows being stated.
    """
    tolerated = {kind.tolerance: kind for kind in catalogue().values() if kind.tolerance}
    evidence = Evidence(robot, recorded=recorded)
    return tuple(
        kind(target)
        for key in Tolerance.model_fields
        if (kind := tolerated.get(key)) is not None
        for target in kind.applies(evidence)
    )


@dataclass(frozen=True)
class Hypothesis:
    """Nuisances and causes with their values.

    Attributes:
        effects: nuisances first, then the causes.
        tolerance: of the nuisances.
        n_nuisances: how many.
        freed: labels of nuisances that may leave their tolerance: they are causes then.
        scales: label.parameter -> size of a linear parameter.
        drawn: (label, fall of chi-square, count) of numbers drawn anew in every record.
        priors: (label, parameter, value, standard deviation) of what other records tell of a cause.
        known: what the robot's files state of nuisances, in place of the tolerance.
    """

    effects: tuple[Effect, ...]
    tolerance: Tolerance
    n_nuisances: int
    freed: frozenset[str] = frozenset()
    scales: tuple[tuple[str, float], ...] = ()
    drawn: tuple[tuple[str, float, int], ...] = ()
    priors: tuple[tuple[str, str, float, float], ...] = ()
    known: Known = NOTHING

    @classmethod
    def baseline(
        cls, robot: FlexibleRobot, tolerance: Tolerance, recorded: bool = False
    ) -> Hypothesis:
        """The nominal model with its nuisances.

        Args:
            robot: as its files say.
            tolerance: how far stiffness and damping may be off, where its files state no spread.
            recorded: as of `nuisances`.
        """
        found = nuisances(robot, recorded)
        return cls(found, tolerance, len(found), known=known_of(robot, found, tolerance))

    @classmethod
    def nominal(cls, problem: Problem) -> Hypothesis:
        """As `baseline`, of a problem's robot and records.

        Args:
            problem: data and noise.
        """
        return cls.baseline(problem.robot, problem.campaign.tolerance, problem.recorded)

    @property
    def causes(self) -> tuple[Effect, ...]:
        """The effects that are no nuisances, and the nuisances that are freed."""
        freed = tuple(e for e in self.effects[: self.n_nuisances] if e.label in self.freed)
        return freed + self.effects[self.n_nuisances :]

    @property
    def labels(self) -> frozenset[str]:
        """Labels of the causes."""
        return frozenset(effect.label for effect in self.causes)

    @property
    def drawing(self) -> tuple[Effect, ...]:
        """The effects with numbers that are drawn anew in every record, and sought there."""
        return tuple(e for e in self.effects if e.latent is not None and not e.latent.linear)

    def is_known_in(self, record: str) -> bool:
        """Whether the numbers that are drawn anew have been sought in a record.

        Args:
            record: its name.
        """
        return all(record in effect.hidden for effect in self.drawing)

    @property
    def at_ends(self) -> frozenset[str]:
        """Labels of the nuisances that stand at an end of what is tolerated: they ask for more."""
        pairs = zip(self.unknowns(), self.vector(), strict=True)
        return frozenset(
            label
            for unknown, u in pairs
            if unknown.effect < self.n_nuisances
            and (label := self.effects[unknown.effect].label) not in self.freed
            and not unknown.is_inside(u)
        )

    def plus(self, effect: Effect) -> Hypothesis:
        """With one more cause; a nuisance becomes one by being freed.

        Args:
            effect: the cause.
        """
        for i, known in enumerate(self.effects[: self.n_nuisances]):
            if known.label == effect.label:
                effects = list(self.effects)
                at = min(max(known.values["scale"] * effect.values["scale"], 0.05), 20.0)
                effects[i] = known.with_values(scale=at)
                return replace(self, effects=tuple(effects), freed=self.freed | {effect.label})
        linear = [p for p in effect.parameters if not p.logarithmic]
        sizes = [abs(effect.values[p.name]) for p in linear]
        typical = max((v for v in sizes if v > 0.0 and math.isfinite(v)), default=1.0)
        own = tuple(
            (f"{effect.label}.{p.name}", size if size > 0.0 else p.size_beside(typical))
            for p, size in zip(linear, sizes, strict=True)
        )
        return replace(self, effects=(*self.effects, effect), scales=self.scales + own)

    def joined(self, cause: Effect) -> Hypothesis:
        """With one more cause, at just the values that it has in another hypothesis.

        Args:
            cause: with the values to keep.
        """
        more = self.plus(cause)
        effects = tuple(cause if e.label == cause.label else e for e in more.effects)
        return replace(more, effects=effects)

    def informed(self, cause: Effect, std: Mapping[str, float]) -> Hypothesis:
        """With a cause of which other records tell the values, and how well.

        Args:
            cause: at those values; it is added where it is missing.
            std: parameter -> standard deviation, SI.
        """
        more = self if cause.label in self.labels else self.joined(cause)
        kept = tuple(p for p in self.priors if p[0] != cause.label)
        told = tuple((cause.label, name, cause.values[name], s) for name, s in std.items())
        return replace(more, priors=kept + told)

    def minus(self, label: str) -> Hypothesis:
        """Without one of the causes; a nuisance that was freed goes back into its tolerance.

        Args:
            label: of the cause.

        Returns:
            the hypothesis that is left.
        """
        tolerated = [
            self._tolerated(e) if e.label == label and label in self.freed else e
            for e in self.effects[: self.n_nuisances]
        ]
        causes = [e for e in self.effects[self.n_nuisances :] if e.label != label]
        drawn = tuple(item for item in self.drawn if item[0] != label)
        priors = tuple(item for item in self.priors if item[0] != label)
        rest = replace(self, freed=self.freed - {label}, drawn=drawn, priors=priors)
        return replace(rest, effects=(*tolerated, *causes))

    def _tolerated(self, nuisance: Effect) -> Effect:
        """At the tolerated value nearest to where it is: a jump from there would skip cycles."""
        lower, upper = self._tolerance(nuisance)
        return nuisance.with_values(scale=min(max(nuisance.values["scale"], lower), upper))

    def _tolerance(self, nuisance: Effect) -> tuple[float, float]:
        sigma = self._sigma(nuisance)
        reach = TOLERATED if self.tolerance.beyond(FITTED) else _AMONG_EXACT
        if self.known.sigma(nuisance.label) is not None:  # of the logarithm
            return max(math.exp(-reach * sigma), 0.05), min(math.exp(reach * sigma), 20.0)
        return max(1.0 - reach * sigma, 0.05), 1.0 + reach * sigma

    def _sigma(self, nuisance: Effect) -> float:
        known = self.known.sigma(nuisance.label)
        return float(getattr(self.tolerance, nuisance.tolerance)) if known is None else known

    def unknowns(self) -> list[Unknown]:
        """What the fit may move."""
        found = []
        scales = dict(self.scales)
        told = {(label, name): (value, std) for label, name, value, std in self.priors}
        for i, effect in enumerate(self.effects):
            nuisance = i < self.n_nuisances
            for p in effect.fitted:
                if effect.discrete or effect.latent is not None:
                    continue  # found in another way than by the fit
                prior = None
                lower, upper = p.lower, p.upper
                if nuisance:
                    sigma = self._sigma(effect)
                    if sigma == 0.0:
                        continue
                    if effect.label not in self.freed:
                        lower, upper = self._tolerance(effect)
                        prior = (0.0, sigma)
                scale = scales.get(f"{effect.label}.{p.name}", 1.0)
                if p.spread:
                    prior = (p.neutral / scale, p.spread / scale)
                if (effect.label, p.name) in told:
                    value, std = told[effect.label, p.name]
                    prior = (math.log(value), std / value) if p.logarithmic else (
                        value / scale, std / scale
                    )  # fmt: skip
                if p.logarithmic:
                    low = math.log(lower) if lower > 0 else -700.0
                    found.append(Unknown(i, p.name, True, 1.0, low, math.log(upper), prior))
                else:
                    ends = lower / scale, upper / scale
                    found.append(Unknown(i, p.name, False, scale, *ends, prior))
        return found

    def vector(self) -> FloatArray:
        """The present values of the unknowns."""
        return np.array(
            [u.coordinate(self.effects[u.effect].values[u.name]) for u in self.unknowns()]
        )

    def at(self, vector: Sequence[float] | FloatArray) -> Hypothesis:
        """With other values.

        Args:
            vector: (unknowns,) transformed, as `vector` gives them.
        """
        changes: dict[int, dict[str, float]] = {}
        for unknown, u in zip(self.unknowns(), vector, strict=True):
            clipped = min(max(float(u), unknown.lower), unknown.upper)
            changes.setdefault(unknown.effect, {})[unknown.name] = unknown.value(clipped)
        # log and exp leave a bound by a rounding.
        effects = tuple(
            effect.bounded(**changes[i]) if i in changes else effect
            for i, effect in enumerate(self.effects)
        )
        return replace(self, effects=effects)
