"""How sure a life is: stiffness, damping, blows, strength and the model itself as distributions."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from picchio.core.processes import one_thread
from picchio.core.shown import seeing
from picchio.fatigue.counting.counter import Residue
from picchio.fatigue.mean_stress import Rule
from picchio.fatigue.sn.curve import SNCurve
from picchio.fatigue.uncertain_lives import QUANTILES, Draws, Uncertain, summarise
from picchio.model.model import Model, ModelLike
from picchio.robot.spread import root_of
from picchio.studies.default_task import TaskLike, task_of
from picchio.studies.rivet.variation import WornParts
from picchio.studies.uncertainty.drawn import Drawn
from picchio.studies.uncertainty.measurements import measure_first
from picchio.studies.uncertainty.result import UncertainLife
from picchio.studies.uncertainty.sampler import Sampler

# Samples go on until the ends of every sampling interval are this near to each other.
_NEAR = 1.2
# Samples before a narrow interval is believed; draws of a replicate for the total-order indices.
_FEWEST, _MIXED = 512, 8


@one_thread()
def uncertain_life(
    robot: ModelLike,
    task: TaskLike = None,
    *,
    sn_curve: str | SNCurve | None = None,
    inputs: Mapping[str, Uncertain] | None = None,
    samples: int | None = None,
    seed: int = 0,
    totals: bool = True,
    residue: Residue = "half-cycles",
    mean_stress: Rule = "none",
    gravity_stiffness: bool | None = None,
    gravity_balanced: bool | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> UncertainLife:
    """P10, P50 and P90 of every joint's life, and what makes them uncertain.

    Rivets start from rest and ring down, cycles are counted by rainflow (`assess`'s default).
    Values with a spread of their own (`FlexibleRobot.spreads`) vary by it, correlated as the
    robot's posterior says. One factor is common to the stiffness of all other joints, and one to
    their damping. Specimens' strength scatters as each curve says, one rank for all joints; a
    curve without scatter counts as certain.

    Samples are doubled until every quantile of the robot's life is known within a factor of 1.2
    (the ends of its 95 % sampling interval), or `samples` are done.

    Args:
        robot: with shafts or reducers; or a model of it.
        task: what it does; as in `assess`.
        sn_curve: for all joints, instead of their own.
        inputs: factors on the nominal values, by name: "stiffness", "damping_ratio", "force",
            "width" (of the blows), "model" (error of the computed stress); if not given,
            `DEFAULT_INPUTS`, without the width where blows have none. One joint's stiffness or
            damping ratio ("stiffness.joint_1"), or any other value with a spread, by its name:
            in place of its own spread.
        samples: at most so many, 32 at the least; if not given, 16,384, and fewer for models that
            compiled code cannot take.
        seed: the same seed gives the same result.
        totals: also the total-order indices, which need more runs.
        residue: as in `assess`.
        mean_stress: as in `assess`.
        gravity_stiffness: as in `assess`.
        gravity_balanced: as in `assess`.
        progress: called with (samples done, samples at most).

    Returns:
        the lives as distributions.

    Raises:
        InputError: no joint with a shaft or reducer, an unknown input, a width where blows have
            none.
    """
    model = Model.of(robot, gravity_stiffness=gravity_stiffness, gravity_balanced=gravity_balanced)
    task = task_of(model.robot, task)
    geared = any(joint.reducer for joint in model.robot.flexible_joints)
    stress = WornParts.of(model.robot, sn_curve, None, residue, mean_stress, needed=not geared)
    notes: list[str] = []
    sampler = Sampler.of(model, task, stress, inputs, notes)
    names = [each.name for each in sampler.inputs]
    root = root_of(names, model.robot.posterior)
    most = samples or sampler.budget
    draws = Draws(len(names), seed, most)
    drawn: Drawn | None = None
    mixed = None
    while True:
        new = draws.more()
        found = sampler.run(new.reshape(-1, len(names)) @ root)
        found = Drawn(*(part.reshape(-1, *new.shape[:2]) for part in found))
        drawn = found if drawn is None else Drawn.joined([drawn, found], axis=2)
        lives, used = drawn.lives, drawn.used
        done = draws.scores.shape[0] * draws.scores.shape[1]
        if progress is not None:
            progress(min(done, most), most)
        weakest = summarise(names, draws.scores, drawn.robots_life, drawn.robots_use)
        if 2 * done > most or (done >= _FEWEST and weakest.settled(_NEAR)):
            break
    if totals:
        rows = draws.mixed(_MIXED) @ root
        again = sampler.run(rows.reshape(-1, len(names)))
        mixed = again.used.reshape(len(used), len(names), -1)
        mixed_robot = again.robots_use.reshape(len(names), -1)
    spreads = {
        joint.name: summarise(
            names, draws.scores, lives[k], used[k], None if mixed is None else mixed[k]
        )
        for k, joint in enumerate(stress.joints)
        if (used[k] > 0).all() and (mixed is None or (mixed[k] > 0).all())
    }
    every = draws.scores.reshape(-1, len(names)) @ root
    flat = Drawn(*(part.reshape(len(part), len(every)) for part in drawn))
    first = flat.ends(stress.columns)
    posterior = model.robot.posterior
    if posterior is not None and posterior.among(names) is not None:
        notes.append(
            "correlated values share independent normal factors by the symmetric root of their "
            "correlation matrix; a share is that of the factor nearest to its value"
        )
    answer = UncertainLife(
        joints=spreads,
        robot=summarise(
            names,
            draws.scores,
            drawn.robots_life,
            drawn.robots_use,
            None if mixed is None else mixed_robot,
        ),
        inputs={each.name: each.uncertain for each in sampler.inputs},
        sources={each.name: each.source for each in sampler.inputs},
        estimated=tuple(each.name for each in sampler.inputs if each.estimated),
        scans=sampler.scans(),
        assumptions=(
            "values with a spread of their own vary by it, one factor on the stiffness is common "
            "to all other joints, and one on the damping",
            "shares are of the variance of ln utilisation, which is finite where life is not",
            *notes,
            *model.without_load(),
        ),
        seed=seed,
        lives=drawn.robots_life.ravel(),
        intervals=sampler.intervals(drawn),
        utilisation={
            name: float(np.quantile(flat.robots_use, level)) for name, level in QUANTILES.items()
        },
        ends_first={
            joint.name: float(share)
            for joint, share in zip(model.robot.flexible_joints, first, strict=True)
        },
        measure_first=measure_first(model.robot, sampler.inputs, every, flat, root @ root),
    )
    return seeing(answer, robot=model, task=task)
