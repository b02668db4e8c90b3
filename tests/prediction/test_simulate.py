"""A simulated campaign differs from the model by white noise of the level asked for, no more."""

import numpy as np
import pytest

from picchio.campaign.campaign import load_campaign
from picchio.core.errors import InputError
from picchio.core.toml import parse_toml, validate
from picchio.model.effects.registry import effect_class
from picchio.model.model import Model
from picchio.prediction.percussion import percussion_setups, predict
from picchio.prediction.plan import FORMAT, Plan, plan_toml
from picchio.prediction.simulation import simulate
from picchio.robot.loading.load import load_robot

from ..whiteness import whiteness

# Every kind of channel that a percussion record holds, with a noise in its SI unit.
NOISE = {
    "force": 2.0,
    "deflection": 2e-6,
    "acceleration.tool": 0.05,
    "accelerometer.tool": 0.03,
    "velocity.tool": 2e-4,
    "displacement.tool": 1e-6,
}
BASE = {
    "format": FORMAT,
    "poses": [[0.3, 0.5, -0.8]],
    "directions": [[0.6, 0.0, 0.8]],
    "hits": 12,
    "sample_rate": 1000.0,
    "length": 0.85,
    "excitation": {"force": 300.0, "period": 0.04, "width": 0.004},
    "sensor": [{"channels": name, "noise": std} for name, std in NOISE.items()],
}


def plan(**changes):
    content = {**BASE, **changes}
    return validate({k: v for k, v in content.items() if v is not None}, Plan, format=FORMAT)


def simulated(robot, plan, **options):
    return simulate(robot, plan, **options).campaign


@pytest.fixture(scope="module")
def robot():
    return load_robot("fanuc_like_3dof")


def std_of(channel):
    return NOISE.get(channel.rpartition(".")[0], NOISE.get(channel.partition(".")[0]))


def alarms(robot, seeds, level=0.01, **changes):
    """How many whiteness tests were made, and which raised the alarm."""
    made, raised = 0, []
    for seed in seeds:
        campaign = simulated(robot, plan(seed=seed, **changes))
        for record in campaign:
            predicted = predict(robot, campaign)[record.file]
            for name in record.channels:
                left = record[name] - predicted[name]
                found = whiteness(left, std=std_of(name), rate=1000.0, level=level)
                made += 1
                if found.alarm:
                    raised.append((seed, name, found.worst.name, found.worst.probability))
    return made, raised


def most(made, level, sure=1e-3):
    from scipy.stats import binom

    return binom.isf(sure, made, level)


@pytest.mark.parametrize("hits", [12, None], ids=["burst", "steady"])
def test_the_residual_is_white_at_the_level_asked_for(robot, hits):
    made, raised = alarms(robot, range(6), hits=hits)
    assert made == 6 * 16
    assert len(raised) <= most(made, 0.01), raised


@pytest.mark.slow
@pytest.mark.parametrize("hits", [12, None], ids=["burst", "steady"])
def test_false_alarms_come_at_the_rate_stated(robot, hits):
    from scipy.stats import binom

    made, raised = alarms(robot, range(1000, 1200), hits=hits)
    kinds = {}
    for _, name, _, _ in raised:
        kinds[name] = kinds.get(name, 0) + 1
    assert made == 200 * 16
    low, high = binom.ppf([1e-3, 1 - 1e-3], made, 0.01)
    assert low <= len(raised) <= high, (len(raised), low, high)
    # No single channel hides behind the others.
    assert max(kinds.values()) <= binom.isf(1e-3 / 16, 200, 0.01), kinds


def test_a_wrong_model_is_seen_in_every_channel(robot):
    """The tests above can fail: a payload that the model does not have is not white."""
    campaign = simulated(robot, plan(), effects=[effect_class("payload")("tool", mass=5.0)])
    predicted = predict(robot, campaign)["r01.csv"]
    record = campaign["r01.csv"]
    for name in record.channels:
        found = whiteness(record[name] - predicted[name], std=std_of(name))
        # A payload moves the tool in the blow's plane; y and joint_1 stay at rest there.
        still = np.abs(predicted[name]).max() < 5.0 * std_of(name)
        assert found.alarm == (name != "force" and not still), name


def test_written_and_read_back_it_is_the_same(robot, tmp_path):
    made = simulated(robot, plan(levels=[150.0, 300.0]), robot_name="fanuc_like_3dof")
    made.save(tmp_path / "campaign")
    read = load_campaign(tmp_path / "campaign")
    assert read.table.provenance["seed"] == 0
    assert [r.excitation.force for r in read] == [150.0, 300.0]
    for a, b in zip(made, read, strict=True):
        for name in a.channels:
            np.testing.assert_array_equal(a[name], b[name])
    left = read["r02.csv"]["force"] - predict(robot, read)["r02.csv"]["force"]
    assert not whiteness(left, std=2.0, level=1e-4).alarm


def test_a_seed_makes_the_same_noise_again_and_another_another(robot):
    one, again, other = (simulated(robot, plan(seed=s))["r01.csv"]["force"] for s in (3, 3, 4))
    np.testing.assert_array_equal(one, again)
    assert np.abs(one - other).max() > 1.0


def test_records_of_one_campaign_have_their_own_noise(robot):
    campaign = simulated(robot, plan(repeats=2))
    a, b = (r["accelerometer.tool.x"] for r in campaign)
    assert (a - b).std() == pytest.approx(np.sqrt(2) * NOISE["accelerometer.tool"], rel=0.1)


def test_the_plan_says_which_records(robot):
    two = {"poses": [[0.3, 0.5, -0.8], {"joint_2": 0.4}], "levels": [100.0, 200.0, 300.0],
           "directions": [[1, 0, 0], [0, 0, 2.0]], "length": 0.1, "quiet": 0.0}  # fmt: skip
    every = simulated(robot, plan(**two))
    assert len(every.records) == 12
    assert {r.excitation.force for r in every} == {100.0, 200.0, 300.0}
    turned = plan(**two, combine="in-turn")
    assert turned.count == 2
    assert [r["force"] for r in turned.records()] == [100.0, 200.0]
    assert every.records[0].clock.start == 0.0


def test_a_plan_survives_its_file(tmp_path):
    asked = plan(levels=[100.0], effect=[{"effect": "backlash", "target": "joint_2",
                                          "parameters": {"gap": 1e-4}}])  # fmt: skip
    (tmp_path / "plan.toml").write_text(plan_toml(asked))
    assert parse_toml(tmp_path / "plan.toml", Plan, format=FORMAT) == asked


@pytest.mark.parametrize(
    ("effect", "target", "values"),
    [
        ("pulse_jitter", "tool", {"std": 1e-3}),
        ("missed_hits", "tool", {"fraction": 0.3}),
        ("mains_hum", "accelerometer.tool", {"amplitude": 0.5}),
    ],
)
def test_what_is_drawn_anew_in_every_record_is_drawn(robot, effect, target, values):
    given = {"effect": effect, "target": target, "parameters": values}
    campaign = simulated(robot, plan(repeats=2, effect=[given]))
    clean = predict(robot, campaign)
    a, b = (r["accelerometer.tool.x"] - clean[r.file]["accelerometer.tool.x"] for r in campaign)
    noise = NOISE["accelerometer.tool"]
    assert a.std() > 2.0 * noise
    assert (a - b).std() > 2.0 * noise
    assert campaign.table.provenance["effects"][0]["effect"] == effect


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"poses": [[0.0, 0.1]]}, "3"),
        ({"sensor": [{"channels": "deflection.joint_9", "noise": 0.0}]}, "joint_9"),
        ({"sensor": [{"channels": "accelerometer.hand", "noise": 0.0}]}, "hand"),
        ({"sensor": [{"channels": "torque.joint_1", "noise": 0.0}]}, "percussion"),
        ({"sensor": [{"channels": "force"}, {"channels": "force"}]}, "twice"),
        ({"sensor": [{"channels": "deflection", "noise": 1.0, "unit": "mm"}]}, "rad"),
        ({"effect": [{"effect": "payload", "target": "tool", "parameters": {"m": 1}}]}, "m"),
        ({"excitation": {"kind": "measured", "file": "f.csv"}}, "measured"),
        ({"excitation": {"period": 0.04, "width": 0.004}}, "force"),
        ({"times": []}, "1"),
        ({"sample_rate": 1e9}, "samples"),
    ],
)
def test_a_wrong_plan_is_told_in_one_line(robot, changes, word):
    with pytest.raises(InputError, match=word) as caught:
        simulated(robot, plan(**changes))
    assert "\n" not in str(caught.value)


def test_gravity_counts_unless_switched_off(robot):
    quiet = plan(sensor=[{"channels": "deflection"}])
    with_gravity = simulated(robot, quiet)["r01.csv"]["deflection.joint_2"]
    without = simulated(robot, quiet, gravity_stiffness=False)["r01.csv"]["deflection.joint_2"]
    assert np.abs(with_gravity - without).max() > 1e-4 * np.abs(without).max()


def test_noise_free_it_is_the_model_bit_for_bit(robot):
    quiet = simulated(robot, plan(sensor=[{"channels": c} for c in NOISE]))
    (setup,) = percussion_setups(robot, quiet)
    for name, values in setup.predict(Model(robot, True)).items():
        np.testing.assert_array_equal(quiet["r01.csv"][name], values)
