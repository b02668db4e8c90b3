"""The tests that narrow the life most: the choice, and the files to do them with."""

from __future__ import annotations

import csv
import io
import math
import re
import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from picchio.campaign.tables import CAMPAIGN_FILE, Tolerance
from picchio.campaign.tables import FORMAT as CAMPAIGN
from picchio.core import spoken
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.core.files import write_text
from picchio.core.listing import Listing
from picchio.core.processes import one_thread
from picchio.core.provenance import provenance
from picchio.core.registry import classes_in
from picchio.core.results import TableResult
from picchio.core.shown import seeing
from picchio.diagnosis.planning.choose import Choice, Chosen, choose
from picchio.diagnosis.planning.kind import REACH, Test, angles, told_in, within_reach
from picchio.diagnosis.planning.outcome import Outcome, decades, outcome_of
from picchio.prediction.plan import PlannedTest, TestPlan, plan_toml
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.loading.find import typed_name
from picchio.robot.loading.load import load_robot
from picchio.robot.loading.objects import RobotLike
from picchio.studies.default_task import possible_poses, task_of
from picchio.studies.placement.self_collision import SelfCollision
from picchio.studies.tasks import Task

FORMAT = "picchio-test-plan/1"
PLAN = "plan.toml"
_POSES, _OWN, _DRAWN = 40, 5, 120  # tried; of the task; drawn, before those that collide are out
_ROBOTS = 16  # drawn from what is known, at which the records are looked at
_STRONGEST = 400.0  # N, of a pull by hand
_UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0}
_BUDGET = re.compile(r"(\d+(?:\.\d*)?)\s*(s|min|h)")
_TEST: Any = Test


@dataclass(frozen=True)
class Narrowed:
    """What the tests are expected to tell of a joint.

    Attributes:
        name: of the joint.
        before, after: the factor either way within which its stiffness lies, at 90 %.
    """

    name: str
    before: float
    after: float


@dataclass(frozen=True, eq=False, repr=False)
class PlannedTests(TableResult):
    """Which tests to do; its table is the records, in the order in which to take them.

    Attributes:
        robot: that is tested.
        instruments: at hand.
        budget: s.
        outcome: what the tests are to narrow.
        choice: the records by their gain, and what is expected after them.
        records: the same records, those at one pose and with one setting together.
        files: of the campaign, that each record goes to.
        notes: what else to know.
        seed: of the draws.
        inputs: files that were read.
    """

    BARS = ("seconds",)
    PLOTS: ClassVar = {"bars": "visuals.plots.results:plot_columns"}

    INDEX = "record"
    UNITS: ClassVar = {"force": "N", "seconds": "s"}

    robot: FlexibleRobot
    instruments: tuple[str, ...]
    budget: float
    outcome: Outcome
    choice: Choice
    records: tuple[Chosen, ...]
    files: tuple[str, ...]
    notes: tuple[str, ...]
    seed: int
    inputs: tuple[Path, ...]
    PAGE = "visuals.report.test_plan:plan_page"

    @property
    def seconds(self) -> float:
        """All the time that it takes."""
        return sum(record.seconds for record in self.records)

    @property
    def joints(self) -> tuple[Narrowed, ...]:
        """What is expected of every flexible joint's stiffness."""
        n = len(self.robot.flexible_joints)
        before = np.sqrt(np.diag(self.outcome.covariance))
        after = np.sqrt(np.diagonal(self.choice.covariance, axis1=1, axis2=2).mean(axis=0))
        return tuple(
            Narrowed(name, math.exp(1.645 * before[k]), math.exp(1.645 * after[k]))
            for k, name in enumerate(self.robot.flexible_names[:n])
        )

    @property
    def widths(self) -> tuple[float, float]:
        """80 % intervals of the outcome in decades, all that is uncertain in: now, and then."""
        rest = math.sqrt(self.outcome.rest)
        now, then = (math.hypot(rest, size) for size in (self.choice.before, self.choice.after))
        return decades(now), decades(then)

    def save(self, folder: str | Path, *, overwrite: bool = False) -> tuple[Path, ...]:
        """Write the campaign with its forms to fill in, and the plan.

        The sheet to print is the result's page: `picchio.report(plan).save("sheet.html")`.

        Args:
            folder: is made if it is not there; the folder above must be.
            overwrite: write over such files.

        Returns:
            what was written.

        Raises:
            InputError: one of the files is there already.
            OutputError: they cannot be written there.
        """
        where = Path(folder)
        texts = {**self._forms(), CAMPAIGN_FILE: self._campaign(), PLAN: self._plan()}
        for name in texts:
            if (where / name).exists() and not overwrite:
                hint = "--overwrite writes over it, and over readings in it"
                raise InputError("is there already", file=where / name, hint=hint)
        where.mkdir(exist_ok=True)
        for name, text in texts.items():
            write_text(where / name, text)
        return tuple(where / name for name in texts)

    def _forms(self) -> dict[str, str]:
        """The tables to fill in, by file."""
        rows: dict[str, list[dict[str, object]]] = {}
        for record, file in zip(self.records, self.files, strict=True):
            one = record.candidate
            if row := _test(one.kind).row(self.robot, one, self.instruments):
                rows.setdefault(file, []).append(row)
        found = {}
        for file, lines in rows.items():
            stream = io.StringIO()
            writer = csv.DictWriter(stream, list(lines[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows(lines)
            found[file] = stream.getvalue()
        return found

    def _campaign(self) -> str:
        import tomlkit

        document = tomlkit.document()
        document.add(tomlkit.comment("Made by picchio plan: fill in the tables, then"))
        document.add(tomlkit.comment(f"{self.next_command('.')}"))
        document["format"] = CAMPAIGN
        document["robot"], document["tool"] = self._typed, self.robot.tool_frame
        tables = tomlkit.aot()
        for file, record in dict(zip(self.files, self.records, strict=True)).items():
            one = record.candidate
            table = _test(one.kind).table(self.robot, one)
            tables.append(tomlkit.item({"file": file, "kind": one.kind, **table}))
        document["record"] = tables
        return tomlkit.dumps(document)

    def _plan(self) -> str:
        return plan_toml(TestPlan(
            robot=self._typed, instruments=list(self.instruments),
            test=[
                PlannedTest(
                    kind=one.candidate.kind,  # type: ignore[arg-type]
                    pose={name: float(x) for name, x in
                          zip(self.robot.joint_names, one.candidate.pose, strict=True)},
                    direction=one.candidate.direction.tolist(), force=one.candidate.force,
                    read_direction=_listed(one.candidate.reads),
                    file=file, minutes=one.seconds / 60.0,
                )
                for one, file in zip(self.records, self.files, strict=True)
            ],
        ))  # fmt: skip

    @property
    def _typed(self) -> str:
        return typed_name(self.robot.name, self.robot.source)

    def next_command(self, folder: str) -> str:
        """What to type once the form is filled in.

        Args:
            folder: of the campaign.
        """
        return shlex.join(["picchio", "identify", self._typed, "--data", folder, "--out",
                           "flex.toml"])  # fmt: skip

    def _headline(self) -> str:
        now, then = self.widths
        count = len(self.records)
        return (
            f"{self.robot.name}: {count} record{'' if count == 1 else 's'} in "
            f"{self.seconds / 60.0:.0f} minutes narrow {self.outcome.words} "
            f"from {spoken.factor(now)} to {spoken.number(10.0**then, 2)}"
        )

    def _factors(self) -> Listing:
        """How well each stiffness is known now, and then."""
        title = "The stiffness lies within this factor either way (90 %)"
        columns = {"joint": "name", "now [factor]": "before", "then [factor]": "after"}
        return Listing.of(title, self.joints, columns)

    def _rows(self) -> list[dict[str, Any]]:
        return [
            {"record": k, "kind": one.candidate.kind,
             **{name: value for name, (value, _) in angles(self.robot, one.candidate.pose).items()},
             "direction": one.candidate.direction.tolist(), "force": one.candidate.force,
             "reads": _listed(one.candidate.reads),
             "seconds": one.seconds, "file": file}
            for k, (one, file) in enumerate(zip(self.records, self.files, strict=True), start=1)
        ]  # fmt: skip

    def _content(self) -> dict[str, Any]:
        now, then = self.widths
        names = self.robot.joint_names
        return {
            "format": FORMAT,
            "robot": self.robot.name,
            "with": list(self.instruments),
            "budget": self.budget,
            "seconds": self.seconds,
            "ends": self.choice.why,
            "outcome": {
                "of": self.outcome.words, "deviation_before": self.choice.before,
                "deviation_after": self.choice.after, "others": math.sqrt(self.outcome.rest),
                "interval_decades": [now, then],
            },
            "joints": self.joints,
            "records": [
                {"kind": one.candidate.kind, "file": file,
                 "pose": dict(zip(names, one.candidate.pose.tolist(), strict=True)),
                 "direction": one.candidate.direction.tolist(), "force": one.candidate.force,
                 "reads": _listed(one.candidate.reads),
                 "seconds": one.seconds, "deviation_after": one.deviation}
                for one, file in zip(self.records, self.files, strict=True)
            ],
            "notes": list(self.notes),
            "provenance": provenance(self.inputs, seed=self.seed),
        }  # fmt: skip


@cache
def tests() -> tuple[Test, ...]:
    """Every kind of test that can be planned."""
    return tuple(made() for made in classes_in("picchio.diagnosis.planning", _TEST))


def _test(name: str) -> Test:
    return next(test for test in tests() if test.name == name)


@one_thread()
def plan(
    robot: RobotLike,
    task: str | Path | Task | None = None,
    *,
    budget: str | float = "20min",
    instruments: Sequence[str] = ("scale", "dial"),
    force: float | None = None,
    flex: str | Path | None = None,
    tool: str | None = None,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> PlannedTests:
    """The tests for stiffness and damping that narrow the life on a task most.

    Poses are drawn where the arm can stand without touching itself, and those of the task, as far
    as a person reaches the tool there (0.2 to 2 m above the floor, z = 0); records
    are taken one after the other by what each is expected to tell of the life for the time that it
    takes (`picchio.diagnosis.planning.choose`), until the time is up or another one would not
    change the answer. What is known already is in the robot's spreads and its posterior: with the
    sidecar of an earlier `identify` the plan goes on from there.

    Args:
        robot: a robot, its name or its file.
        task: what it does; its example task if not given, else `default_task`.
        budget: the time there is: s, or a text such as "20min", "1h" or "900s".
        instruments: at hand: "scale" or "weight" with "dial" or "tracker", "hammer" with
            "accelerometer".
        force: N, how hard to pull; as hard as the task's blows, at most 400 N, if not given.
        flex: sidecar of the robot.
        tool: the frame that carries the tool.
        seed: of the draws.
        progress: told what is being done.

    Returns:
        the records, in the order in which to take them.

    Raises:
        InputError: instruments that are unknown or make no test, no time, no force, a task that
            the robot cannot do.
    """
    say = progress or (lambda text: None)
    seconds = _seconds(budget)
    hands = tuple(dict.fromkeys(instruments))
    kinds = _possible(hands)
    loaded = load_robot(robot, flex=flex, tool=tool)
    work = task_of(loaded, task)
    if force is not None and not (math.isfinite(force) and force > 0.0):
        raise InputError("must be positive", key="force", value=force)
    say("how the life hangs on stiffness and damping")
    outcome = outcome_of(loaded, work, draws=_ROBOTS, seed=seed)
    say("poses")
    poses, notes = _poses(loaded, work, seed)
    blows = max(op.excitation.peak_force for op in work.operations)
    hard = force or min(blows or _STRONGEST, _STRONGEST)
    say("what each record would tell")
    offered = [
        kind.candidates(loaded, poses, outcome, hard, hands, Tolerance()) for kind in kinds
    ]  # fmt: skip
    if not any(one.each for one in offered):
        raise InputError("at no pose may the drives be loaded so hard", key="force", value=hard)
    say("which records")
    choice = choose(outcome, [one for one in offered if one.each], seconds)
    records = _together(choice.records)
    files = tuple(
        _test(one.candidate.kind).file.format(k) for k, one in enumerate(records, start=1)
    )
    said = [*notes, *([work.note] if work.note else [])]
    found = PlannedTests(
        loaded, hands, seconds, outcome, choice, records, files, tuple(said), seed,
        (*loaded.files, *work.files),
    )  # fmt: skip
    return seeing(found, robot=loaded, task=work)


def _seconds(budget: str | float) -> float:
    if isinstance(budget, str):
        found = _BUDGET.fullmatch(budget.strip())
        if not found:
            raise InputError("must be a time such as 20min, 1h or 900s", key="budget",
                             value=budget)  # fmt: skip
        return _seconds(float(found[1]) * _UNITS[found[2]])
    if not (math.isfinite(budget) and budget > 0.0):
        raise InputError("must be positive", key="budget", value=budget)
    return float(budget)


def _possible(instruments: Sequence[str]) -> list[Test]:
    known = sorted({name for test in tests() for name in (*test.loads, *test.reads)})
    for name in instruments:
        if name not in known:
            raise InputError("unknown instrument", key="instruments", value=name, choices=known)
    found = [test for test in tests() if test.possible(instruments)]
    if not found:
        sets = [f"{' or '.join(sorted(test.loads))} with {' or '.join(sorted(test.reads))}"
                for test in tests()]  # fmt: skip
        raise InputError("these make no test", key="instruments", value=",".join(instruments),
                         choices=sets)  # fmt: skip
    return found


def _poses(robot: FlexibleRobot, task: Task, seed: int) -> tuple[FloatArray, list[str]]:
    """(m, nv) to try: the task's own, then drawn ones; to a tenth of a degree or a millimetre."""
    own = np.concatenate([np.asarray(op.poses) for op in task.operations])[:_OWN]
    every = np.concatenate([own, possible_poses(robot, _DRAWN, seed=seed)])
    scale = np.array([told_in(robot, name)[0] for name in robot.joint_names])
    finest = np.where(scale > 500.0, 1.0, 10.0)
    every = np.round(every * scale * finest) / finest / scale
    every = every[((every >= robot.lower) & (every <= robot.upper)).all(axis=1)]
    every = every[np.sort(np.unique(every, axis=0, return_index=True)[1])]
    near = np.array([within_reach(robot, pose) for pose in every])
    notes = ["Look first whether the room is free: only the robot itself was looked at."]
    if near.any():
        every = every[near]
    else:
        notes.append("At every pose the tool is below {:g} m or above {:g} m.".format(*REACH))
    check = SelfCollision.of(robot, every[0])
    if isinstance(check, str):
        notes.append(f"Whether links touch was not checked: {check}.")
    else:
        every = np.array([pose for pose in every[: _POSES + _DRAWN] if not check.collides(pose)])
        if not len(every):
            raise InputError("at every pose that was drawn links of the robot touch",
                             file=robot.source)  # fmt: skip
    return every[:_POSES], notes


def _listed(direction: FloatArray | None) -> list[float] | None:
    return None if direction is None else [float(x) for x in direction]


def _together(records: Sequence[Chosen]) -> tuple[Chosen, ...]:
    """Those of one pose together, and of these those of one setting."""
    places = list(dict.fromkeys(one.candidate.place for one in records))
    settings = list(dict.fromkeys((one.candidate.place, one.candidate.setting) for one in records))
    return tuple(sorted(records, key=lambda one: (
        places.index(one.candidate.place),
        settings.index((one.candidate.place, one.candidate.setting)),
    )))  # fmt: skip
