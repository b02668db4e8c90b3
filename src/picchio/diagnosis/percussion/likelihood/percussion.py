"""Percussion records under one hypothesis: residuals by the full model, slopes by a linear one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from picchio.core.arrays import BoolArray, FloatArray
from picchio.core.errors import InputError
from picchio.diagnosis.evidence.estimate import Prior
from picchio.diagnosis.evidence.numbers import Numbers
from picchio.diagnosis.percussion.data.problem import (
    MeasuredRecord,
    Problem,
    near_edges,
    residual,
)
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis as Old
from picchio.diagnosis.percussion.likelihood.factor import FACTOR, Factor
from picchio.diagnosis.percussion.tolerance.nudges import Inexact, inexact, nudged
from picchio.model.effects.effect import Effect
from picchio.model.model import Model

if TYPE_CHECKING:
    from picchio.diagnosis.percussion.likelihood.slopes import Slopes

_ONCE_A_POSE = ("pose_repeat", "damping_by_mode")


@dataclass(frozen=True, eq=False)
class Data:
    """A campaign's records and everything in them that is never exact.

    Attributes:
        problem: robot, records, noise.
        base: factors on what the files state: stiffness, damping, force.
        shared: numbers of the campaign.
        groups: of a pose, as its first record has them.
        own: of each record, with the blow that each belongs to, or -1.
        sought: effects whose values in the files count for nothing.
        chosen: which of the records; all where None.
    """

    problem: Problem
    base: tuple[Factor, ...]
    shared: tuple[Inexact, ...]
    groups: tuple[tuple[Inexact, ...], ...]
    own: tuple[tuple[tuple[Inexact, int], ...], ...]

    @classmethod
    def of(cls, problem: Problem, sought: frozenset[str] = frozenset()) -> Data:
        """From a problem.

        Args:
            problem: robot, records and noise.
            sought: effects whose values in the files count for nothing: known within a factor.
        """
        old = Old.nominal(problem)
        tolerance = problem.campaign.tolerance
        base = []
        for effect in old.effects:
            sigma = old.known.sigma(effect.label)
            if sigma is None:
                sigma = float(getattr(tolerance, effect.tolerance))
            sigma = math.hypot(FACTOR, sigma) if effect.name in sought else max(sigma, 1e-6)
            base.append(Factor(effect, sigma))
        lists = [inexact(problem, r, tolerance, measured=False) for r in problem.records]
        shared: dict[str, Inexact] = {}
        groups: dict[int, tuple[Inexact, ...]] = {}
        own = []
        for record, found in zip(problem.records, lists, strict=True):
            for one in found:
                if one.once:
                    shared.setdefault(one.name, one)
            groups.setdefault(record.pose, tuple(o for o in found if o.key in _ONCE_A_POSE))
            mine: list[tuple[Inexact, int]] = []
            for one in found:
                if one.once or one.key in _ONCE_A_POSE:
                    continue
                if one.each_blow:
                    hits = np.unique(record.setup.blows.hit).size
                    first = 1 if one.key == "blow_time" else 0
                    mine += [(one, k) for k in range(first, hits)]
                else:
                    mine.append((one, -1))
            own.append(tuple(mine))
        return cls(
            problem,
            tuple(base),
            tuple(shared.values()),
            tuple(groups[p] for p in sorted(groups)),
            tuple(own),
            sought,
        )

    sought: frozenset[str] = frozenset()
    chosen: tuple[int, ...] | None = None

    @cached_property
    def records(self) -> list[MeasuredRecord]:
        """The records."""
        every = self.problem.records
        return every if self.chosen is None else [every[k] for k in self.chosen]

    @property
    def one_a_pose(self) -> list[int]:
        """A record of each pose, each of another direction."""
        by_pose: dict[int, list[int]] = {}
        for k, record in enumerate(self.records):
            by_pose.setdefault(record.pose, []).append(k)
        return [own[i % len(own)] for i, own in enumerate(by_pose.values())]

    def only(self, chosen: Sequence[int]) -> Data:
        """Some of the records.

        Args:
            chosen: which records.
        """
        return replace(self, chosen=tuple(chosen), own=tuple(self.own[k] for k in chosen))


@dataclass(frozen=True, eq=False)
class Percussion:
    """The records under a hypothesis, up to a time.

    Attributes:
        data: records and numbers.
        end: s; None for all.
        edges: where samples near a jump are left out: (record) -> masks.
    """

    data: Data
    end: float | None = None
    edges: tuple[dict[str, BoolArray] | None, ...] = ()
    light: bool = False

    def __post_init__(self) -> None:
        if not self.edges:
            edges = self._edges([c.effect for c in self.data.base])
            object.__setattr__(self, "edges", edges)

    def _edges(self, effects: Sequence[Effect]) -> tuple[dict[str, BoolArray] | None, ...]:
        model = self.data.problem.model.with_effects(effects)
        return tuple(near_edges(r.until(self.end), model, r.smeared) for r in self.data.records)

    # Layout -----------------------------------------------------------------------------------
    @cached_property
    def names(self) -> list[str]:
        """Of the shared numbers: first the factors, then what is never exact."""
        return [each.label for each in self.data.base] + [each.name for each in self.data.shared]

    @cached_property
    def prior(self) -> Prior:
        """Of all numbers."""
        base, shared = self.data.base, self.data.shared
        tiny = 1e-6 if self.light else 1.0
        std = np.array([each.std for each in base] + [tiny] * len(shared))
        mean = np.zeros(std.size)
        one_way = [0.0 if o.one_way and not o.each_blow else -np.inf for o in shared]
        low = np.array([each.ends[0] for each in base] + one_way)
        high = np.array([each.ends[1] for each in base] + [np.inf] * len(shared))
        groups = tuple(np.full(len(g), tiny) for g in self.data.groups)
        records = tuple(np.full(len(own), tiny) for own in self.data.own)
        zero = lambda parts: tuple(np.zeros(p.size) for p in parts)  # noqa: E731
        return Prior(
            Numbers(mean, zero(groups), zero(records)), Numbers(std, groups, records), low, high
        )

    @property
    def group_of(self) -> list[int]:
        """The pose of each record."""
        return [r.pose for r in self.data.records]

    @cached_property
    def samples(self) -> list[int]:
        """Of each record, all its channels together; what is left out counts as one each."""
        return [r.until(self.end).samples.count * len(r.values) for r in self.data.records]

    @cached_property
    def signal(self) -> list[float]:
        """Power of what was measured, in units of the noise, whitened."""
        out = []
        for r in self.data.records:
            count = r.until(self.end).samples.count
            total = 0.0
            for name, values in r.values.items():
                total += float((r.noise[name].model.whiten(values[:count]) ** 2).sum())
            out.append(total)
        return out

    def start(self, at: Numbers | None = None, like: Percussion | None = None) -> Numbers:
        """Numbers to begin at: those of another where it has them, else as stated.

        Args:
            at: numbers of the other hypothesis; None for the stated ones.
            like: the other hypothesis.
        """
        known = {}
        if at is not None and like is not None:
            known = dict(zip(like.names, at.shared, strict=True))
        shared = np.array([known.get(name, 0.0) for name in self.names])
        zero = self.prior.mean
        if at is None or like is None or like.data.chosen != self.data.chosen:
            return Numbers(shared, zero.groups, zero.records)
        return Numbers(shared, at.groups, at.records)

    # The model at a point ----------------------------------------------------------------------
    def effects_at(self, at: Numbers) -> tuple[Effect, ...]:
        """Effects of the files' values.

        Args:
            at: the numbers.

        Returns:
            in the order of the factors.
        """
        return tuple(one.at(float(u)) for one, u in zip(self.data.base, at.shared, strict=False))

    def moved(self, record: int, at: Numbers) -> list[tuple[Inexact, FloatArray]]:
        """What is moved in a record, by how many standard deviations.

        Args:
            record: which.
            at: the numbers.
        """
        if self.light:
            return []
        k = len(self.data.base)
        pose = self.data.records[record].pose
        out = [(o, at.shared[k + i : k + i + 1]) for i, o in enumerate(self.data.shared)]
        out += [(o, at.groups[pose][i : i + 1]) for i, o in enumerate(self.data.groups[pose])]
        blows: dict[str, tuple[Inexact, FloatArray]] = {}
        for (o, blow), x in zip(self.data.own[record], at.records[record], strict=True):
            if blow < 0:
                out.append((o, np.array([x])))
                continue
            if o.name not in blows:
                hits = np.unique(self.data.records[record].setup.blows.hit).size
                blows[o.name] = (o, np.zeros(hits))
            blows[o.name][1][blow] = x
        out += blows.values()
        return [(o, s) for o, s in out if s.any()]

    def there(
        self, record: int, at: Numbers, effects: Sequence[Effect]
    ) -> tuple[MeasuredRecord, Model]:
        """A record with its pose moved, and the model with everything in it.

        Args:
            record: which.
            at: the numbers.
            effects: at these numbers.
        """
        own = self.data.records[record]
        moved, more = nudged(own, self.moved(record, at))
        return moved, self.data.problem.model.with_effects((*effects, *more))

    def residuals(self, at: Numbers) -> list[FloatArray]:
        """Whitened (channels, m) of each record.

        Args:
            at: the numbers.

        Raises:
            InputError: no model there.
        """
        effects = self.effects_at(at)
        out = []
        for k in range(len(self.data.records)):
            record, model = self.there(k, at, effects)
            out.append(self.residual(k, record, model))
        return out

    def residual(self, k: int, record: MeasuredRecord, model: Model) -> FloatArray:
        """Of one record under a model.

        Args:
            k: which record.
            record: with its pose moved.
            model: with everything in it.

        Raises:
            InputError: no model there, or one whose motion diverges.
        """
        try:
            with np.errstate(all="ignore"):
                rows = residual(record, model, self.end, lambda: self.edges[k])
        except (ArithmeticError, np.linalg.LinAlgError) as error:
            raise InputError(f"no model that can be computed: {error}") from error
        if not np.isfinite(rows).all():
            raise InputError("no model that can be computed: the motion diverges")
        return rows

    def linearised(self, at: Numbers) -> Slopes:
        """The slopes there.

        Args:
            at: the numbers.
        """
        from picchio.diagnosis.percussion.likelihood.slopes import Slopes

        return Slopes.of(self, at)
