"""What a record would tell, should one model be true: the other is refitted with it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.data.record import MeasuredRecord
from picchio.diagnosis.percussion.fit.least_squares import Fit, fit
from picchio.measurement.noise.autoregression import AutoRegression
from picchio.measurement.noise.level import Noise
from picchio.prediction.percussion import PercussionSetup

_TURNS = 8


def expected_rise(
    problem: Problem,
    setup: PercussionSetup,
    sensor: str,
    fresh: Mapping[str, float],
    true: Fit,
    other: Fit,
) -> float:
    """How far chi-square would rise by a record in which one model is true, the other refitted.

    Slopes say so as long as nothing moves far; what the records so far leave open may move far.

    Args:
        problem: what was measured.
        setup: the record that might be taken.
        sensor: kind of sensor that is there beside those of the campaign.
        fresh: as `picchio.diagnosis.percussion.follow_up.separation.new_noise`.
        true: simulated in the record, without noise.
        other: fitted to all records.
    """
    record = _simulated(problem, setup, sensor, fresh, true)
    hypothesis = other.hypothesis
    after = fit(problem, hypothesis, [*problem.records, record], None, iterations=_TURNS)
    # Samples near edges count as noise, whatever is true.
    (own,) = problem.residuals(true.hypothesis.effects, [record])
    return max(after.cost - other.cost - float((own**2).sum()), 0.0)


def _simulated(
    problem: Problem,
    setup: PercussionSetup,
    sensor: str,
    fresh: Mapping[str, float],
    true: Fit,
) -> MeasuredRecord:
    # Under a name of its own: what is known by the others' names is not asked for.
    setup = replace(setup, name="next")
    read = setup.predict(problem.model.with_effects(true.hypothesis.effects))
    rate = 1.0 / setup.samples.step
    noise: dict[str, Noise] = {}
    for channel in setup.channels:
        known = problem.noise.get(channel.name)
        if known is not None and known.std > 0.0:
            noise[channel.name] = known.at(rate)
        elif channel.group.split(".")[0] == sensor:
            std = fresh[channel.group]
            white = AutoRegression(np.zeros(0), std**2)
            noise[channel.name] = Noise(channel.name, channel.unit, rate, std, 1.0, white)
    values = {name: read[name] for name in noise}
    return MeasuredRecord(setup, values, noise, problem.n_poses)
