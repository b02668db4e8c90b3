"""The 3-D scene of a robot: what a task, or blows at a pose, do to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from picchio.core.errors import InputError
from picchio.diagnosis.result import Diagnosis
from picchio.excitation.excitation import Excitation
from picchio.model.model import Model, ModelLike
from picchio.studies.assessment.result import Assessment
from picchio.studies.assessment.run import assess
from picchio.studies.default_task import TaskLike, task_of
from picchio.studies.maps.result import WorkspaceMap
from picchio.studies.maps.stored import open_map
from picchio.studies.tasks import Task, blows_of
from picchio.visuals.diagnosis_file import read_diagnosis
from picchio.visuals.scene.build import build_scene
from picchio.visuals.scene.scene import Scene
from picchio.visuals.worst_rivet import worst_rivet

if TYPE_CHECKING:
    import xarray


def view(
    robot: ModelLike,
    *,
    task: TaskLike = None,
    pose: ArrayLike | Mapping[str, float] | None = None,
    excitation: Excitation | None = None,
    hits: int | None = None,
    workspace: str | Path | WorkspaceMap | xarray.Dataset | None = None,
    diagnosis: str | Path | Diagnosis | None = None,
    joint: str | None = None,
    flex: str | Path | None = None,
    tool: str | None = None,
    gravity_stiffness: bool | None = None,
    assessment: Assessment | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Scene:
    """The robot in 3-D with its direction envelopes, rivets and vibration.

    Without a pose the task is assessed and shown at its worst rivet.

    Args:
        robot: the robot, its name or file, or a model of it.
        task: the robot's own example task if None, else an assumed one (`default_task`).
        pose: (nv,) rad or m.
        excitation: the blows at `pose`; those of the task if None.
        hits: with `pose`, blows of a burst from rest; the steady state if None.
        workspace: a workspace map, or its file, as a layer.
        diagnosis: what `picchio diagnose --json` found, or its file: causes where they sit.
        joint: whose envelope is shown first.
        flex: sidecar of the robot.
        tool: the frame that carries the tool.
        gravity_stiffness: add gravity's stiffness dg/dq to the springs'.
        assessment: of the robot on this task, where there is one already.
        progress: called with (done, total) poses of the task.

    Returns:
        the scene: `save` writes it as one offline HTML file, `show` opens a live viewer.

    Raises:
        InputError: a file that cannot be read, a bad pose, an unknown joint.
    """
    model = Model.of(robot, gravity_stiffness=gravity_stiffness, flex=flex, tool=tool)
    loaded = model.robot
    if diagnosis is not None and not isinstance(diagnosis, Diagnosis):
        diagnosis = read_diagnosis(diagnosis, loaded)
    if isinstance(workspace, (str, Path)):
        workspace = open_map(workspace)
    layers: dict[str, Any] = {"joint": joint, "workspace": workspace, "diagnosis": diagnosis}
    if pose is not None:
        if excitation is None:
            if isinstance(task, Task):
                raise InputError("needs its blows, too: a task's may differ by operation",
                                 key="pose", hint="give `excitation`")  # fmt: skip
            excitation = blows_of(loaded, task)
        return build_scene(model, pose, excitation, hits=hits, **layers)
    for key, value in (("excitation", excitation), ("hits", hits)):
        if value is not None:
            raise InputError("needs --pose: a task says its blows itself", key=key, value=value)
    task = task_of(loaded, task)
    life = assessment or assess(model, task, progress=progress)
    worst = worst_rivet(life, model, task)
    return build_scene(
        model,
        worst.pose,
        worst.operation.excitation,
        hits=worst.operation.hits_per_rivet,
        direction=worst.operation.direction,
        assessment=life,
        **layers,
    )
