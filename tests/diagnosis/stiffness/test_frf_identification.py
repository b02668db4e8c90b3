"""Stiffness and damping from frequency response functions: exact, blind, and what is said."""

import json
import math

import blind_stiffness
import numpy as np
import pinocchio as pin
import pytest
from scipy.linalg import eigh

import picchio
from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record
from picchio.campaign.tables import Tolerance
from picchio.diagnosis.stiffness.fit import climb, score
from picchio.diagnosis.stiffness.modes import peaks
from picchio.diagnosis.stiffness.prior import prior_of
from picchio.diagnosis.stiffness.responses import make_problem
from picchio.robot.annotations.sidecar import read_sidecar


@pytest.fixture(scope="module")
def frfs():
    """The independent world of responses."""
    from worlds import frfs

    return frfs


def exactly(world) -> Campaign:
    campaign = blind_stiffness.frf_campaign(world)
    return Campaign.from_records(campaign.records, tolerance=Tolerance.zero().model_dump())


def problem(world, tolerance=None):
    robot = picchio.load_robot(world.robot)
    records = blind_stiffness.frf_campaign(world).records
    return make_problem(robot, records, tolerance or Tolerance(), prior_of(robot))


def test_modes_are_those_that_poles_show(frfs, monkeypatch):
    """Another library's poles, fitted to the same functions without any model of an arm."""
    from sdypy import EMA

    monkeypatch.setitem(frfs.BAND, 3, (0.0, 59.75))  # it wants its lines from zero on
    world = frfs.draw(3, 5, exact=True, noise=1e-4)
    found = picchio.identify(world.robot, blind_stiffness.frf_campaign(world))
    made, n = found.fit.problem, 3
    springs = np.exp(found.fit.mean[:n]) * made.standings[0].spring
    ratio = np.exp(found.fit.mean[n : 2 * n]) * made.damping_ratio
    mass = made.standings[0].mass
    back = np.linalg.inv(mass)
    damp = made.damping(mass, springs, ratio, np.ones(n))
    stiff = np.diag(springs) + made.standings[0].gravity
    ours = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)],
                                       [-back @ stiff, -back @ damp]]))  # fmt: skip
    ours = np.sort_complex(1j * ours[ours.imag > 0.0])[::-1]
    same = [one for one, table in world.records if table["pose"] == world.records[0][1]["pose"]]
    functions = np.array([one["real"] + 1j * one["imag"] for one in same])
    theirs = EMA.Model(functions, same[0]["frequency"], lower=1, upper=59, pol_order_high=12,
                       frf_type="accelerance")  # fmt: skip
    theirs.get_poles(show_progress=False)
    for pole in -1j * ours:
        near = min(theirs.all_poles[-1], key=lambda one: abs(one - pole))
        assert abs(near) == pytest.approx(abs(pole), rel=2e-4)
        assert -near.real / abs(near) == pytest.approx(-pole.real / abs(pole), rel=0.03)


@pytest.mark.parametrize("joints", [3, 7])
def test_the_prediction_is_the_worlds(frfs, joints):
    world = frfs.draw(joints, 2, exact=True, noise=1e-9)
    made = problem(world, Tolerance.zero())
    at = np.zeros(len(made.precision))
    at[:joints] = np.log(world.truth / world.nominal)
    at[joints:] = np.log(world.damping / made.damping_ratio)
    for part, table in zip(made.predict(at), made.tables, strict=True):
        left = np.linalg.norm(part.residual * table.scale[:, None])
        assert left < 1e-6 * np.linalg.norm(table.measured)


def test_bodies_that_are_off_change_mass_and_damping_as_they_do():
    """Masses, centres and inertias far off, on a light wrist: against Pinocchio's own bodies."""
    robot = picchio.load_robot("kinova_gen3")
    rng = np.random.default_rng(3)
    pose = dict(zip(robot.joint_names, rng.uniform(-1.0, 1.0, 7).tolist(), strict=True))
    columns = {"frequency": np.linspace(3.0, 160.0, 40), "real": np.ones(40), "imag": np.zeros(40)}
    record = Record.from_columns(
        "f.csv", columns, kind="frf", pose=pose, force_direction=[0.0, 0.6, 0.8],
        response_direction=[1.0, 0.0, 0.0], quantity="receptance",
    )  # fmt: skip
    made = make_problem(robot, [record], Tolerance(), prior_of(robot))
    at = np.zeros(len(made.precision))
    model = pin.buildModelFromUrdf(str(robot.source))
    for k, joint in enumerate(robot.flexible_names):
        link, mass = robot.tree.joints[joint].child, 2.0 * rng.standard_normal()
        centre = 2.0 * rng.standard_normal(3)
        own = model.inertias[model.getJointId(joint)]
        heavier = (1.0 + 0.01 * mass) * own.inertia
        # Both at once differ from their sum by a hundredth of a shift: one link has one of them.
        names = [f"link_com.{link}.{axis}" for axis in "xyz"] if k % 2 else [f"link_mass.{link}"]
        for name, value in zip(names, centre if k % 2 else [mass], strict=True):
            at[14 + made.steps.index(name)] = value
        model.inertias[model.getJointId(joint)] = (
            pin.Inertia(own.mass, own.lever + 0.002 * centre, own.inertia) if k % 2
            else pin.Inertia((1.0 + 0.01 * mass) * own.mass, own.lever, heavier)
        )  # fmt: skip
    data, q = model.createData(), pin.neutral(model)
    step = np.array([pose[name] for name in model.names[1:]])
    q = pin.integrate(model, q, step)
    m = np.array(pin.crba(model, data, q))
    springs = robot.stiffness
    squared, shapes = eigh(np.diag(springs), m)
    ratio = robot.damping_ratio @ (springs[:, None] * shapes**2) / squared
    c = m @ shapes @ np.diag(2.0 * ratio * np.sqrt(squared)) @ shapes.T @ m
    (table,), (part,) = made.tables, made.predict(at)
    k = np.diag(springs) + robot.gravity_stiffness(robot.pose(pose))
    value = np.array([
        table.sight @ np.linalg.solve(k - w**2 * m + 1j * w * c, table.push) for w in table.omega
    ])  # fmt: skip
    told = np.stack([value.real, value.imag], axis=1) / table.scale[:, None]
    np.testing.assert_allclose(table.values - part.residual, told, atol=1e-6 * np.abs(told).max())


def test_slopes_are_those_of_differences(frfs):
    made = problem(frfs.draw(3, 4))
    rng = np.random.default_rng(0)
    at = 0.3 * rng.standard_normal(len(made.precision))
    parts = made.predict(at)
    for k in rng.permutation(len(at))[:25]:
        step = 1e-5 * (np.arange(len(at)) == k)
        plus, minus = made.predict(at + step), made.predict(at - step)
        for part, more, less in zip(parts, plus, minus, strict=True):
            found = -(more.residual - less.residual) / 2e-5
            np.testing.assert_allclose(part.slope[..., k], found,
                                       atol=2e-4 * max(1e-3, np.abs(found).max()))  # fmt: skip


def test_values_alone_are_the_same(frfs):
    made = problem(frfs.draw(3, 1))
    at = 0.3 * np.random.default_rng(0).standard_normal(len(made.precision))
    alone = made.predict(at, slopes=False)
    for own, other in zip(made.predict(at), alone, strict=True):
        np.testing.assert_allclose(other.residual, own.residual, rtol=1e-9, atol=1e-12)
        assert other.slope.shape == (*own.residual.shape, 0)
    made = problem(frfs.draw(3, 1), Tolerance.zero())
    like = climb(made, np.zeros(len(made.precision)))
    best = score(made, like.mean, like)
    for unit in np.eye(len(like.mean)):  # no small step from the most probable numbers is downhill
        assert score(made, like.mean + 1e-3 * unit, like) > best - 1e-6


def test_stiffness_and_damping_far_off_are_found_exactly(frfs):
    """Joints at 0.40, 1.9 and 0.55 of their stated stiffness, all else exact: within 1 %."""
    world = frfs.draw(3, 1, exact=True, noise=0.01, factors=[0.40, 1.9, 0.55])
    found = picchio.identify(world.robot, exactly(world))
    for joint, stiffness, ratio in zip(found.joints, world.truth, world.damping, strict=True):
        assert joint.stiffness.told
        assert joint.stiffness.value == pytest.approx(stiffness, rel=0.01)
        assert joint.damping_ratio.value == pytest.approx(ratio, rel=0.01)
    assert found.convention == "modal" and found.decided > 5.0 and not found.doubt


def test_the_damping_that_the_functions_follow_is_told(frfs):
    world = frfs.draw(3, 1, exact=True, dashpots=True)
    found = picchio.identify(world.robot, exactly(world))
    assert found.convention == "joint" and found.decided > 5.0
    assert "dashpot" in found.remarks[1]
    values = [joint.stiffness.value for joint in found.joints]
    np.testing.assert_allclose(values, world.truth, rtol=0.01)


def test_peaks_are_the_modes(frfs):
    world = frfs.draw(3, 1, exact=True, noise=1e-4)
    made = problem(world, Tolerance.zero())
    seen = peaks(made.standings[0])
    springs = np.diag(world.truth) + made.standings[0].gravity
    squared = np.linalg.eigvals(np.linalg.solve(made.standings[0].mass, springs))
    modes = np.sort(np.sqrt(squared.real))
    for omega in seen.omega:
        assert np.abs(np.log(omega / modes)).min() < 0.1


@pytest.mark.slow
def test_everything_slightly_wrong(frfs):
    stiffness, damping = blind_stiffness.frf_trial(frfs, 2, first=0, sizes=(3,))
    assert all(one.told and abs(one.error) < 0.05 for one in stiffness)
    assert all(abs(one.error) < 0.7 for one in damping)


@pytest.mark.slow
def test_the_command(frfs, tmp_path, in_process):
    world = frfs.draw(3, 1, exact=True)
    exactly(world).save(tmp_path / "taps")
    done = in_process("identify", world.robot, "--data", "taps", "--out", "flex.toml",
                      "--json", "found.json", "--report", "page.html", cwd=tmp_path)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "Damping: one ratio for each mode" in done.stdout
    # Eighteen functions: those that fit worst are drawn; and the first six modes.
    assert (tmp_path / "page.html").read_text().count("<svg") == 18
    content = json.loads((tmp_path / "found.json").read_text())
    assert content["damping"]["convention"] == "modal"
    sidecar = read_sidecar(tmp_path / "flex.toml")
    assert {f"damping_ratio.{name}" for name in world.joints} <= set(sidecar.posterior.names)
    robot = picchio.load_robot(world.robot, flex=tmp_path / "flex.toml")
    np.testing.assert_allclose(robot.stiffness, world.truth, rtol=0.01)
    assert math.isclose(robot.damping_ratio[0], world.damping[0], rel_tol=0.05)


def test_bad_functions_are_named(frfs):
    world = frfs.draw(3, 1)
    columns, table = world.records[0]
    for change, words in (
        ({"coherence": columns["coherence"] + 0.9}, "coherence.*not within 0 and 1"),
        ({"frequency": columns["frequency"][::-1]}, "ascending"),
        ({"real": 0.0 * columns["real"], "imag": 0.0 * columns["imag"]}, "zero throughout"),
    ):
        world.records[0] = ({**columns, **change}, table)
        with pytest.raises(picchio.InputError, match=words):
            picchio.identify(world.robot, blind_stiffness.frf_campaign(world))
    world.records[0] = (columns, {**table, "response_frame": "hand"})
    with pytest.raises(picchio.InputError, match="no such frame"):
        picchio.identify(world.robot, blind_stiffness.frf_campaign(world))


@pytest.mark.slow
@pytest.mark.minutes
def test_a_step_to_masses_that_no_arm_has_is_shortened(frfs):
    """Met blind: it ended with a matrix that is not positive definite."""
    world = frfs.draw(7, 92075)
    found = picchio.identify(world.robot, blind_stiffness.frf_campaign(world))
    assert found.joints[0].stiffness.told
