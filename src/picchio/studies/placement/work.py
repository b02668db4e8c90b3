"""The work of a task as something that can be moved: where the tool goes, which way, how often."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray, IndexArray
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.ik.chain import tool_chain
from picchio.robot.ik.inverse_kinematics import LEAST_JOINTS_FOR_AXIS
from picchio.studies.tasks import Task

# Points nearer than this, m, are one to the inverse kinematics.
_SAME = 1e-7


@dataclass(frozen=True, eq=False)
class Work:
    """Every rivet place of a task, in the order of its operations and poses; k of them.

    Attributes:
        operation: (k,) index of the operation.
        position: (k, 3) m, of the tool, world.
        axis: (k, 3) unit, the way the tool points; None for an arm that cannot choose it.
        direction: (k, 3) unit, of the force on the robot.
        pose: (k, nv) as the task has them.
        share: (k,) rivets set there over the rivets of a pass.
        group: (k,) places of one position and axis have one number: one inverse kinematics.
        centre: (3,) m, about which the work turns.
        up: (3,) unit, about which it turns: against gravity, which therefore stays.
    """

    operation: IndexArray
    position: FloatArray
    axis: FloatArray | None
    direction: FloatArray
    pose: FloatArray
    share: FloatArray
    group: IndexArray
    centre: FloatArray
    up: FloatArray

    @classmethod
    def of(cls, robot: FlexibleRobot, task: Task) -> Work:
        """A task's work, read off its poses: points and poses are treated alike.

        Args:
            robot: the robot.
            task: what it does.
        """
        states = [robot.state(pose) for op in task.operations for pose in op.poses]
        position = np.array([state.tool_position for state in states])
        aims = len(tool_chain(robot).index) >= LEAST_JOINTS_FOR_AXIS
        pointing = np.array([s.tool_rotation @ np.asarray(robot.tool.axis) for s in states])
        sizes = [len(op.poses) for op in task.operations]
        gravity = np.asarray(robot.mounting.gravity, dtype=float)
        size = float(np.linalg.norm(gravity))
        key = np.round(np.hstack([position, pointing if aims else 0.0 * pointing]) / _SAME)
        return cls(
            operation=np.repeat(np.arange(len(sizes)), sizes),
            position=position,
            axis=pointing if aims else None,
            direction=np.repeat([op.direction for op in task.operations], sizes, axis=0),
            pose=np.concatenate([op.poses for op in task.operations]),
            share=np.repeat([op.rivets for op in task.operations], sizes) / task.rivets_per_pass,
            group=np.unique(key, axis=0, return_inverse=True)[1].ravel(),
            centre=0.5 * (position.min(axis=0) + position.max(axis=0)),
            up=-gravity / size if size > 0.0 else np.array([0.0, 0.0, 1.0]),
        )

    def turn(self, heading: float) -> FloatArray:
        """The rotation (3, 3) by `heading` about `up`.

        Args:
            heading: rad.
        """
        return np.asarray(self._turns(np.array([heading]))[0])

    def _turns(self, heading: FloatArray) -> FloatArray:
        """(b, 3, 3), of many headings (b,)."""
        x, y, z = self.up
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        sine, rest = np.sin(heading)[:, None, None], 1.0 - np.cos(heading)[:, None, None]
        return np.asarray(np.eye(3) + sine * cross + rest * (cross @ cross))

    def positions(self, moves: FloatArray, place: int) -> FloatArray:
        """The positions (b, 3) m where a place ends up after moves.

        Args:
            moves: (b, 4) dx, dy, dz in m, heading in rad.
            place: its index.
        """
        arm = self.position[place] - self.centre
        return np.asarray(self._turns(moves[:, 3]) @ arm + self.centre + moves[:, :3])

    def directions(self, moves: FloatArray, vector: FloatArray) -> FloatArray:
        """The vectors (b, 3) that turn with the work.

        Args:
            moves: (b, 4) dx, dy, dz in m, heading in rad.
            vector: (3,).
        """
        return np.asarray(self._turns(moves[:, 3]) @ vector)

    def base_move(self, move: FloatArray, xyz: FloatArray) -> tuple[FloatArray, float]:
        """The same move done by the base instead: its new position (3,) m, and its turn in rad.

        Args:
            move: (4,) dx, dy, dz in m, heading in rad.
            xyz: (3,) m, the base's position.
        """
        back = self.turn(-move[3])
        return back @ (xyz - self.centre - move[:3]) + self.centre, -float(move[3])
