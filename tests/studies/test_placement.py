"""Placement against brute-force grids whose inverse kinematics and lives are computed elsewhere."""

import dataclasses
import math

import numpy as np
import placement_grid
import pytest

import picchio
from picchio.core.errors import InputError, PicchioWarning
from picchio.robot.drives.reducer import load_reducer
from picchio.studies.placement.run import place
from picchio.studies.placement.sureness import moved
from picchio.studies.placement.work import Work
from picchio.studies.rivet.life_rules import curves_of
from picchio.studies.rivet.poses import damage_at
from picchio.studies.tasks import Task

# Beyond this, relative, the search's last steps no longer look.
REFINED = 1e-6


@pytest.fixture(scope="module")
def arm():
    return picchio.load_robot("fanuc_like_3dof")


@pytest.fixture(scope="module")
def panel(arm):
    """Five of the paper's fifteen rivets, two of its directions: quick to search."""
    points = [
        [1.35, y, z] for y, z in ((-0.5, 0.4), (0.5, 0.4), (0.0, 0.65), (-0.5, 0.9), (0.5, 0.9))
    ]
    operations = [
        {"name": name, "direction": n, "branch": "elbow-down", "points": points}
        for name, n in (("forward", [1, 0, 0]), ("upward", [0, 0, 1]))
    ]
    blows = {"force": 300.0, "period": 0.04, "width": 0.004}
    return picchio.task_from_dict({"excitation": blows, "operation": operations}, arm)


def within_limits(robot, found):
    return not any(robot.limit_violations(pose) for pose in found.best.spot.poses)


def tool_places(robot, poses):
    return np.array([robot.state(pose).tool_position for pose in poses])


def assert_never_worse(robot, found, grid):
    """Than the grid's best (damage, utilisation), than the start; and never out of limits."""
    damage, used = 1.0 / found.best.rivets_to_failure, found.best.utilisation
    now = 1.0 / found.start.rivets_to_failure
    assert damage <= grid[0] * (1 + REFINED)
    assert damage <= now
    if grid[0] == 0.0:
        assert used <= grid[1] * (1 + REFINED)
    if now == 0.0:
        assert used <= found.start.utilisation
    assert within_limits(robot, found)


def test_the_kernel_is_assess(arm):
    rng = np.random.default_rng(3)
    poses = rng.uniform(arm.lower, arm.upper, (5, 3))
    directions = rng.normal(size=(5, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    steel = picchio.load_sn_curve("42CrMo4-QT-shaft")
    for blows, curve in (
        (picchio.PulseTrain(4000.0, 0.04, 0.004), steel),
        (picchio.HalfSineTrain(300.0, 0.05, 0.02), steel.with_miner("haibach")),
        (picchio.PulseTrain(300.0, 0.04, 0.004), picchio.load_sn_curve("nie-2016")),
    ):
        curves = curves_of(arm, curve)
        fast = damage_at(picchio.Model(arm), poses, directions, blows, 12, curves)
        slow = damage_at(picchio.Model(arm), poses, directions, blows, 12, curves, compiled=False)
        assert slow.damage.max() > 0.0
        np.testing.assert_allclose(fast.damage, slow.damage, rtol=1e-5, atol=1e-30)
        scale = np.abs(slow.highest).max()
        np.testing.assert_allclose(fast.amplitude, slow.amplitude, rtol=1e-6, atol=1e-6 * scale)
        np.testing.assert_allclose(fast.lowest, slow.lowest, atol=1e-6 * scale)


@pytest.mark.parametrize("move", [[0.0] * 4, [0.1, 0.1, 0.1, 0.2]])
def test_what_another_branch_gives_is_told_apart_from_what_the_place_gives(arm, move):
    point, blows = [1.2, 0.3, 0.9], {"force": 300.0, "period": 0.04, "width": 0.004}

    def task(pose):
        entry = {"name": "a", "direction": [1, 0, 0], "poses": [list(pose)]}
        return picchio.task_from_dict({"excitation": blows, "operation": [entry]}, arm)

    def life(pose):
        return picchio.assess(arm, task(pose), sn_curve="nie-2016").rivets_to_failure

    worst, best = sorted(arm.all_branches(point), key=life)
    found = place(arm, task(worst), move=move, placements=5, sn_curve="nie-2016")
    poses, there = found.parts["poses"], found.parts["place"]
    assert (found.poses_alone.spot.move == 0.0).all()
    assert found.poses_alone.rivets_to_failure == pytest.approx(life(best), rel=1e-9)
    assert poses.life == pytest.approx(life(best) / life(worst), rel=1e-9) and poses.life > 2.5
    assert there.life > 1.05 if any(move) else there.life == pytest.approx(1.0, rel=1e-12)
    assert found.life_gain == pytest.approx(poses.life * there.life, rel=1e-12)
    assert f"{poses.life:.4g} times the life" in found.explained()
    assert found.explained() in found._repr_html_()
    gain = found.to_dict()["gain"]
    assert (gain["poses"]["life"], gain["place"]["life"]) == (poses.life, there.life)


@pytest.mark.slow
@pytest.mark.parametrize("sn_curve", [None, "nie-2016"])
def test_the_papers_panel_against_a_brute_force_grid(sn_curve):
    """15 rivets, three directions: by utilisation with a real steel, by life with the paper's."""
    robot, task = placement_grid.paper_panel()
    half = [0.2, 0.2, 0.3, 0.4]
    grid, reached = placement_grid.brute_force(
        robot, task, placement_grid.grid_moves(half, [5, 3, 5, 3]), sn_curve
    )
    assert reached > 5
    found = place(robot, task, move=half, placements=100, sn_curve=sn_curve)
    assert_never_worse(robot, found, grid)
    if sn_curve is None:
        assert grid[0] == 0.0 and math.isinf(found.best.rivets_to_failure)
        assert found.utilisation_gain > 1.0
    else:
        assert found.life_gain > 1.0


@pytest.mark.slow
def test_best_is_what_assess_says_and_stands_where_it_says(arm, panel):
    found = place(arm, panel, move=[0.2, 0.2, 0.2, 0.5], placements=30, sn_curve="nie-2016")
    work = Work.of(arm, panel)
    turn = work.turn(found.best.spot.move[3])
    moved = (work.position - work.centre) @ turn.T + work.centre + found.best.spot.move[:3]
    np.testing.assert_allclose(tool_places(arm, found.best.spot.poses), moved, atol=1e-7)
    ops, first = [], 0
    for op in panel.operations:
        poses = found.best.spot.poses[first : first + len(op.poses)]
        first += len(op.poses)
        ops.append(dataclasses.replace(op, poses=poses, direction=turn @ op.direction))
    told = picchio.assess(arm, Task(tuple(ops)), sn_curve="nie-2016")
    now = picchio.assess(arm, panel, sn_curve="nie-2016")
    for joint, use in zip(told.joints, found.best.joints, strict=True):
        assert use.rivets_to_failure == pytest.approx(joint.rivets_to_failure, rel=1e-9)
        assert use.utilisation == pytest.approx(joint.utilisation, rel=1e-9)
    assert found.start.rivets_to_failure == pytest.approx(now.rivets_to_failure, rel=1e-9)
    assert found.life_gain == pytest.approx(told.rivets_to_failure / now.rivets_to_failure)
    assert found.life_gain > 1.0
    assert found.best.limiting_joint == told.limiting_joint
    # Moving the base instead leaves everything as it stands to the arm.
    base, heading = work.base_move(found.best.spot.move, np.zeros(3))
    seen = (work.position - base) @ work.turn(heading)
    np.testing.assert_allclose(seen, moved, atol=1e-9)


def test_never_worse_and_poses_alone(arm, panel):
    still = place(arm, panel, move=[0, 0, 0, 0], placements=10)
    assert still.best.utilisation <= still.start.utilisation
    np.testing.assert_array_equal(still.best.spot.move, 0.0)
    np.testing.assert_allclose(
        tool_places(arm, still.best.spot.poses), Work.of(arm, panel).position, atol=1e-7
    )
    # From its own optimum nothing is gained, and nothing lost.
    ops = (dataclasses.replace(panel.operations[0], poses=still.best.spot.poses[:5]),
           dataclasses.replace(panel.operations[1], poses=still.best.spot.poses[5:]))  # fmt: skip
    again = place(arm, Task(ops), move=[0, 0, 0, 0], placements=10)
    assert again.best.utilisation == pytest.approx(again.start.utilisation, rel=1e-6)
    assert again.best.utilisation <= again.start.utilisation


@pytest.mark.slow
def test_the_gain_of_uncertain_values_is_surer_than_either_life(arm, panel):
    assert place(arm, panel, move=[0.0] * 4, placements=1, sn_curve="nie-2016").sure is None
    soft = picchio.load_robot("fanuc_like_3dof", values={"joint_2": {"stiffness": 1e5,
                              "damping_ratio": 0.03, "estimated": True}})  # fmt: skip
    options = {"move": [0.1, 0.1, 0.1, 0.0], "placements": 4}
    found = place(soft, panel, sn_curve="nie-2016", **options)
    there = picchio.assess(soft, moved(panel, Work.of(soft, panel), found.best.spot),
                           sn_curve="nie-2016", uncertainty=False, steady_check=False)  # fmt: skip
    assert there.rivets_to_failure == pytest.approx(found.best.rivets_to_failure, rel=1e-9)
    sure = found.sure
    for lives in (sure.start, sure.best):
        # Force, strength and the model's error are the same at both places, and cancel.
        assert sure.life[1] / sure.life[0] < lives[2] / lives[0]
    assert sure.life[0] < found.gain.life < sure.life[1]
    assert 0.5 < sure.better_share <= 1.0
    told = found.to_dict()
    assert told["gain"]["life_interval"] == list(sure.life)
    assert told["best"]["life"]["p10"] == sure.best[0]
    assert str(sure.cases) in found._repr_html_()
    bare = [dataclasses.replace(joint, shaft=None) for joint in soft.flexible_joints]
    torques = place(dataclasses.replace(soft, flexible_joints=tuple(bare)), panel, **options)
    low, high = torques.sure.utilisation
    assert torques.by_effort and torques.sure.life is None
    assert "effort" in " ".join(torques.assumptions)
    assert low < torques.gain.utilisation < high


def test_margin_leaves_room_and_off_tells_what_is_lost(arm, panel):
    found = place(arm, panel, move=[0.3, 0.3, 0.3, 0.3], placements=40, margin=0.05)
    assert all(off.reached for off in found.off)
    assert max(off.utilisation for off in found.off) > found.best.utilisation * (1 - 1e-6)
    for off in found.off:
        assert np.linalg.norm(off.shift) == pytest.approx(0.05)


def test_hit_rate_within_the_guns_range(arm, panel):
    own = place(arm, panel, move=[0, 0, 0, 0], placements=5, sn_curve="nie-2016")
    found = place(
        arm, panel, move=[0, 0, 0, 0], placements=5, sn_curve="nie-2016", period_range=(0.03, 0.06)
    )
    assert 0.03 <= found.best.spot.period <= 0.06
    assert found.best.rivets_to_failure >= own.best.rivets_to_failure * (1 - 1e-9)
    for bad in ((0.05, 0.04), (0.003, 0.04), (-1, 1)):
        with pytest.raises(InputError):
            place(arm, panel, period_range=bad)


def test_a_start_beyond_the_limits_is_no_candidate(arm, panel):
    beyond = panel.operations[0].poses + np.array([0.0, 0.0, 2.0 * np.pi])
    far = Task((dataclasses.replace(panel.operations[0], poses=beyond),))
    with pytest.warns(PicchioWarning, match="beyond their limits"):
        found = place(arm, far, move=[0.1, 0.1, 0.1, 0], placements=5)
    assert not found.start_valid
    assert within_limits(arm, found)


def test_reducers_as_the_catalogue_check_has_them():
    rng = np.random.default_rng(0)
    for name in ("RV-80E-121",):
        reducer = load_reducer(name)
        peak, held = rng.uniform(0, 3000, (2, 20))
        told = [reducer.check_blows(p, h).governing.share for p, h in zip(peak, held, strict=True)]
        many = np.max(list(reducer.shares(peak, held).values()), axis=0)
        np.testing.assert_allclose(many, told)


def test_bad_input(arm, panel):
    for options, part in (
        ({"move": [1, 1, 1]}, "four numbers"),
        ({"move": [1, -1, 1, 0]}, "four numbers"),
        ({"placements": 0}, "at least 1"),
        ({"off": 0.0}, "positive"),
        ({"margin": -1.0}, "negative"),
    ):
        with pytest.raises(InputError, match=part):
            place(arm, panel, **options)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ur10", pytest.param("panda", marks=pytest.mark.minutes)])
def test_arms_of_six_and_seven_joints_against_a_brute_force_grid(name):
    """A small panel; shafts assumed, so that there is a life. Roll and null space are free."""
    robot, task = placement_grid.small_panel(name)
    half = [0.1, 0.1, 0.1, 0.5]
    moves = placement_grid.grid_moves(half, [3, 1, 3, 1])
    grid, reached = placement_grid.brute_force(robot, task, moves, "nie-2016")
    assert reached > 5
    found = place(robot, task, move=half, placements=40, sn_curve="nie-2016")
    assert_never_worse(robot, found, grid)
    assert found.life_gain > 1.0


@pytest.mark.slow
def test_without_shafts_estimated_drives_rank_and_links_do_not_touch():
    robot = picchio.load_robot("panda")
    task = picchio.load_task(robot.task_path, robot)
    found = place(robot, task, move=[0.2, 0.2, 0.2, 1.0], placements=30)
    assert not found.by_effort and found.utilisation_gain > 1.0
    assert "pairs of links" in found.self_collision
    assert "values of the robot are uncertain" in " ".join(found.assumptions)


def test_the_place_that_is_mostly_the_best_is_taken(monkeypatch):
    """In two of three cases the second place lives longer; a tie is the first's."""
    from types import SimpleNamespace

    from picchio.studies.placement import sureness

    cases = [
        SimpleNamespace(robots_life=np.array(lives), used=np.ones((1, 3)), geared=np.ones((1, 3)))
        for lives in ([9.0, 20.0, 30.0], [10.0, 21.0, 1.0], [np.inf, 1.0, 1.0])
    ]
    monkeypatch.setattr(sureness, "_drawn", lambda loads, work, spots: cases[: len(spots)])
    robot = SimpleNamespace(spreads={"stiffness.joint_1": 1})
    loads = SimpleNamespace(model=SimpleNamespace(robot=robot), by_effort=False)
    assert sureness.surest(loads, None, ["a", "b"]) == "b"
    assert sureness.surest(loads, None, ["a", "b", "c"]) == "a"
    assert sureness.surest(loads, None, []) is None
    robot.spreads = {}
    assert sureness.surest(loads, None, ["a", "b"]) == "a"
