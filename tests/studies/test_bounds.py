"""What would fill the memory or take hours is refused in one line, or keeps its memory bounded."""

import dataclasses
import time
import tracemalloc
from types import SimpleNamespace

import numpy as np
import pytest

import picchio
from picchio.core.errors import InputError
from picchio.model.effects.registry import effect_class
from picchio.model.linear_system import LinearSystem
from picchio.studies.maps import places
from picchio.studies.rivet.pose import ModelAtPose
from picchio.studies.tasks import task_from_dict
from picchio.vibration.closed_form.modes import modal_analysis
from picchio.vibration.closed_form.response import response_from_rest

POSE = (0.3, 1.1, -1.0)
BLOWS = picchio.PulseTrain(300.0, 0.040, 0.004)
MEASURED = picchio.MeasuredForce(np.linspace(0.0, 0.04, 1000), np.ones(1000))


@pytest.fixture(scope="module")
def arm():
    """The 3-DoF arm; with joints almost without damping; with a gap in a joint."""
    usual = picchio.load_robot("fanuc_like_3dof")
    joints = [dataclasses.replace(j, damping_ratio=1e-9) for j in usual.flexible_joints]
    gap = effect_class("backlash")("joint_2", gap=1e-4)
    return SimpleNamespace(
        usual=usual,
        still=dataclasses.replace(usual, flexible_joints=tuple(joints)),
        loose=picchio.Model(usual).with_effects([gap]),
    )


def along(model, blows, hits):
    return ModelAtPose(model, np.array(POSE)).response_along(blows, hits, np.array([1.0, 0, 0]))


def mapped(robot, folder, **given):
    grid = places.joint_grid(robot, 2)
    return picchio.workspace_map(robot, grid, BLOWS, folder / "m.nc", **given)


def task_of(hits):
    blows = {"kind": "pulse_train", "force": 1.0, "period": 0.04, "width": 0.004}
    entry = {"name": "a", "direction": [1, 0, 0], "poses": [POSE]}
    return {"operation": [entry], "hits_per_rivet": hits, "excitation": blows}


@pytest.mark.parametrize(
    ("refused", "told"),
    [
        (lambda a, f: picchio.envelope(a.usual, POSE, BLOWS, hits=10_001), "hits: .*10000.*10001"),
        (lambda a, f: picchio.envelope(a.usual, POSE, MEASURED, hits=5000), "hits: .*pieces.*5000"),
        (lambda a, f: picchio.envelope(a.still, POSE, BLOWS, hits=3), "damping_ratio: .*values"),
        (lambda a, f: mapped(a.usual, f, hits=10_001), "hits: .*10000.*10001"),
        (lambda a, f: mapped(a.usual, f, damage=10_001), "damage: .*10000.*10001"),
        (lambda a, f: mapped(a.still, f, damage=3), "damping_ratio: .*values"),
        (lambda a, f: along(a.loose, picchio.PulseTrain(300.0, 1e6, 0.004), 12), "hits: .*samples"),
        (lambda a, f: task_from_dict(task_of(10_001), a.usual), "hits_per_rivet: .*10000"),
    ],
)
def test_too_much_is_refused_with_key_and_limit(tmp_path, arm, refused, told):
    with pytest.raises(InputError, match=f"^{told}"):
        refused(arm, tmp_path)


def chain(n, stiffest):
    """n masses in a row, the springs ever stiffer."""
    springs = np.geomspace(1e4, stiffest, n)
    stiffness = np.diag(springs + np.append(springs[1:], 0.0))
    stiffness -= np.diag(springs[1:], 1) + np.diag(springs[1:], -1)
    push = np.random.default_rng(1).normal(size=(n, 3))
    return LinearSystem(
        np.eye(n), 1e-4 * stiffness, stiffness, push, np.eye(n), tuple(map(str, range(n)))
    )


def test_a_long_burst_is_computed_in_bounded_memory():
    response = response_from_rest(modal_analysis(chain(4, 1e9)), BLOWS, hits=400)
    tracemalloc.start()
    try:
        response.worst_directions()
        response.worst_combination(np.eye(4)[:3])
        assert tracemalloc.get_traced_memory()[1] < 120e6
    finally:
        tracemalloc.stop()


def test_blocks_of_any_size_give_the_same_turning_points(monkeypatch):
    response = response_from_rest(modal_analysis(chain(3, 1e6)), BLOWS, hits=7)
    whole, tops = response.turning_points((1, 0, 0)), response.worst_directions()
    monkeypatch.setattr("picchio.vibration.closed_form.response._CELLS", 1)
    for (t0, x0), (t1, x1) in zip(whole, response.turning_points((1, 0, 0)), strict=True):
        np.testing.assert_allclose(t1, t0, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(x1, x0, rtol=1e-12, atol=1e-16)
    for one, other in zip(tops, response.worst_directions(), strict=True):
        assert other.value == pytest.approx(one.value, rel=1e-12)


def test_two_hundred_joints_take_seconds():
    system = chain(200, 1e6)
    begin = time.process_time()
    response = picchio.steady_state(modal_analysis(system), BLOWS)
    found = response.worst_directions()
    assert time.process_time() - begin < 15.0
    # Along its own direction a joint's peak is the same by the turning points.
    for j in (0, 57, 199):
        values = response.turning_points(found[j].direction)[j][1]
        assert np.abs(values).max() == pytest.approx(found[j].value, rel=1e-12)
