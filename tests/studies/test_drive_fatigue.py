"""Drives whose strength is an estimate: fatigue in shares of the torque for repeated peaks."""

from __future__ import annotations

import dataclasses
import math
import re

import numpy as np
import pytest

import picchio
from picchio.core.errors import InputError
from picchio.fatigue.counting.counter import rainflow
from picchio.robot.joint import Strength
from picchio.studies.rivet.poses import damage_at
from picchio.studies.uncertainty.drawn import Drawn
from picchio.studies.uncertainty.measurements import FittedWorlds

PEAK = 900.0
BEARS = {"repeated_peak_torque": PEAK, "repeated_peak_torque_spread": 1.6, "estimated": True}
DRIVES = {f"joint_{k}": {"strength": BEARS} for k in (1, 2, 3)}
TASK = {
    "format": "picchio-task/1", "hits_per_rivet": 12,
    "excitation": {"kind": "pulse_train", "force": 12000.0, "period": 0.04, "width": 0.004},
    "operation": [{"name": "up", "direction": [1, 1, 1],
                   "poses": [[0.3, 0.9, -1.1], [0, 0.4, -0.7]]}],
}  # fmt: skip
FLEX = {f"joint_{k}": {"stiffness": s, "damping_ratio": 0.03} for k, s in
        ((1, 2.4e5), (2, 1e5), (3, 1e5))}  # fmt: skip
BARE = """format = "picchio-sidecar/1"
""" + "".join(f"[joint.{n}]\nstiffness = {v['stiffness']}\n" for n, v in FLEX.items())


@pytest.fixture(scope="module")
def load(tmp_path_factory, repository):
    """Loads the 3-DoF arm without shafts, with values for its joints."""
    folder = tmp_path_factory.mktemp("bare")
    (folder / "flex.toml").write_text(BARE)
    shipped = repository / "robots" / "fanuc_like_3dof" / "robot.urdf"
    urdf = folder / "robot.urdf"
    urdf.write_text(re.sub(r"<picchio:[^>]*/>", "", shipped.read_text()))
    return lambda values: picchio.load_robot(
        urdf, flex=folder / "flex.toml", tool="tool", values=values
    )


@pytest.fixture(scope="module")
def bare(load):
    """Its drives' strengths are estimates."""
    return load(DRIVES)


@pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")
def test_damage_is_that_of_torque_over_its_limit_by_hand(bare) -> None:
    task = picchio.task_from_dict(TASK, bare)
    found = picchio.assess(bare, task, uncertainty=False, steady_check=False)
    curve = picchio.load_sn_curve("drive-teeth")
    operation = task.operations[0]
    for k, joint in enumerate(found.joints):
        by_hand = 0.0
        for pose in operation.poses:
            state = bare.state(pose)
            modes = picchio.modal_analysis(picchio.Model(bare).linear_system(pose))
            response = picchio.response_from_rest(modes, operation.excitation, hits=12)
            turns = response.turning_points(operation.direction)[k][1]
            cycles = rainflow(turns * bare.flexible_joints[k].stiffness / PEAK)
            raised = 1.0 / (1.0 - abs(state.gravity_torque[k]) / PEAK / 2.5)
            lives = curve.cycles_to_failure(cycles.amplitude * min(raised, 20.0))
            by_hand += float((cycles.count / lives).sum())
        assert joint.worn == "drive"
        assert joint.damage_per_rivet == pytest.approx(by_hand / 2.0, rel=1e-6)


@pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")
def test_compiled_code_and_the_exact_path_agree(bare) -> None:
    task = picchio.task_from_dict(TASK, bare)
    operation, model = task.operations[0], picchio.Model(bare)
    curves = [picchio.load_sn_curve("drive-teeth")] * 3
    args = model, operation.poses, operation.direction, operation.excitation, 12, curves
    fast, exact = damage_at(*args), damage_at(*args, compiled=False)
    assert (fast.damage > 0.0).all()
    np.testing.assert_allclose(fast.damage, exact.damage, rtol=1e-6)


@pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")
def test_an_estimated_drive_has_an_interval_and_what_to_measure(bare) -> None:
    task = picchio.task_from_dict(TASK, bare)
    found = picchio.assess(bare, task, steady_check=False)
    told = found.to_dict()
    assert told["estimated"] is True
    assert told["life"]["p10"] < told["life"]["p50"] < told["life"]["p90"]
    assert sum(joint["ends_first"] for joint in told["joints"]) == pytest.approx(1.0)
    assert told["rivets_to_failure"] == told["life"]["p50"]
    best = told["measure_first"][0]
    now, then = best["interval_decades"]
    assert now == pytest.approx(math.log10(told["life"]["p90"] / told["life"]["p10"]), rel=0.02)
    assert then < now
    assert best["what"].startswith("reducer")  # the one value that is uncertain by a factor of 1.6
    # Once the limits are known, what is left is what was foretold.
    exact = {name: {"strength": {"repeated_peak_torque": PEAK}} for name in DRIVES}
    known = dataclasses.replace(
        bare, spreads={}, posterior=None,
        flexible_joints=tuple(
            dataclasses.replace(j, strength=Strength(**exact[j.name]["strength"]))
            for j in bare.flexible_joints
        ),
    )  # fmt: skip
    life = picchio.uncertain_life(known, task, totals=False)
    every = next(one for one in told["measure_first"] if one["what"] == "reducer")
    assert life.decades == pytest.approx(every["interval_decades"][1], rel=0.15)


@pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")
def test_a_reducer_and_a_shaft_take_over_part_by_part(load) -> None:
    values = {
        "joint_1": {"strength": BEARS, "reducer": "RV-80E-121"},
        "joint_2": {"strength": BEARS, "shaft": {"radius": 0.01, "length": 0.02,
                                                 "shear_modulus": 79.3e9}},
        "joint_3": {"strength": BEARS},
    }  # fmt: skip
    robot = load(values)
    first, second, third = robot.flexible_joints
    assert first.strength.repeated_peak_torque == first.reducer.repeated_peak_torque == 1960.0
    assert not any(name.endswith("joint_1") for name in robot.spreads)
    assert first.drive == "reducer RV-80E-121"
    assert second.worn is second.shaft
    assert second.ratings is second.strength
    assert third.worn is third.strength
    found = picchio.assess(robot, picchio.task_from_dict(TASK, robot), steady_check=False)
    assert [joint.worn for joint in found.joints] == ["drive", "shaft", "drive"]
    with pytest.raises(InputError, match="a shaft needs shear"):
        picchio.assess(robot, picchio.task_from_dict(TASK, robot), sn_curve="drive-teeth")


def test_a_wanted_life_counts_estimated_drives(bare) -> None:
    task = picchio.task_from_dict(TASK, bare)
    allowed = picchio.allowable(bare, task, 1e4)
    found = picchio.assess(bare, task, uncertainty=False, steady_check=False)
    lives = {joint.name: joint.rivets_to_failure for joint in found.joints}
    for joint in allowed:
        assert joint.life == pytest.approx(lives[joint.joint], rel=1e-6)
    # Fed back: at the allowed force the stated values just hold.
    assert allowed.force_factor > 0.0


def test_a_measurement_leaves_what_normal_theory_says() -> None:
    rng = np.random.default_rng(3)
    moved = rng.standard_normal((512, 3))
    x, y, rest = moved.T
    width = 2.0 * 1.2815515655446004
    # log10 of the utilisation is 2 x + y + rest / 2, of variance 5.25; of two parts, one is idle.
    used = 10.0 ** np.stack([2.0 * x + y + 0.5 * rest, np.full(512, -30.0)])
    drawn = Drawn(np.full((2, 512), np.inf), used, used, used, np.full((2, 512), np.nan))
    worlds = FittedWorlds.of(moved, drawn, endless=True)
    for columns, error, variance in (
        ([], [], 5.25),
        ([0], [0.5], 5.25 - 4.0 / 1.25),  # read with an error
        ([0, 1], [1e-6, 1e-6], 0.25),
    ):
        left = worlds.expected_width(np.eye(3), columns, np.array(error))
        assert left == pytest.approx(width * math.sqrt(variance), rel=0.03)
    # Two equal parts: the larger one counts, and knowing one of them narrows little.
    used = 10.0 ** np.stack([x, y])
    worlds = FittedWorlds.of(moved, drawn._replace(used=used), endless=True)
    now = worlds.expected_width(np.eye(3), [], np.zeros(0))
    larger = np.maximum(*rng.standard_normal((2, 10**6)))
    assert now == pytest.approx(np.subtract(*np.quantile(larger, [0.9, 0.1])), rel=0.03)
    one, both = (worlds.expected_width(np.eye(3), c, np.full(len(c), 1e-6)) for c in ([0], [0, 1]))
    assert both < 0.02 * now < 0.5 * now < one < now
