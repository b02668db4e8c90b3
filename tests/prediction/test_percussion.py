"""The prediction against an independent nonlinear simulator of the arm (`tests/worlds`)."""

import dataclasses
import warnings

import numpy as np
import pytest

import picchio
from picchio.campaign.campaign import Campaign, load_campaign
from picchio.campaign.record import Record
from picchio.core.errors import InputError
from picchio.model.effects.registry import effect_class
from picchio.model.model import Model
from picchio.prediction.percussion import InCommon, percussion_setups, predict
from picchio.robot.loading.load import load_robot

from ..whiteness import whiteness

GROUPS = ("force", "deflection", "acceleration.tool", "accelerometer.tool", "velocity.tool",
          "displacement.tool")  # fmt: skip
# N: the largest deflection is below 0.1 mrad, so third-order terms are out of sight.
SMALL = 30.0


def made(worlds, **options):
    groups = tuple(g.replace(".tool", "") if g == "accelerometer.tool" else g for g in GROUPS)
    return worlds.make(
        sensors=groups, nuisances=worlds.Nuisances.none(3), force=SMALL, records=4, **options
    )


@pytest.fixture(scope="module")
def small(worlds):
    campaign, truth = made(worlds, seed=1, snr_db=300.0)
    return campaign, truth, predict(load_robot("fanuc_like_3dof"), campaign)


@pytest.mark.parametrize("group", GROUPS)
def test_every_kind_of_channel_at_small_force(small, group):
    campaign, _, predicted = small
    error = scale = 0.0
    for record in campaign:
        for name in record.channels:
            if record.channel(name).group != group:
                continue
            left = record[name] - predicted[record.file][name]
            error = max(error, float(np.sqrt(np.mean(left**2))))
            scale = max(scale, float(np.sqrt(np.mean(record[name] ** 2))))
    assert scale > 0.0
    # 80 dB: the sensors' endless bandwidth is cut at 5 kHz, second-order terms are in the model.
    assert error < 1e-3 * scale


@pytest.mark.parametrize("group", GROUPS)
def test_with_noise_on_it_the_residual_is_white(small, group):
    campaign, _, predicted = small
    rng = np.random.default_rng(0)
    tested = raised = 0
    for record in campaign:
        rate = record.clock.rate
        names = [n for n in record.channels if record.channel(n).group == group]
        level = max(float(np.sqrt(np.mean(record[n] ** 2))) for n in names)
        for name in names:
            std = 0.01 * level  # 40 dB
            noisy = record[name] + std * rng.standard_normal(record[name].size)
            left = noisy - predicted[record.file][name]
            raised += whiteness(left, std=std, rate=rate, level=0.01).alarm
            tested += 1
    # 4 or 12 tests at 1 %: three alarms have a chance of 2e-4.
    assert raised <= 2, (raised, tested)


def test_a_recorded_force_drives_the_prediction_at_its_own_time(worlds):
    """Half-sines of 4 ms read at 2 kHz, none at t = 0: half a sample of delay would leave 12 %."""
    campaign, _ = worlds.make(
        sensors=("accelerometer", "deflection", "force"), nuisances=worlds.Nuisances.none(3),
        records=3, seed=5, snr_db=200.0, sampling=2000.0, hits=3, blend=1.0, programmed=False,
    )  # fmt: skip
    predicted = predict(load_robot("fanuc_like_3dof"), campaign)
    for record in campaign:
        found = predicted[record.file]
        assert set(found) == set(record.channels) - {"force"}  # it can't be wrong about itself
        for group in ("accelerometer.tool", "deflection"):
            names = [name for name in found if record.channel(name).group == group]
            read = np.array([record[name] for name in names])
            left = read - np.array([found[name] for name in names])
            assert np.linalg.norm(left) < 0.01 * np.linalg.norm(read)


def test_what_the_model_leaves_grows_with_the_square_of_the_force_or_faster(worlds):
    """So what is left at small force is no error of the linear part."""
    robot = load_robot("fanuc_like_3dof")
    left = []
    for force in (100.0, 400.0):
        campaign, _ = worlds.make(sensors=("deflection",), nuisances=worlds.Nuisances.none(3),
                                  force=force, records=2, seed=1, snr_db=300.0)  # fmt: skip
        found = predict(robot, campaign)
        rows = [r[n] - found[r.file][n] for r in campaign for n in r.channels]
        left.append(float(np.sqrt(np.mean(np.square(rows)))))
    assert left[1] > 10.0 * left[0]


def _campaign(pose, **blows):
    time = np.arange(-50, 200) * 1e-3
    record = Record.from_arrays(
        "r01.csv", time, {"deflection.joint_1": np.zeros(time.size)},
        pose=pose, direction=[0.0, 1.0, 0.0],
    )  # fmt: skip
    excitation = {"force": 300.0, "period": 0.04, "width": 0.004, "hits": 3} | blows
    return Campaign.from_records([record], robot="fanuc_like_3dof", excitation=excitation)


@pytest.mark.parametrize("filtered", [(), (("sensor_lowpass", {"frequency": 180.0}),)])
@pytest.mark.parametrize(
    ("name", "before", "after"),
    [
        ("force_amplitude", {"scale": 0.99}, {"scale": 1.01}),
        ("pulse_rate", {"scale": 0.9999}, {"scale": 1.0001}),
        ("pulse_width", {"scale": 0.999}, {"scale": 1.001}),
    ],
)
def test_changes_of_the_blows_are_those_between_two_predictions(
    small, name, before, after, filtered
):
    campaign, _, _ = small
    robot = load_robot("fanuc_like_3dof")
    setup = percussion_setups(robot, campaign)[1]
    base = [effect_class(kind)("accelerometer.tool", **values) for kind, values in filtered]
    models = [
        Model(robot, True).with_effects([*base, effect_class(name)("tool", **values)])
        for values in (before, after)
    ]
    found = setup.changes(Model(robot, True).with_effects(base), [tuple(models)], each_blow=True)
    one, other = (setup.predict(model) for model in models)
    for channel in setup.channels:
        expected = other[channel.name] - one[channel.name]
        error = np.abs(found[channel.name][0] - expected).max()
        assert error <= 5e-3 * np.abs(expected).max(), channel.name
    if name != "force_amplitude":  # a change of single blows is told only where it is asked for
        (told,) = setup.changes(models[0], [tuple(models)])["deflection.joint_1"]
        assert np.isnan(told).all()


def test_blows_are_known_by_modes_after_however_many_changes_of_the_structure(small):
    campaign, _, _ = small
    robot = load_robot("fanuc_like_3dof")
    setup = percussion_setups(robot, campaign)[1]
    plain = Model(robot, True)

    def pair(name, low, high, where="tool"):
        return tuple(
            plain.with_effects([effect_class(name)(where, **{key: value})])
            for key, value in (low, high)
        )

    heavier = [pair("payload", ("mass", 0.0), ("mass", 0.01 * k)) for k in range(1, 12)]
    wider = pair("pulse_width", ("scale", 0.999), ("scale", 1.001))
    alone = setup.changes(plain, [wider], each_blow=True)
    among = setup.changes(plain, [*heavier, wider], each_blow=True)
    for channel in setup.channels:
        np.testing.assert_array_equal(among[channel.name][-1], alone[channel.name][0])


def test_what_is_far_from_straight_is_not_told_by_modes(worlds):
    """Else a harder blow, which deflects more, and a sensor's gain would seem to be told apart."""
    campaign, _ = made(worlds, seed=1)
    robot = load_robot("fanuc_like_3dof")
    setup = percussion_setups(robot, campaign)[1]
    told = {}
    soft = [effect_class("joint_stiffness")(f"joint_{k}", scale=0.2) for k in (1, 2, 3)]
    for times in (1.0, 40.0):
        one, here, other = (
            Model(robot, True).with_effects(
                [*soft, effect_class("force_amplitude")("tool", scale=times * scale)]
            )
            for scale in (0.995, 1.0, 1.005)
        )
        before, read, after = (setup.predict(model) for model in (one, here, other))
        names = [name for name in read if name.startswith("accelerometer.tool")]
        # Of what doubles with the force, a change of it by 1 % is 1 % of what is read.
        bent = max(
            np.abs(after[n] - before[n] - 0.01 * read[n]).max() / (0.01 * np.abs(read[n]).max())
            for n in names
        )
        told[times] = bent, setup.changes(here, [(one, other)]) is not None
    assert told[1.0][0] < 0.002 and told[1.0][1]
    assert told[40.0][0] > 0.01 and not told[40.0][1]


@pytest.mark.parametrize("times", [1.0, 40.0])
def test_a_sensor_at_its_limit_does_not_tell_what_no_record_can(times, worlds):
    """All forces, masses and springs twice as large move nothing, at the limit or below it.

    Samples that a step takes to the limit, or away from it, would seem to tell.
    """
    campaign, _ = made(worlds, seed=1)
    robot = load_robot("fanuc_like_3dof")
    setup = percussion_setups(robot, campaign)[1]
    soft = [("joint_stiffness", f"joint_{k}", 0.2) for k in (1, 2, 3)]
    base = [*soft, ("force_amplitude", "tool", times)]

    def model(*more, limit=np.inf):
        effects = [effect_class(name)(target, scale=scale) for name, target, scale in more]
        return Model(robot, True).with_effects(
            [*effects, effect_class("sensor_clipping")("deflection", limit=limit)]
        )

    most = max(np.abs(v).max() for n, v in setup.predict(model(*base)).items() if "defl" in n)
    limited = model(*base, limit=0.5 * most)
    links = [("link_mass", f"link_{k}", 1.0) for k in (1, 2, 3)]
    pairs, steps = [], (0.999, 1.001)
    for moved in (*base, *links):
        others = [each for each in (*base, *links) if each is not moved]
        ends = [(*others, (*moved[:2], moved[2] * step)) for step in steps]
        pairs.append(tuple(model(*end, limit=0.5 * most) for end in ends))
    found, there = setup.changes(limited, pairs), setup.predict(limited)
    straight = setup.changes(model(*base), [tuple(model(*e) for e in ends)]) is not None
    assert straight == (times == 1.0)
    at_limit = 0
    for name, changed in found.items():
        if name.startswith("deflection"):
            beyond = np.abs(there[name]) >= 0.5 * most
            at_limit += beyond.sum()
            assert not changed[:, beyond].any()
        if name != "force":
            assert np.abs(changed.sum(axis=0)).max() < 1e-4 * np.abs(changed).max(), name
    assert at_limit > 10


def test_a_pose_the_robot_cannot_have_is_told_with_its_file_and_record(tmp_path):
    arm = picchio.load_robot("fanuc_like_3dof")
    campaign = _campaign({"joint_1": 0.1, "joint_9": 0.2})
    campaign.save(tmp_path / "measured")
    for given, place in (
        (campaign, "r01.csv.pose"),
        (load_campaign(tmp_path / "measured"), "campaign.toml: record[0].pose"),
    ):
        with pytest.raises(InputError, match="joint_9") as caught:
            percussion_setups(arm, given)
        assert place in str(caught.value)


def test_a_burst_that_outlasts_its_record_is_warned_of():
    arm = picchio.load_robot("fanuc_like_3dof")
    pose = {"joint_1": 0.1, "joint_2": 0.2, "joint_3": 0.3}
    with pytest.warns(picchio.PicchioWarning, match="is the period of 40 s right"):
        percussion_setups(arm, _campaign(pose, period=40.0))  # milliseconds, written as seconds
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        percussion_setups(arm, _campaign(pose))


def test_records_struck_alike_share_their_force_and_steps(small):
    robot = load_robot("fanuc_like_3dof")
    first, second, third = percussion_setups(robot, small[0])[:3]
    second = dataclasses.replace(second, blows=second.blows.change(height=1.7 * first.blows.height))
    model = Model(robot)
    assert second.struck(model).unit is first.struck(model).unit
    assert second.struck(model).peak == pytest.approx(1.7 * first.struck(model).peak)
    # What is shared is the same as what is made for one alone.
    alone = dataclasses.replace(third, in_common=InCommon())
    third.predict(model)  # from what the others have made
    for name, values in alone.predict(model).items():
        assert np.array_equal(third.predict(model)[name], values)
    wider = model.with_effects([effect_class("pulse_width")("tool", scale=1.2)])
    assert second.struck(wider).unit is first.struck(wider).unit is not first.struck(model).unit
    direct = wider.blows(second.blows).force()
    assert np.allclose(second.struck(wider).force.constant, direct.constant, rtol=1e-14)
    assert second.struck(wider).force.constant.max() == pytest.approx(1.7 * SMALL)
