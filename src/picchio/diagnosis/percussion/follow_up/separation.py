"""By how much a record would tell a model from its rivals, whatever else is refitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from picchio.campaign.channels import addable_kinds
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.diagnosis.percussion.data.problem import MeasuredRecord, Problem
from picchio.diagnosis.percussion.fit.least_squares import Fit, fit
from picchio.diagnosis.percussion.tolerance.linearise import about_another, beside
from picchio.measurement.noise.autoregression import AutoRegression
from picchio.measurement.noise.level import Noise
from picchio.prediction.percussion import PercussionSetup

# Relative noise of a sensor that the campaign does not have.
_NEW_SENSOR = 0.01
_TURNS = 8


def new_noise(problem: Problem, setups: Sequence[PercussionSetup], best: Fit) -> dict[str, float]:
    """Group -> standard deviation of the noise of sensors that the campaign does not have.

    A hundredth of what they would read in all these records, and the same in each: what moves
    little there is told by them no better.
    """
    model = problem.model.with_effects(best.hypothesis.effects)
    squares: dict[str, list[float]] = {}
    for setup in setups:
        try:
            read = setup.predict(model)
        except InputError:  # the model is none there
            continue
        for channel in setup.channels:
            if not _known(problem, channel.name):
                mean = float(np.mean(read[channel.name] ** 2))
                squares.setdefault(channel.group, []).append(mean)
    return {g: max(_NEW_SENSOR * float(np.sqrt(np.mean(s))), 1e-300) for g, s in squares.items()}


def _known(problem: Problem, name: str) -> float:
    """Standard deviation of a channel's noise; 0 where the campaign does not have it."""
    return problem.noise[name].std if name in problem.noise else 0.0


@dataclass(frozen=True, eq=False)
class Contest:
    """The best model and its rivals, which a further record is to tell apart.

    Attributes:
        problem: what was measured.
        best: the best fit to all records, with its Jacobian.
        rivals: what else it might be, likewise.
        fresh: `new_noise`.
    """

    problem: Problem
    best: Fit
    rivals: Sequence[Fit]
    fresh: Mapping[str, float]

    def separations(self, setup: PercussionSetup) -> dict[str, FloatArray]:
        """Sensor -> by how much chi-square of a record would tell the best from each rival.

        By slopes: the unknowns of the one that is wrong move as far as what is known of them lets
        them.

        Args:
            setup: the record that might be taken.

        Returns:
            (2, rivals): should the best be the true one, and the rival be refitted; and the other
            way round. The two differ where what one claims is within the tolerance of something
            that the other may refit.
        """
        problem, rivals = self.problem, self.rivals
        fits = (self.best, *rivals)
        read = [setup.predict(problem.model.with_effects(f.hypothesis.effects)) for f in fits]
        moves = [_moves(problem, setup, f, at) for f, at in zip(fits, read, strict=True)]
        own = [c.name for c in setup.channels if c.group in problem.groups]
        noise = {c.name: _known(problem, c.name) or self.fresh[c.group] for c in setup.channels}
        found = {}
        for kind in addable_kinds():
            rows = own + [n for n in read[0] if n.startswith(f"{kind.name}.") and n not in own]
            slopes = [
                np.concatenate([m[n] / noise[n] for n in rows]) if m else None for m, _ in moves
            ]
            told = np.zeros((2, len(rivals)))
            for k in range(1, len(fits)):
                left = np.concatenate([(read[k][n] - read[0][n]) / noise[n] for n in rows])
                told[:, k - 1] = [_left(left, slopes[m], moves[m][1]) for m in (k, 0)]
            found[kind.name] = told
        return found

    def expected_rise(self, setup: PercussionSetup, sensor: str, true: Fit, other: Fit) -> float:
        """How far chi-square would rise by a record in which one model is true, the other refitted.

        Slopes say so as long as nothing moves far; what the records so far leave open may move far.

        Args:
            setup: the record that might be taken.
            sensor: kind of sensor that is there beside those of the campaign.
            true: simulated in the record, without noise.
            other: fitted to all records.
        """
        problem = self.problem
        # Under a name of its own: what is known by the others' names is not asked for.
        record = self._imagined(replace(setup, name="next"), sensor)
        with about_another(problem):
            moved = beside(problem, record, other.hypothesis)
            there, more = (record, ()) if moved is None else (moved.record, moved.effects)
            model = problem.model.with_effects((*true.hypothesis.effects, *more))
            read = there.setup.predict(model)
            record = replace(record, values={name: read[name] for name in record.values})
            if moved is not None:
                there = replace(there, values=record.values)
                problem.moved = {**problem.moved, record.name: replace(moved, record=there)}
                problem.renew()
            records = [*problem.records, record]
            after = fit(problem, other.hypothesis, records, None, iterations=_TURNS)
            # Samples near edges count as noise, whatever is true.
            own = _square(problem.residuals(true.hypothesis.effects, records))
            own -= _square(problem.residuals(true.hypothesis.effects))
            return max(after.cost - other.cost - own, 0.0)

    def _imagined(self, setup: PercussionSetup, sensor: str) -> MeasuredRecord:
        """A record that might be taken: nothing is read yet."""
        problem = self.problem
        rate = 1.0 / setup.samples.step
        noise: dict[str, Noise] = {}
        for channel in setup.channels:
            known = problem.noise.get(channel.name)
            if known is not None and known.std > 0.0:
                noise[channel.name] = known.at(rate)
            elif channel.kind.name == sensor:
                std = self.fresh[channel.group]
                white = AutoRegression(np.zeros(0), std**2)
                noise[channel.name] = Noise(channel.name, channel.unit, rate, std, 1.0, white)
        values = dict.fromkeys(noise, np.zeros(setup.samples.count))
        return MeasuredRecord(setup, values, noise, problem.n_poses)


def _square(residuals: Sequence[FloatArray]) -> float:
    return float(sum((r * r).sum() for r in residuals))


def _moves(
    problem: Problem, setup: PercussionSetup, fitted: Fit, here: dict[str, FloatArray]
) -> tuple[dict[str, FloatArray], FloatArray]:
    """Channel -> (samples, unknowns) of a fitted model, and the unknowns' covariance."""
    if fitted.jacobians is None:
        return {}, np.zeros((0, 0))
    covariance = fitted.covariance()
    vector = fitted.hypothesis.vector()
    steps = np.clip(np.sqrt(np.maximum(covariance.diagonal(), 0.0)), 1e-6, 1e-3)
    columns: dict[str, list[FloatArray]] = {name: [] for name in here}
    for k, step in enumerate(steps):
        moved = vector.copy()
        moved[k] += step
        effects = fitted.hypothesis.at(moved).effects
        there = setup.predict(problem.model.with_effects(effects))
        for name in here:
            columns[name].append((there[name] - here[name]) / step)
    return {name: np.stack(c, axis=1) for name, c in columns.items()}, covariance


def _left(left: FloatArray, slopes: FloatArray | None, covariance: FloatArray) -> float:
    """Chi-square of a difference after what the unknowns, within what is known, can do."""
    total = float(left @ left)
    if slopes is None:
        return total
    scaled = slopes @ _root(covariance)
    right = scaled.T @ left
    return total - float(right @ np.linalg.solve(np.eye(right.size) + scaled.T @ scaled, right))


def _root(covariance: FloatArray) -> FloatArray:
    """(n, n) whose product with its transpose is the covariance, singular or not."""
    scale = np.sqrt(np.maximum(covariance.diagonal(), 0.0))
    outer = np.outer(scale, scale)
    related = np.where(outer > 0.0, covariance / np.where(outer > 0.0, outer, 1.0), 0.0)
    values, vectors = np.linalg.eigh(0.5 * (related + related.T))
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))
