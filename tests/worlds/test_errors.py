"""A world that is a little wrong everywhere, against pinocchio and scipy."""

import json

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import eigh

from picchio.campaign.tables import Tolerance
from worlds import campaign, cases, errors, robots
from worlds.bench import nominal_chain, rest

SHORT = {"records": 3, "hits": 3, "ring": 0.05, "quiet": 0.02}
CLEAN = {"snr_db": 300.0, "bandwidth": None, "sampling": 1000.0}
ROBOTS = ("fanuc_like_3dof", "ur10", "kinova_gen3")


def wrong_model(robot, drawn):
    """Pinocchio's model with the bodies that were drawn, and where force and sensor really are."""
    model = robot.model.copy()
    for name, link in zip(robot.joints, robot.links(), strict=True):
        at = model.getJointId(name)
        own, factor = model.inertias[at], 1.0 + drawn["link_mass"][link]
        size, axes = np.linalg.eigh(factor * own.inertia)
        size = size * (1.0 + np.array(drawn["link_inertia"][link]))
        lever = own.lever + drawn["link_com"][link]
        model.inertias[at] = pin.Inertia(factor * own.mass, lever, axes @ np.diag(size) @ axes.T)
    tool = model.frames[model.getFrameId(robot.tool)]
    for name in ("tool_point", "sensor_position"):
        aside = pin.SE3(np.eye(3), np.array(drawn[name]["tool"]))
        frame = pin.Frame(name, tool.parentJoint, tool.placement * aside, pin.FrameType.OP_FRAME)
        model.addFrame(frame)
    return model


def to_q(model, pose):
    """Positions of a model of which some joints turn without end."""
    q = np.zeros(model.nq)
    for joint, value in zip(list(model.joints)[1:], pose, strict=True):
        q[joint.idx_q : joint.idx_q + joint.nq] = (
            [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
        )
    return q


@pytest.mark.parametrize("name", ROBOTS)
def test_bodies_are_those_of_an_edited_rigid_model(name):
    robot = robots.load(name)
    _, truth = campaign.make(name, seed=4, mismatch=2.0, **{**SHORT, "hits": 1})
    model = wrong_model(robot, truth["errors"])
    data = model.createData()
    chain = truth["world"].errors.chain(nominal_chain(name))
    pose = np.array(truth["world"].plan.shots[0].pose)
    mass, torque, _ = rest(chain, pose)
    exact = pin.crba(model, data, to_q(model, pose))
    exact = np.triu(exact) + np.triu(exact, 1).T
    assert np.abs(mass - exact).max() < 1e-12 * np.abs(exact).max()
    gravity = pin.computeGeneralizedGravity(model, data, to_q(model, pose))
    assert np.abs(torque - gravity).max() < 1e-9 * np.abs(gravity).max()
    nominal = rest(nominal_chain(name), pose)[0]
    assert np.abs(np.diag(mass) / np.diag(nominal) - 1.0).max() > 1e-3
    for tensor in chain.inertia:
        moments = np.linalg.eigvalsh(tensor)
        assert moments.min() > 0.0 and 2.0 * moments.max() <= moments.sum() * (1.0 + 1e-12)


def force_at(t, truth, index, hits, period, width, told):
    """N: trapezia of the told height and impulse, each blow a little late and of its own height."""
    drawn, file = truth["errors"], f"r{index + 1:02d}.csv"
    rise = drawn["rise_time"]["tool"]
    total = 0.0
    for h in range(hits):
        since = t - h * period - drawn["blow_time"][file][h]
        share = np.interp(since, [0.0, rise, width, width + rise], [0.0, 1.0, 1.0, 0.0])
        total += share * (1.0 + drawn["blow_force"][file][h])
    return told * (1.0 + drawn["force"]["tool"]) * total


def integrated(name, truth, index, times):
    """(samples, n) deflections and (samples, 3) accelerometer by DOP853 and pinocchio's ABA."""
    robot, drawn, plan = robots.load(name), truth["errors"], truth["world"].plan
    shot, pose_index = plan.shots[index], str(index // 3 + 1)
    model = wrong_model(robot, drawn)
    data = model.createData()
    n, joints = model.nv, robot.joints
    pose = np.array(shot.pose) + [drawn["pose"][j] for j in joints]
    pose = pose + drawn["pose_repeat"][pose_index]
    q0 = to_q(model, pose)
    gravity = pin.computeGeneralizedGravity(model, data, q0).copy()
    springs = robot.springs(gravity) * [1.0 + drawn["stiffness"][j] for j in joints]
    mass = pin.crba(model, data, q0)
    mass = np.triu(mass) + np.triu(mass, 1).T
    squared, shapes = eigh(np.diag(springs), mass)
    ratio = robot.damping_ratio * (1.0 + drawn["damping_ratio"]["robot"])
    ratio = ratio * (1.0 + np.array(drawn["damping_by_mode"][pose_index]))
    damping = mass @ shapes @ np.diag(2.0 * ratio * np.sqrt(squared)) @ shapes.T @ mass
    more = drawn["gravity_stiffness"]["robot"]
    more = more * pin.computeGeneralizedGravityDerivatives(model, data, q0)
    turn = pin.exp3(np.array(drawn["direction"][f"r{index + 1:02d}.csv"]))
    way = turn @ shot.direction
    point, seat = model.getFrameId("tool_point"), model.getFrameId("sensor_position")
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED

    def accelerations(t, y):
        q, v = pin.integrate(model, q0, y[:n]), y[n:]
        torque = gravity - springs * y[:n] - damping @ v - more @ y[:n]
        size = force_at(t, truth, index, plan.hits, plan.period, plan.width, shot.force)
        jacobian = pin.computeFrameJacobian(model, data, q, point, world)[:3]
        return q, v, pin.aba(model, data, q, v, torque + jacobian.T @ way * size)

    def rate(t, y):
        return np.concatenate([y[n:], accelerations(t, y)[2]])

    rise, edges = drawn["rise_time"]["tool"], [0.0, times[-1] + 1e-6]
    for h in range(plan.hits):
        start = h * plan.period + drawn["blow_time"][f"r{index + 1:02d}.csv"][h]
        edges += [start, start + rise, start + plan.width, start + plan.width + rise]
    edges = np.unique([e for e in edges if 0.0 <= e <= times[-1] + 1e-6])
    y, states = np.zeros(2 * n), np.zeros((times.size, 2 * n))
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        here = (times >= a) & (times < b)
        # a joint that carries next to nothing would make any tolerance of the whole too loose
        done = solve_ivp(
            rate, (a, b), y, "DOP853", np.append(times[here], b), rtol=1e-9, atol=1e-13
        )
        states[here], y = done.y[:, :-1].T, done.y[:, -1]
    read = np.zeros((times.size, 3))
    askew = pin.exp3(np.array(drawn["sensor_angle"][f"accelerometer.{robot.tool}"]))
    for i in np.flatnonzero(times > 0.0):
        q, v, a = accelerations(times[i], states[i])
        pin.forwardKinematics(model, data, q, v, a)
        pin.updateFramePlacements(model, data)
        moved = pin.getFrameClassicalAcceleration(model, data, seat, world).linear
        felt = data.oMf[seat].rotation.T @ (moved - model.gravity.linear)
        read[i] = askew.T @ (felt - rest_felt(model, data, q0, seat))
        pin.forwardKinematics(model, data, q, v, a)
    gains = drawn["sensor_gain"]
    return (
        states[:, :n] * (1.0 + gains["deflection"]),
        read * (1.0 + gains[f"accelerometer.{robot.tool}"]),
    )


def rest_felt(model, data, q0, seat):
    """What an accelerometer reads at rest, in the frame's axes."""
    pin.framesForwardKinematics(model, data, q0)
    return data.oMf[seat].rotation.T @ -model.gravity.linear


@pytest.mark.parametrize(("name", "bound"), [("fanuc_like_3dof", 1e-5), ("ur10", 1e-4)])
def test_a_record_with_every_error_is_what_pinocchio_and_scipy_make_of_it(name, bound):
    """Twice the tolerances, all at once; the errors as `truth` tells them."""
    made, truth = campaign.make(name, seed=7, mismatch=2.0, **SHORT, **CLEAN)
    assert all(key in truth["errors"] for key in errors.KEYS)
    record = made.records[1]
    deflection, felt = integrated(name, truth, 1, record["time"])
    robot = robots.load(name)
    got = truth["clean"][1]
    _, exact = campaign.make(name, seed=7, **SHORT, **CLEAN)
    for group, other in (("deflection", deflection), (f"accelerometer.{robot.tool}", felt)):
        size = np.sqrt(np.mean(other**2))
        error = np.sqrt(np.mean((got[group] - other) ** 2)) / size
        apart = np.sqrt(np.mean((exact["clean"][1][group] - other) ** 2)) / size
        print(f"{name} {group}: {error:.1e}, without errors {apart:.1e}")
        assert error < bound and apart > 0.03


def test_without_a_mismatch_the_campaign_says_that_it_is_exact():
    made, truth = campaign.make(seed=1, **SHORT)
    stated = made.tolerance.model_dump()
    drawn = {"stiffness": 0.05, "damping_ratio": 0.20, "force": 0.05}
    assert stated == Tolerance.zero().model_dump() | drawn
    assert truth["errors"] == {} and truth["world"].errors is None
    wrong, _ = campaign.make(seed=1, mismatch=1.0, **SHORT)
    assert wrong.tolerance == Tolerance()


def test_the_pose_that_is_told_is_not_where_the_robot_stands(tmp_path):
    folder = tmp_path / "c"
    made, truth = campaign.make(seed=1, mismatch=1.0, folder=folder, **{**SHORT, "records": 6})
    world = truth["world"]
    shots = world.plan.shots
    benches = [world.bench(i) for i in range(6)]
    aside = np.array([b.pose - np.array(s.pose) for b, s in zip(benches, shots, strict=True)])
    assert np.array_equal(aside[0], aside[2]) and not np.array_equal(aside[0], aside[3])
    zero = np.array(list(truth["errors"]["pose"].values()))
    repeat = np.array([truth["errors"]["pose_repeat"][k] for k in ("1", "2")])
    assert aside[::3] == pytest.approx(zero + repeat, abs=1e-15)
    for record, shot, bench in zip(made, shots, benches, strict=True):
        assert list(record.pose.values()) == pytest.approx(list(shot.pose), abs=0.0)
        told = np.array(record.direction) / np.linalg.norm(record.direction)
        assert 1e-4 < np.arccos(min(1.0, told @ bench.direction)) < 0.05
    text = (folder / "campaign.toml").read_text()
    assert "tolerance" not in text and "mismatch" not in text


def test_a_mode_that_is_damped_otherwise_rings_down_otherwise():
    """Free motion after the blows, in the modes' own coordinates."""
    options = {"seed": 3, "records": 1, "hits": 1, "ring": 1.5, **CLEAN}
    _, truth = campaign.make(mismatch=3.0, only=("damping_by_mode",), **options)
    drawn = np.array(truth["errors"]["damping_by_mode"]["1"])
    bench = truth["world"].bench(0)
    squared, shapes = eigh(np.diag(bench.springs), bench.nominal_mass())
    times = truth["world"].plan.times()
    after = times > 0.05
    modes = truth["clean"][0]["deflection"][after] @ (bench.nominal_mass() @ shapes)
    t = times[after]
    for k, w in enumerate(np.sqrt(squared)):
        # the envelope: the amplitude at this frequency in windows of whole periods
        wide = 4.0 * 2.0 * np.pi / w
        starts = np.arange(t[0], min(t[-1] - wide, t[0] + 20.0 * wide), 0.5 * wide)
        size = []
        for a in starts:
            inside = (t >= a) & (t < a + wide)
            size.append(abs(np.mean(modes[inside, k] * np.exp(-1j * w * t[inside]))))
        size = np.array(size)
        use = size > 0.02 * size[0]
        ratio = -np.polyfit(starts[use], np.log(size[use]), 1)[0] / w
        print(f"mode {k}: {ratio / bench.damping_ratio - 1.0:+.3f} drawn {drawn[k]:+.3f}")
        assert ratio / bench.damping_ratio - 1.0 == pytest.approx(drawn[k], abs=0.06)
    assert np.ptp(drawn) > 0.2


def test_errors_are_normal_with_the_tolerances_as_their_spread():
    chain, robot = nominal_chain("ur10"), robots.load("ur10")
    plan = campaign.plan_of("ur10", 1, records=3)
    groups = ("accelerometer.tool0", "deflection")
    found = {key: [] for key in errors.KEYS}
    for seed in range(150):
        numbers = errors.Errors.draw(chain, seed).numbers(robot, plan, groups)
        for key in errors.KEYS:
            for value in numbers[key].values():
                values = np.ravel(value)
                # the first blow's time is exact; a rotation about the force itself does nothing
                found[key].append(values[1:] if key == "blow_time" else values)
    for key, values in found.items():
        values = np.concatenate(values) / errors.STATED[key]
        spread = np.sqrt(np.mean(values**2)) * (np.sqrt(1.5) if key == "direction" else 1.0)
        bound = 0.2 if key == "link_inertia" else 4.0 / np.sqrt(2.0 * values.size)
        print(f"{key}: {spread:.3f} of {values.size}")
        assert spread == pytest.approx(1.0, abs=bound)
        if key not in ("rise_time",):
            assert abs(values.mean()) < 4.5 / np.sqrt(values.size)


def test_a_larger_mismatch_is_the_same_errors_larger_and_only_some_can_be_had():
    chain = nominal_chain("fanuc_like_3dof")
    one, two = (errors.Errors.draw(chain, 5, m) for m in (1.0, 2.0))
    assert np.allclose(two.link_com, 2.0 * one.link_com) and two.force == 2.0 * one.force
    alone = errors.Errors.draw(chain, 5, 1.0, only=("pose",))
    assert np.array_equal(alone.pose, one.pose)
    assert not any(np.any(v) for v in (alone.stiffness, alone.link_mass, alone.link_inertia))
    same = alone.chain(chain)
    assert np.array_equal(same.inertia, chain.inertia) and np.array_equal(same.com, chain.com)
    with pytest.raises(ValueError, match="no error 'poses'"):
        errors.Errors.draw(chain, 5, only=("poses",))
    for seed in range(200):  # whatever is drawn stays physical
        wild = errors.Errors.draw(chain, seed, 4.0)
        assert (wild.stiffness > -0.95).all() and wild.damping_ratio > -0.95
        assert (wild.damping_by_mode([0.1, 0.2, 0.3]) > -0.95).all()


def test_an_unmeasured_burst_has_errors_of_its_own():
    _, truth = campaign.make(seed=1, mismatch=1.0, **SHORT)
    world, shot = truth["world"], truth["world"].plan.shots[0]
    moved = campaign.quantities(world, pose=np.array(shot.pose) + 0.1)
    assert max(moved["peak_deflection"].values()) > 0.0
    own = world.errors
    assert not np.array_equal(own.pose_repeat(shot.pose), own.pose_repeat(shot.pose + 0.1))
    same = campaign.quantities(world, index=0)["peak_deflection"]
    clean = np.abs(truth["clean"][0]["deflection"]).max(axis=0)
    gain = 1.0 + truth["errors"]["sensor_gain"]["deflection"]
    assert list(same.values()) == pytest.approx(clean / gain, rel=0.02)


def test_what_was_drawn_too_far_out_is_told():
    numbers = {"pose": {"joint_1": 4e-3, "joint_2": 1e-4}, "direction": {"r01.csv": [0, 0.03, 0]}}
    found = errors.beyond(numbers)
    assert [(key, target) for key, target, _ in found] == [
        ("pose", "joint_1"), ("direction", "r01.csv")
    ]  # fmt: skip
    assert found[1][2] == pytest.approx(6.0)
    _, truth = campaign.make(seed=1, mismatch=1.0, **SHORT)
    assert json.loads(json.dumps(campaign.plain(truth))) == campaign.plain(truth)


def test_typical_causes_are_far_beyond_what_is_never_exact():
    robot = robots.load("fanuc_like_3dof")
    for effect in ("joint_stiffness", "modal_damping", "force_amplitude", "sensor_gain"):
        for seed in range(12):
            options = {"effect": effect, "mismatch": 1.0, **SHORT}
            found = cases.causes("single", seed, **options)
            assert found == cases.causes("single", seed, **options)
            drawn = campaign.errors_of("fanuc_like_3dof", seed)
            assert cases.in_tolerances(found[0], drawn, robot) >= 5.0
    assert cases.in_tolerances(("tool_offset", "tool", {"x": 0.0, "y": 0.03, "z": 0.04})) == 50.0
    assert cases.in_tolerances(("payload", "tool", {"mass": 3.0})) is None


def test_errors_of_size_zero_are_none():
    """The way that errors take through the world adds nothing of its own."""
    plan = campaign.plan_of("ur10", 1, records=1, hits=2, ring=0.05)
    nothing = errors.Errors.draw(nominal_chain("ur10"), 1, 0.0)
    groups = ("accelerometer.tool0", "deflection")
    nominal = campaign.Nuisances.none(6)
    one = campaign.clean(campaign.World(plan, nominal), groups)[0]
    other = campaign.clean(campaign.World(plan, nominal, errors=nothing), groups)[0]
    for group in groups:
        assert np.abs(one[group] - other[group]).max() < 1e-9 * np.abs(one[group]).max()
