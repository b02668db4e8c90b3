"""Parameters that a fit has pushed to where they do nothing are put back, and fitted again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from picchio.diagnosis.percussion.fit import Fit, fit
from picchio.diagnosis.percussion.problem import MeasuredRecord, Problem
from picchio.model import Effect
from picchio.model.effects import Scales

# So many times smaller or larger than its typical size, a logarithmic parameter has no slope left
# that could lead a fit back.
_FAR = 1e3


def unstuck(problem: Problem, best: Fit, scales: Scales, records: Sequence[MeasuredRecord]) -> Fit:
    """The fit, or a better one from where what has run off stands at its typical size again.

    Args:
        problem: data and noise.
        best: the fit.
        scales: sizes in this campaign.
        records: that are fitted.
    """
    effects = tuple(_returned(effect, scales) for effect in best.hypothesis.effects)
    moved = {e.label for e, old in zip(effects, best.hypothesis.effects, strict=True) if e != old}
    if not moved & best.hypothesis.labels:
        return best
    again = fit(problem, replace(best.hypothesis, effects=effects), records, None, iterations=8)
    return again if again.cost < best.cost else best


def _returned(effect: Effect, scales: Scales) -> Effect:
    if effect.latent is not None or effect.discrete:
        return effect
    typical: dict[str, float] = {}
    for trial in effect.trials(scales):
        for name, value in trial.items():
            typical.setdefault(name, value)
    gone = {}
    for p in effect.parameters:
        size = typical.get(p.name, 0.0)
        if p.logarithmic and size > 0.0:
            ratio = effect.values[p.name] / size
            if not 1.0 / _FAR < ratio < _FAR:
                gone[p.name] = size
    return effect.with_values(**gone) if gone else effect
