"""picchio: how many rivets a robot survives.

It takes a URDF robot, the stiffness of its joints and the blows of the tool it holds, and says how
long each joint lasts. Heavy parts load when they are used:

    >>> import picchio
    >>> robot = picchio.load_robot("fanuc_like_3dof")
    >>> task = picchio.load_task(robot.task_path, robot)
    >>> picchio.assess(robot, task).limiting_joint
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from picchio import datasets
    from picchio.campaign import Campaign, Record, load_campaign, write_campaign
    from picchio.core.errors import InputError, PicchioError, PicchioWarning
    from picchio.excitation import HalfSineTrain, MeasuredForce, PulseTrain
    from picchio.fatigue import SNCurve, load_sn_curve, rainflow
    from picchio.model import LinearSystem, Model
    from picchio.robot import FlexibleRobot, load_robot
    from picchio.studies import Assessment, Task, assess, load_task, task_from_dict
    from picchio.vibration import (
        modal_analysis,
        response_from_rest,
        steady_state,
        truncated_fourier_response,
    )

_HOME = {
    "Assessment": "studies",
    "Campaign": "campaign",
    "FlexibleRobot": "robot",
    "HalfSineTrain": "excitation",
    "InputError": "core.errors",
    "LinearSystem": "model",
    "MeasuredForce": "excitation",
    "Model": "model",
    "PicchioError": "core.errors",
    "PicchioWarning": "core.errors",
    "PulseTrain": "excitation",
    "Record": "campaign",
    "SNCurve": "fatigue",
    "Task": "studies",
    "assess": "studies",
    "load_campaign": "campaign",
    "load_robot": "robot",
    "load_sn_curve": "fatigue",
    "load_task": "studies",
    "modal_analysis": "vibration",
    "rainflow": "fatigue",
    "response_from_rest": "vibration",
    "steady_state": "vibration",
    "task_from_dict": "studies",
    "truncated_fourier_response": "vibration",
    "write_campaign": "campaign",
}

__all__ = [
    "Assessment",
    "Campaign",
    "FlexibleRobot",
    "HalfSineTrain",
    "InputError",
    "LinearSystem",
    "MeasuredForce",
    "Model",
    "PicchioError",
    "PicchioWarning",
    "PulseTrain",
    "Record",
    "SNCurve",
    "Task",
    "assess",
    "datasets",
    "load_campaign",
    "load_robot",
    "load_sn_curve",
    "load_task",
    "modal_analysis",
    "rainflow",
    "response_from_rest",
    "steady_state",
    "task_from_dict",
    "truncated_fourier_response",
    "write_campaign",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return import_module("picchio.core.provenance").package_version()
    if name == "datasets":
        return import_module("picchio.datasets")
    if name in _HOME:
        return getattr(import_module(f"picchio.{_HOME[name]}"), name)
    raise AttributeError(f"module 'picchio' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__, "__version__"])
