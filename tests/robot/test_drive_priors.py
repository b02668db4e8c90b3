from __future__ import annotations

import json
import math
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from picchio.core.errors import InputError
from picchio.robot.drives.hierarchy import Group, predict
from picchio.robot.drives.predictors import QUANTITIES, places, predictors
from picchio.robot.drives.priors import drive_priors, moments, quantiles, with_reducer
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.loading.load import load_robot
from picchio.robot.spread import root_of

sys.path.append(str(Path(__file__).resolve().parents[2] / "benchmarks"))
drive_fit = pytest.importorskip("drive_fit", reason="the benchmarks are not here")


@cache
def arm(name: str) -> FlexibleRobot:
    return load_robot(name, allow_rigid=True)


def test_the_shipped_fit_is_of_the_shipped_facts() -> None:
    shipped = json.loads((drive_fit.FOLDER / "fitted.json").read_text())
    assert shipped["facts"] == drive_fit.facts_hash()


def test_facts_say_where_they_are_from_and_no_estimate_is_truth() -> None:
    robots = {robot.name: robot for robot in drive_fit.measured_robots(arm)}
    assert all(robot.source for robot in robots.values())
    assert all(robot.evidence for robot in robots.values() if np.isfinite(robot.truth).any())
    assert not np.isfinite(robots["Kinova Gen3"].truth).any()
    kr500 = np.exp(robots["KUKA KR 500"].truth)  # two sources count once
    assert kr500[0] == pytest.approx(math.sqrt(2.3e6 * 6.5e6))


def test_predictors_are_those_of_the_arm() -> None:
    found = predictors(arm("kuka_iiwa14"), payload=14.0)
    values = dict(zip(QUANTITIES, np.exp(found.values).T, strict=True))
    assert found.names == arm("kuka_iiwa14").joint_names
    assert values["effort"][0] == pytest.approx(320.0)
    assert values["lever"][1] == pytest.approx(0.946, rel=0.01)  # shoulder to flange, stretched
    assert math.isnan(values["gravity_torque"][0])  # a vertical axis
    assert values["payload"][0] == pytest.approx(14.0)
    assert np.isnan(values["payload"][1:]).all()
    scaled = predictors(arm("kuka_iiwa14"), reach=2.0)
    assert np.exp(np.nanmax(scaled.values[:, QUANTITIES.index("lever")])) == pytest.approx(2.0)
    assert np.isnan(predictors(arm("kuka_kr210_r2700")).values[:, 3:]).all()  # limits of zero


def test_the_fit_finds_what_made_the_data_and_its_ranges_hold() -> None:
    """40 robots made by the model: 90 % ranges of the 20 left out, gaps and all."""
    rng = np.random.default_rng(0)
    groups = []
    for _ in range(60):
        size, own = rng.standard_normal(), 0.3 * rng.standard_normal(3)
        joint = rng.standard_normal(6)[:, None]
        level = np.array([10.0, 3.0, 1.0]) + size * np.array([2.0, 2.0, 0.5]) + own
        noise = np.array([0.3, 0.2, 0.4]) * rng.standard_normal((6, 3))
        values = level + joint * np.array([0.5, 0.8, 0.0]) + noise
        values[rng.random((6, 3)) < 0.2] = np.nan
        groups.append(Group(values, places(6), np.zeros(6, dtype=np.intp)))
    draws = drive_fit.fit(groups[:40], draws=40, sweeps=400)
    assert np.median(np.abs(draws.size), axis=0) == pytest.approx([2.0, 2.0, 0.5], rel=0.5)
    inside, away = [], []
    for group in groups[40:]:
        low, high = quantiles(mixture := predict(draws, group), (0.05, 0.95))
        truth = group.values[:, 0]
        there = np.isfinite(truth)
        inside += list((truth > low)[there] & (truth < high)[there])
        away += list((truth - moments(mixture)[0])[there])
    assert 0.82 <= np.mean(inside) <= 0.97
    assert np.std(away) < 0.8  # without the predictors: more than 2


def test_wrists_are_told_worse_and_errors_hang_together() -> None:
    found = drive_priors(arm("fanuc_r2000ic"))
    spread = [joint.stiffness_spread for joint in found.joints]
    assert max(spread[:3]) < min(spread[3:])
    assert all(low < joint.stiffness < high for joint in found.joints
               for low, high in [joint.stiffness_range])  # fmt: skip
    correlation = np.array(found.posterior().correlation)
    assert correlation[0, 1] > 0.3
    names = found.posterior().names
    assert names[0] == "stiffness.joint_1"
    assert correlation[0, names.index("damping_ratio.joint_1")] == 0.0
    assert correlation[0, names.index("strength.repeated_peak_torque.joint_1")] == 0.0
    assert root_of(names, found.posterior()).shape == (18, 18)
    assert "would ring at" in found.joints[0].reasons[1]
    assert json.dumps(found.to_dict())
    assert "wrist" in found._repr_html_()


def test_what_is_known_narrows() -> None:
    free = drive_priors(arm("ur10"))
    named = drive_priors(arm("ur10"), payload=10.0,
                         reducers={"shoulder_pan_joint": "CSG-32-100-2UH"})  # fmt: skip
    assert named.drive_class == "strain-wave"
    assert named.joints[0].stiffness_spread < free.joints[0].stiffness_spread
    assert named.joints[0].stiffness_range[1] < 1.1e5  # softer than the reducer
    direct = drive_priors(arm("ur10"), drive_class="direct").joints[0]
    assert not direct.supported
    assert "not backed" in direct.reasons[-1]


def test_a_reducer_weighs_a_normal_distribution_as_by_integration() -> None:
    mean, size, stiffness, shares = 11.0, 0.7, 1e5, (0.3, 0.5)
    one = np.array([1.0]), np.array([[mean, 0.0]]), np.array([[[size**2, 0.2], [0.2, 1.0]]])
    found, cov = moments(with_reducer(one, 0, stiffness, shares))
    x = np.linspace(mean - 8.0 * size, math.log(stiffness), 200001)
    t = math.log(stiffness) - x
    density = np.exp(-0.5 * ((x - mean) / size) ** 2) * (-math.log(0.15) + t) ** -3.0
    density /= density.sum()
    assert found[0] == pytest.approx(density @ x, abs=5e-3)
    assert cov[0, 0] == pytest.approx(density @ x**2 - (density @ x) ** 2, rel=0.02)
    assert found[1] == pytest.approx(0.2 / size**2 * (found[0] - mean))


def test_a_reducer_without_a_stiffness_still_tells_the_torque() -> None:
    robot = arm("fanuc_r2000ic")
    named = drive_priors(robot, drive_class="cycloidal", reducers={"joint_2": "RV-80E-121"})
    joint, alone = named.joints[1], drive_priors(robot, drive_class="cycloidal").joints[1]
    assert joint.repeated_peak_torque == pytest.approx(1960.0, rel=0.01)  # 2.5 x 784 N m
    assert joint.repeated_peak_torque_spread == pytest.approx(1.0, abs=1e-6)
    assert not any("softer than" in reason for reason in joint.reasons)
    assert joint.stiffness == pytest.approx(alone.stiffness, rel=0.5)


@pytest.mark.parametrize(
    ("name", "given", "said"),
    [
        ("ur10", {"drive_class": "worm"}, "drive_class"),
        ("ur10", {"payload": -1.0}, "payload"),
        ("ur10", {"reducers": {"elbow": "CSG-25-100-2UH"}}, "reducers"),
        ("emps", {}, "no rotary joint"),
    ],
)
def test_what_cannot_be_is_refused(name: str, given: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        drive_priors(arm(name), **given)  # type: ignore[arg-type]
