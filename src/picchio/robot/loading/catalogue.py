"""The list of robots that can be named."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar

from picchio.core.errors import InputError
from picchio.core.html import sheet
from picchio.core.results import TableResult
from picchio.robot.annotations.inline import read_annotations
from picchio.robot.annotations.sidecar import Sidecar, read_sidecar
from picchio.robot.loading.find import FoundRobot, example_robots, shipped_robots
from picchio.robot.urdf.check import read_tree
from picchio.robot.urdf.xml import parse_urdf, read_urdf_bytes


@dataclass(frozen=True)
class RobotEntry:
    """One robot of the list.

    Args:
        name: what it is called.
        urdf: its file.
        dof: movable joints that do not mimic another.
        flexible: the joints that could be flexible: revolute, continuous or prismatic.
        with_stiffness: those whose stiffness is known.
        stiffness_source: where the stiffnesses are from, or None where there are none.
        estimated: some stiffness is an estimate.
        problem: why the robot cannot be loaded, or None.
    """

    name: str
    urdf: Path
    dof: int
    flexible: tuple[str, ...]
    with_stiffness: tuple[str, ...]
    stiffness_source: str | None
    estimated: bool = False
    problem: str | None = None


@dataclass(frozen=True, eq=False, repr=False)
class RobotList(TableResult):
    """The robots that can be named; its table is one row a robot.

    Attributes:
        entries: this project's robots, then those of example-robot-data.
    """

    LACKS: ClassVar = {"plot": "it is a list to read", "show": "it is a list to read"}

    entries: tuple[RobotEntry, ...]

    def __len__(self) -> int:
        return len(self.entries)

    def __iter__(self) -> Iterator[RobotEntry]:
        return iter(self.entries)

    def _headline(self) -> str:
        known = sum(bool(entry.with_stiffness) for entry in self.entries)
        return f"{len(self.entries)} robots, {known} with known stiffness"

    def _rows(self) -> list[dict[str, Any]]:
        return [asdict(entry) for entry in self.entries]

    def _repr_html_(self) -> str:
        columns = ("name", "DoF", "stiffness known", "source")
        rows = [
            (e.name, e.dof, ", ".join(e.with_stiffness) or None, e.problem or e.stiffness_source)
            for e in self.entries
        ]
        return sheet(self._headline(), None, columns, rows)

    def _content(self) -> dict[str, Any]:
        return {"format": "picchio-robots/1", "robots": self.entries}


def robots(*, examples: bool = True) -> RobotList:
    """The robots that `load_robot` knows by name, and which have stiffness data, from where.

    Args:
        examples: also read example-robot-data's 69 URDFs.
    """
    shipped = shipped_robots()
    found = list(shipped.values())
    if examples:
        found += [
            FoundRobot(name, urdf) for name, urdf in example_robots().items() if name not in shipped
        ]
    return RobotList(tuple(describe_robot(robot) for robot in found))


def describe_robot(robot: FoundRobot) -> RobotEntry:
    """One entry; a robot that cannot be loaded has its reason as `problem`."""
    name = robot.name or robot.urdf.stem
    try:
        root = parse_urdf(read_urdf_bytes(robot.urdf), robot.urdf)
        tree = read_tree(root, robot.urdf)
        annotation = read_annotations(root, robot.urdf)
        sidecar, file = annotation, robot.urdf
        if annotation is None and robot.flex is not None:
            sidecar, file = read_sidecar(robot.flex), robot.flex
    except InputError as error:
        return RobotEntry(name, robot.urdf, 0, (), (), None, problem=str(error))
    flexible = tuple(tree.movable())
    known, source, estimated = _stiffness(sidecar, file)
    return RobotEntry(name, robot.urdf, len(flexible), flexible, known, source, estimated)


def _stiffness(sidecar: Sidecar | None, file: Path) -> tuple[tuple[str, ...], str | None, bool]:
    joints = sidecar.joint if sidecar else {}
    known = {name: entry for name, entry in joints.items() if entry.flexible}
    if not known:
        return (), None, False
    sources = sorted({entry.source for entry in known.values() if entry.source})
    place = f"{file.parent.name}/{file.name}"
    text = sources[0] if sources else place
    if len(sources) > 1:
        text += f" (and {len(sources) - 1} more in {place})"
    return tuple(known), text, any(entry.estimated for entry in known.values())
