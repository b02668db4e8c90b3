"""Joint stiffness from static loadings: closed form, blind trials, the real arm, the command."""

import json
import math

import blind_stiffness
import numpy as np
import pytest

import picchio
from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record
from picchio.campaign.tables import Tolerance
from picchio.diagnosis.stiffness.static import identify_static
from picchio.robot.annotations.sidecar import read_sidecar

EXACT = Tolerance.zero().model_dump()


@pytest.fixture(scope="module")
def loads():
    """The independent world of loadings."""
    from worlds import loads

    return loads


def campaign(columns, tolerance=None, **table):
    record = Record.from_columns("loads.csv", columns, kind="static", **table)
    return Campaign.from_records([record], tolerance=tolerance)


@pytest.mark.parametrize("joints", [3, 6, 7])
def test_the_closed_form_is_the_worlds_equilibrium(loads, joints):
    """Newton's solution of the nonlinear equilibrium, stiffness up to a factor of four off."""
    world = loads.draw(joints, 5, exact=True)
    found = identify_static(picchio.load_robot(world.robot), campaign(world.columns, EXACT),
                            search=False)  # fmt: skip
    values = np.array([joint.stiffness.value for joint in found.joints])
    told = np.array([joint.stiffness.told for joint in found.joints])
    assert told.sum() >= joints - 1  # a force through the last axis turns nothing about it
    np.testing.assert_allclose(values[told], world.truth[told], rtol=2e-3)
    plain = identify_static(picchio.load_robot(world.robot), campaign(world.columns, EXACT),
                            gravity_stiffness=False, search=False)  # fmt: skip
    other = np.array([joint.stiffness.value for joint in plain.joints])
    assert np.abs(other[told] / world.truth[told] - 1.0).max() > 2e-4  # it is seen to count


@pytest.mark.slow
def test_blind_trials(loads):
    """Twenty campaigns with everything slightly wrong; 200 in `benchmarks/stiffness.py`."""
    judged = blind_stiffness.static_trial(loads, 20, first=5000)
    found = blind_stiffness.summary(judged)
    assert found["told"] >= 60
    assert found["told_within_10_percent"] >= 0.97
    assert found["median_error"] <= 0.03
    assert found["coverage_told"] >= 0.85
    # One in a hundred is allowed; of a hundred joints that is more than three once in fifty times.
    assert found["wrong_confident"] * found["told"] <= 3
    assert found["told_of_those"] >= 0.90


def test_a_base_that_turns_is_found_and_one_that_does_not_is_not(loads):
    world = loads.draw(3, 8, base=2e5)
    robot = picchio.load_robot(world.robot)
    found = picchio.identify(robot, campaign(world.columns))
    (cause,) = [c for c in found.causes if c.effect == "base_compliance"]
    assert cause.target == "rx" and cause.confidence > 0.9
    stated = cause.parameters["stiffness"]
    assert abs(stated.value - 2e5) < 3.0 * stated.std
    errors = [math.log(j.stiffness.value / t)
              for j, t in zip(found.joints, world.truth, strict=True)]  # fmt: skip
    assert max(map(abs, errors)) < 0.1
    stands = loads.draw(3, 8)
    assert not picchio.identify(robot, campaign(stands.columns)).causes


def test_what_no_loading_moves_keeps_its_prior_and_says_so(loads):
    world = loads.draw(3, 2)
    columns = dict(world.columns)
    # Pulls in the plane of the arm turn nothing about the vertical axis.
    angle = columns["pose.joint_1"]
    size = np.hypot(columns["force.x"], columns["force.y"])
    columns |= {"force.x": size * np.cos(angle), "force.y": size * np.sin(angle)}
    found = picchio.identify(world.robot, campaign(columns))
    first = found.joints[0].stiffness
    assert not first.told and "keeps what was known before" in first.why
    assert first.high / first.low == pytest.approx(16.0, rel=0.3)


def test_outliers_are_told_and_hardly_count(loads):
    world = loads.draw(3, 1)
    reading = next(name for name in world.columns if name.startswith(("dial", "displacement")))
    columns = dict(world.columns)
    columns[reading] = columns[reading].copy()
    columns[reading][[2, 9]] += (4e-3, -3e-3)
    clean = picchio.identify(world.robot, campaign(world.columns))
    found = picchio.identify(world.robot, campaign(columns))
    assert {"loads.csv sample 3", "loads.csv sample 10"} <= set(found.outliers)
    for one, other in zip(clean.joints, found.joints, strict=True):
        assert other.stiffness.value == pytest.approx(one.stiffness.value, rel=0.05)


def test_a_zero_that_rows_share_is_found(loads):
    world = loads.draw(3, 4, exact=True, loadings=24)
    columns = dict(world.columns)
    sets = np.repeat([0.0, 1.0], 12)
    for name in columns:
        if name == "dial" or name.startswith("displacement"):
            columns[name] = columns[name] + np.where(sets > 0.0, 2e-3, -1e-3)
    found = picchio.identify(world.robot, campaign(columns | {"set": sets}, EXACT))
    values = [joint.stiffness.value for joint in found.joints]
    np.testing.assert_allclose(values, world.truth, rtol=0.01)


def test_a_robot_of_which_nothing_is_known(loads):
    """Of a URDF without any stiffness the priors are those of its drives."""
    robot = picchio.load_robot("talos_left_arm")
    rng = np.random.default_rng(1)
    columns = {f"pose.{name}": rng.uniform(-0.5, 0.5, 6) for name in robot.flexible_names}
    columns |= {"weight": np.full(6, 20.0), f"displacement.{robot.tool_frame}.z": np.full(6, -1e-3)}
    found = picchio.identify(robot, campaign(columns))
    assert len(found.joints) == len(robot.flexible_names)
    assert all(joint.stiffness.low < joint.stiffness.high for joint in found.joints)


def test_joints_and_frames_that_are_not_there_are_named(loads):
    world = loads.draw(3, 1)
    columns = {k.replace("joint_3", "joint_9"): v for k, v in world.columns.items()}
    with pytest.raises(picchio.InputError, match=r"pose\.joint_9.*joint_3"):
        picchio.identify(world.robot, campaign(columns))
    columns = {k: v for k, v in world.columns.items() if k.startswith(("pose", "force"))}
    with pytest.raises(picchio.InputError, match="no such frame"):
        picchio.identify(
            world.robot, campaign(columns | {"displacement.hand.x": np.zeros(15)})
        )  # fmt: skip
    zero = {k: 0.0 * v if k.startswith("force") else v for k, v in world.columns.items()}
    with pytest.raises(picchio.InputError, match="no loading of this record has a force"):
        picchio.identify(world.robot, campaign(zero))


def test_kinds_that_are_not_identified_together(loads):
    world = loads.draw(3, 1)
    static = Record.from_columns("loads.csv", world.columns, kind="static")
    time = np.arange(5.0)
    motion = Record.from_arrays("m.csv", time, {"torque.joint_1": time}, kind="motion")
    mixed = Campaign.from_records([static, motion])
    with pytest.raises(picchio.InputError, match=r"not identified together.*motion and static"):
        picchio.identify(world.robot, mixed)


def test_the_command_and_its_sidecar(loads, tmp_path, in_process):
    world = loads.draw(3, 1)
    blind_stiffness.campaign(world).save(tmp_path / "loads")
    done = in_process("identify", world.robot, "--data", "loads", "--out", "flex.toml",
                      "--json", "found.json", cwd=tmp_path)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "90 % interval" in done.stdout and "loadings tell half of it" in done.stdout
    content = json.loads((tmp_path / "found.json").read_text())
    assert content["format"] == "picchio-identification/1"
    assert [joint["name"] for joint in content["joints"]] == list(world.joints)
    assert all(set(j["stiffness"]) == {"value", "low", "high", "told", "why"}
               for j in content["joints"])  # fmt: skip
    assert 0.0 < content["residual"]["after"] < content["residual"]["before"]
    sidecar = read_sidecar(tmp_path / "flex.toml")
    assert set(sidecar.posterior.names) >= {f"stiffness.{name}" for name in world.joints}
    robot = picchio.load_robot(world.robot, flex=tmp_path / "flex.toml")
    for joint, written in zip(robot.flexible_joints, content["joints"], strict=True):
        assert joint.stiffness == pytest.approx(written["stiffness"]["value"])
        spread = robot.spreads[f"stiffness.{joint.name}"]
        reach = math.log(written["stiffness"]["high"] / written["stiffness"]["value"])
        assert spread.size == pytest.approx(reach / 1.645, rel=0.2)
    # The answer is the prior of what follows.
    again = picchio.identify(robot, blind_stiffness.campaign(loads.draw(3, 1)))
    for one, other in zip(content["joints"], again.joints, strict=True):
        before = math.log(one["stiffness"]["high"] / one["stiffness"]["low"])
        assert math.log(other.stiffness.high / other.stiffness.low) < before
    assessed = in_process("assess", world.robot, "--flex", "flex.toml", "--json", "a.json",
                          cwd=tmp_path)  # fmt: skip
    assert assessed.returncode == 0, assessed.stderr


def r2000ic(folder):
    """The real arm's loadings, as its controller shows the angles."""
    table = np.genfromtxt(folder / "r2000ic-static" / "loads.csv", delimiter=",", skip_header=1)
    columns = {f"pose.joint_{k + 1}": table[:, k] for k in range(6)}
    columns |= {f"force.{axis}": table[:, 6 + k] for k, axis in enumerate("xyz")}
    columns |= {f"displacement.tcp.{axis}": table[:, 9 + k] for k, axis in enumerate("xyz")}
    turned = {f"joint_{k}": {f"joint_{k}": -1.0} for k in (4, 5, 6)}
    return campaign(
        columns, joint_map={"joint_3": {"joint_2": -1.0, "joint_3": -1.0}, **turned}
    )  # fmt: skip


def test_the_real_arm(measured_data):
    """Plain least squares as its source has it, and what loadings left out say of the rest."""
    robot, data = picchio.load_robot("fanuc_r2000ic"), r2000ic(measured_data)
    alone = identify_static(robot, data, search=False)
    found = np.array([joint.stiffness.value for joint in alone.joints])
    np.testing.assert_allclose(found[:3], [8.6e5, 2.7e6, 2.0e6], rtol=0.1)
    assert alone.joints[0].stiffness.told and not alone.joints[5].stiffness.told
    assert 0.21 < alone.answer.left_out.nrmse < 0.25
    whole = picchio.identify(robot, data)
    assert whole.answer.left_out.nrmse < 0.75 * alone.answer.left_out.nrmse
    across = [
        weight for causes, weight in whole.answer.weights.items()
        if any(cause.effect == "transverse_compliance" for cause in causes)
    ]  # fmt: skip
    assert sum(across) > 0.9
