"""Which of the trials of a round is chosen: compared over the same samples, and held out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from picchio.diagnosis.percussion.evidence import weigh
from picchio.diagnosis.percussion.fit import fit
from picchio.diagnosis.percussion.measured_record import MeasuredRecord
from picchio.diagnosis.percussion.problem import Problem
from picchio.diagnosis.percussion.trials import SAME, Trial, score
from picchio.model.effects import effect_class

# Fall of BIC up to which a rival may owe its place to the samples that it counts as known.
_ROUGH = 100.0


def held_out_choice(tied: Sequence[tuple[Trial, float | None]]) -> Trial | None:
    """Of trials that do as well, the first that the records held out confirm, or clearly prefer.

    Args:
        tied: with the fall of chi-square there, None where they can't tell.
    """
    held = [(t, gain) for t, gain in tied if gain is None or gain > 0.0]
    if not held:
        return None
    best, least = held[0]
    if least is None:
        return best
    other, most = max(held, key=lambda each: -math.inf if each[1] is None else each[1])
    return other if most is not None and most > least + SAME else best


def over_the_same_samples(
    problem: Problem, trials: Sequence[Trial], records: Sequence[MeasuredRecord]
) -> list[Trial]:
    """Trials, the best first; where that leaves noise, close rivals are compared with it anew.

    Each was fitted with its own choice of which samples are known, by which its cost is rough: a
    fit may stop early, or gain by what it leaves out. Now all count those of the best.
    """
    best = trials[0]
    close = [
        t
        for t in trials
        if t.finished(records)
        and t.score - best.score < _ROUGH
        and effect_class(t.label.split(":")[0]).latent is None
    ]
    if best not in close or len(close) < 2:
        return list(trials)
    if not weigh(problem, best.fit.residuals, best.fit.records).is_noise:
        return list(trials)
    with problem.pinned(best.fit.hypothesis.effects):
        again = []
        for t in close:
            there = fit(problem, t.fit.hypothesis, records, None, iterations=6)
            again.append(replace(t, fit=there, score=score(there)))
    others = [t for t in trials if t not in close]
    return sorted([*again, *others], key=lambda t: t.score)
