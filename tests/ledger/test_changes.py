"""What changed, in histories where it is known, and in histories where nothing did."""

from itertools import groupby

import numpy as np
import pandas
import pytest
import shift
from scipy.linalg import eigh

import picchio
from picchio.ledger.samples import Samples
from picchio.ledger.store import SHIFT, Stream
from picchio.ledger.watch.changes import FIRST, Reading, Shown, find, readings_of
from picchio.ledger.watch.drives import drives
from picchio.ledger.watch.ringing import decaying, ring_downs
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


def moves(rng, *, friction=1.0, gap=0.0, offset=0.0, seconds=8.0, rate=250.0):
    """An arm that swings to and fro: torques by pinocchio, friction, both sides of each joint."""
    import pinocchio as pin

    robot = picchio.load_robot(NAME)
    model = pin.buildModelFromUrdf(str(robot.files[0]))
    time = np.arange(int(seconds * rate)) / rate
    w = 2.0 * np.pi * np.array([0.31, 0.43, 0.55])[:, None]
    q = np.array([0.2, 0.8, -0.7])[:, None] + 0.3 * np.sin(w * time)
    v, a = 0.3 * w * np.cos(w * time), -0.3 * w**2 * np.sin(w * time)
    data = model.createData()
    torque = np.array(
        [pin.rnea(model, data, *state) for state in zip(q.T, v.T, a.T, strict=True)]
    ).T
    rub = friction * np.array([60.0, 40.0, 20.0])[:, None]
    torque = torque + rub * (np.sign(v) + 0.2 * v) + offset
    torque = torque + 5.0 * rng.standard_normal(torque.shape)
    motor = q + 0.5 * gap * np.sign(v) + 1e-5 * rng.standard_normal(q.shape)
    stamps = shift.BEGIN + np.rint(time * 1e9).astype(np.int64)
    others = {f"torque.joint_{j + 1}": (stamps, torque[j]) for j in range(3)}
    others |= {f"position.joint_{j + 1}": (stamps, q[j]) for j in range(3)}
    return Samples("trigger", stamps, np.zeros((time.size, 1)), stamps, motor.T, others), v


def test_friction_and_lost_motion_are_read_of_a_moving_arm():
    rng = np.random.default_rng(4)
    model = Model.of(picchio.load_robot(NAME))
    samples, v = moves(rng, friction=1.5, gap=4e-4)
    found = {name: value for name, _, value in drives(samples, model)}
    for j, dry in enumerate((60.0, 40.0, 20.0)):
        fast = np.abs(v[j]) > max(0.02, 0.2 * np.quantile(np.abs(v[j]), 0.99))
        usual = 1.5 * dry * (1.0 + 0.2 * np.median(np.abs(v[j][fast])))
        assert found[f"friction.joint_{j + 1}"] == pytest.approx(usual, rel=0.05)
        assert found[f"lost_motion.joint_{j + 1}"] == pytest.approx(4e-4, rel=0.03)
        assert abs(found[f"offset.joint_{j + 1}"]) < 0.01
    # An arm that stands still shows none of it.
    rest = np.tile(samples.poses[0], (samples.stamps.size, 1))
    still = Samples("trigger", samples.stamps, samples.values, samples.stamps, rest, samples.others)
    assert drives(still, model) == []


def test_friction_of_a_real_drive_is_what_was_published(measured_data):
    """EMPS, by Janot, Gautier and Brunot (2019): 20.39 N and 203.5 N s/m, one slide."""
    import picchio.datasets

    for record, near in zip(
        picchio.datasets.load("emps", measured_data), (0.01, 0.06), strict=True
    ):
        read = record.read()
        stamps = shift.BEGIN + np.rint(read["time"] * 1e9).astype(np.int64)
        slide = read["motor_position.slide"]
        samples = Samples("trigger", stamps, np.zeros((stamps.size, 1)), stamps, slide[:, None],
                          {"torque.slide": (stamps, read["torque.slide"])})  # fmt: skip
        found = {n: v for n, _, v in drives(samples, Model.of(picchio.load_robot("emps")))}
        speed = np.abs(np.gradient(slide, read["time"]))
        usual = float(np.median(speed[speed > 0.2 * np.quantile(speed, 0.99)]))
        assert found["friction.slide"] == pytest.approx(20.39 + 203.5 * usual, rel=near)


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


def ringing(rng, pose, softer, seconds=1.0, rate=500.0, damping=1.0):
    """A blow and its ring-down with softened joints: deflections of all joints, in `worlds`."""
    arm = robots.load(NAME)
    mass, gravity, _ = bench.rest(bench.nominal_chain(NAME), pose)
    springs = arm.springs(gravity) * softer
    squared, shapes = eigh(np.diag(springs), mass)
    time = np.arange(int(seconds * rate)) / rate
    start = shapes.T @ rng.normal(size=3)
    joints = np.zeros((3, time.size))
    for k in range(3):
        w, z = np.sqrt(squared[k]), damping * arm.damping_ratio
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
    shown = {}
    for number, rows in groupby(sorted(features, key=lambda row: row[1]), lambda r: r[1] // SHIFT):
        one = Shown(model)
        one.read(rows)
        shown[number] = one.told
    readings = readings_of(robot.flexible_names, shown)
    assert {r.target for r in readings} == {"joint_1", "joint_2", "joint_3", "robot"}
    changes = find(readings)
    assert [c.reading.target for c in changes] == ["joint_2"]
    (told,) = [c.to_dict() for c in changes]
    assert told["effect"] == "stiffness_drift"
    assert told["low"] < -0.04 < told["high"]
    assert told["since_low"] <= "2026-04-10" <= told["since_high"]
    assert "stiffness of joint_2 fell by" in told["words"]


LINKS = {"force": "force", "temp": "temperature.joint_1"} | {
    f"{short}{k}": f"{long}.joint_{k}" for k in (1, 2, 3) for short, long in
    (("m", "motor_position"), ("l", "position"), ("t", "torque"), ("d", "deflection"))
}  # fmt: skip
LOG_MAPPING = (
    'format = "picchio-mapping/1"\n'
    + "".join(f'[[channel]]\nfrom = "{a}"\nto = "{b}"\n' for a, b in LINKS.items())
    + "[blows]\nthreshold = 100.0\ndirection = [1.0, 0.0, 0.0]\n"
)


def shift_log(path, number, rng, softer, friction, gap, warm, *, offset=0.0, damping=1.0):
    """A shift: the arm swings, then sets three rivets at three places and rings after each."""
    parts = []
    samples, _ = moves(rng, friction=friction, gap=gap, offset=offset, rate=500.0)
    table = {"force": np.zeros(samples.stamps.size)}
    for k in (1, 2, 3):
        table |= {f"m{k}": samples.poses[:, k - 1], f"d{k}": np.zeros(samples.stamps.size),
                  f"l{k}": samples.others[f"position.joint_{k}"][1],
                  f"t{k}": samples.others[f"torque.joint_{k}"][1]}  # fmt: skip
    parts.append(pandas.DataFrame(table))
    for place in range(3):
        time, joints = ringing(rng, shift.POSES[place], softer, damping=damping)
        joints = 1e-4 * joints / joints.std() + 3e-6 * rng.standard_normal(joints.shape)
        pose = shift.POSES[place][:, None] + 1e-5 * rng.standard_normal(joints.shape)
        table = {"force": np.where(time < 0.005, 500.0, 0.0)}
        for k in (1, 2, 3):
            table |= {f"m{k}": pose[k - 1], f"l{k}": pose[k - 1], f"d{k}": joints[k - 1],
                      f"t{k}": np.zeros(time.size)}  # fmt: skip
        parts.append(pandas.DataFrame(table))
    whole = pandas.concat(parts, ignore_index=True)
    # A second between the parts, in which the arm moves and nothing is logged.
    later = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    stamps = shift.BEGIN + number * DAY + 2_000_000 * np.arange(len(whole)) + 10**9 * later
    whole.insert(0, "stamp", stamps)
    whole["temp"] = warm
    whole.to_parquet(path / f"{number:03d}.parquet")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["coulomb_friction", "backlash"])
def test_a_drive_that_changes_is_named_from_its_logs(tmp_path, kind):
    """Friction 25 % more, or lost motion doubled; nothing else is told, nor too early."""
    (tmp_path / "mapping.toml").write_text(LOG_MAPPING)
    robot, rng = picchio.load_robot(NAME), np.random.default_rng([5, len(kind)])
    for number in range(50):
        late = number >= 38
        rub = 1.25 if late and kind == "coulomb_friction" else 1.0
        gap = 2e-4 if late and kind == "backlash" else 1e-4
        warm = 20.0 + rng.standard_normal()
        # No arm is the simulated one: its torques are off by a constant, its damping by a sixth.
        shift_log(tmp_path, number, rng, np.ones(3), rub, gap, warm, offset=-6.0, damping=1.15)
        if number == 37:  # enough for a change to be told
            assert picchio.count(robot, tmp_path, tmp_path / "ledger").changes == ()
    found = picchio.count(robot, tmp_path, tmp_path / "ledger")
    assert {change["effect"] for change in found.changes} == {kind}
    assert {change["target"] for change in found.changes} == {"joint_1", "joint_2", "joint_3"}
    for change in found.changes:
        assert change["since_low"] <= "2026-04-08" <= change["since_high"]
        assert change["low"] < (0.25 if kind == "coulomb_friction" else 1.0) < change["high"]
