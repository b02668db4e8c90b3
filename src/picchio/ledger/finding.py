"""How blows are found: by a force, the tool's acceleration, its trigger, the task's poses."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from picchio.campaign.channels import AXES
from picchio.campaign.importing.mapping import Mapping
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.ledger.blows import Blow, Run, Shape, assumed, measured, runs
from picchio.ledger.damage import unscaled
from picchio.ledger.jolts import jolts
from picchio.ledger.samples import STEPS, Samples
from picchio.ledger.store import Kept, Stream
from picchio.model.many_poses import ManyPoses
from picchio.model.model import Model
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.studies.rivet.pose import ModelAtPose
from picchio.studies.tasks import Operation, Task
from picchio.vibration.closed_form.response import unit_vector

SHARE = 0.2  # of the task's force: what a blow exceeds where nobody says
_FOOT = 0.1  # of the threshold
_AT_REST = 12.0  # m/s^2: an accelerometer reads gravity, and its noise
NEAR = 0.02
"""rad or m: a robot that stands so near to a pose of the task works there."""


def stream_of(samples: Samples, rules: Mapping, task: Task, robot: FlexibleRobot) -> Stream:
    """The stream that a log belongs to.

    Args:
        samples: its first stretch.
        rules: its mapping.
        task: whose force tells what a blow exceeds.
        robot: whose masses tell which acceleration that is.

    Raises:
        InputError: a force along one direction that nobody states, a threshold that must be given.
    """
    asked = rules.blows
    kind, columns = samples.kind, samples.values.shape[1]
    threshold = asked.threshold if asked else None
    if threshold is None and kind in ("trigger", "poses"):
        threshold = 0.5
    if threshold is None and kind == "force":
        threshold = SHARE * max(op.excitation.peak_force for op in task.operations)
    told = asked.model_dump(mode="json") if asked else {}
    settings = {k: told.get(k) for k in ("direction", "frame", "trigger", "operation")}
    rest = 0.0
    if kind == "acceleration":
        settings["sensor"] = list(samples.names)
        meant = _operations(task, settings["operation"], None)
        settings["hold"] = round(2e9 * max(op.excitation.period for op in meant))
        rest = _AT_REST * samples.names[0].startswith("accelerometer")
        if threshold is None:
            weakest = _felt_least(settings, task, robot)
            if weakest < 2.5 * rest:
                raise InputError(f"say what the reading exceeds in a blow: the task's blows are "
                                 f"{weakest:.3g} m/s^2, which gravity hides",
                                 key="blows.threshold", hint="such as 100.0, m/s^2")  # fmt: skip
            threshold = float(f"{max(SHARE * weakest, 1.25 * rest):.2g}")
    assert threshold is not None
    usual = min(max(_FOOT * threshold, rest), threshold)
    foot = asked.foot if asked and asked.foot else usual
    if kind in ("trigger", "poses"):
        foot = threshold
    if foot > threshold:
        raise InputError("must not exceed the threshold", key="blows.foot", value=foot)
    if kind == "force" and columns == 1 and settings["direction"] is None:
        only = _operation(task, settings["operation"], None)
        settings["direction"], settings["frame"] = only.direction.tolist(), "world"
    return Stream(kind, samples.gap, columns, threshold, foot, settings)


def _operations(task: Task, name: str | None, pose: FloatArray | None) -> list[Operation]:
    """Those that may be meant: by name, by where the robot stands, or all."""
    if name is not None:
        for operation in task.operations:
            if operation.name == name:
                return [operation]
        raise InputError("the task has no such operation", key="blows.operation", value=name,
                         choices=[op.name for op in task.operations])  # fmt: skip
    if len(task.operations) == 1 or pose is None:
        return list(task.operations)
    near = [op for op in task.operations if (np.abs(op.poses - pose).max(axis=1) < NEAR).any()]
    return near or list(task.operations)


def _operation(task: Task, name: str | None, pose: FloatArray | None) -> Operation:
    """The operation that is meant: by its name, by where the robot stands, or the only one."""
    meant = _operations(task, name, pose)
    if len(meant) == 1:
        return meant[0]
    raise InputError("several operations of the task may be meant: say which one",
                     key="blows.operation", choices=[op.name for op in meant])  # fmt: skip


def standing(samples: Samples, task: Task) -> Samples:
    """Where the robot stands at a pose of the task, as a trigger; other samples as they are.

    Args:
        samples: of a log.
        task: its poses.
    """
    if samples.kind != "poses":
        return samples
    near = np.zeros(len(samples.poses), dtype=bool)
    for operation in task.operations:
        for pose in operation.poses:
            near |= np.abs(samples.poses - pose).max(axis=1) < NEAR
    return replace(samples, stamps=samples.pose_stamps, values=near[:, None].astype(float))


def blows_of(
    stream: Stream, parts: Iterable[Kept], model: Model, task: Task,
    steady: dict[int, int] | None = None,
) -> Iterator[Blow]:  # fmt: skip
    """The blows of a stream, by time.

    Args:
        stream: which.
        parts: what the ledger holds of it, by time: no run crosses two of them.
        model: the robot, and the effects on blows that are assumed.
        task: whose blows are assumed where none are seen.
        steady: what reads as of a tool without separate blows is added to it: {begins: lasts}, ns.

    Raises:
        InputError: no pose anywhere; an operation that is not told.
    """
    settings, robot = stream.settings, model.robot

    def turn(pose: FloatArray) -> FloatArray:
        return robot.frame_placement(pose, robot.tool_frame)[1]

    rotation = turn if settings.get("frame") == "tool" else None
    given = settings.get("direction")
    fixed = None if given is None or stream.columns == 3 else unit_vector(given)
    shapes: dict[tuple[int, int], list[Shape]] = {}
    gains: dict[tuple[Any, ...], FloatArray] = {}
    hit, before = 0, 0  # of a rivet, and ns of the blow before

    def told(run: Run) -> Iterator[Blow]:
        nonlocal hit, before
        if stream.kind == "force":
            yield measured(run, fixed, rotation)
            return
        if stream.kind == "acceleration":
            meant = _operations(task, settings.get("operation"), run.pose)
            found = _jolts(run, stream, meant[0])
            if found is None and steady is not None:
                steady[run.onset] = run.last - run.onset
            for jolt, peak in found or ():
                blow = _felt(jolt, peak, settings, meant, task, model, shapes)
                near = blow.onset - before < 2e9 * meant[0].excitation.period
                hit, before = hit + 1 if near else 0, blow.onset
                yield _corrected(blow, hit, stream, meant[0], model, gains)
            return
        operation = _operation(task, settings.get("operation"), run.pose)
        period = operation.excitation.period
        length = (run.last - run.onset) * 1e-9
        hits = 1 if settings.get("trigger") == "blow" else 1 + int(length / period)
        if stream.kind == "poses":
            hits = (
                operation.hits_per_rivet if length >= 0.5 * period * operation.hits_per_rivet else 0
            )
        yield from assumed(run, operation, stream.kind, hits, model, shapes)

    late: list[Blow] = []  # blows that are assumed may go on after the next run has begun
    for kept in parts:
        for run in runs(kept):
            yield from (blow for blow in late if blow.onset < run.onset)
            late = [*(blow for blow in late if blow.onset >= run.onset), *told(run)]
            late.sort(key=lambda blow: blow.onset)
    yield from late


def _jolts(run: Run, stream: Stream, operation: Operation) -> list[tuple[Run, FloatArray]] | None:
    """The blows of a run, each with the largest reading, (k,) m/s^2; None: see `jolts`."""
    period = operation.excitation.period
    width = operation.excitation.width or 0.1 * period
    time = (run.stamps - run.stamps[0]) * 1e-9
    found = jolts(time, run.values, stream.threshold, width, period)
    if found is None:
        return None
    at = [(int(run.stamps[0]) + round(1e9 * begin), peak, cut) for begin, peak, cut in found]
    return [(replace(run, onset=onset, last=onset, cut=cut), peak) for onset, peak, cut in at]


def _felt(
    run: Run, peak: FloatArray, settings: dict[str, Any], meant: list[Operation], task: Task,
    model: Model, shapes: dict[tuple[int, int], list[Shape]],
) -> Blow:  # fmt: skip
    """A blow of the task's shape, as large as the peak of the tool's acceleration tells.

    While a blow lasts the springs have not moved: a = J M^-1 J^T n F. Of the operations that may be
    meant that one is taken whose n fits the reading best.
    """
    if len(meant) > 1 and peak.size < 2:
        meant = [_operation(task, settings.get("operation"), run.pose)]
    best: tuple[float, float, Operation] | None = None
    for operation in meant:
        per = _answers(settings, operation, unscaled(model), run.pose[None])[0]
        force = float(peak @ per) / float(per @ per)
        left = float(np.linalg.norm(peak - force * per))
        if best is None or left < best[0] * (1.0 - 1e-9):
            best = left, abs(force), operation
    assert best is not None
    blow = assumed(run, best[2], "acceleration", 1, model, shapes)[0]
    within = int(np.searchsorted(run.stamps, run.onset + round(1e9 * blow.time[-1])))
    within -= int(np.searchsorted(run.stamps, run.onset))
    return replace(blow, force=blow.force * (best[1] / blow.peak), samples=within, cut=run.cut)


def _corrected(
    blow: Blow, hit: int, stream: Stream, operation: Operation, model: Model,
    gains: dict[tuple[Any, ...], FloatArray],
) -> Blow:  # fmt: skip
    """The blow, less what the springs' pull is taken for.

    They do move a little while a blow lasts, and the arm's ringing is not quite what was read
    around it: how much too large that makes each of the task's own blows is computed, read as often
    as the log was and kept as it is, and taken out. The first blows of a rivet come out smaller
    than the later ones, and count most.
    """
    if model.nonlinear:
        return blow
    step = stream.gap / STEPS
    key = (operation.name, *np.round(blow.pose / NEAR), *np.round(blow.direction, 2))
    if key not in gains and step:
        excitation, hits = operation.excitation, operation.hits_per_rivet
        quiet = int(2 * excitation.period / step * 1e9)
        time = step * 1e-9 * np.arange(quiet + int((hits + 2) * excitation.period / step * 1e9))
        response = ModelAtPose(unscaled(model), blow.pose).tool_response(excitation, hits)
        read = np.zeros((time.size, 3))
        read[quiet:] = response.acceleration(time[: time.size - quiet], blow.direction).T
        stamps = np.rint(1e9 * time).astype(np.int64)
        size = blow.peak / excitation.peak_force
        made = Kept(stream, stamps, size * read, stamps[:1], blow.pose[None])
        mass, jacobian = ManyPoses(unscaled(model), blow.pose[None]).mass_and_jacobian()
        per = jacobian[0] @ np.linalg.solve(mass[0], blow.direction @ jacobian[0])
        told = [
            float(peak @ per) / (blow.peak * float(per @ per))
            for run in runs(made)
            for _, peak in _jolts(run, stream, operation) or ()
        ]
        gains[key] = np.array(told) if len(told) == hits else np.ones(1)
    known = gains.get(key, np.ones(1))
    return replace(blow, force=blow.force / known[min(hit, len(known) - 1)])


def _answers(
    settings: dict[str, Any], operation: Operation, model: Model, poses: FloatArray
) -> FloatArray:
    """(p, k) what the sensor reads of a blow, m/s^2 a newton, in its own axes."""
    robot, found = model.robot, []
    mass, jacobian = ManyPoses(model, poses).mass_and_jacobian()
    sensor = settings.get("sensor") or ["acceleration"]
    kind, _, rest = sensor[0].partition(".")
    for k, pose in enumerate(poses):
        frame = robot.frame_placement(pose, robot.tool_frame)[1]
        along = model.force_directions(frame) @ operation.direction
        moved = jacobian[k] @ np.linalg.solve(mass[k], along @ jacobian[k])
        if not rest:  # its axis is not told: that of the blow
            found.append(np.array([along @ moved]))
            continue
        if kind == "accelerometer":
            moved = robot.frame_placement(pose, rest.rpartition(".")[0])[1].T @ moved
        found.append(moved[[AXES.index(name[-1]) for name in sensor]])
    return np.array(found)


def _felt_least(settings: dict[str, Any], task: Task, robot: FlexibleRobot) -> float:
    """m/s^2, what the sensor reads of the task's weakest blow."""
    model = Model.of(robot)
    return min(
        float(np.linalg.norm(_answers(settings, op, model, op.poses), axis=1).min())
        * op.excitation.peak_force
        for op in _operations(task, settings.get("operation"), None)
    )
