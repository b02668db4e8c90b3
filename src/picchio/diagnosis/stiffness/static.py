"""Joint stiffness from what stands still: weights and pulls, and motors that press."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from picchio.campaign.campaign import Campaign
from picchio.campaign.loadings import read_loadings
from picchio.core import spoken
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.core.provenance import provenance
from picchio.diagnosis.identified import (
    FORMAT,
    Compared,
    Identification,
    Identified,
    IdentifiedJoint,
    Method,
    PoseLeft,
)
from picchio.diagnosis.result import Cause, Value
from picchio.diagnosis.stiffness.fit import Problem
from picchio.diagnosis.stiffness.joints import Told, stiffness_of
from picchio.diagnosis.stiffness.presses import EXACT, Press, make_press
from picchio.diagnosis.stiffness.prior import Suspect, prior_of, suspects
from picchio.diagnosis.stiffness.select import Answer, select
from picchio.diagnosis.stiffness.statics import Table, make_table
from picchio.diagnosis.stiffness.written import sidecar
from picchio.model.expansion import WideChain
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.joint import is_drive

_ENCODER = 1e-5  # rad or m, of a joint's deflection, to begin with
_LIKELY = 0.9  # a probability of a cause from which on no rival is told
_SHOWN = 0.05  # of a set of causes
_LINES = 3  # loadings that a reason names
_UNITS = {"pose": "rad", "tool_point": "m", "sensor_position": "m", "sensor_angle": "rad",
          "play": "rad"}  # fmt: skip
_READ = {"deflection": ("rad", 1e3, "mrad"), "torque": ("1", 100.0, "% of the largest")}
"""By group of readings: its unit, and how it is told."""
_METRES = ("m", 1e3, "mm")
_LOOSE = {"static_force": "the scale of the forces", "gravity_stiffness": "gravity's stiffness"}


class ByLoads(Method):
    """Springs fitted to static loadings and to motors that press on a tool held fast."""

    name = "static"
    kinds = frozenset({"static", "clamped"})
    needs_springs = frozenset({"static", "clamped"})

    def identify(
        self,
        robot: FlexibleRobot,
        campaign: Campaign,
        *,
        workers: int | None = None,
        progress: Callable[[str], None] | None = None,
    ) -> Identification:
        """As `identify_static`."""
        return identify_static(robot, campaign, progress=progress)


@dataclass(frozen=True, eq=False, repr=False)
class StaticIdentification(Identification):
    """What static loadings and motors that press say of the joints' stiffness.

    Attributes:
        campaign: the loadings.
        answer: the fit, and what else was tried.
        half: standard deviations to either end of a 90 % interval.
        lines: (rows,) where each stands: "loads.csv line 4", "press.csv joint_2".
    """

    campaign: Campaign
    answer: Answer
    half: float
    lines: tuple[str, ...]

    @property
    def outliers(self) -> tuple[str, ...]:
        """The loadings that fit nothing, by where they stand."""
        out = self.answer.fit.outliers
        return tuple(line for line, bad in zip(self.lines, out, strict=True) if bad)

    @property
    def named(self) -> tuple[Suspect, ...]:
        """What is beside the joints' springs more likely than not."""
        answer = self.answer
        return tuple(s for s in answer.fit.problem.causes if answer.confidence(s) > 0.5)

    @property
    def causes(self) -> tuple[Cause, ...]:
        """The same, with the numbers of the most probable fit, and each one's probability."""
        answer = self.answer
        return tuple(
            Cause(s.effect, s.target, answer.confidence(s), _parameters(answer, s))
            for s in self.named
        )

    @property
    def sets(self) -> tuple[tuple[float, tuple[Suspect, ...]], ...]:
        """Probability and content of every set of causes that may be, the likeliest first."""
        likely = sorted(self.answer.weights.items(), key=lambda pair: -pair[1])
        return tuple(
            (weight, tuple(sorted(causes, key=lambda one: one.words)))
            for causes, weight in likely if weight > _SHOWN
        )  # fmt: skip

    @property
    def remarks(self) -> tuple[str, ...]:
        """What is left on loadings left out, what else yields, and which rows are outliers."""
        noise = ", ".join(
            f"{scale * size:.2g} {told} ({group})"
            for group, size in self.answer.fit.noise.items()
            for _, scale, told in (_READ.get(group, _METRES),)
        )
        said = [f"{self.read}. {self._judged}.", f"Noise, as the fit finds it: {noise}."]
        for cause, one in zip(self.causes, self.named, strict=True):
            values = ", ".join(
                f"{name} {v.value:.3g} +- {v.std:.2g} {v.unit}"
                for name, v in cause.parameters.items()
            )
            said.append(
                f"  {one.words} ({cause.effect} of {cause.target}): {values}; "
                f"probability {cause.confidence:.2f}"
            )
        if self.sets[0][0] < _LIKELY and any(sets for _, sets in self.sets):
            said.append("What there may be beside joint springs, with its probability:")
            for weight, sets in self.sets:
                words = " and ".join(one.words for one in sets) or "joint springs alone"
                said.append(f"  {weight:.2f} {words}")
        if self.outliers:
            said.append(f"Outliers, which hardly count: {', '.join(self.outliers)}.")
        return tuple(said)

    @property
    def _judged(self) -> str:
        """How much is left of what was left out."""
        left, alone = self.answer.left_out, self.answer.alone
        if math.isnan(alone.nrmse):
            return "Nothing could be left out to judge the fit by: one more record would do"
        said = (
            f"On what was left out, {spoken.per_cent(alone.before)} % of the signal is left "
            f"with the stated stiffness, {spoken.per_cent(alone.nrmse)} % with joint springs "
            "fitted to the others"
        )
        if self.named:
            said += f", {spoken.per_cent(left.nrmse)} % with what else is most probable"
        return said

    @property
    def read(self) -> str:
        """How many readings there are, in words."""
        tables = self.answer.fit.problem.tables
        pressed = [table for table in tables if isinstance(table, Press)]
        loads = len(self.lines) - sum(map(len, pressed))
        said = [_counted(loads, "loading")] if loads else []
        if pressed:
            motors = len({k for table in pressed for k in np.flatnonzero(table.moves).tolist()})
            press = "motor that presses" if motors == 1 else "motors that press"
            said.append(f"{motors} {press} in {_counted(len(pressed), 'record')}")
        return " and ".join(said)

    def compared(self) -> list[Compared]:
        """Every instrument of every record, loading by loading; of a motor its turn and torque."""
        fit, found = self.answer.fit, []
        problem = fit.problem
        for record, table, part in zip(
            self.campaign, problem.tables, problem.predict(fit.mean), strict=True
        ):
            if isinstance(table, Press):
                found += _pressed(table, table.values - part.residual)
                continue
            for k, group in enumerate(table.groups):
                _, scale, unit = _READ.get(group, _METRES)
                measured, left = table.values[:, k], part.residual[:, k]
                shared = table.groups.count(group) > 1
                size = max(float(np.linalg.norm(measured)), 1e-300)
                title = f"{record.file}: {group}" + (f" {k + 1}" if shared else "")
                found.append(Compared(
                    title, record.source.row_word, f"reading [{unit}]",
                    np.arange(len(table)) + float(record.source.first_row), scale * measured,
                    scale * (measured - left), np.full(len(table), scale * fit.noise[group]),
                    float(np.linalg.norm(left)) / size, False,
                ))  # fmt: skip
        return found

    def by_pose(self) -> list[PoseLeft]:
        """Pose by pose, the instruments together, each alike; a press by its record."""
        fit, found = self.answer.fit, []
        for record, table, part in zip(
            self.campaign, fit.problem.tables, fit.problem.predict(fit.mean), strict=True
        ):
            if isinstance(table, Press):
                shares = [one.left for one in _pressed(table, table.values - part.residual)]
                found.append(PoseLeft(record.file, len(shares), _rms(shares)))
                continue
            poses = np.column_stack([*read_loadings(record).pose.values()])
            _, which = np.unique(poses, axis=0, return_inverse=True)
            for number in dict.fromkeys(which.ravel().tolist()):
                rows = np.flatnonzero(which.ravel() == number)
                of = [np.array([g == group for g in table.groups]) for group in set(table.groups)]
                shares = [
                    float(np.linalg.norm(part.residual[rows][:, one]))
                    / max(float(np.linalg.norm(table.values[rows][:, one])), 1e-300)
                    for one in of
                ]
                lines = rows + record.source.first_row
                many = f" to {lines[-1]}" if len(lines) > 1 else ""
                where = f"{record.file} {record.source.row_word} {lines[0]}{many}"
                found.append(PoseLeft(where, len(rows), _rms(shares)))
        return found

    def sidecar_text(self) -> str:
        """See `Identification`; a joint that is not told has a wide spread."""
        return sidecar(
            self.robot, self.joints, self.source, self.campaign.files, self.remarks,
            self.answer.covariance,
        )  # fmt: skip

    def _content(self) -> Mapping[str, Any]:
        left, alone = self.answer.left_out, self.answer.alone
        fit = self.answer.fit
        first = fit.problem.springs
        return {
            "format": FORMAT,
            "robot": self.robot.name,
            "method": ByLoads.name,
            "joints": self.joints,
            "also": self.causes,
            "residual": {
                "before": alone.before, "after": left.nrmse, "joints_alone": alone.nrmse,
                "held_out": [
                    record.file for record in self.campaign if not math.isnan(alone.nrmse)
                ],
            },
            "sets": [
                {"probability": weight,
                 "causes": [{"effect": s.effect, "target": s.target} for s in sets]}
                for weight, sets in self.sets
            ],
            "outliers": list(self.outliers),
            "noise": {
                group: {"std": size, "unit": _READ.get(group, _METRES)[0]}
                for group, size in fit.noise.items()
            },
            "nuisances": {
                name: {
                    "value": float(fit.mean[first + k] * fit.problem.size_of(name)),
                    "std": float(math.sqrt(fit.covariance[first + k, first + k])
                                 * fit.problem.size_of(name)),
                    "tolerance": fit.problem.size_of(name),
                    "unit": _UNITS.get(name.partition(".")[0], "1"),
                }
                for k, name in enumerate(fit.problem.steps)
            },
            "provenance": provenance([*self.robot.files, *self.campaign.files]),
        }  # fmt: skip

    def _headline(self) -> str:
        return f"{self._told()} told by {self.read}"


def identify_static(
    robot: FlexibleRobot,
    campaign: Campaign,
    *,
    gravity_stiffness: bool | None = None,
    search: bool = True,
    progress: Callable[[str], None] | None = None,
) -> StaticIdentification:
    """The stiffness of every joint from static loadings and clamped tests, from nothing.

    Every flexible joint's stiffness, on a logarithmic scale, starts at what the robot's files say
    with a spread of a factor of four unless they state one, and is fitted together with all that
    `[tolerance]` says is never exact. Base, bearings, bending links, play and another point of
    attack are tried, and taken where the loadings ask for them; not where motors alone press.

    Args:
        robot: flexible, its stiffness stated or estimated.
        campaign: static and clamped records.
        gravity_stiffness: whether gravity's change with the deflection counts.
        search: whether anything beside the joints' springs is tried.
        progress: told what is being done.

    Returns:
        values, intervals and reasons.

    Raises:
        InputError: a record that cannot be read, or that names a joint or frame that is not there.
    """
    say = progress or (lambda text: None)
    say("static loadings: the robot at every pose")
    chain, tolerance = WideChain(robot), campaign.tolerance
    tables = tuple(
        make_press(robot, chain, record, tolerance) if record.kind == "clamped"
        else make_table(robot, chain, read_loadings(record), tolerance)
        for record in campaign
    )  # fmt: skip
    stated = {"displacement": tolerance.dial, "dial": tolerance.dial, "deflection": _ENCODER,
              "torque": EXACT}  # fmt: skip
    added = robot.adds_gravity(gravity_stiffness, usual=True)
    problem = Problem(tables, prior_of(robot), stated, gravity=added)
    for table, record in zip(tables, campaign, strict=True):
        if isinstance(table, Table) and not np.abs(table.force).max() > 0.0:
            raise InputError("no loading of this record has a force", file=record.source.path,
                             key=record.source.key)  # fmt: skip
    say("static loadings: springs")
    lever = float(max(np.median([table.lever for table in tables]), 1e-3))
    numbers = {name for table in tables for name in table.step}
    every = [one for one in suspects(robot, lever) if all(name in numbers for name, _ in one.loose)]
    # What no loading tells from a joint is not tried: both together are the joint. Of motors that
    # press the fixture is all that yields besides, wherever it does.
    if all(isinstance(table, Press) for table in tables):
        every = []
    shadows = [(one, _shadowed(tables, problem.joints, one)) for one in every]
    answer = select(problem, [one for one, joint in shadows if joint is None] if search else ())
    lines = tuple(
        line
        for record, table in zip(campaign, tables, strict=True)
        for line in (
            [f"{record.file} {table.names[k]}" for k in table.pressed] if isinstance(table, Press)
            else [f"{record.file} {record.source.row_word} {row + record.source.first_row}"
                  for row in range(len(table))]
        )
    )  # fmt: skip
    told = _told(robot, answer, lines, shadows)
    unseen = "loads that stand still show no damping: the nominal value and its tolerance"
    width = campaign.tolerance.damping_ratio
    joints = tuple(
        IdentifiedJoint(
            joint.name, one,
            Identified.of(joint.damping_ratio, joint.damping_ratio * width, False, unseen),
        )
        for joint, one in zip(
            robot.flexible_joints, stiffness_of(robot.flexible_joints, told), strict=True
        )
        if is_drive(joint.name)
    )  # fmt: skip
    source = "memory" if campaign.folder is None else campaign.folder.resolve().name
    return StaticIdentification(robot, source, joints, campaign, answer, told.half, lines)


def _counted(count: int, what: str) -> str:
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def _rms(shares: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(shares)))) if shares else 0.0


def _told(robot: FlexibleRobot, answer: Answer, lines: tuple[str, ...],
          shadowed: Sequence[tuple[Suspect, int | None]]) -> Told:  # fmt: skip
    fit, n = answer.fit, answer.fit.problem.joints
    problem = fit.problem
    spring_names = [f"the stiffness of {name}" for name in robot.flexible_names]
    spring_names += [
        f"what holds the tool in {table.file}" for table in problem.tables for _ in table.always
    ]
    spring_names += [one.words for one in fit.problem.causes if one.spring is not None]
    names = (
        *spring_names,
        *(_LOOSE.get(name, name) for name in fit.problem.steps),
        *("a set's zero" for _ in fit.problem.zeros),
    )
    before = np.sqrt(np.diag(fit.covariance))[:n]
    size = np.sqrt(np.diag(answer.covariance))
    known = np.diag(fit.data_information)[:n] + np.diag(np.linalg.inv(problem.prior.covariance))
    return Told(
        answer.mean, answer.covariance, problem.prior.std, 1.0 / np.sqrt(known), fit.half(), names,
        fit.covariance, tuple(_moved(fit.information[:, k], lines) for k in range(n)),
        tuple(
            next((f"if {one.words}, that is in it" for one, j in shadowed if j == k), "")
            for k in range(n)
        ),
        np.sqrt(np.maximum(size**2 - before**2, 0.0)),
    )  # fmt: skip


def _moved(information: FloatArray, lines: tuple[str, ...]) -> str:
    """Which loadings tell a joint most, in words."""
    total = float(information.sum())
    if not total > 1.0:
        return ""
    first = np.argsort(-information, kind="stable")[:_LINES]
    half = int(np.searchsorted(np.cumsum(np.sort(information)[::-1]), 0.5 * total)) + 1
    named = [lines[k] for k in first if information[k] > 0.02 * total]
    numbered = [name.rsplit(" ", 1)[1].isdigit() for name in named]
    if not any(numbered):
        motors = (name.rsplit(" ", 1) for name in named)
        return "told most by the torque of " + ", ".join(f"{of} in {file}" for file, of in motors)
    if not all(numbered):
        return f"{half} of {len(lines)} rows tell half of it, most of all {', '.join(named)}"
    file = named[0].split(" ")[0]
    if all(name.startswith(f"{file} ") for name in named):
        word = named[0].split(" ")[-2]
        numbers = ", ".join(name.rsplit(" ", 1)[1] for name in named)
        text = f"{file} {word}{'s' if len(named) > 1 else ''} {numbers}"
    else:
        text = ", ".join(named)
    return f"{half} of {len(lines)} loadings tell half of it, most of all {text}"


def _pressed(table: Press, fitted: FloatArray) -> list[Compared]:
    """A motor's torque over its turn, of each that presses, with friction as it was split."""
    found = []
    for r, k in enumerate(table.pressed):
        if not table.moves[k]:
            continue
        springs = table.turn @ (fitted[r] / table.scale[r] * table.moves)
        torque, left = table.torque[:, r], table.torque[:, r] - springs - table.friction[:, r]
        share = float(np.linalg.norm(left)) / max(float(np.linalg.norm(torque)), 1e-300)
        found.append(Compared(
            f"{table.file}: {table.names[k]}", "motor's turn [mrad]", "torque [N m]",
            1e3 * table.turn[:, k], torque, torque - left, np.full(len(left), left.std()), share,
            True,
        ))  # fmt: skip
    return found


def _shadowed(tables: Sequence[Table | Press], joints: int, suspect: Suspect) -> int | None:
    """The joint that turns the arm as a suspect's spring does in all loadings; None for none."""
    if suspect.spring is None or len(suspect.spring.coordinates) > 1:
        return None
    (name,) = suspect.spring.coordinates
    for k in range(joints):
        apart = [
            min(np.abs(own - other).max(), np.abs(own + other).max()) / max(np.abs(own).max(), 1e-9)
            for table in tables
            for own, other in [(table.ways(table.names[k]), table.ways(name))]
        ]
        if max(apart) < 1e-6:
            return k
    return None


def _parameters(answer: Answer, suspect: Suspect) -> dict[str, Value]:
    """The numbers of a cause in the most probable fit."""
    fit = answer.fit
    problem = fit.problem
    size = np.sqrt(np.diag(fit.covariance))
    first = problem.springs

    def number(name: str, scale: float = 1.0) -> Value:
        k = first + problem.steps.index(name)
        unit = problem.size_of(name) * scale
        return Value(float(fit.mean[k] * unit), float(size[k] * abs(unit)), "m")

    if suspect.spring is not None:
        k = problem.joints + problem.extra.index(suspect.spring)
        value = suspect.spring.stiffness * math.exp(fit.mean[k])
        return {"stiffness": Value(value, value * float(size[k]), suspect.spring.unit)}
    if suspect.loose:
        return {name[-1]: number(name) for name, _ in suspect.loose}
    gap = number(f"play.{suspect.play[0]}")
    return {"gap": replace(gap, value=abs(gap.value), unit="rad")}
