"""The allowable force, hits and shaft radius for a target life."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from picchio.core.errors import InputError
from picchio.core.html import sheet
from picchio.core.processes import one_thread
from picchio.core.results import TableResult
from picchio.fatigue.counting.counter import Residue
from picchio.fatigue.counting.cycles import Cycles
from picchio.fatigue.mean_stress import Rule
from picchio.fatigue.miner import damage
from picchio.fatigue.sn.curve import SNCurve
from picchio.model.model import Model
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.studies.rivet.variation import ShaftStress, VariedRivet, rivets_of
from picchio.studies.tasks import Task

_MOST_HITS = 1 << 10
# How exactly the force is found where every trial must be integrated in time.
_NONLINEAR_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Allowable:
    """What a wanted life allows one joint; the other quantities stay as they are.

    Attributes:
        joint: its name.
        rivets: the wanted life, rivets of the task's mix.
        survival: the wanted probability that a specimen lives so long; None: the curve's own.
        force_factor: by which every blow's force may be multiplied; inf where the blows do not
            move the joint.
        radius: m, the smallest shaft radius, at the same joint stiffness.
        hits: blows a rivet may take; None where operations differ in it, or where more than 1024
            are allowed.
        life: rivets to failure as things are, at that survival.
    """

    joint: str
    rivets: float
    survival: float | None
    force_factor: float
    radius: float
    hits: int | None
    life: float


@dataclass(frozen=True, repr=False)
class AllowableLoads(TableResult):
    """What a target life allows, joint by joint.

    Attributes:
        joints: of each joint with a shaft.
        notes: what was left out, and why.
    """

    INDEX = "joint"
    UNITS: ClassVar[Mapping[str, str]] = {"radius": "m", "life": "1", "rivets": "1"}

    joints: tuple[Allowable, ...]
    notes: tuple[str, ...] = ()

    def __iter__(self) -> Iterator[Allowable]:
        return iter(self.joints)

    def __len__(self) -> int:
        return len(self.joints)

    def __getitem__(self, index: int) -> Allowable:
        return self.joints[index]

    def _rows(self) -> list[dict[str, Any]]:
        return [dataclasses.asdict(joint) for joint in self.joints]

    def _content(self) -> dict[str, Any]:
        return {"for_life": self._rows(), "for_life_notes": self.notes}

    def _headline(self) -> str:
        least = min(self.joints, key=lambda joint: joint.force_factor)
        return (
            f"for {least.rivets:g} rivets the force may be {least.force_factor:.4g} times as "
            f"large, by {least.joint}"
        )

    def _repr_html_(self) -> str:
        rows = [(j.joint, j.life, j.force_factor, 1e3 * j.radius, j.hits) for j in self.joints]
        columns = ("joint", "life now [rivets]", "force factor", "least radius [mm]", "most hits")
        facts = {"target life [rivets]": self.joints[0].rivets, "survival": self.joints[0].survival}
        return sheet("Allowable loads", facts, columns, rows)


@one_thread()
def allowable(
    robot: FlexibleRobot | Model,
    task: Task,
    rivets: float,
    *,
    survival: float | None = None,
    sn_curve: str | SNCurve | None = None,
    residue: Residue = "half-cycles",
    mean_stress: Rule = "none",
    gravity_stiffness: bool | None = None,
    gravity_balanced: bool | None = None,
) -> AllowableLoads:
    """Allowable force, hits and shaft radius of every joint for a target life.

    Rivets start from rest and ring down, cycles are counted by rainflow. Gravity's stress does not
    grow with the force, but with a thinner shaft. Where the curve knows its yield strength in
    shear, the largest stress must stay below it, too.

    Args:
        robot: with shafts; or a model of it.
        task: what it does.
        rivets: the target life, in rivets of the task's mix.
        survival: move each curve to this probability; None leaves it.
        sn_curve: for all joints, instead of their own.
        residue: as in `assess`.
        mean_stress: as in `assess`.
        gravity_stiffness: as in `assess`.
        gravity_balanced: as in `assess`.

    Returns:
        what each joint with a shaft allows.

    Raises:
        InputError: no joint with a shaft, a life that is not positive, a curve without scatter
            where a survival is asked for, gravity alone too much.
    """
    if not (math.isfinite(rivets) and rivets > 0):
        raise InputError("must be positive", key="rivets", value=rivets)
    model = Model.of(robot, gravity_stiffness=gravity_stiffness, gravity_balanced=gravity_balanced)
    stress = ShaftStress.of(model.robot, sn_curve, survival, residue, mean_stress)
    search = _Backwards(stress, rivets_of(model, task), task, rivets, survival)
    return AllowableLoads(
        tuple(search.joint(k) for k in range(len(stress.joints))), model.without_load()
    )


Load = list[tuple[Cycles, float, float]]
"""For each rivet place: the stress cycles of a rivet, the steady stress, the rivets set there."""


@dataclass(frozen=True)
class _Backwards:
    """The search, joint by joint; the loads are computed once for all of them."""

    stress: ShaftStress
    places: list[tuple[VariedRivet, float]]
    task: Task
    rivets: float
    survival: float | None
    known: dict[tuple[float, int | None], list[Load]] = field(default_factory=dict)

    @cached_property
    def nonlinear(self) -> bool:
        """Whether every trial must be integrated in time."""
        return any(place.nonlinear for place, _ in self.places)

    def _loads(self, joint: int, force: float = 1.0, hits: int | None = None) -> Load:
        """Of a joint, with the force times a factor; a linear model's cycles are scaled."""
        solved = force if self.nonlinear else 1.0
        if (solved, hits) not in self.known:
            found = [
                (self.stress.cycles(place.varied(force=solved, hits=hits, compiled=False)), count)
                for place, count in self.places
            ]
            self.known[solved, hits] = [
                [(*cycles[k], count) for cycles, count in found]
                for k in range(len(self.stress.joints))
            ]
        load = self.known[solved, hits][joint]
        rest = force / solved
        return load if rest == 1.0 else [(c.scaled(rest), steady, n) for c, steady, n in load]

    @property
    def limit(self) -> float:
        """Damage that a pass of the task may do."""
        return self.task.rivets_per_pass / self.rivets

    def joint(self, k: int) -> Allowable:
        """What joint k allows."""
        shaft = self.stress.joints[k].shaft
        assert shaft is not None
        load = self._loads(k)
        # A stress below one pascal is rounding: the blows do not move this joint.
        moved = any(len(cycles) and cycles.range.max() > 1.0 for cycles, _, _ in load)
        force = slimmer = math.inf
        if moved:
            force = largest_factor(
                lambda f: self._spent(k, self._loads(k, f)),
                self.limit,
                _NONLINEAR_TOLERANCE if self.nonlinear else 0.0,
            )
            # A thinner shaft raises every stress of the same torques.
            slimmer = largest_factor(lambda f: self._spent(k, load, f), self.limit)
        now = self._spent(k, load)
        return Allowable(
            joint=self.stress.joints[k].name,
            rivets=self.rivets,
            survival=self.survival,
            force_factor=force,
            radius=0.0 if math.isinf(slimmer) else shaft.radius * slimmer ** (-1.0 / 3.0),
            hits=self._hits(k) if moved else None,
            life=math.inf if now == 0.0 else self.task.rivets_per_pass / now,
        )

    def _spent(self, k: int, load: Load, factor: float = 1.0) -> float:
        """Damage of joint k in a pass, every stress times `factor`; inf beyond its strength."""
        curve, rule = self.stress.curves[k], self.stress.mean_stress
        stresses = [(cycles.scaled(factor), steady * factor, n) for cycles, steady, n in load]
        if _largest(stresses) >= (curve.yield_shear or curve.ultimate_shear or math.inf):
            return math.inf
        return math.fsum(
            n * damage(cycles.shifted(steady), curve, rule) for cycles, steady, n in stresses
        )

    def _hits(self, k: int) -> int | None:
        """The most blows a rivet may take; the response to each number is computed anew."""
        if len({operation.hits_per_rivet for operation in self.task.operations}) != 1:
            return None

        def too_much(hits: int) -> bool:
            return self._spent(k, self._loads(k, hits=hits)) > self.limit

        if not too_much(_MOST_HITS):
            return None
        low, high = 0, _MOST_HITS
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (low, middle) if too_much(middle) else (middle, high)
        return low


def _largest(load: Load) -> float:
    """The largest stress of all, gravity and blows together, Pa."""
    largest = 0.0
    for cycles, steady, _ in load:
        largest = max(largest, abs(steady))
        if len(cycles):
            largest = max(largest, float((np.abs(steady + cycles.mean) + cycles.amplitude).max()))
    return largest


def largest_factor(spent: Callable[[float], float], limit: float, tolerance: float = 0.0) -> float:
    """The largest factor whose damage is within a limit, by bisection.

    Args:
        spent: damage at a factor, never falling; an InputError (above the static strength)
            counts as endless damage.
        limit: what may be spent.
        tolerance: relative, of the factor; 0: to the last bit.

    Raises:
        InputError: even a vanishing factor spends more, so what does not scale breaks the part.
    """

    def too_much(factor: float) -> bool:
        try:
            return spent(factor) > limit
        except InputError:
            return True

    low, high = 1.0, 1.0
    while too_much(low):
        high, low = low, low / 2.0
        if low < 1e-12:
            raise InputError("the steady stress alone breaks the part", key="steady_stress")
    while not too_much(high):
        low, high = high, high * 2.0
    while True:
        middle = 0.5 * (low + high)
        if middle in (low, high) or high - low <= tolerance * high:
            return low
        low, high = (low, middle) if too_much(middle) else (middle, high)
