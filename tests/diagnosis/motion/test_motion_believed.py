"""What a motion log of few joints or records may make believe, and must not."""

import numpy as np
import pinocchio as pin
import pytest
from motion_records import ARM, RATE, wave

from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record
from picchio.diagnosis.motion.criteria.holdout import _fails
from picchio.diagnosis.motion.diagnosis import diagnose_motion
from picchio.diagnosis.result import Gain
from picchio.measurement.quality.report import check
from picchio.model.effects.registry import effect_class
from picchio.robot.loading.load import load_robot

RUBS = 4.0
REST = {"panda": 0.4, "ur10": -0.7, ARM: 0.9}


def one_joint(robot, joint, weighs, stated=False, records=2):
    """Records of one joint alone: the others stand at `REST`, which only `stated` writes down."""
    model = pin.buildModelFromUrdf(str(robot.source))
    data, rng = model.createData(), np.random.default_rng(4)
    index = model.joints[model.getJointId(joint)].idx_v
    names = [model.names[i] for i in range(1, model.njoints)]
    rest = {n: REST[robot.name] for n in names if n != joint and "finger" not in n}
    made = []
    for number in range(records):
        t = np.arange(int(20 * RATE)) / RATE
        q = -0.6 + wave(np.random.default_rng(number), t)
        v, a = np.gradient(q, 1 / RATE), np.gradient(np.gradient(q, 1 / RATE), 1 / RATE)
        torque = np.empty_like(q)
        for i in range(q.size):
            pose, fast, faster = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
            for n, at in rest.items():
                pose[model.joints[model.getJointId(n)].idx_q] = at
            pose[model.joints[model.getJointId(joint)].idx_q] = q[i]
            fast[index], faster[index] = v[i], a[i]
            torque[i] = pin.rnea(model, data, pose, fast, faster)[index]
            if not weighs:
                torque[i] -= pin.computeGeneralizedGravity(model, data, pose)[index]
        torque += RUBS * np.sign(v) + 0.05 * rng.normal(size=q.size)
        channels = {f"position.{joint}": q + 1e-6 * rng.normal(size=q.size),
                    f"torque.{joint}": torque}  # fmt: skip
        more = {"pose": rest} if stated else {}
        made.append(Record.from_arrays(f"m{number}.csv", t, channels, kind="motion", **more))
    return Campaign.from_records(made)


ALONE = [("panda", "panda_joint2"), ("ur10", "elbow_joint"), (ARM, "joint_2")]


def friction(diagnosis):
    return next(c for c in diagnosis.causes if c.effect == "coulomb_friction").parameters["torque"]


@pytest.mark.parametrize(("arm", "joint"), ALONE)
@pytest.mark.parametrize(
    ("how", "cause"),
    [({"weighs": False}, "missing_gravity"), ({"weighs": True}, "unknown_pose")],
)
def test_a_joint_alone_whose_others_stand_anywhere(arm, joint, how, cause):
    robot = load_robot(arm, allow_rigid=True)
    records = one_joint(robot, joint, **how)
    found = diagnose_motion(robot, records)
    told = {c.effect for c in found.causes}
    assert cause in told
    assert not told & set(found.not_looked_for)
    assert friction(found).value == pytest.approx(RUBS, rel=0.1)
    others = set(robot.joint_names) - {joint}
    assert set(found.extra["not_recorded"]) == others
    assert {"payload", "link_inertia"} <= set(found.not_looked_for)
    seen = [f for f in check(records, robot).findings if "has no angle" in f.message]
    assert {f.severity for f in seen} == {"warning"}
    assert all(name in seen[0].message for name in others)


@pytest.mark.parametrize(("arm", "joint"), ALONE)
def test_a_pose_that_is_stated_is_believed(arm, joint):
    robot = load_robot(arm, allow_rigid=True)
    records = one_joint(robot, joint, weighs=True, stated=True)
    found = diagnose_motion(robot, records)
    assert not {"unknown_pose", "missing_gravity"} & {c.effect for c in found.causes}
    assert friction(found).value == pytest.approx(RUBS, rel=0.05)
    assert found.verdict in ("named", "ambiguous")


@pytest.mark.parametrize("seed", range(3))
def test_an_arms_torques_without_gravity(seed):
    robot = load_robot(ARM)
    model = robot.rigid._model
    data, rng = model.createData(), np.random.default_rng(seed)
    t = np.arange(int(10 * RATE)) / RATE
    records = []
    for number in range(2):
        q = np.array([wave(rng, t) for _ in robot.joint_names])
        v = np.gradient(q, 1 / RATE, axis=1)
        a = np.gradient(v, 1 / RATE, axis=1)
        torque = np.array([
            pin.rnea(model, data, *x) - pin.computeGeneralizedGravity(model, data, x[0])
            for x in zip(q.T, v.T, a.T, strict=True)
        ]).T  # fmt: skip
        torque += 20.0 * np.sign(v) + 0.5 * rng.normal(size=q.shape)
        channels = {f"torque.{j}": x for j, x in zip(robot.joint_names, torque, strict=True)}
        channels |= {f"position.{j}": x for j, x in zip(robot.joint_names, q, strict=True)}
        records.append(Record.from_arrays(f"m{number}.csv", t, channels, kind="motion"))
    found = diagnose_motion(robot, Campaign.from_records(records))
    told = {(c.effect, c.target): c.parameters for c in found.causes}
    assert ("missing_gravity", "torque") in told
    assert not {"payload", "payload_body", "link_inertia", "counterbalance"} & {e for e, _ in told}
    for joint in robot.joint_names:
        assert told["coulomb_friction", joint]["torque"].value == pytest.approx(20.0, rel=0.05)


@pytest.mark.parametrize(
    ("rubs", "late", "rate"), [(5.5, 0.14, 64.0), (2.0, 0.1, 100.0), (9.0, 0.06, 50.0)]
)
def test_friction_that_is_read_late_is_not_taken_out_again(tmp_path, rubs, late, rate):
    """A joint that creeps to and fro: dry friction, more of it near standstill and one way."""
    from scipy.signal import butter, sosfiltfilt

    urdf = tmp_path / "joint.urdf"
    urdf.write_text(
        '<robot name="joint"><link name="base"/><link name="arm"><inertial><mass value="1"/>'
        '<inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="j" type="revolute"><parent link="base"/><child link="arm"/>'
        '<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="100" velocity="3"/></joint>'
        "</robot>"
    )
    rng, t = np.random.default_rng(1), np.arange(int(90 * rate)) / rate
    records = []
    for number in range(2):
        way = 2.0 * np.abs(2.0 * ((t / (9.1 + 0.4 * number)) % 1.0) - 1.0) - 1.0
        q = 0.005 * sosfiltfilt(butter(2, 0.5, fs=rate, output="sos"), way)
        v = np.interp(t - late, t, np.gradient(q, 1.0 / rate))
        torque = (rubs + 0.2 * rubs * np.exp(-((v / 0.0012) ** 2))) * np.sign(v)
        torque += -0.2 * rubs + 60.0 * rubs * np.abs(v)
        torque = sosfiltfilt(butter(2, 3.0, fs=rate, output="sos"), torque)
        channels = {"position.j": q + 5e-7 * rng.normal(size=t.size),
                    "torque.j": torque + 0.01 * rng.normal(size=t.size)}  # fmt: skip
        records.append(Record.from_arrays(f"r{number}.csv", t, channels, kind="motion"))
    found = diagnose_motion(load_robot(urdf, allow_rigid=True), Campaign.from_records(records))
    told = {c.effect: c.parameters for c in found.causes}
    assert told["coulomb_friction"]["torque"].value == pytest.approx(rubs, rel=0.05)
    assert found.gain.extended_nrmse < 0.05
    if "asymmetric_friction" in told:
        most = told["coulomb_friction"]["torque"].value
        assert abs(told["asymmetric_friction"]["torque"].value) <= most


@pytest.mark.parametrize("arm", ["panda", "ur10", ARM])
def test_no_number_is_free_to_be_what_no_robot_has(arm):
    robot = load_robot(arm, allow_rigid=True)
    model = pin.buildModelFromUrdf(str(robot.source))
    carries = model.frames[model.getFrameId(robot.tool_frame)].parentJoint
    for name in ("payload", "payload_body"):
        least = effect_class(name)("tool").possible(robot)["mass"][0]
        assert least == pytest.approx(-model.inertias[carries].mass)
    joint = robot.joint_names[0]
    most = effect_class("joint_inertia")(joint).possible(robot)["inertia"][1]
    poses = np.random.default_rng(0).uniform(-3.0, 3.0, (50, len(robot.joint_names)))
    poses[:, ["finger" in name for name in robot.joint_names]] = 0.0
    has = max(robot.rigid.mass_matrix(q)[0, 0] for q in poses)
    assert has < most < 100.0 * has


@pytest.mark.parametrize(
    ("gains", "ripple", "fails"),
    [
        ({"long": (0.4, 3500), "short": (-0.5, 200)}, False, False),
        ({"long": (0.4, 3500), "short": (-0.5, 3500)}, False, True),
        ({"a": (0.3, 1000), "b": (0.2, 1000), "c": (-0.1, 20)}, False, False),
        ({"a": (-0.3, 1000), "short": (0.9, 20)}, False, True),
        ({"a": (0.1, 1000), "b": (-0.04, 1000)}, True, False),
        ({"a": (0.1, 1000), "b": (-0.04, 1000)}, False, True),
        ({}, False, False),
    ],
)
def test_a_short_record_is_heard_as_far_as_it_is_long(gains, ripple, fails):
    powers = {(f, "torque.j"): (1.0, 1.0 - gain, rows) for f, (gain, rows) in gains.items()}
    assert _fails(powers, ripple) is fails


@pytest.mark.parametrize(
    ("before", "after", "floor", "told"),
    [
        (99.9, 1.03, 0.02, ""),  # more is left than the signal
        (99.9, 0.177, 0.02, "99.9 %"),
        (0.5, 0.02, 0.02, "100.0 %"),
        (0.5, 0.021, 0.02, "99.9 %"),
        (0.5, 0.25, 0.02, "75.1 %"),
    ],
)
def test_not_all_is_told_to_be_explained_where_some_is_left(before, after, floor, told):
    gain = Gain((), (), before, after, floor)
    assert ("of what is wrong is explained" in gain.told) == bool(told)
    assert told in gain.told
