"""What a wanted life allows: force, hits, rivets, shaft radius and reducer, over every part."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from picchio.core import spoken
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.core.listing import InUnit, Key, Listing
from picchio.core.processes import one_thread
from picchio.core.results import TableResult
from picchio.core.shown import seeing
from picchio.fatigue.counting.counter import Residue, rainflow
from picchio.fatigue.counting.cycles import Cycles
from picchio.fatigue.mean_stress import Rule
from picchio.fatigue.miner import damage, utilisation
from picchio.fatigue.shaft_stress import check_shaft
from picchio.fatigue.sn.curve import SNCurve
from picchio.fatigue.sn.library import DEFAULT_SN_CURVE, load_sn_curve
from picchio.model.model import Model, ModelLike
from picchio.robot.annotations.flexibility import estimate_notice
from picchio.robot.drives.reducer import Reducer, all_reducers
from picchio.robot.estimate.rigid import left_rigid
from picchio.robot.joint import Joint, Strength, is_drive
from picchio.studies.assessment.verdict import SHAFT_TOLERANCE, Status, softer
from picchio.studies.default_task import LIFE, TaskLike, task_of
from picchio.studies.rivet.life_rules import RainflowRule, curves_of
from picchio.studies.rivet.pose import JointLoad, need_springs
from picchio.studies.rivet.variation import VariedRivet, WornParts, rivets_of
from picchio.studies.tasks import Task
from picchio.studies.uncertainty.cases import Cases
from picchio.studies.uncertainty.drawn import interval

SURE = 0.9
"""Share of the drawn cases that must hold for a yes."""
_MOST_HITS = 1 << 10
# A value given lies this far on the safe side, relative, so that rounding does not undo it.
_GUARD = 1e-11
# How near the allowable force is to the least that is too much, where every trial is integrated.
_NONLINEAR_TOLERANCE = 1e-9
# A torque, N m, and a stress, Pa, below these are rounding.
_NO_TORQUE, _NO_STRESS = 1e-3, 1.0
# What is further beyond a limit, or below it, is not told apart.
_FAR = 50.0


@dataclass(frozen=True)
class Allowable:
    """What a wanted life allows one joint; the other quantities stay as they are.

    Attributes:
        joint: its name.
        rivets: the wanted life, rivets of the task's mix.
        survival: the wanted probability that a specimen lives so long; None: the curve's own.
        force_factor: by which every blow's force may be multiplied, the least over the joint's
            parts; inf where no force is too much or no part is known, 0 where gravity alone is.
        radius: m, the smallest shaft radius, at the same joint stiffness; of a joint without a
            shaft, for the default steel (or the curve that was given); NaN for a slide without one.
        hits: blows a rivet may take; None where operations differ in it, or where more than 1024
            are allowed.
        life: rivets to failure of the shaft as things are, at that survival; NaN without a shaft.
        met: whether every part of the joint holds as things are; None where it has none.
        most_rivets: the most rivets that may be wanted; None if unlimited.
        governed_by: shaft, yield or reducer: the part that limits the force; "" where none does.
        reducer: the smallest of the catalogues that bears the torque; None where none does, and
            of a slide.
        peak_torque: N m, largest magnitude of gravity and blows together; N of a slide.
        failing: what does not hold as things are, in words; "" where all does.
    """

    joint: str
    rivets: float
    survival: float | None
    force_factor: float
    radius: float
    hits: int | None
    life: float
    met: bool | None = None
    most_rivets: int | None = None
    governed_by: str = ""
    reducer: str | None = None
    peak_torque: float = math.nan
    failing: str = ""


def _needs(joint: Allowable) -> str:
    """What the task asks of a joint of which no part is known."""
    if not joint.peak_torque > _NO_TORQUE:
        return f"{joint.joint} any"
    shaft = "" if math.isnan(joint.radius) else f"{1e3 * joint.radius:.4g} mm, "
    unit = "N" if math.isnan(joint.radius) else "N m"
    small = f" ({joint.reducer})" if joint.reducer else ""
    return f"{joint.joint} {shaft}{joint.peak_torque:.4g} {unit}{small}"


@dataclass(frozen=True, repr=False)
class AllowableLoads(TableResult):
    """What a target life allows, joint by joint and for the robot.

    Attributes:
        joints: of each flexible joint.
        notes: what was left out, and why.
        force_factor: the least of the joints'.
        force: N, of the strongest blows, by which the whole robot just holds; the blows of all
            operations are scaled alike. Inf if unlimited.
        hits: blows a rivet may take; as in `Allowable`.
        contrary: why the answer cannot be told whatever the parts bear; "" where it can.
        steel: the S-N curve for the radius where a joint has no shaft.
        held: share of the drawn cases in which every part holds, where a value of the robot has a
            spread; None otherwise. A yes needs `SURE` of them.
        intervals: P10 and P90 in these cases: of "force", N, "hits" and "rivets" (None: unlimited),
            and of each joint's "peak_torque" and "reducer"; empty without spreads.
        estimated: what the drives bear is picchio's own estimate.
    """

    INDEX = "joint"
    BARS = ("force_factor",)
    PLOTS: ClassVar = {"bars": "visuals.plots.results:plot_columns"}
    UNITS: ClassVar[Mapping[str, str]] = {
        "radius": "m", "life": "1", "rivets": "1", "peak_torque": "N m",
    }  # fmt: skip

    joints: tuple[Allowable, ...]
    notes: tuple[str, ...] = ()
    force_factor: float = math.inf
    force: float = math.inf
    hits: int | None = None
    contrary: str = ""
    steel: str = DEFAULT_SN_CURVE
    held: float | None = None
    intervals: Mapping[str, Any] = field(default_factory=dict)
    estimated: bool = False

    def __iter__(self) -> Iterator[Allowable]:
        return iter(self.joints)

    def __len__(self) -> int:
        return len(self.joints)

    def __getitem__(self, index: int) -> Allowable:
        return self.joints[index]

    @property
    def met(self) -> bool | None:
        """Whether every part, as given, holds; None where a joint has none and no other fails.

        With spreads also None where it holds in too few of the drawn cases for a yes, and False
        where it holds in too few for a doubt.
        """
        told = [joint.met for joint in self.joints]
        held = 1.0 if self.held is None else self.held
        if False in told or held <= 1.0 - SURE:
            return False
        return None if None in told or held < SURE or self.contrary else True

    @property
    def yes(self) -> bool:
        """Whether the life can be promised: by drives that somebody stands for."""
        return self.met is True and not self.contrary and not self.estimated

    @property
    def tone(self) -> Status:
        """The status of an assessment that stands for the answer, on a page."""
        holds = self.met is True and not self.contrary
        return "fails" if self.met is False else "safe" if holds else "cannot-be-told"

    @property
    def rivets(self) -> int | None:
        """The most rivets that may be wanted; None if unlimited."""
        known = [joint.most_rivets for joint in self.joints if joint.most_rivets is not None]
        return min(known, default=None)

    @property
    def told(self) -> str:
        """The force that one blow may have; "" where nothing can be told."""
        if self.contrary:
            return ""
        return (
            f"Allowable force of one blow: {self.force_told}, for "
            f"{spoken.count(self[0].rivets)} rivets with blows of this width and rate."
        )

    @property
    def answer(self) -> str:
        """Yes, no, or why it cannot be told; then what may be changed."""
        first = self.joints[0]
        sure = "" if first.survival is None else f" at {100 * first.survival:.6g} %"
        wanted = f"{spoken.count(first.rivets)} rivets{sure}"
        stated = all(joint.met for joint in self.joints) and not self.contrary
        if self.held is not None and self.held < SURE and stated:
            start = "No" if self.met is False else "Cannot be told"
            return (
                f"{start}: at the stated values every part survives {wanted}, but these are "
                f"uncertain and {100 * self.held:.3g} % of the drawn cases do; a yes needs "
                f"{100 * SURE:g} %. {self._force()}"
            )
        if self.met is False:
            worst = min(self.joints, key=lambda joint: (joint.met is not False, joint.force_factor))
            return f"No: {worst.failing}, so {wanted} cannot be promised. {self._force()}"
        if self.contrary:
            return f"Cannot be told: {self.contrary}."
        if self.met is None:
            bare = [joint.joint for joint in self.joints if joint.met is None]
            who = "no joint has" if len(bare) == len(self.joints) else f"{', '.join(bare)} lack"
            needs = "; ".join(_needs(joint) for joint in self.joints if joint.met is None)
            return (
                f"Cannot be told: {who} a shaft or a reducer. For {wanted} this task needs a shaft "
                f"of at least this radius ({self.steel}) and a reducer with at least this repeated "
                f"peak torque: {needs}."
            )
        sure = "" if self.held is None else f", in {100 * self.held:.3g} % of the drawn cases"
        if self.estimated:
            return f"Probably: every part, as estimated, survives {wanted}{sure}. {self._force()}"
        return f"Yes: every part that is given survives {wanted}{sure}. {self._force()}"

    @property
    def force_told(self) -> str:
        """The force that the life allows, in a few words."""
        if math.isinf(self.force_factor):
            return "any"
        if (ends := self.intervals.get("force")) is not None:
            return f"{spoken.allowed(ends)} N in 80 % of the cases"
        return f"{spoken.number(self.force)} N"

    def _force(self) -> str:
        if math.isinf(self.force_factor):
            return "No force of the blows is too much."
        if self.force_factor == 0.0:
            return (
                "No force of the blows is small enough: gravity and feed force alone are too much."
            )
        least = min(self.joints, key=lambda joint: joint.force_factor)
        part = "drive" if least.governed_by == "reducer" else "shaft"
        if (ends := self.intervals.get("force")) is not None:
            return f"The force may be {spoken.allowed(ends)} N in 80 % of the drawn cases."
        start = "The" if self.held is None else "At the stated values, which are uncertain, the"
        return (
            f"{start} force may be {self.force_factor:.4g} times as large, {self.force:.4g} N, by "
            f"the {part} of {least.joint}."
        )

    def _rows(self) -> list[dict[str, Any]]:
        return [dataclasses.asdict(joint) for joint in self.joints]

    def _content(self) -> dict[str, Any]:
        first = self.joints[0]
        least = min(self.joints, key=lambda joint: joint.force_factor)
        return {
            "for_life": self._rows(),
            "for_life_notes": self.notes,
            "allowable": {
                "met": self.met,
                "answer": self.answer,
                "life": first.rivets,
                "survival": first.survival,
                "force": self.force,
                "force_factor": self.force_factor,
                "governed_by": least.governed_by or None,
                "joint": least.joint if least.governed_by else None,
                "hits": self.hits,
                "rivets": self.rivets,
                "radius": {joint.joint: joint.radius for joint in self.joints},
                "reducer": {joint.joint: joint.reducer for joint in self.joints},
                "peak_torque": {joint.joint: joint.peak_torque for joint in self.joints},
                **({} if self.held is None else {"held_share": self.held}),
                **{f"{key}_interval": ends for key, ends in self.intervals.items()},
            },
        }

    def _headline(self) -> str:
        return self.answer

    def _listing(self) -> Listing:
        return listing_of(self.joints, held=self.held)


def listing_of(
    joints: Sequence[Allowable], loads: Mapping[str, str] | None = None, held: float | None = None
) -> Listing:
    """What a wanted life allows, as people read it.

    Args:
        joints: what it allows each.
        loads: {joint: unit of its torque} where not all are N m.
        held: as in `AllowableLoads`.

    Returns:
        a row a joint.
    """
    units, first = loads or {}, joints[0]
    sure = "" if first.survival is None else f", survival {first.survival:g}"
    sure += "" if held is None else ", at the stated values"
    unknown = lambda j: j.met is None and math.isinf(j.force_factor)  # noqa: E731
    unlimited = lambda j: spoken.UNLIMITED if j.hits is None else j.hits  # noqa: E731
    columns: dict[str, Key] = {
        "joint": "joint",
        "rivets as it is": lambda j: spoken.count(j.life),
        "force times": lambda j: None if unknown(j) else j.force_factor,
        "by its": lambda j: j.governed_by or None,
        "hits a rivet": lambda j: None if unknown(j) else unlimited(j),
        "shaft radius at least [mm]": lambda j: 1e3 * j.radius,
        "peak torque": lambda j: InUnit(j.peak_torque, units.get(j.joint, "N m")),
        "smallest reducer": "reducer",
    }
    title = f"What a life of {spoken.count(first.rivets)} rivets allows{sure}"
    return Listing.of(title, joints, columns)


@one_thread()
def allowable(
    robot: ModelLike,
    task: TaskLike = None,
    rivets: float = LIFE,
    *,
    survival: float | None = None,
    sn_curve: str | SNCurve | None = None,
    residue: Residue = "half-cycles",
    mean_stress: Rule = "none",
    gravity_stiffness: bool | None = None,
    gravity_balanced: bool | None = None,
    reducers: Sequence[str | Path] = (),
    thorough: bool = True,
) -> AllowableLoads:
    """Whether a task can be done for a target life, and what that life allows.

    Every part counts: a shaft's fatigue and its static strength in shear (where its curve knows
    one), and the torque limits of a reducer. Rivets start from rest and ring down, cycles are
    counted by rainflow. Gravity's stress does not grow with the force, but with a thinner shaft.

    Args:
        robot: with stiffnesses, and shafts or reducers where they are known; or a model of it.
        task: what it does; as in `assess`.
        rivets: the target life, in rivets of the task's mix.
        survival: move each curve to this probability; None leaves it.
        sn_curve: for all joints, instead of their own.
        residue: as in `assess`.
        mean_stress: as in `assess`.
        gravity_stiffness: as in `assess`.
        gravity_balanced: as in `assess`.
        reducers: catalogues beside the shipped ones, to choose from.
        thorough: False leaves out the hits, whose answer is then None, and draws fewer cases.

    Where a value of the robot has a spread (`FlexibleRobot.spreads`), a yes needs every part to
    hold in 90 % of the drawn cases, too: values, blows and the model's error vary as in
    `uncertain_life`, and the specimens' strength stays at the survival asked for.

    Returns:
        yes or no, and what each joint allows: the force and the radius hold to 1e-9, from the safe
        side; of hits, rivets and reducer the value given holds and the next one does not.

    Raises:
        InputError: no flexible joint, a life that is not positive, a curve without scatter where a
            survival is asked for.
    """
    if not (math.isfinite(rivets) and rivets > 0):
        raise InputError("must be positive", key="rivets", value=rivets)
    model = Model.of(robot, gravity_stiffness=gravity_stiffness, gravity_balanced=gravity_balanced)
    task = task_of(model.robot, task)
    need_springs(model.robot)
    curves = curves_of(model.robot, sn_curve)
    steel = sn_curve if isinstance(sn_curve, SNCurve) else load_sn_curve(
        sn_curve or DEFAULT_SN_CURVE, quiet=True
    )  # fmt: skip
    if survival is not None:
        curves = tuple(curve and curve.at_survival(survival) for curve in curves)
        steel = steel.at_survival(survival)
    parts = [
        _Parts(joint, curve, steel, residue, mean_stress)
        for joint, curve in zip(model.robot.flexible_joints, curves, strict=True)
    ]
    named = [joint.reducer for joint in model.robot.flexible_joints if joint.reducer]
    catalogue = all_reducers(reducers) | {reducer.name: reducer for reducer in named}
    order = sorted(catalogue.values(), key=_size)
    search = _Backwards(model, task, rivets, survival, parts, order, thorough)
    joints = tuple(search.joint(k) for k, part in enumerate(parts) if is_drive(part.joint.name))
    factor = search.force_of_all(min(joint.force_factor for joint in joints))
    strongest = max(operation.excitation.peak_force for operation in task.operations)
    held: float | None = None
    intervals: dict[str, Any] = {}
    notes = [*model.without_load(), *search.notes(joints)]
    if model.robot.spreads and any(part.curve or part.ratings for part in parts):
        held, intervals = search.drawn(factor, strongest, notes)
    found = AllowableLoads(
        joints,
        tuple(notes),
        force_factor=factor,
        force=factor * strongest if strongest else math.inf,
        hits=search.hits_of_all(joints),
        contrary="; ".join(
            [
                *(str(one) for one in model.robot.findings if one.severity == "impossible"),
                *(part.contrary for part in parts if part.contrary),
                *(
                    f"{one.joint} is left rigid, and the blows load it: it {one.why}"
                    for one in left_rigid(model.robot)
                    if one.moves_tool
                ),
            ]
        ),
        steel=steel.name,
        held=held,
        intervals=intervals,
        estimated=bool(estimate_notice(model.robot.name, model.robot.origins)),
    )
    return seeing(found, robot=model, task=task)


def _size(reducer: Reducer) -> tuple[float, float, float, str]:
    """By which one reducer is smaller than another."""
    return (reducer.repeated_peak_torque, reducer.momentary_peak_torque, reducer.rated_torque,
            reducer.name)  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Load:
    """What a joint carries in a pass of the task, N m (N of a slide).

    Of every cycle of the vibration `range`, `mean`, `count` and the `steady` torque beside it; of
    every place the torque `at_rest` and the vibration's `low` and `high`.
    """

    range: FloatArray
    mean: FloatArray
    count: FloatArray
    steady: FloatArray
    at_rest: FloatArray
    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, loads: Sequence[tuple[JointLoad, float]], residue: Residue) -> _Load:
        """Of a joint at every place, with the rivets of a pass set there."""
        columns: list[list[FloatArray]] = [[], [], [], []]
        ends = []
        for load, rivets in loads:
            assert load.rest is not None
            torque, rest = load.stiffness * load.rest, load.stiffness * load.static
            cycles = rainflow(torque, residue=residue)
            steady = np.full(len(cycles), rest)
            found = (cycles.range, cycles.mean, cycles.count * rivets, steady)
            for column, values in zip(columns, found, strict=True):
                column.append(values)
            ends.append((rest, float(torque.min()), float(torque.max())))
        return cls(*map(np.concatenate, columns), *np.array(ends).T)

    def scaled(self, factor: float) -> _Load:
        """With the blows so many times as high, in a linear model."""
        keys = ("range", "mean", "low", "high")
        return dataclasses.replace(self, **{key: getattr(self, key) * factor for key in keys})

    def stress(self, per: float, curve: SNCurve) -> Cycles:
        """The cycles that a curve counts, Pa or 1, where a torque brings `per` times as much."""
        width = self.range * per * curve.raised_by(self.steady * per)
        return Cycles.trusted(width, (self.mean + self.steady) * per, self.count)

    @property
    def swing(self) -> float:
        return float(max(-self.low.min(), self.high.max()))

    @property
    def peak(self) -> float:
        ends = np.abs(self.at_rest + self.low), np.abs(self.at_rest + self.high)
        return float(np.max(ends))

    @property
    def held(self) -> float:
        return float(np.abs(self.at_rest).max())


@dataclass(frozen=True)
class _Parts:
    """What may fail in a joint: how far its load is from what each part bears.

    A score is the logarithm of actual over allowable: above 0 it is too much.
    """

    joint: Joint
    curve: SNCurve | None
    steel: SNCurve
    residue: Residue
    mean_stress: Rule

    @property
    def ratings(self) -> Reducer | Strength | None:
        return self.joint.ratings

    @property
    def contrary(self) -> str:
        """Why the shaft cannot be; "" where it can."""
        joint = self.joint
        ratio = 1.0 + check_shaft(joint.stiffness, joint.shaft) if joint.shaft else 1.0
        if ratio >= 1.0 - SHAFT_TOLERANCE:
            return ""
        return f"the shaft of {joint.name}, by G Jp / l, {softer(ratio)}"

    @property
    def radius(self) -> float:
        """m, of the shaft; any where there is none."""
        return self.joint.shaft.radius if self.joint.shaft else 0.01

    @property
    def per_torque(self) -> float:
        """1/m^3, the stress of a unit torque; 1/(N m) of a drive."""
        return self.joint.per_torque if self.joint.worn else 2.0 / (math.pi * self.radius**3)

    def spent(self, load: _Load, curve: SNCurve, factor: float = 1.0) -> float:
        """Damage of what wears in a pass, its stresses times a factor; inf at its strength."""
        rule = RainflowRule(self.residue, self.mean_stress).of(curve)[0]
        try:
            return damage(load.stress(factor * self.per_torque, curve), curve, rule)
        except InputError:  # mean and amplitude together are above the static strength
            return math.inf

    def shaft_scores(
        self, load: _Load, curve: SNCurve, limit: float, factor: float = 1.0
    ) -> dict[str, float]:
        """Of fatigue and of yield, the stresses times a factor."""
        per = factor * self.per_torque
        spent = self.spent(load, curve, factor)
        if curve.kind == "torque":
            return {"drive": _log(spent / limit)}
        strength = np.nan_to_num(curve.static_strength, nan=math.inf)
        scores = {"shaft": _log(spent / limit), "yield": _log(per * load.peak / float(strength))}
        if spent == 0.0 or limit < spent < math.inf:
            # At an endurance limit the damage leaps; the stress does not.
            used = _log(utilisation(load.stress(per, curve), curve, self.mean_stress))
            if spent == 0.0:
                scores["shaft"] = min(used, 0.0)
            elif used > 0.0:
                scores["shaft"] = min(scores["shaft"], used)
        return scores

    def scores(self, load: _Load, limit: float) -> dict[str, float]:
        """Of every part that the joint has."""
        found = self.shaft_scores(load, self.curve, limit) if self.curve else {}
        if self.ratings is not None:
            shares = self.ratings.shares(load.peak, load.held)
            found["reducer"] = _log(max(shares.values()))
        return found

    def failing(self, load: _Load, limit: float, per_pass: float) -> str:
        """The part that is worst beyond what it bears, in words; "" where none is."""
        scores = self.scores(load, limit)
        worst = max(scores, key=lambda part: scores[part], default="")
        if not worst or scores[worst] <= 0.0:
            return ""
        name = self.joint.name
        if scores.get("yield", 0.0) > 0.0 and worst != "reducer":
            return (
                f"gravity and blows take the shaft of {name} to {math.exp(scores['yield']):.3g} "
                "times its yield strength"
            )
        if worst in ("shaft", "drive"):
            assert self.curve is not None
            life = per_pass / self.spent(load, self.curve)
            part = "shaft" if worst == "shaft" else self.joint.drive
            return f"the {part} of {name} survives {spoken.count(life)} rivets"
        assert self.ratings is not None
        shares = self.ratings.shares(load.peak, load.held)
        most = max(shares, key=lambda key: shares[key])
        return (
            f"gravity and blows take the {self.joint.drive} of {name} to "
            f"{shares[most]:.3g} times its {most}"
        )


@dataclass(frozen=True)
class _Backwards:
    """The search, joint by joint; the loads are computed once for all of them."""

    model: Model
    task: Task
    rivets: float
    survival: float | None
    parts: list[_Parts]
    order: list[Reducer]
    thorough: bool
    known: dict[tuple[float, int | None], list[_Load]] = field(default_factory=dict)

    @cached_property
    def places(self) -> list[tuple[VariedRivet, float]]:
        """Every rivet of a pass."""
        return rivets_of(self.model, self.task)

    @cached_property
    def nonlinear(self) -> bool:
        """Whether every trial must be integrated in time."""
        return any(place.nonlinear for place, _ in self.places)

    @property
    def limit(self) -> float:
        """Damage that a pass of the task may do."""
        return self.task.rivets_per_pass / self.rivets

    def load(self, k: int, force: float = 1.0, hits: int | None = None) -> _Load:
        """Of joint k, with the force times a factor; a linear model's is scaled."""
        solved = force if self.nonlinear else 1.0
        if (solved, hits) not in self.known:
            every = [
                (place.varied(force=solved, hits=hits), rivets) for place, rivets in self.places
            ]
            self.known[solved, hits] = [
                _Load.of([(loads[j], rivets) for loads, rivets in every], part.residue)
                for j, part in enumerate(self.parts)
            ]
        found = self.known[solved, hits][k]
        return found if force == solved else found.scaled(force / solved)

    def score(self, k: int, load: _Load) -> float:
        """The worst of joint k's parts; above 0 it is too much."""
        return max(self.parts[k].scores(load, self.limit).values(), default=-math.inf)

    def joint(self, k: int) -> Allowable:
        """What joint k allows."""
        part, load = self.parts[k], self.load(k)
        curve, limit = part.curve, self.limit
        shaft = part.joint.shaft is not None and curve is not None
        least = _NO_STRESS / part.per_torque if shaft else _NO_TORQUE
        moved = load.swing > least
        has_part = bool(part.scores(load, limit))
        force, governor = self._force(k) if moved and has_part else (math.inf, "")
        failing = part.failing(load, limit, self.task.rivets_per_pass)
        slide = part.joint.kind == "prismatic"
        radius = self._radius(k) if load.peak > least else 0.0
        spent = part.spent(load, curve) if curve else math.nan
        return Allowable(
            joint=part.joint.name,
            rivets=self.rivets,
            survival=self.survival,
            force_factor=force,
            radius=math.nan if slide and part.joint.shaft is None else radius,
            hits=self._most_hits(k) if moved and has_part and self.thorough else None,
            life=self.task.rivets_per_pass / spent if spent else math.inf,
            met=not failing if has_part else None,
            most_rivets=self._most_rivets(k),
            governed_by="reducer" if governor == "drive" else governor,
            reducer=None if slide else self._reducer(load),
            peak_torque=load.peak,
            failing=failing,
        )

    def _force(self, k: int) -> tuple[float, str]:
        """The largest factor on the force, and the part that does not bear more."""

        def over(factor: float) -> str:
            scores = self.parts[k].scores(self.load(k, factor), self.limit)
            return max(scores, key=lambda part: scores[part])

        still = self.parts[k].scores(self.load(k).scaled(0.0), self.limit)
        if max(still.values()) > 0.0:
            return 0.0, max(still, key=lambda part: still[part])
        tolerance = _NONLINEAR_TOLERANCE if self.nonlinear else 0.1 * _GUARD
        most = largest_factor(lambda f: self.score(k, self.load(k, f)), 0.0, tolerance)
        # What was integrated holds as it is; what was scaled is solved anew when it is fed back.
        return most if self.nonlinear else most * (1.0 - _GUARD), over(most * (1.0 + tolerance))

    def force_of_all(self, factor: float) -> float:
        """The largest factor at which every joint holds, from the least of the joints' own."""

        def worst(force: float) -> float:
            return max(self.score(k, self.load(k, force)) for k in range(len(self.parts)))

        if not self.nonlinear or factor in (0.0, math.inf) or worst(factor) <= 0.0:
            return factor
        return largest_factor(worst, 0.0, _NONLINEAR_TOLERANCE, start=factor)

    def _radius(self, k: int) -> float:
        """m, the least that bears the torques as they are."""
        part, load = self.parts[k], self.load(k)
        if part.joint.shaft is None:
            bare = dataclasses.replace(part.joint, strength=None)
            part = dataclasses.replace(part, joint=bare, curve=None)
        curve = part.curve or part.steel
        # A thinner shaft raises every stress of the same torques.
        slimmer = largest_factor(
            lambda f: max(part.shaft_scores(load, curve, self.limit, f).values()), 0.0, 0.1 * _GUARD
        )
        return float(part.radius * slimmer ** (-1.0 / 3.0) * (1.0 + _GUARD))

    def _reducer(self, load: _Load) -> str | None:
        fits = (r for r in self.order if max(r.shares(load.peak, load.held).values()) <= 1.0)
        found = next(fits, None)
        return None if found is None else found.name

    def _most_rivets(self, k: int) -> int | None:
        """The largest number of rivets that the joint survives; None: unlimited."""
        part, load, per_pass = self.parts[k], self.load(k), self.task.rivets_per_pass
        if max(part.scores(load, math.inf).values(), default=0.0) > 0.0:
            return 0  # beyond what no shorter life changes
        spent = part.spent(load, part.curve) if part.curve else 0.0
        if spent == 0.0:
            return None
        most = int(per_pass / spent)
        if most < 1 << 50:
            while most and spent > per_pass / most:
                most -= 1
            while spent <= per_pass / (most + 1):
                most += 1
        return most

    def _most_hits(self, k: int) -> int | None:
        """The most blows a rivet may take; the response to each number is computed anew."""
        stated = {operation.hits_per_rivet for operation in self.task.operations}
        if len(stated) != 1:
            return None

        def holds(hits: int) -> bool:
            return self.score(k, self.load(k, hits=hits)) <= 0.0

        if not self.nonlinear and holds(_MOST_HITS):  # the usual end, without the way there
            return None
        return most_holding(holds, stated.pop())

    def hits_of_all(self, joints: tuple[Allowable, ...]) -> int | None:
        """The most blows at which every joint holds."""
        most = min((joint.hits for joint in joints if joint.hits is not None), default=None)
        while most and any(
            self.score(k, self.load(k, hits=most)) > 0.0 for k in range(len(self.parts))
        ):
            most -= 1
        return most

    def drawn(
        self, factor: float, strongest: float, notes: list[str]
    ) -> tuple[float, dict[str, Any]]:
        """The share of the drawn cases that hold, and the intervals of what is allowed."""
        known = [(j, part, part.curve) for j, part in enumerate(self.parts) if part.curve]
        stress = WornParts(
            [part.joint for _, part, _ in known],
            [j for j, _, _ in known],
            [dataclasses.replace(curve, scatter=0.0) for _, _, curve in known if curve],
            self.parts[0].residue,
            self.parts[0].mean_stress,
        )
        cases = Cases(self.model, self.task, stress)
        holds = cases.drawn.holds(self.rivets)
        lives = np.where(cases.drawn.holds(0.0), cases.drawn.robots_life, 0.0)
        found: dict[str, Any] = {
            "rivets": tuple(None if math.isinf(n) else math.floor(n) for n in interval(lives))
        }
        torques = {name: each["peak_torque"] for name, each in cases.intervals.items()}
        found["peak_torque"] = torques
        if cases.cheap and strongest:
            near = factor if 0.0 < factor < math.inf else 1.0
            factors = cases.force_factor(self.rivets, near, thorough=self.thorough)
            found["force"] = tuple(end * strongest for end in interval(factors))
            if (
                self.thorough
                and len({operation.hits_per_rivet for operation in self.task.operations}) == 1
            ):
                found["hits"] = self._hits_held(cases)
        else:
            notes.append(
                "the allowable force and hits are at the stated values, which are uncertain: their "
                "intervals would take too long with this model or rule"
            )
        return float(holds.mean()), found

    def _hits_held(self, cases: Cases) -> tuple[int | None, int | None]:
        """The most hits at which 90 and 10 % of some of the cases hold; None beyond 1024."""

        @cache
        def share(hits: int) -> float:
            blows = [dataclasses.replace(op, hits_per_rivet=hits) for op in self.task.operations]
            drawn = cases.at(dataclasses.replace(self.task, operations=tuple(blows)))
            return float(drawn.holds(self.rivets).mean())

        start = self.task.operations[0].hits_per_rivet
        return (
            most_holding(lambda hits: share(hits) >= SURE, start),
            most_holding(lambda hits: share(hits) >= 1.0 - SURE, start),
        )

    def notes(self, joints: tuple[Allowable, ...]) -> Iterator[str]:
        """What an answer leaves out."""
        names = [part.joint.name for part in self.parts if part.joint.shaft is None]
        bare = [name for name in names if is_drive(name)]
        if bare:
            steel = self.parts[0].steel.name
            yield f"no shaft is given for {', '.join(bare)}: the radius is for {steel}"
        if not self.thorough:
            yield "how many hits a rivet may take is searched for with --for-life only"
        elif len({operation.hits_per_rivet for operation in self.task.operations}) != 1:
            yield "the operations differ in their hits a rivet, so no number of hits is given"
        none = [j.joint for j in joints if j.reducer is None and not math.isnan(j.radius)]
        if none:
            yield f"no reducer of the catalogues bears the torque in {', '.join(none)}"


def most_holding(holds: Callable[[int], bool], start: int) -> int | None:
    """The largest number that holds.

    Args:
        holds: falls once as the number grows.
        start: to begin with.

    Returns:
        0 if none does; None where more than 1024 do.
    """
    low, high = 0, start
    while holds(high):
        if high >= _MOST_HITS:
            return None
        low, high = high, min(2 * high, _MOST_HITS)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def _log(ratio: float) -> float:
    return math.log(ratio) if 0.0 < ratio < math.inf else math.copysign(math.inf, ratio - 1.0)


def largest_factor(
    spent: Callable[[float], float], limit: float, tolerance: float = 0.0, start: float = 1.0
) -> float:
    """The largest factor at which no more than a limit is spent.

    Regula falsi over the factor's logarithm (Illinois: an end that stays is weighed half), and
    halving where that does not narrow.

    Args:
        spent: at a factor, never falling; an InputError (above the static strength) is too much.
        limit: what may be spent.
        tolerance: relative, of the factor; 0: to the last bit.
        start: a factor to begin with.

    Returns:
        a factor that was tried and is not too much; one that is too much lies within the tolerance.

    Raises:
        InputError: even a vanishing factor spends more, so what does not scale breaks the part.
    """

    def excess(factor: float) -> float:
        try:
            return min(max(spent(factor) - limit, -_FAR), _FAR)
        except InputError:
            return _FAR

    low = high = start
    below = above = excess(start)
    while below > 0.0:
        if low < 1e-12:
            raise InputError("the steady stress alone breaks the part", key="steady_stress")
        high, above, low = low, below, low / 2.0
        below = excess(low)
    while above <= 0.0:
        low, below, high = high, above, high * 2.0
        above = excess(high)
    last, tried = 0, 0
    while high > low * (1.0 + tolerance):
        width, tried = math.log(high / low), tried + 1
        share = 0.5 if tried % 4 == 0 else -below / (above - below)
        # Near an end, beside it: so that the other end comes near, too.
        near = 0.5 * min(tolerance / width, 1.0)
        middle = low * math.exp(width * min(max(share, near), 1.0 - near))
        if not low < middle < high:
            middle = 0.5 * (low + high)
            if not low < middle < high:
                break
        value = excess(middle)
        if value > 0.0:
            high, above, below = middle, value, below / 2.0 if last > 0 else below
            last = 1
        else:
            low, below, above = middle, value, above / 2.0 if last < 0 else above
            last = -1
    return low
