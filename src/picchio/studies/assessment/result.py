"""An assessment in a sentence."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from picchio.core import spoken
from picchio.core.arrays import FloatArray, TextArray
from picchio.core.errors import InputError
from picchio.core.html import listed, sheet
from picchio.core.listing import InUnit, Key, Listing
from picchio.core.results import TableResult
from picchio.core.shown import named_function
from picchio.fatigue.standstill import RISKS, FalseBrinelling
from picchio.robot.annotations.flexibility import estimate_notice
from picchio.robot.joint import ESTIMATED_DRIVE
from picchio.robot.ratings import TorqueLimit
from picchio.robot.units import JointUnits, units_of
from picchio.studies.assessment.verdict import Verdict, judge

if TYPE_CHECKING:
    from picchio.fatigue.uncertain_lives import LifeSpread
    from picchio.robot.annotations.tool_choice import ToolPlace
    from picchio.robot.estimate.rigid import LeftRigid
    from picchio.studies.assessment.backwards import AllowableLoads
    from picchio.studies.uncertainty.result import UncertainLife
    from picchio.visuals.worst_rivet import WorstRivet

# What an assessment found: the life of every joint, and where it goes.

FORMAT = "picchio-assessment/1"


@dataclass(frozen=True, eq=False)
class OperationResult:
    """One operation, pose by pose.

    Attributes:
        name: of the operation.
        direction: (3,) unit vector of the force.
        excitation: the blows, in words.
        hits_per_rivet: blows a rivet takes.
        rivets: at each pose, per pass.
        poses: (n_poses, nv) rad or m.
        tool_position: (n_poses, 3) m.
        natural_frequencies: (n_poses, n) Hz.
        peak_deflection: (n_poses, n) rad, of the method's own response.
        steady_peak_deflection: (n_poses, n) rad, exact steady state; NaN where there is none.
        rest_peak_deflection: (n_poses, n) rad, a rivet from rest; NaN where it goes on.
        peak_torque: (n_poses, n) N m (N for a prismatic joint), of the vibration, through the
            spring: what shaft and reducer carry.
        gravity_torque: (n_poses, n) N m, magnitude.
        peak_shear_stress: (n_poses, n) Pa, of the vibration; NaN for a joint without a shaft.
        gravity_shear_stress: (n_poses, n) Pa, magnitude.
        peak_total_stress: (n_poses, n) Pa, largest magnitude of gravity and vibration together.
        utilisation: (n_poses, n) of the shafts.
        reducer_utilisation: (n_poses, n) of the reducers, torque over the limit that binds; NaN
            where a joint names none.
        reducer_torque: (n_poses, n) N m, that which the limit that binds is about: the peak, or
            what is held; NaN likewise.
        reducer_limit: (n_poses, n) N m, of the catalogue; NaN likewise.
        reducer_governed_by: (n_poses, n) the limit that binds; "" likewise.
        damage_per_rivet: (n_poses, n).
        swing: (n_poses, n) rad, of the deflection over a rivet from rest, end to end.
        swing_cycles: (n_poses, n) of the swing, those that reach a tenth of it, a rivet.
    """

    name: str
    direction: FloatArray
    excitation: str
    hits_per_rivet: int
    rivets: float
    poses: FloatArray
    tool_position: FloatArray
    natural_frequencies: FloatArray
    peak_deflection: FloatArray
    steady_peak_deflection: FloatArray
    rest_peak_deflection: FloatArray
    peak_torque: FloatArray
    gravity_torque: FloatArray
    peak_shear_stress: FloatArray
    gravity_shear_stress: FloatArray
    peak_total_stress: FloatArray
    utilisation: FloatArray
    reducer_utilisation: FloatArray
    reducer_torque: FloatArray
    reducer_limit: FloatArray
    reducer_governed_by: TextArray
    damage_per_rivet: FloatArray
    swing: FloatArray
    swing_cycles: FloatArray


@dataclass(frozen=True)
class JointLife:
    """One joint over the whole task.

    Attributes:
        name: of the joint.
        kind: "revolute" or "prismatic"; of a prismatic one, angles are metres, torques newtons.
        peak_deflection: rad, largest over the task.
        peak_torque: N m, largest of the vibration.
        gravity_torque: N m, largest magnitude.
        peak_shear_stress: Pa, largest of the vibration; NaN without a shaft.
        gravity_shear_stress: Pa, largest magnitude.
        peak_total_stress: Pa, largest magnitude of gravity and vibration together, from rest.
        utilisation: largest equivalent amplitude over the allowable, of the shaft, or of the drive
            where no shaft is known; NaN without either.
        reducer: its catalogue name; empty where it is not known.
        reducer_utilisation: largest torque, gravity and blows together, over the limit that binds;
            NaN without a reducer or an estimate of what the drive bears.
        damage_per_rivet: mean over the rivets of the task's mix.
        rivets_to_failure: all rivets of the mix; infinite where the life is unlimited.
        sn_curve: name of the shaft's or the drive's curve; empty without either.
        estimated_drive: its torque limits are an estimate, since none is given.
        worn: whose fatigue the life is: "shaft" or "drive"; empty without either.
        worst_operation: where the utilisation (or, without a shaft, the deflection) is largest.
        worst_pose: index of the pose there.
        damage_share: of each operation in this joint's damage; empty without damage.
        reducer_governed_by: the limit that binds, such as "repeated peak torque"; empty without.
        reducer_limits: every limit that applies, largest share over the task first: which torque
            acts, which is allowed.
        reducer_warnings: what the catalogue does not promise, and which limits are exceeded.
        yield_utilisation: `peak_total_stress` over the static strength in shear; NaN where either
            is not known.
        shaft_ratio: the shaft's own stiffness, G Jp / l, over the joint's; NaN without a shaft.
        rate_sensitivity: the peak of the worst rivet with the blows 5 % faster or slower, the
            larger one, over its peak as stated; NaN where that was not asked for.
        false_brinelling: indicators for its output bearing; None without a reducer.
        spread: the life as a distribution, where a value of the robot has a spread; None otherwise.
        estimated: a value is an estimate: `rivets_to_failure` is then the median.
        intervals: P10 and P90 of "utilisation", "yield_utilisation", "reducer_utilisation" and
            "peak_torque" (gravity and blows together), where a value of the robot has a spread.
        ends_first: share of the drawn cases in which this joint ends the robot's life; NaN without
            spreads.
    """

    name: str
    kind: str
    peak_deflection: float
    peak_torque: float
    gravity_torque: float
    peak_shear_stress: float
    gravity_shear_stress: float
    peak_total_stress: float
    utilisation: float
    reducer: str
    reducer_utilisation: float
    damage_per_rivet: float
    rivets_to_failure: float
    sn_curve: str
    worst_operation: str
    worst_pose: int
    damage_share: Mapping[str, float] = field(default_factory=dict)
    estimated_drive: bool = False
    worn: str = ""
    reducer_governed_by: str = ""
    reducer_limits: tuple[TorqueLimit, ...] = ()
    reducer_warnings: tuple[str, ...] = ()
    yield_utilisation: float = math.nan
    shaft_ratio: float = math.nan
    rate_sensitivity: float = math.nan
    false_brinelling: FalseBrinelling | None = None
    spread: LifeSpread | None = None
    estimated: bool = False
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    ends_first: float = math.nan

    def to_dict(self) -> dict[str, Any]:
        """The entry as plain values, with "life" and intervals where a value has a spread."""
        hidden = ("spread", "estimated", "intervals", "ends_first")
        own = {key: value for key, value in vars(self).items() if key not in hidden}
        own["worst_pose"] += 1  # as text and tables count
        own |= {f"{key}_interval": ends for key, ends in self.intervals.items()}
        if not math.isnan(self.ends_first):
            own["ends_first"] = self.ends_first
        if self.estimated:
            own["estimated"] = True
        return own if self.spread is None else own | {"life": self.spread.quantiles}

    @property
    def sure_life(self) -> float:
        """The life that 90 % of the worlds exceed, where values have spreads; else `life`."""
        return self.life if self.spread is None else self.spread.p10

    @property
    def told_life(self) -> str:
        """The rivets to failure as people read them: an interval where a value has a spread."""
        if self.spread is not None:
            return self.spread.told
        return spoken.count(self.rivets_to_failure)

    def told_percent(self, key: str) -> str:
        """A utilisation in per cent as people read it: an interval where a value has a spread.

        Args:
            key: such as "reducer_utilisation".

        Returns:
            such as "85.2" or "60 to 130"; "-" where it is not known.
        """
        if key in self.intervals:
            return spoken.likely(self.intervals[key])
        return spoken.per_cent(getattr(self, key))

    def told_interval(self, key: str) -> str:
        """P10 to P90 of a value, its number where it has no spread.

        Args:
            key: such as "peak_torque".

        Returns:
            the text.
        """
        ends = self.intervals.get(key, (getattr(self, key),))
        return spoken.between(ends, partial(spoken.number, least=1e-3))

    @property
    def drive(self) -> str:
        """What its torque limits are of; empty without any."""
        if self.reducer:
            return f"reducer {self.reducer}"
        return ESTIMATED_DRIVE if self.estimated_drive else ""

    @property
    def units(self) -> JointUnits:
        """How its values are written."""
        return units_of(self.kind)

    @property
    def life(self) -> float:
        """Rivets to failure; infinite where a shaft never fails, or no shaft is known."""
        return self.rivets_to_failure if self.sn_curve else float("inf")

    @property
    def reducer_governing(self) -> TorqueLimit | None:
        """The reducer's limit that binds, with its torque; None without a reducer."""
        return self.reducer_limits[0] if self.reducer_limits else None

    @property
    def governing_key(self) -> str:
        """Which of the two `governing_utilisation` is."""
        geared = not self.utilisation >= self.reducer_utilisation and bool(self.drive)
        return "reducer_utilisation" if geared else "utilisation"

    @property
    def governing_utilisation(self) -> float:
        """The larger of shaft's and reducer's."""
        return float(np.nanmax([self.utilisation, self.reducer_utilisation, 0.0]))


@dataclass(frozen=True)
class SteadyStateCheck:
    """What the paper's steady state misjudges, one entry a joint, largest over the task.

    Attributes:
        joint: name.
        steady_peak: rad, exact steady state.
        rest_peak: rad, the rivet as it happens: from rest, ring-down included.
        paper_life: rivets, by the paper's rule and curve on the steady state.
        counted_life: rivets, same curve, cycles of the rivet from rest counted by rainflow.
    """

    joint: str
    steady_peak: float
    rest_peak: float
    paper_life: float
    counted_life: float

    @property
    def peak_ratio(self) -> float:
        """Peak of the rivet over the peak of the steady state."""
        return self.rest_peak / self.steady_peak if self.steady_peak > 0.0 else float("nan")

    @property
    def life_ratio(self) -> float:
        """Life by counted cycles over the paper's life."""
        if not np.isfinite(self.paper_life) or not np.isfinite(self.counted_life):
            return float("nan")
        return self.counted_life / self.paper_life

    def to_dict(self) -> dict[str, Any]:
        """The check's results as plain values, the ratios included."""
        return vars(self) | {"peak_ratio": self.peak_ratio, "life_ratio": self.life_ratio}


@dataclass(frozen=True, eq=False, repr=False)
class Assessment(TableResult):
    """The life of a robot on a task.

    Attributes:
        robot: its name.
        method: "rainflow" or "paper", and its variant.
        sn_curve: names of the curves used.
        joints: one entry a flexible joint.
        operations: one entry an operation.
        limiting_joint: shortest life, or largest utilisation where every life is unlimited; None
            where no joint has a shaft.
        rivets_to_failure: of the limiting joint; infinite where the life is unlimited.
        steady_state: what the steady state misjudges, one entry a joint.
        assumptions: what was taken for granted, a sentence each.
        origins: where each value of the robot came from.
        provenance: version and hashes.
        inputs: what entered: robot, sidecar, effects, task, options, S-N curves, reducers.
        warnings: of loading the robot and of the assessment.
        doubts: what else lowers trust in the result, a sentence each.
        uncertainty: the lives as distributions, where a value of the robot has a spread.
        task_note: what the task is, where nobody gave one; else "".
        left_out: the joints that can move and have no spring, and why.
        refused: why the URDF's effort limit was not believed, by joint whose strength is estimated.
        impossible: what of the robot's own numbers cannot be, a sentence each.
        tool: the tool's frame, where it is and why it was taken.
        allowable: which force the task's places allow, where no task was given; None otherwise.
    """

    PAGE = "visuals.report.assessment:assessment_report"
    PLOTS: ClassVar = {
        "utilisation": "visuals.plots.life:plot_utilisation",
        "damage": "visuals.plots.life:plot_damage",
        "torque": "visuals.plots.life:plot_peak_torque",
    }
    UNITS: ClassVar[Mapping[str, str]] = {
        "peak_deflection": "rad",
        "peak_torque": "N m",
        "gravity_torque": "N m",
        "peak_shear_stress": "Pa",
        "gravity_shear_stress": "Pa",
        "peak_total_stress": "Pa",
        "rivets_to_failure": "1",
        "damage_per_rivet": "1",
    }

    robot: str
    method: str
    sn_curve: str
    joints: tuple[JointLife, ...]
    operations: tuple[OperationResult, ...]
    limiting_joint: str | None
    rivets_to_failure: float
    steady_state: tuple[SteadyStateCheck, ...]
    assumptions: tuple[str, ...]
    origins: Mapping[str, str]
    provenance: Mapping[str, Any]
    inputs: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    uncertainty: UncertainLife | None = None
    task_note: str = ""
    left_out: tuple[LeftRigid, ...] = ()
    refused: Mapping[str, str] = field(default_factory=dict)
    impossible: tuple[str, ...] = ()
    tool: ToolPlace | None = None
    allowable: AllowableLoads | None = None

    @property
    def estimated(self) -> bool:
        """Whether a value that enters the life is an estimate."""
        return self.uncertainty is not None and bool(self.uncertainty.estimated)

    @property
    def notice(self) -> str:
        """What of the drives is an estimate of picchio's own, in words; "" where nothing is."""
        return estimate_notice(self.robot, self.origins)

    @property
    def verdict(self) -> Verdict:
        """What it comes to: safe, limited, fails or cannot be told, by what, and how surely."""
        return judge(self)

    def _seen(self) -> Mapping[str, Any]:
        seen = super()._seen()
        return seen and {**seen, "assessment": self}

    def worst_rivet(self) -> WorstRivet:
        """The rivet where the part that governs the verdict fares worst, in full.

        Raises:
            InputError: nothing is known of the loads; an assessment that was read from a file.
        """
        if not (seen := super()._seen()):
            raise InputError(
                "was read from a file: it has no robot by it", key="assessment", value=self.robot
            )
        return named_function("visuals.worst_rivet:worst_rivet")(self, **seen)  # type: ignore[no-any-return]

    def joint(self, name: str) -> JointLife:
        """The entry of one joint.

        Args:
            name: of the joint.
        """
        return next(joint for joint in self.joints if joint.name == name)

    @property
    def reducer_warnings(self) -> tuple[str, ...]:
        """What the reducers' catalogues do not promise, a sentence each, with its joints."""
        said: dict[str, list[str]] = {}
        for joint in self.joints:
            for line in joint.reducer_warnings:
                said.setdefault(line.removeprefix(f"{joint.reducer}: "), []).append(joint.name)
        return tuple(f"{', '.join(names)}: {text}" for text, names in said.items())

    @property
    def false_brinelling(self) -> tuple[dict[str, Any], ...]:
        """Joints with a reducer at every pose, by risk of false brinelling, the highest first.

        Each has joint, operation, pose (counted from 1), risk, ratio (travel of a contact of the
        output bearing over its width) and cycles of the swing in a pass.
        """
        found: list[dict[str, Any]] = []
        for j, joint in enumerate(self.joints):
            if (told := joint.false_brinelling) is None:
                continue
            largest = max(op.swing[:, j].max() for op in self.operations) or 1.0
            found += [
                {
                    "joint": joint.name,
                    "operation": op.name,
                    "pose": k + 1,
                    "risk": told.risk,
                    "ratio": float(told.ratio * swing / largest),
                    "cycles": float(op.swing_cycles[k, j] * op.rivets),
                }
                for op in self.operations
                for k, swing in enumerate(op.swing[:, j])
            ]
        # Unknown ratios are NaN and share a risk of their own, so they do not disturb the order.
        return tuple(sorted(found, key=lambda e: (RISKS.index(e["risk"]), -e["ratio"])))

    def _listing(self) -> Listing:
        """The joints; of a robot whose drives are estimates as people may know them: P10 to P90."""
        if self.notice:
            title = "The joints, 80 % ranges (gravity and blows together)"
            columns: dict[str, Key] = {
                "joint": "name",
                "rivets to failure": lambda j: j.told_life if j.worn else "unknown",
                "utilisation: torque [%]": lambda j: j.told_percent("reducer_utilisation"),
                "in fatigue [%]": lambda j: j.told_percent("utilisation"),
                "ends first [%]": lambda j: spoken.number(100.0 * j.ends_first, 2),
                "torque": lambda j: InUnit(j.told_interval("peak_torque"), j.units.load),
            }
        else:
            title = "The joints"
            columns = {
                "joint": "name",
                "peak deflection": lambda j: InUnit(1e3 * j.peak_deflection, j.units.small),
                "peak torque": lambda j: InUnit(j.peak_torque, j.units.load),
                "gravity torque": lambda j: InUnit(j.gravity_torque, j.units.load),
            }
            if any(joint.sn_curve for joint in self.joints):
                title = "Life of the joints"
                columns |= {
                    "peak stress [MPa]": lambda j: j.peak_shear_stress / 1e6,
                    "gravity stress [MPa]": lambda j: j.gravity_shear_stress / 1e6,
                    "utilisation [%]": lambda j: j.told_percent("utilisation"),
                    "damage a rivet": lambda j: (
                        spoken.number(j.damage_per_rivet, least=0.0) if j.sn_curve else None
                    ),
                    "rivets to failure": lambda j: j.told_life if j.sn_curve else "unknown",
                }
            if any(joint.reducer for joint in self.joints):
                columns["reducer [%]"] = lambda j: j.told_percent("reducer_utilisation")
        columns["worst at"] = lambda j: f"{j.worst_operation}, pose {j.worst_pose + 1}"
        return Listing.of(title, self.joints, columns, bold=self.verdict.joint)

    def _reducers(self) -> Listing:
        """The reducers, and the limit of each that binds."""
        worn = [joint for joint in self.joints if joint.reducer]
        columns: dict[str, Key] = {
            "joint": "name",
            "reducer": "reducer",
            "the limit that binds": lambda j: j.reducer_governed_by or None,
            "torque [N m]": lambda j: (
                j.reducer_governing and spoken.number(j.reducer_governing.torque, 4)
            ),
            "limit [N m]": lambda j: (
                j.reducer_governing and spoken.number(j.reducer_governing.limit, 4)
            ),
            "utilisation [%]": lambda j: j.told_percent("reducer_utilisation"),
        }
        return Listing.of("The reducers", worn, columns)

    def _steady(self) -> Listing:
        """The paper's steady state against a rivet as it happens."""
        title = "The paper's steady state against a rivet as it happens\n(largest over the task"
        units = {joint.name: joint.units.small for joint in self.joints}
        columns: dict[str, Key] = {
            "joint": "joint",
            "steady peak": lambda c: InUnit(1e3 * c.steady_peak, units[c.joint]),
            "rivet's peak": lambda c: InUnit(1e3 * c.rest_peak, units[c.joint]),
            "ratio": "peak_ratio",
        }
        if any(not math.isnan(check.paper_life) for check in self.steady_state):
            title += "; the paper's S-N curve on both"
            columns |= {
                "rivets, steady, one cycle a hit": lambda c: spoken.count(c.paper_life),
                "rivets, from rest, counted": lambda c: spoken.count(c.counted_life),
                "ratio of the lives": "life_ratio",
            }
        return Listing.of(f"{title})", self.steady_state, columns)

    def _headline(self) -> str:
        return f"{self.robot!r}, method={self.method!r}: {self.verdict.headline}"

    def _rows(self) -> list[dict[str, Any]]:
        left_out = ("damage_share", "reducer_limits", "reducer_warnings", "false_brinelling",
                    "spread", "estimated", "intervals")  # fmt: skip
        return [
            {key: value for key, value in vars(joint).items() if key not in left_out}
            | {"worst_pose": joint.worst_pose + 1}
            | (joint.spread.quantiles if joint.spread is not None else {})
            | {f"{key}_interval": ends for key, ends in joint.intervals.items()}
            for joint in self.joints
        ]

    def _repr_html_(self) -> str:
        told = self.verdict
        note = " ".join(f"Doubt: {line}." for line in told.reasons)
        doubts = f"Doubts: {len(told.reasons)}." if told.reasons else ""
        head = " ".join(filter(None, [told.headline, doubts]))
        facts = {"method": self.method, "S-N curve": self.sn_curve or None}
        title, shown = f"Assessment of {self.robot}", self._listing()
        if self.notice:
            title, head = f"{title}, estimated: P10 to P90", f"{self.notice}. {head}"
        names = [
            each.name
            for each in shown.columns
            if each.name not in ("gravity torque", "gravity stress", "worst at")
        ]
        return sheet(title, facts, *listed(shown.only(*names)), note, head)

    def _content(self) -> dict[str, Any]:
        hidden = ("doubts", "uncertainty", "task_note", "left_out", "refused", "impossible",
                  "allowable")  # fmt: skip
        own = {key: value for key, value in vars(self).items() if key not in hidden}
        if self.uncertainty is not None:
            own |= {
                "life": self.uncertainty.robot.quantiles,
                "utilisation": self.uncertainty.utilisation,
                "spread_shares": self.uncertainty.robot.shares,
                "estimated": self.estimated,
                "measure_first": self.uncertainty.measure_first,
                "uncertainty": self.uncertainty.to_dict(),
            }
        if self.allowable is not None:
            own |= {"allowable": self.allowable.to_dict()["allowable"]}
        ranked = self.false_brinelling
        return {"format": FORMAT, "verdict": self.verdict, **own, "false_brinelling": ranked}
