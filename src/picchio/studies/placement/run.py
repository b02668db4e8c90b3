"""Where to put the work so that the robot lasts longest.

The work may be shifted and turned about the vertical (or the base the other way: only how they
stand to each other counts). At every placement each rivet takes the best of the poses that reach
it: all branches, the roll about the tool's axis, the null space of a redundant arm. First many
placements spread over what is allowed, then a pattern search from the best few of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError, warn_user
from picchio.core.processes import one_thread
from picchio.core.provenance import provenance
from picchio.core.shown import seeing
from picchio.fatigue.miner import life
from picchio.fatigue.sn.curve import SNCurve
from picchio.model.model import Model, ModelLike
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.ik.chain import tool_chain
from picchio.studies.default_task import TaskLike, task_of
from picchio.studies.placement.loads import Loads
from picchio.studies.placement.reach import Candidates
from picchio.studies.placement.result import JointUse, Off, Placement, Standing
from picchio.studies.placement.search import ROUNDS, SHIFTS, Search, Spot, descend
from picchio.studies.placement.self_collision import SelfCollision
from picchio.studies.placement.sureness import sureness, surest
from picchio.studies.placement.work import Work
from picchio.studies.rivet.life_rules import curves_of
from picchio.studies.rivet.pose import need_springs
from picchio.studies.tasks import Task

PLACEMENTS = 400
_DESCENTS = 3
_PERIODS = 7


@one_thread()
def place(
    robot: ModelLike,
    task: TaskLike = None,
    *,
    move: Sequence[float] | None = None,
    period_range: tuple[float, float] | None = None,
    placements: int = PLACEMENTS,
    off: float = 0.05,
    margin: float = 0.0,
    sn_curve: str | SNCurve | None = None,
    self_collision: bool = True,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> Placement:
    """The placement, poses and hit rate that spare the weakest joint most.

    Lives are those of `assess` by its default method, gravity stiffness off.

    Args:
        robot: with stiffnesses, and shafts or reducers (or else effort limits); or a model of it.
        task: the work; the tool's places are read off its poses. The robot's example if not
            given, else `default_task`.
        move: how far the work may go each way: x, y, z in m, heading in rad; half the arm's
            reach and a half turn if not given. Zeros leave it where it is: poses alone.
        period_range: s, shortest and longest period of the blows; as the task says if not given.
        placements: how many within reach are tried all over before the search goes local.
        off: m, how far beside the best place `off` of the result looks.
        margin: m; the best place must leave every rivet within reach when the work stands so far
            beside it along x, y or z. Without one the best place may be at the very edge of reach.
        sn_curve: for all joints, instead of their own.
        self_collision: check for it where the URDF has meshes.
        seed: moves what is tried.
        progress: called with (steps done, steps in all): placements all over, then rounds of the
            local searches.

    Returns:
        the placement; never worse than the start where the start is within the limits, and
        always within them.

    Raises:
        InputError: no flexible joint, nothing to rank joints by, a bad range, no place at all
            where every rivet can be set.
    """
    model = Model.of(robot)
    robot = model.robot
    if model.nonlinear:
        effects = ", ".join(e.label for e in model.effects if e.where == "nonlinear")
        raise InputError(
            "placement compares many thousands of poses, and a nonlinear model must be integrated "
            "in time at each",
            value=effects,
            hint="place the work by a model without it, then assess the place with it",
        )
    need_springs(robot)
    task = task_of(robot, task)
    if placements < 1:
        raise InputError("must be at least 1", key="placements", value=placements)
    if not (math.isfinite(off) and off > 0.0):
        raise InputError("must be positive", key="off", value=off)
    if not (math.isfinite(margin) and margin >= 0.0):
        raise InputError("must not be negative", key="margin", value=margin)
    curves = curves_of(robot, sn_curve)
    loads = Loads(model, task, curves, tuple(j.ratings for j in robot.flexible_joints))
    work = Work.of(robot, task)
    half = _half(robot, move)
    periods = _periods(task, period_range)
    meshes: SelfCollision | str = "not asked for"
    if self_collision:
        meshes = SelfCollision.of(robot, work.pose[0])
    search = Search(work, loads, meshes if isinstance(meshes, SelfCollision) else None, margin)
    damage, used = _costs(search, np.zeros(4), None, work.pose, compiled=True)
    start = Spot(np.zeros(4), None, work.pose, float(damage.max()), float(used.max()))
    beyond = any(robot.limit_violations(pose) for pose in work.pose)
    valid = not beyond and not search.colliding(work.pose)
    if not valid:
        warn_user(
            "the work now stands where joints are beyond their limits or links collide: it is "
            "no candidate for the best place"
        )
    best = _search(search, start if valid else None, half, periods, placements, seed, progress)
    now = _standing(search, start)
    if best is None:
        raise InputError(
            "nowhere within the range can every rivet be set", key="move", value=half.tolist()
        )
    then = _standing(search, best)
    still = Search(work, loads, search.collision, margin)
    poses = _search(still, start if valid else None, np.zeros(4), None, 1, seed, None)
    alone = None if poses is None else _standing(search, poses)
    if valid and (alone is None or not _exact(alone).better_than(_exact(now))):
        alone = now
    if alone is not None and not _exact(then).better_than(_exact(alone)):
        then = alone
    found = Placement(
        robot=robot.name,
        by_effort=loads.by_effort,
        start=now,
        start_valid=valid,
        poses_alone=alone,
        best=then,
        sure=sureness(loads, work, start, then.spot),
        off=_beside(search, then.spot, off),
        centre=work.centre,
        placements=search.tried,
        reached=search.reached,
        nearby=search.nearby,
        self_collision=(
            f"{meshes.pairs} pairs of links" if isinstance(meshes, SelfCollision) else meshes
        ),
        assumptions=_assumptions(loads, meshes),
        provenance=provenance([*robot.files, *task.files], seed=seed),
    )
    return seeing(found, robot=model, task=_moved(task, work, then.spot))


def _moved(task: Task, work: Work, spot: Spot) -> Task:
    """The task with its work at another spot."""
    turn, period = work.turn(spot.move[3]), spot.period
    return replace(
        task,
        operations=tuple(
            replace(
                op,
                direction=turn @ op.direction,
                poses=spot.poses[work.operation == k],
                excitation=op.excitation if period is None else op.excitation.with_period(period),
            )
            for k, op in enumerate(task.operations)
        ),
    )


def _half(robot: FlexibleRobot, move: Sequence[float] | None) -> FloatArray:
    if move is None:
        reach = 0.5 * tool_chain(robot).reach
        return np.array([reach, reach, reach, np.pi])
    half = np.asarray(move, dtype=float)
    if half.shape != (4,) or not np.isfinite(half).all() or (half < 0.0).any():
        raise InputError(
            "must be four numbers that are not negative: x, y, z in m and the heading",
            key="move",
            value=list(move),
        )
    half[3] = min(half[3], np.pi)
    return half


def _periods(task: Task, wanted: tuple[float, float] | None) -> tuple[float, float] | None:
    if wanted is None:
        return None
    low, high = (float(p) for p in wanted)
    if not (0.0 < low <= high < math.inf):
        raise InputError(
            "must be two positive periods in s, the shorter first", key="period_range", value=wanted
        )
    for operation in task.operations:
        try:
            operation.excitation.with_period(low)  # refuses blows longer than that
        except InputError as error:
            raise InputError(error.problem, key="period_range", value=low) from None
    return low, high


def _costs(
    search: Search, move: FloatArray, period: float | None, poses: FloatArray, *, compiled: bool
) -> tuple[FloatArray, FloatArray]:
    """Of given poses: each joint's damage by a rivet of the mix, (n,); utilisation, (k, n)."""
    only = Candidates(move[None], tuple(pose[None, None] for pose in poses))
    damage, used = (table[:, 0, 0] for table in search.costs(only, period, compiled=compiled))
    return (damage * search.work.share[:, None]).sum(axis=0), used


def _search(
    search: Search,
    start: Spot | None,
    half: FloatArray,
    periods: tuple[float, float] | None,
    placements: int,
    seed: int,
    progress: Callable[[int, int], None] | None,
) -> Spot | None:
    rng = np.random.default_rng(seed)
    rates = [None] if periods is None else list(np.linspace(*periods, _PERIODS))
    total = placements + (_DESCENTS + 1) * ROUNDS

    def tell(done: int) -> None:
        if progress is not None:
            progress(min(done, total), total)

    found = search.explore(half, rates, placements, seed, tell)
    chosen: list[Spot] = [] if start is None else [start]
    if start is not None and periods is not None:
        own = search.loads.task.operations[0].excitation.period
        if periods[0] <= own <= periods[1]:
            chosen = [replace(start, period=own)]
    for spot in found:
        if len(chosen) > _DESCENTS:
            break
        if any(_near(spot, other, half) for other in chosen[1 if start else 0 :]):
            continue
        settled = _settle(search, spot, seed)
        if settled is not None:
            chosen.append(settled)
    step = 0.5 * half / placements**0.25
    ended = []
    for k, spot in enumerate(chosen):

        def step_done(number: int, done: int = placements + k * ROUNDS) -> None:
            tell(done + number)

        ended.append(descend(search, spot, step, half, periods, rng, step_done))
    tell(total)
    ended.sort(key=lambda s: (s.damage, s.utilisation))
    return surest(search.loads, search.work, ended)


def _near(one: Spot, other: Spot, half: FloatArray) -> bool:
    gap = np.abs(one.move - other.move)
    gap[3] = min(gap[3], 2.0 * np.pi - gap[3])
    return bool((gap <= 0.15 * half).all()) and one.period == other.period


def _settle(search: Search, spot: Spot, seed: int) -> Spot | None:
    """The spot, checked; with other poses where links would touch; None where none are left."""
    worst = replace(spot, damage=math.inf, utilisation=math.inf)
    everywhere = search.reach.everywhere(4, seed)
    for seeds in (
        [q[None, search.reach.chain.index] for q in spot.poses],
        [everywhere] * len(spot.poses),
    ):
        found = search.score(search.reach.candidates(spot.move[None], seeds), spot.period, worst)
        if found and found[0] is not None:
            return found[0]
    return None


def _standing(search: Search, spot: Spot) -> Standing:
    """The same spot by the exact path."""
    damage, used = _costs(search, spot.move, spot.period, spot.poses, compiled=False)
    joints = tuple(
        JointUse(joint.name, life(float(damage[j])), float(used[:, j].max()))
        for j, joint in enumerate(search.loads.joints)
    )
    mounting = search.loads.model.robot.mounting
    base, heading = search.work.base_move(spot.move, np.asarray(mounting.xyz, dtype=float))
    return Standing(spot, joints, base, heading)


def _exact(standing: Standing) -> Spot:
    rivets = standing.rivets_to_failure
    damage = 1.0 / rivets if rivets > 0.0 else math.inf
    return replace(standing.spot, damage=damage, utilisation=standing.utilisation)


def _beside(search: Search, spot: Spot, off: float) -> tuple[Off, ...]:
    """What it costs to be beside the best place by `off` m along x, y and z."""
    result = []
    for shift, score in zip(off * SHIFTS, search.beside(spot, off), strict=True):
        at = (float(shift[0]), float(shift[1]), float(shift[2]))
        rivets = math.nan if score is None else life(score.damage)
        result.append(Off(at, rivets, math.nan if score is None else score.utilisation))
    return tuple(result)


def _assumptions(loads: Loads, meshes: SelfCollision | str) -> tuple[str, ...]:
    lines = [
        "gravity stiffness off; each rivet starts from rest and rings down before the next",
        "the work keeps its shape and its place to gravity: it is shifted, and turned about the "
        "vertical; the force and the tool's axis turn with it",
        "the tool turns freely about its axis",
        "the robot may change its branch between any two rivets",
        *loads.model.without_load(),
        "nothing is known of obstacles around robot and work, nor whether the tool fits",
    ]
    if loads.model.robot.spreads:
        lines.append(
            "values of the robot are uncertain: of the best places found, that is taken which is "
            "the best in most of the drawn cases"
        )
    if loads.by_effort:
        lines.append(
            "no joint has a shaft or a reducer: utilisation is the largest torque, gravity and "
            "blows together, over the URDF's effort limit, and no life is given"
        )
    if isinstance(meshes, str):
        lines.append(f"self-collisions are not checked: {meshes}")
    return tuple(lines)
