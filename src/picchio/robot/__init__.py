"""Robots: URDF, annotation, sidecar, poses and inverse kinematics -> `FlexibleRobot`."""

from picchio.robot.catalogue import RobotEntry, list_robots
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.joint import Joint, Shaft
from picchio.robot.load import load_robot
from picchio.robot.state import RobotState
from picchio.robot.tool import Gun, Mounting, Tool

__all__ = [
    "FlexibleRobot",
    "Gun",
    "Joint",
    "Mounting",
    "RobotEntry",
    "RobotState",
    "Shaft",
    "Tool",
    "list_robots",
    "load_robot",
]
