"""Arguments and options that several subcommands share, and how their text is read."""

from __future__ import annotations

import os
import re
import shlex
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from picchio.cli.app import BLOWS, OUTPUT, ROBOT
from picchio.cli.output import folder_to_write, to_write
from picchio.core.errors import InputError

if TYPE_CHECKING:
    from picchio.excitation.excitation import Excitation
    from picchio.robot.flexible_robot import FlexibleRobot


def output(
    key: str, *endings: str, metavar: str | None = None, help: str | None = None, **how: bool
) -> Any:
    """An option that names a file to write; it is refused before any work where it cannot be.

    Args:
        key: such as "--out".
        *endings: of the file's name, where they are not all right.
        metavar: of its value, as the command's docstring says if not given here.
        help: likewise.
        **how: see `picchio.core.guard.Guard.declare`.
    """

    def named(text: str) -> Path:
        return to_write(text, key, endings, **how)

    return typer.Option(key, metavar=metavar, help=help, parser=named, rich_help_panel=OUTPUT)


def folder(key: str) -> Any:
    """An option that names the folder of a campaign to write.

    Args:
        key: such as "--to".
    """

    def named(text: str) -> Path:
        return folder_to_write(text, key)

    return typer.Option(key, parser=named, rich_help_panel=OUTPUT)


def _json(text: str) -> str:
    return text if text == "-" else str(to_write(text, "--json"))


_robot = partial(typer.Option, rich_help_panel=ROBOT)
_blows = partial(typer.Option, rich_help_panel=BLOWS)
PAGES = (".html", ".htm")
PICTURES = (".png", ".svg", ".pdf")


def robot_names() -> list[str]:
    """For the shell: robots that can be named."""
    from picchio.robot.loading.find import example_robots, shipped_robots

    return [*shipped_robots(), *example_robots()]


def out_beside(name: str, ending: str) -> Path:
    """What `--out` is where it is not given: the robot's name with an ending, in this folder.

    Args:
        name: of the robot.
        ending: such as "-map.nc".
    """
    return to_write(re.sub(r"[^\w-]", "_", name) + ending, "--out")


def curve_names() -> list[str]:
    """For the shell: S-N curves that can be named."""
    from picchio.fatigue.sn.library import sn_curve_names

    return list(sn_curve_names())


def joint_names() -> list[str]:
    """For the shell: flexible joints of the robot that was typed after the command."""
    from picchio.robot.loading.load import load_robot

    # An option without its value yet is no whole line, so that nothing of it is parsed.
    typed = os.environ.get("COMP_WORDS") or os.environ.get("_TYPER_COMPLETE_ARGS", "")
    _, _, robot, *_ = [*shlex.split(typed), "", "", ""]
    try:
        return list(load_robot(robot).flexible_names)
    except InputError:  # no robot yet
        return []


RobotArgument = Annotated[
    str,
    typer.Argument(
        autocompletion=robot_names,
        metavar="ROBOT",
        help="A name from `picchio robots`, a URDF, or a saved model (picchio-model/1).",
    ),
]
FlexOption = Annotated[
    Path | None,
    _robot(
        metavar="FILE",
        help="Sidecar (TOML) with stiffness, damping and shafts; the robot's own if not given.",
    ),
]
ToolOption = Annotated[
    str | None,
    _robot(
        metavar="FRAME",
        help="Frame of the URDF on which the tool's force acts; the sidecar's if not given.",
    ),
]
ReducersOption = Annotated[
    list[Path] | None,
    _robot(
        metavar="FILE",
        help="Catalogue of reducers (TOML, see `picchio formats reducers`), stronger than those "
        "shipped; may be repeated.",
    ),
]


@dataclass(frozen=True, kw_only=True)
class RobotGiven:
    """A robot as it is typed: its name, and the files that go with it."""

    robot: RobotArgument
    flex: FlexOption = None
    tool: ToolOption = None
    reducers: ReducersOption = None

    def load(self, **how: Any) -> FlexibleRobot:
        """The robot.

        Args:
            **how: of `picchio.load_robot`, besides.
        """
        from picchio.robot.loading.load import load_robot

        return load_robot(
            self.robot, flex=self.flex, tool=self.tool, reducers=self.reducers or (), **how
        )


TaskOption = Annotated[
    Path | None,
    _blows(
        metavar="FILE",
        help="What the robot does (TOML, see `picchio formats task`); its example task if not "
        "given, else one that is printed first.",
    ),
]
PayloadOption = Annotated[
    float | None,
    _robot(metavar="KG", help="Rated payload; narrows the estimates."),
]
ReachOption = Annotated[
    float | None,
    _robot(metavar="M", help="Rated reach; what the URDF says if not given."),
]
ClassOption = Annotated[
    str | None,
    _robot(
        "--class",
        metavar="CLASS",
        help="Of the drives: strain-wave, cycloidal, planetary, direct or ball-screw.",
    ),
]
SNCurveOption = Annotated[
    str | None,
    _robot(
        autocompletion=curve_names,
        metavar="NAME",
        help="S-N curve of all shafts: a name or a TOML file; each shaft's own if not given.",
    ),
]
ForceOption = Annotated[
    float | None,
    _blows(help="Peak force of one blow, N; the example task's if not given."),
]
PeriodOption = Annotated[
    float | None,
    _blows(help="Time from one blow to the next, s; likewise."),
]
WidthOption = Annotated[float | None, _blows(help="Duration of a blow, s; likewise.")]


@dataclass(frozen=True, kw_only=True)
class BlowsGiven:
    """What is typed of the blows, in place of the task's."""

    force: ForceOption = None
    period: PeriodOption = None
    width: WidthOption = None

    def on(self, robot: FlexibleRobot, task: Path | None = None) -> Excitation:
        """The blows.

        Args:
            robot: whose task has those that were not typed.
            task: in place of its own.
        """
        from picchio.studies.tasks import blows_of

        return blows_of(robot, task, **vars(self))


HitsOption = Annotated[
    int | None,
    _blows(
        metavar="N",
        min=1,
        help="Blows of a burst from rest, at most 10000; steady state if not given.",
    ),
]
DataOption = Annotated[
    Path, typer.Option(metavar="CAMPAIGN", help="Measured data: a folder with a campaign.toml.")
]
ReportOption = Annotated[
    Path | None,
    output("--report", *PAGES, metavar="OUT.html", help="Write one HTML page to read and print."),
]
JsonOption = Annotated[
    str | None,
    typer.Option(
        metavar="FILE",
        help="Write the result as JSON; - for stdout.",
        parser=_json,
        rich_help_panel=OUTPUT,
    ),
]
GravityStiffnessOption = Annotated[
    bool | None,
    _robot(
        "--gravity-stiffness/--no-gravity-stiffness",
        help="Whether gravity's stiffness dg/dq is added to that of the springs; of a saved model "
        "what its fit assumed.",
    ),
]


def numbers(text: str, key: str, count: int | None = None) -> list[float]:
    """Numbers separated by commas.

    Args:
        text: as given.
        key: the option, for the message.
        count: how many there must be; any number if not given.

    Raises:
        InputError: something that is no number, or not as many as there must be.
    """
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError("must be numbers separated by commas", key=key, value=text) from None
    if count is not None and len(values) != count:
        raise InputError(f"must be {count} numbers", key=key, value=text)
    return values


def pose_given(text: str, key: str = "--pose") -> list[float] | dict[str, float] | str:
    """A pose as it is typed: numbers, NAME=VALUE pairs, or the name of a pose.

    Args:
        text: such as "0.3,1.1,-1.0", "joint_1=0.3,joint_2=-0.5" or "home".
        key: the option, for the message.

    Returns:
        what `FlexibleRobot.pose` takes.

    Raises:
        InputError: a joint twice, or a value that is no number.
    """
    if "=" not in text:
        word = "," not in text and not _is_number(text)
        return text.strip() if word else numbers(text, key)
    pose: dict[str, float] = {}
    for part in text.split(","):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals:
            raise InputError("give every joint as NAME=VALUE, or none", key=key, value=part)
        if name in pose:
            raise InputError("the joint is given twice", key=key, value=name)
        pose[name] = numbers(value, f"{key} {name}", 1)[0]
    return pose


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
