"""What changed, in histories where it is known, and in histories where nothing did."""

import numpy as np
import pytest
import shift
from scipy.linalg import eigh

import picchio
from picchio.ledger.changes import FIRST, Reading, exchanged, find, readings_of
from picchio.ledger.ringing import decaying, ring_downs
from picchio.ledger.samples import Samples
from picchio.ledger.store import Stream
from picchio.model.model import Model
from worlds import bench, robots

NAME = "fanuc_like_3dof"
DAY = 86_400 * 10**9


def history(values, name="stiffness of joint_2", target="joint_2", covariates=None):
    count = len(values)
    when = shift.BEGIN + DAY * np.arange(count)
    none = np.empty((0, count)) if covariates is None else covariates
    return Reading(name, "stiffness_drift", target, when, np.asarray(values), none)


def step_or_ramp(rng, kind, size=-0.03, begin=60, count=200, noise=0.01):
    index = np.arange(count)
    after = index >= begin
    moved = size * after if kind == "step" else size * np.clip((index - begin) / 60.0, 0.0, 1.0)
    return noise * rng.standard_normal(count) + np.log1p(moved)


@pytest.mark.parametrize("kind", ["step", "ramp"])
def test_three_per_cent_are_found_and_dated(kind):
    found, dated = 0, 0
    for seed in range(30):
        rng = np.random.default_rng(seed)
        others = [history(0.01 * rng.standard_normal(200), f"joint {k}") for k in range(4)]
        changes = find([history(step_or_ramp(rng, kind)), *others])
        mine = [
            c for c in changes if c.reading.target == "joint_2" and "stiffness" in c.reading.name
        ]
        found += bool(mine)
        if mine:
            assert mine[0].value == pytest.approx(-0.03, abs=0.01)
            dated += mine[0].onset_low <= 60 <= mine[0].onset_high
    assert found >= 27
    assert dated >= 0.75 * found


def test_nothing_is_told_of_histories_in_which_nothing_happens():
    alarms = 0
    warmth = 20.0 + 5.0 * np.sin(np.arange(200) / 20.0)
    for seed in range(60):
        rng = np.random.default_rng(100 + seed)
        # Nothing but noise, of another size in each reading, one of them warm in summer.
        readings = [
            history(size * rng.standard_normal(200), f"joint {k}")
            for k, size in enumerate((0.003, 0.01, 0.05))
        ]
        values = -1e-3 * warmth + 0.01 * rng.standard_normal(200)
        readings.append(history(values, "warm", covariates=warmth[None]))
        alarms += bool(find(readings))
    assert alarms <= 4  # 2 % of 60 are 1.2: more than 4 by chance once in 200


def test_a_short_history_tells_nothing():
    assert find([history(np.linspace(0.0, 1.0, FIRST + 2))]) == []
    assert find([history(np.zeros(100))]) == []


def test_two_robots_in_one_ledger_are_told():
    rng = np.random.default_rng(3)
    readings = [
        history(step_or_ramp(rng, "step", size), f"stiffness of {j}", j)
        for j, size in (("joint_1", 0.08), ("joint_2", -0.06), ("joint_3", 0.1))
    ]
    (told,) = exchanged(find(readings))
    assert "joint_1" in told and "joint_3" in told and "two robots" in told
    assert exchanged(find(readings[:1])) == ()


def test_frequencies_of_a_decay_are_fitted():
    rng = np.random.default_rng(1)
    time = np.arange(1500) / 1000.0
    values = np.zeros((2, time.size))
    for f, z, a in ((6.3, 0.03, (1.0, 0.4)), (17.0, 0.025, (0.3, 0.8))):
        w = 2.0 * np.pi * f
        wave = np.exp(-z * w * time) * np.cos(w * np.sqrt(1 - z * z) * time + 0.7)
        values += np.outer(a, wave)
    values += 0.01 * rng.standard_normal(values.shape) + [[3.0], [-1.0]]
    frequency, error, damping = decaying(
        time, values, np.array([6.0, 18.0]), np.array([0.04, 0.04])
    )
    assert frequency == pytest.approx([6.3, 17.0], rel=2e-3)
    assert (np.abs(np.log(frequency / [6.3, 17.0])) < 4.0 * error).all()
    assert damping == pytest.approx([0.03, 0.025], rel=0.05)


def ringing(rng, pose, softer, seconds=1.0, rate=500.0):
    """A blow and its ring-down with softened joints: deflections of all joints, in `worlds`."""
    arm = robots.load(NAME)
    mass, gravity, _ = bench.rest(bench.nominal_chain(NAME), pose)
    springs = arm.springs(gravity) * softer
    squared, shapes = eigh(np.diag(springs), mass)
    time = np.arange(int(seconds * rate)) / rate
    start = shapes.T @ rng.normal(size=3)
    joints = np.zeros((3, time.size))
    for k in range(3):
        w, z = np.sqrt(squared[k]), arm.damping_ratio
        damped = w * np.sqrt(1.0 - z * z)
        joints += np.outer(shapes[:, k] * start[k],
                           np.exp(-z * w * time) * np.sin(damped * time) / damped)  # fmt: skip
    return time, joints


def test_the_joint_that_softens_is_found_by_its_frequencies():
    robot = picchio.load_robot(NAME)
    model = Model.of(robot)
    stream = Stream("force", 5_000_000, 1, 100.0, 10.0)
    rng = np.random.default_rng(6)
    features = []
    for number in range(50):
        softer = np.ones(3)
        if number >= 40:
            softer[1] = 0.96
        for rivet in range(3):
            pose = shift.POSES[rivet]
            time, joints = ringing(rng, pose, softer * 1.03)  # nominal stiffness is 3 % off
            begin = shift.BEGIN + number * DAY + rivet * 10 * 10**9
            stamps = begin + np.rint(time * 1e9).astype(np.int64)
            force = np.where(time < 0.005, 500.0, 0.0)[:, None]
            joints = joints + 0.03 * joints.std() * rng.standard_normal(joints.shape)
            others = {f"deflection.joint_{j + 1}": (stamps, joints[j]) for j in range(3)}
            poses = pose + 1e-5 * rng.standard_normal((stamps[::10].size, 3))
            samples = Samples("force", stamps, force, stamps[::10], poses, others)
            features += ring_downs(samples, stream, model)
    readings = readings_of(model, [], features)
    assert {r.target for r in readings} == {"joint_1", "joint_2", "joint_3", "robot"}
    changes = find(readings)
    assert [c.reading.target for c in changes] == ["joint_2"]
    (told,) = [c.to_dict() for c in changes]
    assert told["effect"] == "stiffness_drift"
    assert told["low"] < -0.04 < told["high"]
    assert told["since_low"] <= "2026-04-10" <= told["since_high"]
    assert "stiffness of joint_2 fell by" in told["words"]
