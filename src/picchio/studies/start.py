"""Where to start with a robot of which only the URDF is known: two files, ready to be edited."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from picchio.core.errors import InputError
from picchio.core.files import write_text
from picchio.core.provenance import provenance
from picchio.core.results import TableResult
from picchio.robot.annotations.inline import read_annotations
from picchio.robot.annotations.sidecar import JointEntry, Sidecar, given, read_sidecar, spreads_of
from picchio.robot.drives.reducer import Reducer
from picchio.robot.estimate.rigid import left_rigid
from picchio.robot.estimate.sidecar import estimated_sidecar
from picchio.robot.estimate.template import beside, comment, literal, sidecar_text
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.loading.find import FoundRobot, find_robot
from picchio.robot.loading.load import load_robot
from picchio.robot.loading.objects import RobotLike, named
from picchio.robot.spread import ESTIMATE
from picchio.robot.urdf.xml import parse_urdf, read_urdf_bytes
from picchio.studies.default_task import default_task_content

_TASK_HEAD = """\
A first task for {name}, to be edited into yours. Nothing in it was measured.

Every rivet takes a train of blows. Along each axis the robot sets one rivet in each of five
poses, and then begins again. `picchio formats task` lists all that may stand here."""
_POSES = """\
Five poses drawn with seed {seed}: within the joints' limits, in front of the robot and
above the plane it stands on, neither stretched nor folded, away from singular ones. No mesh
was looked at: check that its links do not touch one another. In rad (m where a joint
slides){order}.

In place of `poses`, `points = [[x, y, z], ...]` says in m where the tool shall be, and
picchio finds the poses."""


@dataclass(frozen=True, eq=False, repr=False)
class Start(TableResult):
    """A robot's estimated drives and a first task; `save` writes both as files to edit.

    Attributes:
        robot: its name.
        asked: how the robot was asked for.
        stem: what the files' names begin with.
        sidecar: the drives, each value with its spread.
        task: keys and values of the task file.
        order: of the joints in a pose that is a list.
        seed: of its poses.
        rigid: the joints without a spring, by the reason.
        known: joints of which the robot's own files say something, in words; it stands.
        origin: what the estimates were made from, a sentence.
        inputs: files that were read.
        files: where the two were saved, or empty.
    """

    INDEX = "joint"
    LACKS: ClassVar = {"plot": "it is two files to edit", "show": "it is two files: load them"}

    robot: str
    asked: str
    stem: str
    sidecar: Sidecar
    task: Mapping[str, Any]
    order: tuple[str, ...]
    seed: int
    rigid: Mapping[str, list[str]]
    known: Mapping[str, str]
    origin: str
    inputs: tuple[Path, ...]
    files: list[Path] = field(default_factory=list)

    @property
    def names(self) -> tuple[str, str]:
        """The files' names, sidecar and task."""
        return f"{self.stem}.flex.toml", f"{self.stem}.task.toml"

    @property
    def sidecar_text(self) -> str:
        """The sidecar as a file, commented."""
        return sidecar_text(self.sidecar, origin=self.origin, notes=self.known, rigid=self.rigid)

    @property
    def task_text(self) -> str:
        """The task as a file, commented."""
        blows = self.task["excitation"]
        lines = [
            *comment(_TASK_HEAD.format(name=self.robot)),
            f"format = {literal(self.task['format'])}",
            beside(f"hits_per_rivet = {self.task['hits_per_rivet']}", "blows of a rivet; assumed"),
            "",
            *comment("The blows, all assumed, as in the paper behind picchio (Nie et al. 2016). "
                     "Each force is taken to be uncertain by 5 %; `picchio assess --spread "
                     "force=1.3` makes that 30 %."),
            "[excitation]",
            beside(f"kind = {literal(blows['kind'])}", 'rectangular; or "half_sine_train"'),
            beside(f"force = {literal(blows['force'])}", "N, peak force of one blow"),
            beside(f"period = {literal(blows['period'])}", "s, from one blow to the next"),
            beside(f"width = {literal(blows['width'])}", "s, duration of a blow"),
            "",
            *comment(self._about_poses()),
        ]  # fmt: skip
        for operation in self.task["operation"]:
            lines += [
                "[[operation]]",
                f"name = {literal(operation['name'])}",
                beside(f"direction = {literal(operation['direction'])}",
                       "world; the force on the robot acts along it"),
                "poses = [",
                *(f"    {literal(pose)}," for pose in operation["poses"]),
                "]",
                beside("rivets = 1", "at each pose, before the task begins again"),
                "",
            ]  # fmt: skip
        return "\n".join(lines).rstrip("\n") + "\n"

    def _about_poses(self) -> str:
        listed = not isinstance(self.task["operation"][0]["poses"][0], Mapping)
        order = f", in the order {', '.join(self.order)}" if listed else ""
        return _POSES.format(seed=self.seed, order=order)

    def next_command(self, folder: Path = Path()) -> str:
        """What to type next.

        Args:
            folder: where the files are.

        Returns:
            a command line.
        """
        flex, task = (str(folder / name) for name in self.names)
        return shlex.join(["picchio", "assess", self.asked, "--flex", flex, "--task", task])

    def save(self, folder: str | Path = ".", *, force: bool = False) -> tuple[Path, Path]:
        """Write both files, each whole or not at all.

        Args:
            folder: where they go; it must exist.
            force: write over files that are there.

        Returns:
            the paths, sidecar and task.

        Raises:
            InputError: one of them is there already.
            OutputError: they cannot be written there.
        """
        flex, task = (Path(folder) / name for name in self.names)
        for path in (flex, task):
            if path.exists() and not force:
                raise InputError("is there already", file=path,
                                 hint="--force writes over it")  # fmt: skip
        write_text(flex, self.sidecar_text)
        write_text(task, self.task_text)
        self.files[:] = [flex, task]
        return flex, task

    def _rows(self) -> list[dict[str, Any]]:
        keys = ("stiffness", "stiffness_spread", "damping_ratio", "damping_ratio_spread")
        return [
            {"joint": name, **{key: getattr(entry, key) for key in keys}}
            for name, entry in self.sidecar.joint.items()
        ]

    def _headline(self) -> str:
        return f"{self.robot}: {len(self.sidecar.joint)} drives estimated, a first task"

    def _content(self) -> dict[str, Any]:
        return {
            "format": "picchio-start/1",
            "robot": self.robot,
            "files": self.files,
            "joints": {
                name: entry.model_dump(exclude_none=True)
                for name, entry in self.sidecar.joint.items()
            },
            "rigid": {name: why for why, names in self.rigid.items() for name in names},
            "task": self.task,
            "provenance": provenance(self.inputs, seed=self.seed),
        }


def start(
    robot: RobotLike,
    *,
    tool: str | None = None,
    payload: float | None = None,
    reach: float | None = None,
    drive_class: str | None = None,
    reducers: Mapping[str, str | Reducer] | None = None,
    seed: int = 0,
) -> Start:
    """Estimate what nobody gave of a robot, and draw it a first task: two files to edit.

    Args:
        robot: as `load_robot` takes it.
        tool: the frame on which the tool's force acts.
        payload: kg, rated; it makes the estimates more certain.
        reach: m, rated, where the URDF's is not right.
        drive_class: strain-wave, cycloidal, planetary, direct or ball-screw.
        reducers: a catalogue's reducers by joint.
        seed: of the task's poses.

    Returns:
        both, which `save` writes.

    Raises:
        InputError: the robot cannot be loaded, or no rotary joint moves its tool; an unknown class,
            joint or reducer; a number that is not positive.
    """
    asked = named(robot)
    loaded = load_robot(asked, tool=tool, allow_rigid=True)
    sidecar = estimated_sidecar(
        loaded, payload=payload, reach=reach, drive_class=drive_class, reducers=reducers
    )
    found = find_robot(asked)
    sidecar, known = _with_own(found, sidecar)
    rigid: dict[str, list[str]] = {}
    for out in left_rigid(loaded, sidecar.joint):
        rigid.setdefault(out.why, []).append(out.joint)
    return Start(
        robot=loaded.name,
        asked=str(asked),
        stem=(found.name or found.urdf.stem).replace("/", "_"),
        sidecar=sidecar,
        task=default_task_content(loaded, seed=seed),
        order=loaded.joint_names_given,
        seed=seed,
        rigid=rigid,
        known=known,
        origin=_origin(loaded, payload, reach, drive_class, reducers),
        inputs=loaded.files,
    )


def _with_own(found: FoundRobot, sidecar: Sidecar) -> tuple[Sidecar, dict[str, str]]:
    """The estimates, with what the robot's own files say in their place, and of which joints."""
    if found.flex is not None:
        own: Sidecar | None = read_sidecar(found.flex)
    else:
        own = read_annotations(parse_urdf(read_urdf_bytes(found.urdf), found.urdf), found.urdf)
    if own is None:
        return sidecar, {}
    entries, told = dict(sidecar.joint), {}
    for name in entries.keys() & own.joint.keys():
        stated, guess = given(own.joint[name]), given(entries[name])
        whose = stated.get("source", (found.flex or found.urdf).name)
        bears: dict[str, Any] = {}
        if not {"shaft", "reducer", "strength"} & stated.keys():
            bears = {key: guess[key] for key in ("strength", "reducer") if key in guess}
            bears["strength"] = bears["strength"].model_copy(update={"source": ESTIMATE})
        if not own.joint[name].flexible:  # a sidecar may give a joint's shaft alone
            bears = {key: value for key, value in guess.items() if key not in stated}
        entries[name] = JointEntry(**(bears | stated | {"source": whose}))
        told[name] = f"What its own files say, {whose}."
    known = {spread.name for spread in spreads_of(sidecar.model_copy(update={"joint": entries}))}
    mine = {f"{key}.{name}" for key in ("stiffness", "damping_ratio") for name in told}
    changed = {
        "joint": entries,
        "tool": own.tool if own.tool is not None else sidecar.tool,
        "posterior": sidecar.posterior and sidecar.posterior.among(known - mine),
    }
    return sidecar.model_copy(update=changed), told


def _origin(
    robot: FlexibleRobot,
    payload: float | None,
    reach: float | None,
    drive_class: str | None,
    reducers: Mapping[str, str | Reducer] | None,
) -> str:
    given = [
        *([f"a payload of {payload:g} kg"] if payload is not None else []),
        *([f"a reach of {reach:g} m"] if reach is not None else []),
        *([f"{drive_class} drives"] if drive_class is not None else []),
        *([f"the reducer of {', '.join(reducers)}"] if reducers else []),
    ]
    told = f", given {'; '.join(given)}" if given else ""
    return f"Made by `picchio start` from {robot.source.name}{told}."
