"""Numbers that are drawn anew in every record or for every blow: lines, late and missing blows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.evidence.arrow import reduce
from picchio.diagnosis.evidence.estimate import Fit, scaled
from picchio.diagnosis.evidence.numbers import Numbers
from picchio.diagnosis.percussion.likelihood.causes import Cause, cause_of
from picchio.diagnosis.percussion.likelihood.percussion import Drawn, Percussion
from picchio.diagnosis.percussion.tolerance.nudges import Inexact
from picchio.model.effects.effect import Effect
from picchio.model.effects.scales import Scales

Kind = tuple[type[Effect], str]
_SPREADS = np.geomspace(1e-5, 1.0, 16)  # of the reading, or of the time between blows
_FREE = 0.5  # a standard deviation of a blow's height where it may be missing
_GONE = 0.5  # of the median: a blow lower than this is none
_MANY = 0.4  # of all blows: more are not missing, something else is wrong


def drawn_candidates(fit: Fit, kinds: Sequence[Kind], scales: Scales) -> list[tuple[float, Cause]]:
    """What such numbers gain in evidence at a fit, each with its most probable spread.

    Args:
        fit: about which.
        kinds: effects and targets.
        scales: of readings and times.

    Returns:
        (gain in nats, cause), the best first.
    """
    found = []
    have = {cause.label for cause in fit.likelihood.causes}
    tolerance = fit.likelihood.data.problem.campaign.tolerance
    for kind, target in kinds:
        latent = kind.latent
        if latent is None or latent.whole or f"{kind.name}:{target}" in have:
            continue
        unit = scales.reading[target][0] if target in scales.reading else scales.period
        tolerated = float(getattr(tolerance, kind.exceeds, 0.0)) if kind.exceeds else 0.0
        for values in kind(target).trials(scales):
            effect = kind(target).bounded(**{**values, latent.spread: unit})
            cause = cause_of(effect, [values], tolerance)
            likelihood = replace(fit.likelihood, causes=(*fit.likelihood.causes, cause))
            at = likelihood.start(fit.at, fit.likelihood)
            grams = likelihood.linearised(at).grams(fit.residuals)
            gains = [
                _evidence(likelihood, grams, at, fit, float(np.hypot(size, tolerated)))
                for size in (0.0, *(_SPREADS * unit))
            ]
            best = int(np.argmax(gains[1:]))
            spread = {latent.spread: float(_SPREADS[best] * unit)}
            cause = replace(cause, effect=effect.with_values(**spread))
            found.append((gains[1 + best] - gains[0], cause))
    return sorted(found, key=lambda one: -one[0])


def _evidence(
    likelihood: Percussion, grams: Sequence[FloatArray], at: Numbers, fit: Fit, spread: float
) -> float:
    """Log evidence by slopes, up to a constant, where what is drawn has one spread."""
    std = likelihood.prior.std
    own = tuple(
        np.array([max(spread, 1e-12) if isinstance(one, Drawn) else size
                  for (one, _), size in zip(likelihood.own(k), std.records[k], strict=True)])
        for k in range(len(std.records))
    )  # fmt: skip
    std = replace(std, records=own)
    there = (at + likelihood.prior.mean.scaled(-1.0)) / std
    products, of, weights = (
        scaled(grams, likelihood.group_of, std),
        likelihood.group_of,
        fit.objective.weights,
    )
    system = reduce(products, of, weights, there)
    step = system.back(np.linalg.solve(system.precision, system.pull))
    log_det = system.log_determinant + float(np.linalg.slogdet(system.precision)[1])
    gain = 0.0
    for k, gram in enumerate(products):
        move = np.concatenate([step.records[k], step.groups[of[k]], step.shared])
        after = np.append(-move, 1.0)
        gain += 0.5 * weights[of[k]] * float(gram[-1, -1] - after @ gram @ after)
    gain += 0.5 * (there.square - (there + step).square)
    return gain - 0.5 * log_det


def missing_blows(fit: Fit, kinds: Sequence[Kind]) -> tuple[Cause | None, int]:
    """Which blows are missing, by one elimination with all heights free.

    Args:
        fit: about which.
        kinds: effects and targets.

    Returns:
        the cause, and how many are missing; None where none is, or most.
    """
    kind = next((k for k, _ in kinds if k.latent is not None and k.latent.whole), None)
    if kind is None:
        return None, 0
    of = fit.likelihood
    known = next((c.effect.hidden for c in of.causes if isinstance(c.effect, kind)), {})
    sigma = of.data.problem.campaign.tolerance.blow_force
    if not sigma:
        return None, 0
    heights = [
        [blow if isinstance(one, Inexact) and one.key == "blow_force" else -1 for one, blow in own]
        for own in map(of.own, range(len(of.data.records)))
    ]
    std = of.prior.std
    own = tuple(np.where(np.array(h) >= 0, _FREE / sigma, s)
                for h, s in zip(heights, std.records, strict=True))  # fmt: skip
    std = replace(std, records=own)
    there = (fit.at + of.prior.mean.scaled(-1.0)) / std
    grams = scaled(fit.linear.grams(fit.residuals), of.group_of, std)
    system = reduce(grams, of.group_of, fit.objective.weights, there)
    step = system.back(np.linalg.solve(system.precision, system.pull)) * std
    hidden, count, every = {}, 0, 0
    for k, record in enumerate(of.data.records):
        hits = int(np.unique(record.setup.blows.hit).size)
        height = np.ones(hits)
        for blow, x, dx in zip(heights[k], fit.at.records[k], step.records[k], strict=True):
            if blow >= 0:
                height[blow] = 1.0 + sigma * (x + dx)
        gone = height < _GONE * float(np.median(height))
        gone |= np.array(known.get(record.name, (0.0,) * hits)) > 0.5
        gone[0] = False
        hidden[record.name] = tuple(gone.astype(float))
        count, every = count + int(gone.sum()), every + hits
    if not count or count > _MANY * every:
        return None, 0
    share = count / max(every - len(hidden), 1)
    return Cause(kind("tool", fraction=min(share, 1.0)).with_hidden(hidden), ()), count
