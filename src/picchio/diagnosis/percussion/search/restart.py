"""Restarts: parameters that a fit has pushed to where they do nothing start again."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from picchio.core.errors import InputError
from picchio.diagnosis.attempt import attempt
from picchio.diagnosis.percussion.criteria.remainder import allowed
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.fit.least_squares import Fit, fit_growing, is_nonsmooth
from picchio.diagnosis.percussion.search.alike import settled_by_itself
from picchio.diagnosis.percussion.search.state import Search
from picchio.model.effects.effect import Effect
from picchio.model.effects.scales import Scales

# So many times smaller or larger than its typical size, a logarithmic parameter has no slope left
# that could lead a fit back.
_FAR = 1e3
# A parameter that, changed by this factor, changes chi-square by no more than one, does nothing.
_MOVED = 1.3
# Where there is a kink, a small error early is a large one late: not all at once, s.
_GROWING = (0.16, 0.3, 0.6, None)


def restarted(search: Search, best: Fit) -> Fit:
    """The fit, or a better one from where what does nothing stands at one of its usual sizes again.

    What is far off is put back always; where more than noise is left, so is what does nothing where
    it is, such as the preload of a contact that never opens: it may have to be much smaller. A
    whole number, such as a filter's order, then takes each of its other values. Where something is
    not exact, it does so always, and that is sought anew beside it: it may have made up for another
    kind of filter, and noise hides in all samples together what is left.

    Args:
        search: data, sizes and records.
        best: the fit.
    """
    found = best
    problem, noisy = search.problem, not search.leaves_noise(best)
    for effect in best.hypothesis.causes:
        for name, sizes in _usual(effect, search.scales).items():
            (parameter,) = (p for p in effect.parameters if p.name == name)
            if parameter.whole:
                again = noisy or allowed(problem)
            else:
                far = [not 1.0 / _FAR < effect.values[name] / size < _FAR for size in sizes]
                again = all(far) and parameter.logarithmic
                again = again or (noisy and _does_nothing(problem, best, effect, name))
            if not again:
                continue
            for size in sizes:
                effects = tuple(
                    e.with_values(**{name: size}) if e.label == effect.label else e
                    for e in found.hypothesis.effects
                )
                start = replace(found.hypothesis, effects=effects)
                windows = _GROWING if is_nonsmooth(start) else (None,)
                grow = partial(fit_growing, windows=windows, iterations=8)
                tried = attempt(effect.label, partial(grow, problem, start, search.records))
                if parameter.whole and tried is not None and allowed(problem):
                    tried, about = settled_by_itself(search, effect.label, tried)
                    if tried is not None and tried.cost < found.cost:
                        about.restore(problem)
                found = tried if tried is not None and tried.cost < found.cost else found
    return found


def _usual(effect: Effect, scales: Scales) -> dict[str, list[float]]:
    """The sizes at which an effect's parameters are tried: above 0, or another whole number."""
    sizes: dict[str, list[float]] = {}
    if effect.latent is not None or effect.discrete:
        return sizes
    for trial in effect.trials(scales):
        for name, wanted in trial.items():
            value = effect.bounded(**{name: wanted}).values[name]
            whole = any(p.whole for p in effect.parameters if p.name == name)
            fits = value != effect.values[name] if whole else value > 0.0
            if fits and value not in sizes.get(name, []):
                sizes.setdefault(name, []).append(value)
    return sizes


def _does_nothing(problem: Problem, best: Fit, effect: Effect, name: str) -> bool:
    """Whether the motion is the same with a parameter a little larger or smaller."""
    told = False
    for factor in (_MOVED, 1.0 / _MOVED):
        try:
            moved = effect.with_values(**{name: factor * effect.values[name]})
            effects = tuple(moved if e is effect else e for e in best.hypothesis.effects)
            there = problem.residuals(effects, best.records, best.end)
        except InputError:  # beyond its bounds
            continue
        pairs = zip(there, best.residuals, strict=True)
        change = sum(float(((a - b) ** 2).sum()) for a, b in pairs)
        if change > 1.0:
            return False
        told = True
    return told
