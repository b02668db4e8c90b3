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
    from picchio.campaign.campaign import Campaign, load_campaign, write_campaign
    from picchio.campaign.record import Record
    from picchio.core.errors import InputError, PicchioError, PicchioWarning
    from picchio.excitation.half_sine_train import HalfSineTrain
    from picchio.excitation.measured import MeasuredForce
    from picchio.excitation.pulse_train import PulseTrain
    from picchio.fatigue.counting.counter import rainflow
    from picchio.fatigue.sn.curve import SNCurve
    from picchio.fatigue.sn.library import load_sn_curve
    from picchio.model.linear_system import LinearSystem
    from picchio.model.model import Model
    from picchio.robot.flexible_robot import FlexibleRobot
    from picchio.robot.loading.load import load_robot
    from picchio.studies.assessment.result import Assessment
    from picchio.studies.assessment.run import assess
    from picchio.studies.tasks import Task, load_task, task_from_dict
    from picchio.vibration.closed_form.fourier import truncated_fourier_response
    from picchio.vibration.closed_form.modes import modal_analysis
    from picchio.vibration.closed_form.response import response_from_rest, steady_state

_HOME = {
    "Assessment": "studies.assessment.result",
    "Campaign": "campaign.campaign",
    "FlexibleRobot": "robot.flexible_robot",
    "HalfSineTrain": "excitation.half_sine_train",
    "InputError": "core.errors",
    "LinearSystem": "model.linear_system",
    "MeasuredForce": "excitation.measured",
    "Model": "model.model",
    "PicchioError": "core.errors",
    "PicchioWarning": "core.errors",
    "PulseTrain": "excitation.pulse_train",
    "Record": "campaign.record",
    "SNCurve": "fatigue.sn.curve",
    "Task": "studies.tasks",
    "assess": "studies.assessment.run",
    "load_campaign": "campaign.campaign",
    "load_robot": "robot.loading.load",
    "load_sn_curve": "fatigue.sn.library",
    "load_task": "studies.tasks",
    "modal_analysis": "vibration.closed_form.modes",
    "rainflow": "fatigue.counting.counter",
    "response_from_rest": "vibration.closed_form.response",
    "steady_state": "vibration.closed_form.response",
    "task_from_dict": "studies.tasks",
    "truncated_fourier_response": "vibration.closed_form.fourier",
    "write_campaign": "campaign.campaign",
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
