"""Causes: effects whose parameters are numbers of the model, with broad priors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from picchio.campaign.tables import Tolerance
from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.scales import Scales

FACTOR = 0.7
"""Of the logarithm of a factor on what is stated: one standard deviation, a factor of two."""
SHAPE = 1.5
"""Of the logarithm of what says how, not how much: a factor of 4.5 about where it is tried."""
AMOUNT = 3.0
"""One standard deviation of an amount, over the size at which it is tried."""
STIFF = 0.02
"""The least compliance of a spring that yields, over that at which it is tried."""


@dataclass(frozen=True)
class EffectNumber:
    """A parameter of an effect as a coordinate u that a fit moves.

    Attributes:
        parameter: its name.
        kind: u is log(value / origin), (value - origin) / scale, scale / value; or, of a damper
            beside a spring, log(value / stiffness / origin): of their relaxation time.
        origin, scale: SI.
        std: of u beforehand; its mean is `mean`.
        low, high: bounds of u.
        amount: whether u says how much: 0 does nothing.
        mean: of u beforehand.
    """

    parameter: str
    kind: Literal["log", "linear", "inverse", "relaxation"]
    origin: float
    scale: float
    std: float
    low: float
    high: float
    amount: bool
    mean: float = 0.0

    def value(self, u: float) -> float:
        """The parameter at a coordinate, SI.

        Args:
            u: the coordinate.
        """
        if self.kind in ("log", "relaxation"):
            return self.origin * math.exp(u)
        return self.scale / u if self.kind == "inverse" else self.origin + self.scale * u

    def coordinate(self, value: float) -> float:
        """The coordinate of a value, SI.

        Args:
            value: SI.
        """
        if self.kind in ("log", "relaxation"):
            return math.log(value / self.origin)
        if self.kind == "inverse":
            return self.scale / value
        return (value - self.origin) / self.scale

    def slope(self, u: float) -> float:
        """Of the value by the coordinate.

        Args:
            u: the coordinate.
        """
        if self.kind == "log":
            return self.value(u)
        return -self.scale / u**2 if self.kind == "inverse" else self.scale


@dataclass(frozen=True, eq=False)
class Cause:
    """One way in which the world may differ: an effect at a target.

    Attributes:
        effect: at the values where it is tried.
        numbers: those that a fit moves.
    """

    effect: Effect
    numbers: tuple[EffectNumber, ...]

    @property
    def label(self) -> str:
        """Name and target."""
        return self.effect.label

    def at(self, u: Sequence[float]) -> Effect:
        """The effect at coordinates.

        Args:
            u: a coordinate of each number.
        """
        values = {n.parameter: n.value(float(x)) for n, x in zip(self.numbers, u, strict=True)}
        for n in self.numbers:
            if n.kind == "relaxation":
                values[n.parameter] *= values["stiffness"]
        return self.effect.bounded(**values)

    def coordinates(self, effect: Effect) -> list[float]:
        """The coordinates of an effect's values, within their bounds.

        Args:
            effect: with values.
        """
        found = []
        for n in self.numbers:
            value = effect.values[n.parameter]
            if n.kind == "relaxation":
                value /= effect.values["stiffness"]
            if n.kind == "inverse" and math.isinf(value):
                u = n.low
            elif n.kind in ("log", "relaxation") and not 0.0 < value < math.inf:
                u = 0.0
            else:
                u = n.coordinate(value)
            found.append(min(max(u, n.low), n.high))
        return found

    def partly(self, share: float) -> Effect:
        """The effect with so much of its amount.

        Args:
            share: of the amount at which it is tried.
        """
        u = [
            x * share if n.amount else x
            for n, x in zip(self.numbers, self.coordinates(self.effect), strict=True)
        ]
        return self.at(u)


def cause_of(effect: Effect, trials: Sequence[Mapping[str, float]], tolerance: Tolerance) -> Cause:
    """An effect as a cause, with the prior of each of its numbers.

    Args:
        effect: at values where it is tried.
        trials: all values at which it is tried.
        tolerance: what is tolerated of the same numbers.
    """
    key = effect.tolerance or effect.exceeds
    tolerated = float(getattr(tolerance, key, 0.0)) if key else 0.0
    numbers = []
    for p in effect.parameters:
        if p.whole or effect.discrete or p.name in ("smoothing",):
            continue
        if effect.latent is not None and p.name == effect.latent.spread:
            continue
        if effect.latent is not None and effect.latent.linear and p.name == "amplitude":
            continue
        numbers.append(_number(p, effect, trials, tolerated))
    return Cause(effect, tuple(numbers))


def _number(
    p: Parameter, effect: Effect, trials: Sequence[Mapping[str, float]], tolerated: float
) -> EffectNumber:
    value = effect.values[p.name]
    tried = [abs(t[p.name]) for t in trials if p.name in t and math.isfinite(t[p.name])] or [
        abs(value)
    ]
    if p.by_inverse:
        k0 = min(tried)
        return EffectNumber(p.name, "inverse", 0.0, k0, AMOUNT, STIFF, 1e3, True)
    stiffness = effect.values.get("stiffness", 0.0)
    if p.name == "damping" and any(
        q.name == "stiffness" and q.by_inverse for q in effect.parameters
    ):
        return EffectNumber(p.name, "relaxation", value / stiffness, 1.0, SHAPE, -12.0, 12.0, False)
    if p.logarithmic:
        amount = 0.0 < p.neutral < math.inf and not p.shape and p.neutral == 1.0
        origin = p.neutral if amount else value if 0.0 < value < math.inf else max(p.lower, 1e-6)
        low = math.log(max(p.lower, 1e-300) / origin)
        high = math.log(p.upper / origin) if math.isfinite(p.upper) else 50.0
        std = math.hypot(FACTOR, tolerated) if amount else SHAPE
        return EffectNumber(p.name, "log", origin, 1.0, p.spread or std, low, high, amount)
    about = p.neutral if math.isfinite(p.neutral) else 0.0
    size = max(tried) or p.size or 1.0
    if all(p.name not in t for t in trials):
        primary = [abs(v) for t in trials for k, v in t.items()]
        size = p.size_beside(max(primary, default=1.0)) or 1.0
    amount = not p.shape and about == 0.0
    std = p.spread / size if p.spread else (math.hypot(AMOUNT, tolerated / size) if amount else 1.0)
    return EffectNumber(
        p.name,
        "linear",
        about,
        size,
        std,
        max((p.lower - about) / size, -1e9),
        min((p.upper - about) / size, 1e9),
        amount,
    )


def candidate_starts(
    kind: type[Effect], target: str, scales: Scales, tolerance: Tolerance
) -> list[Cause]:
    """A candidate at every size at which it is tried.

    Args:
        kind: of effect.
        target: where it may be at work.
        scales: of what size it is tried.
        tolerance: of the campaign.
    """
    trials = kind(target).trials(scales)
    out = []
    for t in trials:
        effect = kind(target).bounded(**t)
        out.append(cause_of(effect, trials, tolerance))
    return out
