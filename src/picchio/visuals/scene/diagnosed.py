"""The scene of a diagnosis: the causes on the robot, at the pose where the residual is largest."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from picchio.excitation.measured import MeasuredForce
from picchio.visuals.scene.build import build_scene
from picchio.visuals.scene.scene import Scene

if TYPE_CHECKING:
    from picchio.diagnosis.percussion.diagnosis import PercussionDiagnosis


def diagnosis_scene(found: PercussionDiagnosis, **options: Any) -> Scene:
    """The robot with the causes where they sit; in a notebook the cell shows it.

    Pose, blows and direction are those of the record that the nominal model explains worst.

    Args:
        found: a diagnosis of percussion records.
        **options: of `build_scene`: joint, subdivisions, ...
    """
    levels = [float(np.mean(residual**2)) for residual in found.baseline.residuals]
    setup = found.baseline.records[int(np.argmax(levels))].setup
    record = found.problem.campaign[setup.name]
    blows, hits = record.blows(), record.hits
    if blows is None:
        # Only measured: what the tool did from the first blow on.
        data = record.read(["force"])
        after = data["time"] >= -1e-12
        blows, hits = MeasuredForce(data["time"][after], data["force"][after]), 1
    return build_scene(
        found.problem.robot,
        setup.geometry.pose,
        blows,
        hits=hits,
        direction=setup.blows.direction,
        diagnosis=found.diagnosis,
        gravity_stiffness=found.problem.model.gravity_stiffness,
        **options,
    )
