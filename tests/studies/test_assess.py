"""The main job: lives that add up, against sums done by hand here."""

import math
import warnings

import numpy as np
import pytest
import rainflow as oracle
from hypothesis import given, settings
from hypothesis import strategies as st

import picchio
from picchio.core.errors import InputError, PicchioWarning

POSE_A, POSE_B = [0.3, 1.1, -1.0], [0.0, 0.5, -0.8]
BLOWS = {"kind": "pulse_train", "force": 300.0, "period": 0.04, "width": 0.004}


@pytest.fixture(scope="module")
def robot():
    return picchio.load_robot("fanuc_like_3dof")


def task(robot, *operations, hits=12, **blows):
    entries = [
        {"name": f"op{i}", "direction": d, "poses": p, **more}
        for i, (d, p, more) in enumerate(operations)
    ]
    data = {"hits_per_rivet": hits, "excitation": {**BLOWS, **blows}, "operation": entries}
    return picchio.task_from_dict(data, robot)


def quiet_assess(*arguments, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PicchioWarning)
        return picchio.assess(*arguments, **options)


def paper(robot, work, **options):
    return quiet_assess(robot, work, method="paper", **options)


def test_reference_figures_of_the_steady_state(robot):
    """Peaks computed by code that is not this one (zeta 0.03, 300 N, 40 ms, 4 ms)."""
    axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    found = paper(robot, task(robot, *[(axis, [POSE_A], {}) for axis in axes]))
    frequencies = found.operations[0].natural_frequencies[0]
    np.testing.assert_allclose(frequencies, [5.5717, 12.4426, 18.4203], atol=5e-5)
    peaks = [op.peak_deflection[0] * 1e3 for op in found.operations]
    expected = [[0.06665, 0.28866, 0.16713], [0.21547, 0.08929, 0.05170], [0, 0.39299, 0.44999]]
    np.testing.assert_allclose(peaks, expected, atol=5.1e-6)


@pytest.mark.parametrize(
    ("pose", "frequencies", "worst"),
    [
        ([0, 0.5, -0.8], [5.3950, 9.2223, 19.6827], [0.23128, 0.46373, 0.49894]),
        ([0.3, 1.1, -1.0], [5.5717, 12.4426, 18.4203], [0.22554, 0.43009, 0.45901]),
        ([0.7, 0, 0], [5.0954, 8.3785, 23.1202], [0.24191, 0.64274, 0.76175]),
    ],
)
def test_reference_figures_of_the_worst_direction(robot, pose, frequencies, worst):
    modes = picchio.modal_analysis(picchio.Model(robot).linear_system(robot.pose(pose)))
    np.testing.assert_allclose(modes.natural_frequencies, frequencies, atol=5.1e-5)
    steady = picchio.steady_state(modes, picchio.PulseTrain(300.0, 0.04, 0.004))
    values = [direction.value * 1e3 for direction in steady.worst_directions()]
    np.testing.assert_allclose(values, worst, atol=5.1e-6)


def test_the_papers_life_by_hand(robot):
    """Eqs. 17-22 with the printed curve, from the peak deflections."""
    operations = [
        ([1, 0, 0], [POSE_A, POSE_B], {"rivets": 3}),
        ([0, 0, 1], [POSE_B], {"rivets": 2, "hits_per_rivet": 20}),
    ]
    found = paper(robot, task(robot, *operations))
    for j, shaft in enumerate(joint.shaft for joint in robot.flexible_joints):
        spent = 0.0
        for op in found.operations:
            stress = shaft.shear_modulus * shaft.radius * op.peak_deflection[:, j] / shaft.length
            spent += (op.rivets * op.hits_per_rivet * (stress / 18930e6) ** (1 / 0.3548)).sum()
            np.testing.assert_allclose(op.peak_shear_stress[:, j], stress, rtol=1e-12)
        rivets = 3 * 2 + 2
        assert found.joints[j].rivets_to_failure == pytest.approx(rivets / spent, rel=1e-9)
    assert found.rivets_to_failure == min(j.rivets_to_failure for j in found.joints)


def test_the_life_at_the_mean_stress_by_hand(robot):
    found = paper(robot, task(robot, ([1, 0, 0], [POSE_A, POSE_B], {})), paper_mean_stress=True)
    stress = found.operations[0].peak_shear_stress.mean(axis=0)
    cycles = (stress / 18930e6) ** (1 / -0.3548)
    lives = [joint.rivets_to_failure for joint in found.joints]
    np.testing.assert_allclose(lives, cycles / 12, rtol=1e-9)


def test_the_default_method_by_an_independent_count(robot):
    """Dense samples of the response, the `rainflow` package, Basquin's line by hand."""
    work = task(robot, ([0.48, -0.6, 0.64], [POSE_A], {}), force=3000.0)
    found = quiet_assess(robot, work, sn_curve="nie-2016")
    modes = picchio.modal_analysis(picchio.Model(robot).linear_system(robot.pose(POSE_A)))
    response = picchio.response_from_rest(modes, work.operations[0].excitation, 12)
    time = np.linspace(0.0, response.horizon, 100_001)
    x = response.deflection(time, work.operations[0].direction)
    for j, joint in enumerate(robot.flexible_joints):
        jp = math.pi * joint.shaft.radius**4 / 2
        stress = joint.stiffness * x[j] * joint.shaft.radius / jp
        spent = sum(
            count * (size / 2 / 18930e6) ** (1 / 0.3548)
            for size, _, count, _, _ in oracle.extract_cycles(stress)
        )
        assert found.joints[j].damage_per_rivet == pytest.approx(spent, rel=1e-4)


def test_the_rivet_is_worse_than_its_steady_state(robot):
    found = quiet_assess(robot, task(robot, ([0, 0, 1], [POSE_A], {})))
    for check in found.steady_state[1:]:
        assert 1.3 < check.peak_ratio < 2.5
        assert check.paper_life > 0
        assert check.counted_life > 0
    assert math.isnan(found.steady_state[0].peak_ratio)


def test_no_finite_life_is_ranked_by_utilisation(robot):
    found = quiet_assess(robot, task(robot, ([1, 0, 0], [POSE_A], {})))
    assert math.isinf(found.rivets_to_failure)
    assert all(0 <= joint.utilisation < 1 for joint in found.joints)
    assert found.limiting_joint == max(found.joints, key=lambda j: j.utilisation).name
    strong = quiet_assess(robot, task(robot, ([1, 0, 0], [POSE_A], {}), force=30000.0))
    assert math.isfinite(strong.rivets_to_failure)
    assert strong.joint(strong.limiting_joint).utilisation > 1


@settings(max_examples=15, deadline=None)
@given(
    pose=st.tuples(st.floats(-3, 3), st.floats(-1.5, 1.5), st.floats(-1.2, 1.2)),
    factor=st.floats(0.1, 20),
)
def test_physics(robot, pose, factor):
    """Linear in the force; a vertical force leaves joint_1 alone; M and S as they must be."""
    work = [task(robot, ([0, 0, 1], [list(pose)], {}), force=300.0 * f) for f in (1.0, factor)]
    one, more = (paper(robot, w).operations[0] for w in work)
    np.testing.assert_allclose(more.peak_deflection, factor * one.peak_deflection, rtol=1e-9)
    assert one.peak_deflection[0, 0] <= 1e-12 * one.peak_deflection[0].max()
    system = picchio.Model(robot).linear_system(robot.pose(list(pose)))
    mass = system.mass_matrix
    np.testing.assert_array_equal(mass, mass.T)
    assert np.linalg.eigvalsh(mass)[0] > 0
    shapes = picchio.modal_analysis(system).mode_shapes
    np.testing.assert_allclose(shapes.T @ mass @ shapes, np.eye(3), atol=1e-10)


@settings(max_examples=10, deadline=None)
@given(hits=st.integers(1, 30), split=st.floats(0.01, 0.99), rivets=st.floats(0.5, 50))
def test_damage_adds_over_any_split_of_a_task(robot, hits, split, rivets):
    whole = task(robot, ([1, 1, 0], [POSE_A, POSE_B], {"rivets": rivets}), hits=hits)
    parts = task(
        robot,
        ([1, 1, 0], [POSE_A, POSE_B], {"rivets": rivets * split}),
        ([1, 1, 0], [POSE_B, POSE_A], {"rivets": rivets * (1 - split)}),
        hits=hits,
    )
    options = {"sn_curve": "nie-2016"}
    for one, other in zip(
        quiet_assess(robot, whole, **options).joints,
        quiet_assess(robot, parts, **options).joints,
        strict=True,
    ):
        assert other.damage_per_rivet == pytest.approx(one.damage_per_rivet, rel=1e-9)
    twice = task(robot, ([1, 1, 0], [POSE_A, POSE_B], {"rivets": rivets}), hits=2 * hits)
    for one, other in zip(paper(robot, whole).joints, paper(robot, twice).joints, strict=True):
        assert other.damage_per_rivet == pytest.approx(2 * one.damage_per_rivet, rel=1e-12)


def test_a_pose_beyond_the_limits_is_a_warning_that_names_the_joint(robot):
    work = task(robot, ([1, 0, 0], [[0.0, 0.0, 2.0]], {}))
    with pytest.warns(PicchioWarning, match="joint_3 is beyond its limits"):
        picchio.assess(robot, work)


def test_bad_methods(robot):
    work = task(robot, ([1, 0, 0], [POSE_A], {}))
    with pytest.raises(InputError, match="valid: rainflow, paper"):
        picchio.assess(robot, work, method="best")
    with pytest.raises(InputError, match="paper_mean_stress"):
        picchio.assess(robot, work, paper_mean_stress=True)
    with pytest.raises(InputError, match="nie-2016"):
        picchio.assess(robot, work, sn_curve="nie-2061")


def test_a_pose_in_degrees_is_suspected(robot):
    work = task(robot, ([1, 0, 0], [[30.0, 60.0, -90.0]], {}))
    with pytest.warns(PicchioWarning, match="angles are in radians"):
        picchio.assess(robot, work)


def test_a_shaft_that_yields_is_told_whatever_its_fatigue_life(robot):
    work = task(robot, ([0, 0, 1], [POSE_A], {}), force=30000.0)
    with pytest.warns(PicchioWarning, match=r"joint_2.*yields"):
        found = picchio.assess(robot, work)
    # Against Pinocchio's gravity and dense samples.
    modes = picchio.modal_analysis(picchio.Model(robot).linear_system(robot.pose(POSE_A)))
    response = picchio.response_from_rest(modes, work.operations[0].excitation, 12)
    swing = 1e5 * response.deflection(np.linspace(0, response.horizon, 100_001), [0, 0, 1])[1]
    torque = np.abs(swing - robot.state(POSE_A).gravity_torque[1]).max()
    stress = 2 * torque / (math.pi * 0.0132**3)
    assert found.joint("joint_2").peak_total_stress == pytest.approx(stress, rel=1e-5)


def test_balanced_gravity_leaves_no_stress_and_the_vibration_as_it_is(robot):
    work = task(robot, ([0, 0, 1], [POSE_A], {}), force=3000.0)
    options = {"mean_stress": "goodman"}
    held = quiet_assess(robot, work, **options).joint("joint_2")
    balanced = quiet_assess(robot, work, gravity_balanced=True, **options).joint("joint_2")
    plain = quiet_assess(robot, work).joint("joint_2")
    assert held.gravity_shear_stress > 0
    assert balanced.gravity_shear_stress == 0
    assert balanced.gravity_torque == 0
    assert balanced.peak_shear_stress == held.peak_shear_stress
    # Goodman raises the amplitude by the mean: less of it without gravity.
    assert plain.utilisation < balanced.utilisation < held.utilisation
