"""The prediction against an independent nonlinear simulator of the arm (`tests/worlds`)."""

import sys

import numpy as np
import pytest

from picchio.prediction.noise_tests import whiteness
from picchio.prediction.percussion import predict
from picchio.robot import load_robot

GROUPS = ("force", "deflection", "acceleration.tool", "accelerometer.tool", "velocity.tool",
          "displacement.tool")  # fmt: skip
# N: the largest deflection is below 0.1 mrad, so third-order terms are out of sight.
SMALL = 30.0


@pytest.fixture(scope="module")
def worlds(repository):
    sys.path.insert(0, str(repository / "tests"))
    try:
        from worlds import campaign
    finally:
        sys.path.pop(0)
    return campaign


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
