"""The gain on records that neither the fit nor the choice of causes has seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from picchio.diagnosis.percussion.criteria.remainder import ALLOWED
from picchio.diagnosis.percussion.criteria.whiteness import excess_by_band
from picchio.diagnosis.percussion.data.problem import MeasuredRecord, Problem, signal_power
from picchio.diagnosis.percussion.fit.drawn import current_hidden, fit_latent, with_hidden
from picchio.diagnosis.percussion.fit.least_squares import fit
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.tolerance.linearise import About, about_another
from picchio.diagnosis.result import Gain, Left


def holdout_gain(
    problem: Problem,
    baseline: Hypothesis,
    extended: Hypothesis,
    train: Sequence[MeasuredRecord],
    kept: Sequence[MeasuredRecord],
    about: About | None = None,
) -> Gain:
    """Normalised RMS residuals of both models on the records held out.

    Each channel's residual is divided by its noise's standard deviation and the square root of
    its samples; all together are relative to the signal so weighted.

    Args:
        problem: data and noise, linearised about the extended model.
        baseline: nuisances alone.
        extended: with the causes.
        train: records that were fitted.
        kept: records held out; those fitted count where there are none.
        about: what the baseline's records were linearised about; the same where None.
    """
    judged = list(kept) or list(train)
    signal, floor = 0.0, 0
    for record in judged:
        for channel in record.channels:
            values = record.values[channel.name]
            offset = values.mean() if channel.kind.free_offset else 0.0
            signal += float(np.mean(((values - offset) / record.noise[channel.name].std) ** 2))
            floor += 1
    signal = max(signal, 1e-300)
    with about_another(problem, about):
        before = _mean_square(problem, baseline, judged)
    return Gain(
        tuple(r.name for r in train),
        tuple(r.name for r in judged),
        float(np.sqrt(before / signal)),
        float(np.sqrt(_mean_square(problem, extended, judged) / signal)),
        float(np.sqrt(floor / signal)),
        floor,
    )


def held_out_remainder(
    problem: Problem, hypothesis: Hypothesis, judged: Sequence[MeasuredRecord]
) -> Left:
    """What is left beside noise, the tolerances integrated out, of the signal, RMS.

    Args:
        problem: data and noise.
        hypothesis: of the model.
        judged: records.
    """
    hypothesis = _own_latent(problem, hypothesis, judged)
    excess: dict[int, float] = {}
    signal: dict[int, float] = {}
    residuals = problem.residuals(hypothesis.effects, judged)
    for record, residual in zip(judged, residuals, strict=True):
        own = float((residual**2).sum() - residual.size)
        excess[record.pose] = excess.get(record.pose, 0.0) + own
        signal[record.pose] = signal.get(record.pose, 0.0) + signal_power([record])

    def share(poses: Sequence[int]) -> float:
        left = max(sum(excess[p] for p in poses), 0.0)
        return float(np.sqrt(left / max(sum(signal[p] for p in poses), 1e-300)))

    whole = share(list(excess))
    all_signal = max(sum(signal.values()), 1e-300)
    bands = excess_by_band(problem, judged, residuals)
    return Left(
        whole,
        whole <= ALLOWED,
        {f"pose {p + 1}": share([p]) for p in sorted(excess)},
        {band: float(np.sqrt(left / all_signal)) for band, left in bands.items()},
    )


def _mean_square(
    problem: Problem, hypothesis: Hypothesis, records: Sequence[MeasuredRecord]
) -> float:
    hypothesis = _own_latent(problem, hypothesis, records)
    total = 0.0
    for residual in problem.residuals(hypothesis.effects, records):
        total += float((residual**2).mean(axis=1).sum())
    return total


def _own_latent(
    problem: Problem, hypothesis: Hypothesis, records: Sequence[MeasuredRecord]
) -> Hypothesis:
    """Numbers that are drawn anew in every record must be found in these, too."""
    for effect in hypothesis.drawing:
        found = fit(problem, hypothesis, records, None, iterations=0)
        found = fit_latent(problem, found, effect)
        whole = {**effect.hidden, **current_hidden(found.hypothesis, effect.label)}
        hypothesis = replace(with_hidden(hypothesis, effect, whole), drawn=(), priors=())
    return hypothesis
