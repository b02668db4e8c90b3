"""Where a cause sits: the robot at a pose, and what to mark on it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.model.effects.registry import effect_class
from picchio.model.expansion import BASE_AXES
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.visuals.kinematics import Frame
from picchio.visuals.scene.robot.body import Body
from picchio.visuals.scene.robot.mesh import Mesh


@dataclass(frozen=True, eq=False)
class Drawn:
    """A piece of a cause's drawing.

    Attributes:
        link: that it moves with; None: it stands still.
        shapes: in world coordinates at the pose, m.
        at: (3,) m, where the label goes; None: this piece has none.
    """

    link: str | None
    shapes: list[Mesh]
    at: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Site:
    """One cause, and the robot at a pose to draw it on.

    Attributes:
        robot: the robot.
        pose: (nv,) rad or m.
        frames: its links' frames.
        places: (4, 4) world placement of every link.
        body: its meshes and size.
        direction: (3,) unit vector of the tool's force on the robot.
        effect, target: of the cause.
        values: its fitted values, SI; empty where none are known.
        colour: of the drawing.
    """

    robot: FlexibleRobot
    pose: FloatArray
    frames: list[Frame]
    places: Mapping[str, FloatArray]
    body: Body
    direction: FloatArray
    effect: str
    target: str
    values: Mapping[str, float]
    colour: str

    @property
    def reach(self) -> float:
        """m, size of the robot."""
        return self.body.reach

    @property
    def tool_link(self) -> str:
        """The link that carries the tool."""
        return self.robot.link_of(self.robot.tool_frame)

    @property
    def tool_position(self) -> FloatArray:
        """(3,) m, where the force acts."""
        return self.robot.tool_position(self.pose)

    def position(self, link: str) -> FloatArray:
        """(3,) m, of a link's frame."""
        return self.places[link][:3, 3]

    def joint(self, name: str) -> tuple[Frame, FloatArray]:
        """A joint's frame and its axis (3,) in the world."""
        frame = next(frame for frame in self.frames if frame.joint == name)
        assert frame.axis is not None
        return frame, self.places[frame.link][:3, :3] @ frame.axis


def check_place(robot: FlexibleRobot, effect: str, target: str) -> None:
    """Whether a robot has what an effect is said to be about.

    Raises:
        InputError: an effect that is not known, or a joint, link or axis that is not there.
    """
    kind = effect_class(effect).target_kind
    joints, links = robot.joint_names, (*robot.tree.links, robot.tool_point)
    there = {
        "joint": joints,
        "joint pair": joints[1:],
        "link": links,
        "joint or link": (*joints, *links),
        "axis": BASE_AXES,
    }
    if target not in there.get(kind, (target,)):
        raise InputError(f"{robot.name} has no such {kind}", key=effect, value=target,
                         choices=there[kind])  # fmt: skip
