"""picchio: how many rivets a robot survives.

It takes a URDF robot, the stiffness of its joints and the blows of the tool it holds, and says how
long each joint lasts. Heavy parts load when they are used:

    >>> import picchio
    >>> picchio.assess("fanuc_like_3dof").limiting_joint
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from picchio import datasets as datasets
    from picchio.campaign.campaign import Campaign as Campaign
    from picchio.campaign.campaign import load_campaign as load_campaign
    from picchio.campaign.importing.importer import import_record as import_record
    from picchio.campaign.record import Record as Record
    from picchio.core.errors import InputError as InputError
    from picchio.core.errors import PicchioWarning as PicchioWarning
    from picchio.diagnosis.diagnose import diagnose as diagnose
    from picchio.diagnosis.identify import identify as identify
    from picchio.diagnosis.percussion.residual import percussion_residual as percussion_residual
    from picchio.diagnosis.planning.plan import plan as plan
    from picchio.excitation.measured import MeasuredForce as MeasuredForce
    from picchio.excitation.pulse_train import HalfSineTrain as HalfSineTrain
    from picchio.excitation.pulse_train import PulseTrain as PulseTrain
    from picchio.fatigue.counting.counter import rainflow as rainflow
    from picchio.fatigue.mean_stress import MeanStress as MeanStress
    from picchio.fatigue.miner import damage as damage
    from picchio.fatigue.sn.fit import fit_sn as fit_sn
    from picchio.fatigue.sn.library import load_sn_curve as load_sn_curve
    from picchio.fatigue.sn.library import sn_curve_names as sn_curve_names
    from picchio.fatigue.sn.test_table import SNTests as SNTests
    from picchio.ledger.count import count as count
    from picchio.measurement.quality.report import check as check
    from picchio.model.effects.registry import effect_from_dict as effect_from_dict
    from picchio.model.model import Model as Model
    from picchio.paper.run import reproduce as reproduce
    from picchio.prediction.motion.closed_loop import CascadeLaw as CascadeLaw
    from picchio.prediction.motion.closed_loop import friction_curve as friction_curve
    from picchio.prediction.motion.closed_loop import simulate_closed_loop as simulate_closed_loop
    from picchio.prediction.percussion import predict as predict
    from picchio.prediction.simulation import simulate as simulate
    from picchio.reference.effects import effects as effects
    from picchio.reference.formats import formats as formats
    from picchio.robot.drives.reducer import load_reducer as load_reducer
    from picchio.robot.ik.self_motion import move_along_self_motion as move_along_self_motion
    from picchio.robot.ik.self_motion import self_motion_basis as self_motion_basis
    from picchio.robot.loading.annotated import annotate as annotate
    from picchio.robot.loading.catalogue import robots as robots
    from picchio.robot.loading.load import load_robot as load_robot
    from picchio.studies.assessment.backwards import allowable as allowable
    from picchio.studies.assessment.method_comparison import compare_methods as compare_methods
    from picchio.studies.assessment.run import assess as assess
    from picchio.studies.comparison import compare as compare
    from picchio.studies.envelopes import envelope as envelope
    from picchio.studies.maps.places import plane as plane
    from picchio.studies.maps.run import workspace_map as workspace_map
    from picchio.studies.placement.run import place as place
    from picchio.studies.start import start as start
    from picchio.studies.tasks import load_task as load_task
    from picchio.studies.tasks import task_from_dict as task_from_dict
    from picchio.studies.uncertainty.run import uncertain_life as uncertain_life
    from picchio.vibration.closed_form.modes import modal_analysis as modal_analysis
    from picchio.vibration.closed_form.response import response_from_rest as response_from_rest
    from picchio.vibration.closed_form.response import steady_state as steady_state
    from picchio.vibration.closed_form.response import (
        truncated_fourier_response as truncated_fourier_response,
    )
    from picchio.visuals.live.explore import explore as explore
    from picchio.visuals.notebook import progress as progress
    from picchio.visuals.report.page import report as report
    from picchio.visuals.view import view as view

# Every public name and its module, which is loaded when the name is first used; "" for a package.
_HOME = {
    # What the commands do: a function each.
    "allowable": "studies.assessment.backwards",
    "annotate": "robot.loading.annotated",
    "assess": "studies.assessment.run",
    "check": "measurement.quality.report",
    "compare": "studies.comparison",
    "count": "ledger.count",
    "diagnose": "diagnosis.diagnose",
    "effects": "reference.effects",
    "envelope": "studies.envelopes",
    "explore": "visuals.live.explore",
    "fit_sn": "fatigue.sn.fit",
    "identify": "diagnosis.identify",
    "formats": "reference.formats",
    "import_record": "campaign.importing.importer",
    "place": "studies.placement.run",
    "plan": "diagnosis.planning.plan",
    "report": "visuals.report.page",
    "reproduce": "paper.run",
    "robots": "robot.loading.catalogue",
    "simulate": "prediction.simulation",
    "start": "studies.start",
    "uncertain_life": "studies.uncertainty.run",
    "view": "visuals.view",
    "workspace_map": "studies.maps.run",
    # What they work on, from files and from Python.
    "Campaign": "campaign.campaign",
    "HalfSineTrain": "excitation.pulse_train",
    "MeasuredForce": "excitation.measured",
    "Model": "model.model",
    "PulseTrain": "excitation.pulse_train",
    "Record": "campaign.record",
    "load_campaign": "campaign.campaign",
    "load_robot": "robot.loading.load",
    "load_sn_curve": "fatigue.sn.library",
    "load_task": "studies.tasks",
    "task_from_dict": "studies.tasks",
    "datasets": "",
    # The steps of the method, for a closer look.
    "CascadeLaw": "prediction.motion.closed_loop",
    "MeanStress": "fatigue.mean_stress",
    "SNTests": "fatigue.sn.test_table",
    "compare_methods": "studies.assessment.method_comparison",
    "damage": "fatigue.miner",
    "effect_from_dict": "model.effects.registry",
    "friction_curve": "prediction.motion.closed_loop",
    "load_reducer": "robot.drives.reducer",
    "modal_analysis": "vibration.closed_form.modes",
    "move_along_self_motion": "robot.ik.self_motion",
    "percussion_residual": "diagnosis.percussion.residual",
    "plane": "studies.maps.places",
    "predict": "prediction.percussion",
    "progress": "visuals.notebook",
    "rainflow": "fatigue.counting.counter",
    "response_from_rest": "vibration.closed_form.response",
    "self_motion_basis": "robot.ik.self_motion",
    "simulate_closed_loop": "prediction.motion.closed_loop",
    "sn_curve_names": "fatigue.sn.library",
    "steady_state": "vibration.closed_form.response",
    "truncated_fourier_response": "vibration.closed_form.response",
    # What goes wrong.
    "InputError": "core.errors",
    "PicchioWarning": "core.errors",
}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return import_module("picchio.core.provenance").package_version()
    if name not in _HOME:
        raise AttributeError(f"module 'picchio' has no attribute {name!r}")
    if not _HOME[name]:
        return import_module(f"picchio.{name}")
    return getattr(import_module(f"picchio.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return __all__
