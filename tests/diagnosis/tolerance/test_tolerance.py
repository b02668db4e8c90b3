"""What is never exact is integrated out: the algebra, the slopes, and worlds a little wrong."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trial

import picchio
from picchio.campaign.tables import Tolerance
from picchio.core.processes import one_thread
from picchio.diagnosis.percussion.criteria.exceeded import exceeded
from picchio.diagnosis.percussion.criteria.pose_consistency import fit_evidence
from picchio.diagnosis.percussion.criteria.remainder import (
    Remainder,
    decisive_gain,
    tempered_evidence,
)
from picchio.diagnosis.percussion.data.problem import (
    Problem,
    held_out,
    residual_under,
    signal_power,
)
from picchio.diagnosis.percussion.diagnosis import _told_by_slopes, diagnose_percussion
from picchio.diagnosis.percussion.fit.drawn import refit
from picchio.diagnosis.percussion.fit.least_squares import (
    Fit,
    between,
    central_jacobian,
    fit,
    fit_growing,
)
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.tolerance import linearise as linearised
from picchio.diagnosis.percussion.tolerance.linearise import (
    About,
    _in_common,
    linearise,
    recentre,
    released,
    settled,
    silent,
    to_the_last,
)
from picchio.diagnosis.percussion.tolerance.marginal import Marginal
from picchio.diagnosis.percussion.tolerance.nudges import Inexact, inexact, nudged, principal
from picchio.diagnosis.percussion.tolerance.slopes import Slopes, all_slopes
from picchio.model.effects.nonlinear.coulomb_friction import CoulombFriction
from picchio.model.effects.nonlinear.hysteresis import Hysteresis
from picchio.model.effects.registry import effect_class
from picchio.model.effects.sensors.sensor_gain import SensorGain
from picchio.model.geometry import Geometry
from picchio.model.model import Model
from picchio.prediction import percussion
from worlds import campaign as worlds

ARM = "fanuc_like_3dof"


def _number(name, once, means=""):
    return Inexact(name, "force", once, "blows", None, means)


def _random_slopes(rng, samples, own, shared, means=""):
    what = (
        *(_number(f"own {i}", False) for i in range(own)),
        *(_number(f"shared {i}", True, means if i == 0 else "") for i in range(shared)),
    )
    columns = rng.normal(size=(2, samples, own + shared)) * np.exp(rng.normal(size=own + shared))
    return Slopes.of(what, own, columns.astype(np.float32))


@pytest.fixture
def dense():
    """Two records' slopes, the same as one dense matrix, and residuals."""
    rng = np.random.default_rng(0)
    slopes = {"a": _random_slopes(rng, 20, 3, 4, "x:y"), "b": _random_slopes(rng, 30, 2, 4, "x:y")}
    a, b = (slopes[n].columns.reshape(-1, slopes[n].columns.shape[2]).astype(float) for n in "ab")
    whole = np.zeros((100, 9))
    whole[:40, :3], whole[40:, 3:5] = a[:, :3], b[:, :2]
    whole[:40, 5:], whole[40:, 5:] = a[:, 3:], b[:, 2:]
    residual = 3.0 * rng.normal(size=100)
    parts = [residual[:40].reshape(2, 20), residual[40:].reshape(2, 30)]
    return slopes, whole, residual, parts


@pytest.mark.parametrize("claimed", [(), ("x:y",)])
def test_the_sum_of_squares_is_that_of_the_whole_covariance(dense, claimed):
    slopes, whole, residual, parts = dense
    used = np.delete(whole, [5] if claimed else [], axis=1)
    covariance = np.eye(100) + used @ used.T
    found = Marginal(slopes).whitened(parts, ["a", "b"], claimed)
    total = sum(float((each**2).sum()) for each in found)
    assert total == pytest.approx(residual @ np.linalg.solve(covariance, residual), rel=1e-10)


def test_where_the_numbers_most_probably_are(dense):
    slopes, whole, residual, parts = dense
    expected = -np.linalg.solve(np.eye(9) + whole.T @ whole, whole.T @ residual)
    found = Marginal(slopes).estimated(parts, ["a", "b"])
    assert found["a"] == pytest.approx(np.r_[expected[:3], expected[5:]], abs=1e-10)
    assert found["b"] == pytest.approx(expected[3:], abs=1e-10)


def test_what_the_campaign_shares_belongs_to_no_record(dense):
    """All together what is left whitened; of each what it shows, and an equal share of the rest."""
    slopes, whole, residual, parts = dense
    numbers = -np.linalg.solve(np.eye(9) + whole.T @ whole, whole.T @ residual)
    left, shared = (residual + whole @ numbers) ** 2, (numbers[5:] ** 2).sum()
    marginal = Marginal(slopes)
    found = marginal.taken_up(parts, ["a", "b"]).by_record
    assert found[0] == pytest.approx(left[:40].sum() + (numbers[:3] ** 2).sum() + shared / 2)
    assert found[1] == pytest.approx(left[40:].sum() + (numbers[3:5] ** 2).sum() + shared / 2)
    white = sum(float((each**2).sum()) for each in marginal.whitened(parts, ["a", "b"]))
    assert found.sum() == pytest.approx(white)


def test_beside_more_than_noise_the_numbers_stay_nearer(dense):
    slopes, whole, residual, parts = dense
    expected = -np.linalg.solve(50.0 * np.eye(9) + whole.T @ whole, whole.T @ residual)
    found = Marginal(slopes).taken_up(parts, ["a", "b"], 50.0)
    assert found.held == pytest.approx(expected @ expected, rel=1e-9)
    left = np.concatenate([each.ravel() for each in found.left])
    assert left == pytest.approx(residual + whole @ expected, abs=1e-9)
    assert not found.is_absurd
    far = [1e3 * part for part in parts]
    assert Marginal(slopes).taken_up(far, ["a", "b"]).is_absurd


@pytest.fixture(scope="module")
def wrong_everywhere():
    """A campaign of the 3-joint arm with nothing hidden, and everything a little off."""
    campaign, _ = worlds.make(ARM, seed=4, records=9, mismatch=1.0)
    return picchio.load_robot(ARM), campaign


def test_links_are_changed_as_bodies_are(wrong_everywhere):
    robot, campaign = wrong_everywhere
    problem = Problem(robot, campaign)
    record = problem.records[0]
    geometry: Geometry = record.setup.geometry
    own = robot.tree.links["link_3"]
    _, axes, moments = principal(own)
    ways = {one.name: one for one in inexact(problem, record, Tolerance())}

    def mass(name, size):
        plant = Model(robot).plant(geometry)
        ways[name].change(plant, size)
        return plant.build(np.array([0.0, 0.0, 1.0])).mass

    still = Model(robot).plant(geometry).build(np.array([0.0, 0.0, 1.0])).mass
    # One per cent of its mass: so much of what the link alone adds.
    alone = geometry.inertia("link_3").mass[:3, :3]
    assert mass("link_mass.link_3", 2.0) - still == pytest.approx(0.02 * alone, abs=1e-12)
    # A moment about an axis turns with that axis, and with no other.
    turn = geometry.motion("link_3").jacobian[3:, :3]
    rotation = geometry.motion("link_3").rotation @ axes
    for k in range(3):
        spin = rotation[:, k] @ turn
        expected = 0.03 * moments[k] * np.outer(spin, spin)
        assert mass(f"link_inertia.link_3.{k + 1}", 1.0) - still == pytest.approx(
            expected, abs=1e-9 * np.abs(still).max()
        )


def test_a_centre_of_mass_is_moved_as_a_body_is(wrong_everywhere):
    """To the second order as well, across its axes, and from where it was moved to already."""
    robot, campaign = wrong_everywhere
    problem = Problem(robot, campaign)
    geometry: Geometry = problem.records[0].setup.geometry
    own = robot.tree.links["link_3"]
    com, axes, _ = principal(own)
    ways = {one.name: one for one in inexact(problem, problem.records[0], Tolerance())}
    plant = Model(robot).plant(geometry)
    for k, size in ((1, 1.5), (2, -2.0), (3, 3.0), (1, -0.5)):
        ways[f"link_com.link_3.{k}"].change(plant, size)
    moved = plant.build(np.array([0.0, 0.0, 1.0])).mass
    still = Model(robot).plant(geometry).build(np.array([0.0, 0.0, 1.0])).mass
    link = geometry.motion("link_3")

    def alone(point):
        jacobian = link.at(point).jacobian[:3, :3]
        return own.mass * jacobian.T @ jacobian

    expected = alone(com + 0.002 * axes @ np.array([1.0, -2.0, 3.0])) - alone(com)
    assert moved - still == pytest.approx(expected, abs=1e-12 * np.abs(still).max())


def test_the_mass_of_all_is_told_by_no_record(wrong_everywhere):
    """Springs, blows and all masses larger alike move nothing: slopes must say so exactly."""
    robot, campaign = wrong_everywhere
    problem = Problem(robot, campaign)
    start = Hypothesis.baseline(robot, campaign.tolerance)
    with one_thread():
        linearise(problem, start, problem.records, both=True)
    marginal = problem.marginal
    heavier = np.array([name.startswith("link_mass") for name in marginal.shared], dtype=float)
    for slopes in marginal.slopes.values():
        left = slopes.columns[:, :, slopes.own :].astype(float) @ heavier
        assert np.linalg.norm(left) < 0.01
    taken = {label: rows @ heavier for (label, _), rows in marginal.absorbed.items()}
    for label in ("joint_stiffness:joint_1", "joint_stiffness:joint_3", "force_amplitude:tool"):
        assert taken[label] == pytest.approx(-0.01, rel=1e-3)
    assert taken["modal_damping:robot"] == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        (CoulombFriction, {"torque": 2.4, "smoothing": 0.0}),
        (Hysteresis, {"torque": 2.4, "deflection": 5e-5}),
    ],
)
def test_where_joints_stick_slopes_leave_the_scale_of_all_open(wrong_everywhere, effect, values):
    """Masses, springs, blows and friction larger by one factor move the arm just as before.

    And with blows and friction alone larger all that is read is larger by that.
    """
    robot, campaign = wrong_everywhere
    problem = Problem(robot, replace(campaign, records=campaign.records[:5]))
    here = Hypothesis.baseline(robot, campaign.tolerance).plus(effect("joint_3", **values))

    def louder(by):
        gains = [SensorGain(group, gain=1.0 + by) for group in problem.groups]
        return problem.unmarginalised((*here.effects, *gains))

    def flat(parts):
        return np.concatenate([part.ravel() for part in parts])

    with problem.pinned(here.effects), one_thread():
        at = problem.unmarginalised(here.effects)
        columns = np.concatenate(central_jacobian(problem, here, problem.records, None, at)).T
        slopes = all_slopes(problem, here.effects, both=True)
        gain = (flat(louder(1e-3)) - flat(louder(-1e-3))) / 2e-3
    along = {}  # by what share of itself
    for unknown, value, column in zip(here.unknowns(), here.vector(), columns, strict=True):
        label = f"{here.effects[unknown.effect].name}.{unknown.name}"
        own = column if unknown.logarithmic else value * column
        along[label] = along.get(label, 0.0) + own
    force, torque = along["force_amplitude.scale"], along[f"{effect.name}.torque"]
    yields = along.get(f"{effect.name}.deflection", 0.0)
    assert np.linalg.norm(gain - force - torque - yields) < 3e-3 * np.linalg.norm(gain)
    masses = sum(
        flat(s.columns[:, :, [one.name == name for one in s.what]] for s in slopes.values())
        for name in ("link_mass.link_1", "link_mass.link_2", "link_mass.link_3")
    ) / campaign.tolerance.link_mass  # fmt: skip
    rest = masses + along["joint_stiffness.scale"] + force + torque
    assert np.linalg.norm(rest) < 1e-3 * np.linalg.norm(masses)


def test_slopes_about_moved_numbers_are_what_differences_are(wrong_everywhere):
    """Also of what stands moved already, such as a rise time: moved on, not moved twice."""
    robot, campaign = wrong_everywhere
    problem = Problem(robot, campaign)
    record, end = problem.records[0], 0.16
    with one_thread():
        begun = fit_growing(problem, Hypothesis.baseline(robot, campaign.tolerance), windows=(end,))
        linearise(problem, begun.hypothesis, problem.records, end)
        found = fit(problem, begun.hypothesis, problem.records, end, iterations=4)
        here = recentre(problem, found)
        sizes = {
            one.name: (one, size)
            for one, size in problem.marginal.slopes[record.name].moved(problem.sizes[record.name])
        }
        slopes = all_slopes(problem, here.effects, end)[record.name]
        model = problem.model.with_effects(here.effects)

        def moved(one, step):
            there = {**sizes, one.name: (one, sizes[one.name][1] + step)}
            return residual_under(record, model, *nudged(record, list(there.values())), end)

        blow = 0  # of a number that every blow has: each by itself, or a force seems to drift
        for k, one in enumerate(slopes.what):
            blow = blow + 1 if k and slopes.what[k - 1] is one else 0
            if one.where == "pose":
                continue
            column = slopes.columns[:, :, k]
            step = 0.02 * np.eye(len(sizes[one.name][1]))[blow]
            expected = (moved(one, step) - moved(one, -step)) / 0.04
            apart = np.linalg.norm(column - expected)
            assert apart < 0.05 * np.linalg.norm(expected) + 0.05, one.name


def test_turns_about_several_axes_are_moved_on_in_their_order(wrong_everywhere):
    """In another order they are another turn: a fine step's quotient would be of that alone."""
    robot, campaign = wrong_everywhere
    problem = Problem(robot, campaign)
    record, end = problem.records[0], 0.16
    here = Hypothesis.baseline(robot, campaign.tolerance)
    with one_thread():
        linearise(problem, here, problem.records, end)
        slopes = problem.marginal.slopes[record.name]
        turns = [k for k, one in enumerate(slopes.what) if one.key == "sensor_angle"]
        size = np.zeros(slopes.columns.shape[2])
        size[turns] = 3.0, -3.0, 3.0
        problem.sizes = {r.name: size for r in problem.records}
        found = all_slopes(problem, here.effects, end)[record.name]
        model = problem.model.with_effects(here.effects)

        def at(sizes):
            return residual_under(record, model, *nudged(record, slopes.moved(sizes)), end)

        for k in turns:
            step = 1e-3 * np.eye(size.size)[k]
            expected = (at(size + step) - at(size - step)) / 2e-3
            apart = np.linalg.norm(found.columns[:, :, k] - expected)
            assert apart < 1e-3 * np.linalg.norm(expected)


def test_a_slope_is_none_of_a_jump():
    """A joint that sticks once more just ahead or behind leaves the slope of the other side."""
    slope, jump = np.ones((4, 10)), np.full((4, 10), 50.0)
    for ahead, behind in ((slope + jump, slope), (slope, slope - jump)):
        assert (between(ahead, behind) == slope).all()
    assert (between(1.1 * slope, 0.9 * slope) == slope).all()


def test_where_every_fine_step_meets_a_jump_the_coarse_slope_stands(wrong_everywhere):
    """A quotient that grows as its step gets finer would have a friction known to 0.03 %."""
    robot, _ = wrong_everywhere
    start = Hypothesis.baseline(robot, Tolerance()).plus(CoulombFriction("joint_2", torque=40.0))
    (k,) = [k for k, u in enumerate(start.unknowns()) if u.name == "torque"]
    here = start.vector()[k]

    class Sticks:
        """Its residuals have a slope of a thousand, and a jump of 0.3 to either side of here."""

        def residuals(self, effects, records, end):
            at = replace(start, effects=tuple(effects)).vector()[k] - here
            return [np.full((1, 400), 1e3 * at + 0.3 * np.sign(at))]

        def changes(self, effects, pairs, records, end):
            return [None] * len(pairs)

    (found,) = central_jacobian(Sticks(), start, [None], None, [np.zeros((1, 400))])
    assert np.abs(found[:, k]).max() == pytest.approx(1e3, rel=0.5)


@pytest.mark.minutes
@pytest.mark.slow
def test_records_held_out_are_found_though_a_gap_makes_small_errors_large():
    """In a record in which an error grows a hundred thousand times its own numbers tell it alone.

    Where a joint has backlash the third blow's small errors are the tenth's large ones: slopes
    taken where nothing is off say nothing of it, though the fitted records are known to the noise.
    Nor does it hang on a billionth of where the search begins.
    """
    case = {"robot": ARM, "kind": "pair", "snr": 40, "draw": 41002, "mismatch": 1.0}
    campaign, truth = trial.make(case, 1)
    robot = picchio.load_robot(ARM)
    problem = Problem(robot, campaign)
    records, kept = held_out(problem)[0]
    here, rng = Hypothesis.baseline(robot, campaign.tolerance), np.random.default_rng(3)
    for cause in truth["causes"]:
        near = {k: v * (1 + 1e-9 * rng.standard_normal()) for k, v in cause["parameters"].items()}
        here = here.plus(effect_class(cause["effect"])(cause["target"]).with_values(**near))
    with one_thread():
        found = settled(problem, refit(problem, here, records), records, rounds=2)
        left = problem.residuals(found.hypothesis.effects, kept)
    assert max((rows**2).mean() for rows in left) < 1.5
    assert [r.name for r in silent(problem)] == ["r09.csv"]
    assert np.abs(problem.sizes["r09.csv"]).max() <= 3.5
    # Its own numbers explain it: no value is from it, and it speaks for the causes.
    stands = SimpleNamespace(problem=problem, best=found)
    with one_thread():
        told = _told_by_slopes(stands)
    assert [r.name for r in problem.records if r not in told] == ["r09.csv"]


def test_no_record_tells_the_mass_of_all_however_slopes_are_taken(wrong_everywhere, monkeypatch):
    """Joints stiffer, links heavier and blows harder by the same share leave the same records.

    Where slopes of some records are taken by modes and of others by differences, both must be of
    the unknowns as well as of the tolerances: else a mass is told, 5 deviations off.
    """
    robot, campaign = wrong_everywhere
    problem = Problem(robot, campaign)
    here, plain = Hypothesis.baseline(robot, campaign.tolerance), problem.model
    shares = []

    def bent(record, share):
        monkeypatch.setattr(percussion, "_BENT", share)
        return record.setup.changes(plain, [(plain, plain)]) is None

    for record in problem.records:
        grid = np.geomspace(1e-5, 1e-2, 40)
        shares.append(next(share for share in grid if not bent(record, share)))
    monkeypatch.setattr(percussion, "_BENT", float(np.median(shares)))
    assert 0 < sum(share > percussion._BENT for share in shares) < len(shares)
    with one_thread():
        linearise(problem, here, problem.records, both=True)
        slopes = all_slopes(problem, here.effects, None, True)
    left = whole = 0.0
    for name, own in problem.marginal.slopes.items():
        heavier = [one.key == "link_mass" for one in own.what]
        left += float((own.columns[:, :, heavier].astype(float).sum(axis=2) ** 2).sum())
        whole += float((slopes[name].columns[:, :, heavier].astype(float).sum(axis=2) ** 2).sum())
    assert left < 1e-7 * whole


@pytest.mark.slow
def test_the_model_that_is_told_does_as_the_records_say(wrong_everywhere):
    """It holds no masses: its springs make up for those that the fit has moved."""
    robot, campaign = wrong_everywhere
    answer = picchio.diagnose(robot, campaign, workers=1)
    found = answer.details["percussion"]
    fitted = found.extended.hypothesis
    assert "stand as stated here" in answer.model_text()

    def left(effects):
        exact = Problem(robot, campaign, workers=1)
        return sum(float((rows**2).sum()) for rows in exact.residuals(effects, exact.records))

    assert found.diagnosis.verdict == "nothing-wrong"
    assert left(found.effects) < 0.9 * left(fitted.effects)
    # A life's interval has more in it than the fitted values, which it holds together with masses.
    known, count = found.left_open, len(fitted.unknowns())
    assert known.centre.size > count + 10
    across = known.covariance[:count, count:]
    assert np.abs(across).max() > 0.1 * np.sqrt(known.covariance.diagonal()[:count]).max()


def test_what_all_modes_damping_has_in_common_is_the_robots(wrong_everywhere):
    robot, campaign = wrong_everywhere
    problem = Problem(robot, campaign)
    record, end, value = problem.records[0], 0.16, ("modal_damping:robot", "scale")
    with one_thread():
        begun = fit_growing(problem, Hypothesis.baseline(robot, campaign.tolerance), windows=(end,))
        linearise(problem, begun.hypothesis, problem.records, end)
        marginal, here = problem.marginal, begun.hypothesis
        sizes, rng = {}, np.random.default_rng(3)
        for name, slopes in marginal.slopes.items():
            on = np.array([one.factor_on is not None for one in slopes.what])
            sizes[name] = on * (1.0 + 0.3 * rng.standard_normal(on.size))

        def left(hypothesis):
            moved = marginal.slopes[record.name].moved(sizes[record.name])
            model = problem.model.with_effects(hypothesis.effects)
            return residual_under(record, model, *nudged(record, moved), end)

        before = left(here)
        up = _in_common(marginal, sizes, value)
        vector = here.vector()
        names = [(here.effects[u.effect].label, u.name) for u in here.unknowns()]
        vector[names.index(value)] += up
        after = left(here.at(vector))
    assert up == pytest.approx(0.17, abs=0.03)  # of three records a pose: 0.1 times the root of 3
    assert sum(size.sum() for size in sizes.values()) == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(after, before, atol=1e-6 * np.abs(before).max())


def test_a_world_that_is_a_little_wrong_leaves_noise(wrong_everywhere):
    robot, campaign = wrong_everywhere
    problem = Problem(robot, campaign)
    with one_thread():
        raw = fit_growing(problem, Hypothesis.baseline(robot, campaign.tolerance))
        found = settled(problem, raw, problem.records)
    assert raw.chi_square / raw.samples > 1.5  # it is not exact
    evidence = fit_evidence(problem, found)
    assert evidence.is_noise, (evidence.worst_band, evidence.worst_pose)
    assert found.chi_square / found.samples == pytest.approx(1.0, abs=0.05)
    # No record tells the mass of all, so none tells a stiffness to less than that.
    spread = np.sqrt(found.covariance().diagonal())
    assert (spread[:3] > 0.003).all() and (spread[:3] < 0.03).all()


@pytest.mark.minutes
@pytest.mark.slow
def test_a_world_of_six_joints_leaves_noise():
    """Fast wrists tell a centre of mass to the second order, and lead slopes far astray."""
    case = {"robot": "ur10", "kind": "null", "snr": 40, "draw": 0, "mismatch": 1.0}
    campaign, _ = trial.make(case)
    problem = Problem(picchio.load_robot("ur10"), campaign)
    start = Hypothesis.baseline(problem.robot, campaign.tolerance)
    with one_thread():
        raw = fit_growing(problem, start)
        found = settled(problem, raw, problem.records)
    assert raw.chi_square / raw.samples > 10.0
    assert found.chi_square / found.samples == pytest.approx(1.0, abs=0.02)
    evidence = fit_evidence(problem, found)
    assert evidence.is_noise, (evidence.worst_band, evidence.worst_pose)


def test_what_stands_far_off_is_settled_anew_only_where_less_is_in_sight(
    wrong_everywhere, monkeypatch
):
    """Put back, a number that is far off goes there again: slopes tell so before it is settled."""
    robot, campaign = wrong_everywhere
    problem = Problem(robot, campaign)
    with one_thread():
        start = Hypothesis.baseline(robot, campaign.tolerance)
        found = settled(problem, fit_growing(problem, start), problem.records[::2])
        sizes = {name: size.copy() for name, size in problem.sizes.items()}
        for size in sizes.values():
            size[-1] = 4.0  # shared by all: the sensor's place
        problem.sizes = sizes
        linearise(problem, found.hypothesis, found.records)
        off = fit(problem, found.hypothesis, found.records, None, with_jacobian=True)
        about, asked, as_it_is = About.of(problem), [], linearised._settled_up_to

        def counted(*given):
            asked.append(given)
            return as_it_is(*given)

        monkeypatch.setattr(linearised, "_settled_up_to", counted)
        assert released(problem, off, least=math.inf) is off
        assert not asked and problem.marginal is about.marginal and problem.sizes is about.sizes
        assert released(problem, off, least=-math.inf).cost <= off.cost
        assert asked


def test_values_are_told_of_a_fit_that_slopes_foretell(wrong_everywhere, monkeypatch):
    """From wherever the search left what is not exact, the same values: one step of slopes errs."""
    robot, campaign = wrong_everywhere
    problem = Problem(robot, campaign)
    told = {}
    with one_thread():
        start = Hypothesis.baseline(robot, campaign.tolerance)
        found = settled(problem, fit_growing(problem, start), problem.records)
        near = About.of(problem)
        sizes = {name: size.copy() for name, size in problem.sizes.items()}
        shared = near.marginal.slopes[problem.records[0].name].own
        for size in sizes.values():
            size[shared:] = 2.0
        for way in ("near", "far", "one step"):
            near.restore(problem)
            if way != "near":
                problem.sizes = sizes
            if way == "one step":
                monkeypatch.setattr(linearised, "ELSE", 0.0)
            fitted = to_the_last(problem, found)
            told[way] = fitted.hypothesis.vector()
    spread = np.sqrt(fitted.covariance().diagonal())
    assert np.abs((told["far"] - told["near"]) / spread).max() < 0.1
    assert np.abs((told["one step"] - told["near"]) / spread).max() > 2.0


def test_where_slopes_are_straight_they_tell_as_much_as_those_taken_anew(
    wrong_everywhere, monkeypatch
):
    """The Jacobian is that of where they were taken: another would seem to know damping better."""
    robot, campaign = wrong_everywhere
    problem = Problem(robot, campaign)
    taken, told = [], []
    plain = linearised.linearise
    monkeypatch.setattr(linearised, "linearise", lambda *a, **k: taken.append(1) or plain(*a, **k))
    with one_thread():
        start = Hypothesis.baseline(robot, campaign.tolerance)
        found = settled(problem, fit_growing(problem, start), problem.records)
        near = About.of(problem)
        for straight in (linearised._STRAIGHT, -1.0):
            near.restore(problem)
            monkeypatch.setattr(linearised, "_STRAIGHT", straight)
            before = len(taken)
            told.append((to_the_last(problem, found), len(taken) - before))
    (one, few), (other, more) = told
    assert more == few + 1
    spread = np.sqrt(other.covariance().diagonal())
    assert np.sqrt(one.covariance().diagonal()) == pytest.approx(spread, rel=0.01)
    assert one.hypothesis.vector() == pytest.approx(
        other.hypothesis.vector(), abs=0.02 * spread.min()
    )


def test_products_of_slopes_stay_theirs(wrong_everywhere):
    """Whatever the unknowns take up is taken out of the products as well."""
    robot, campaign = wrong_everywhere
    problem = Problem(robot, campaign)
    with one_thread():
        linearise(problem, Hypothesis.baseline(robot, campaign.tolerance), problem.records)
    for slopes in problem.marginal.slopes.values():
        flat = slopes.columns.reshape(-1, slopes.columns.shape[2]).astype(float)
        expected = flat.T @ flat
        sizes = np.maximum(slopes.norms, 1.0)  # as they were before: single precision's own errors
        off = np.abs(slopes.gram - expected) / np.outer(sizes, sizes)
        assert off.max() < 1e-6
        assert np.abs(expected).max() > 100.0
        fewer = slopes.without({slopes.what[0].name})
        assert fewer.gram == pytest.approx(slopes.gram[-len(fewer.what) :, -len(fewer.what) :])


@pytest.mark.minutes
@pytest.mark.slow
def test_a_blow_that_rises_slowly_is_one_that_rises_slowly():
    """Fast modes tell a rise from a delay: as a delay, half a millisecond passed for a rebound."""
    campaign, truth = worlds.make("ur10", seed=306784578, records=9, mismatch=1.0,
                                  only=["rise_time"])  # fmt: skip
    (rise,) = truth["errors"]["rise_time"].values()
    tolerance = campaign.tolerance.rise_time
    assert rise > 2.5 * tolerance
    problem = Problem(picchio.load_robot("ur10"), campaign)
    with one_thread():
        raw = fit_growing(problem, Hypothesis.baseline(problem.robot, campaign.tolerance))
        found = settled(problem, raw, problem.records)
    name = problem.records[0].name
    moved = problem.marginal.slopes[name].moved(problem.sizes[name])
    (size,) = next(size for one, size in moved if one.name == "rise_time")
    assert size * tolerance == pytest.approx(rise, rel=0.02)
    assert found.chi_square / found.samples == pytest.approx(1.0, abs=0.015)


def test_where_everything_is_exact_nothing_is_integrated_out():
    robot = picchio.load_robot(ARM)
    campaign, _ = worlds.make(ARM, seed=4, records=3)
    problem = Problem(robot, campaign)
    found = fit_growing(problem, Hypothesis.baseline(robot, campaign.tolerance))
    assert settled(problem, found, problem.records) is found
    assert problem.marginal is None


def test_a_remainder_counts_by_its_power():
    small, large = Remainder(excess=10.0, signal=1e6), Remainder(excess=1e4, signal=1e6)
    assert small.within_tolerance and small.may_be_named(large)
    assert not large.within_tolerance
    assert not Remainder(4e3, 1e8).may_be_named(Remainder(1e4, 1e8))
    assert not Remainder(6e3, 1e8).may_be_partial(Remainder(1e4, 1e8))
    # A time of its own for every blow follows much of whatever disturbs them.
    assert Remainder(2e3, 1e8).may_be_partial(Remainder(1e4, 1e8))
    assert not Remainder(2e3, 1e8).may_be_partial(Remainder(1e4, 1e8), follows=True)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "draw"),
    [("null", 0), pytest.param("null", 1, marks=pytest.mark.minutes), ("single", 1)],
)
def test_worlds_that_are_a_little_wrong_everywhere(kind, draw, tmp_path):
    """Nothing wrong, and a hidden effect, on seeds that were used while building."""
    case = {"robot": ARM, "kind": kind, "effect": None, "snr": 40, "draw": draw, "mismatch": 1.0}
    campaign, truth = trial.make(case)
    found = diagnose_percussion(picchio.load_robot(ARM), campaign).diagnosis
    claimed = [(cause.effect, cause.target) for cause in found.causes]
    assert claimed == [(cause["effect"], cause["target"]) for cause in truth["causes"]]
    assert found.verdict == ("named" if truth["causes"] else "nothing-wrong")
    told = json.loads(json.dumps(found.to_dict()))["remainder"]
    assert told["within_tolerance"] and told["nrmse"] < 0.01 and len(told["by_pose"]) == 2


@pytest.mark.slow
@pytest.mark.minutes
@pytest.mark.parametrize(
    ("draw", "alone"),
    [
        (71000, False),  # a width: a half-sine explains more of it about numbers as they are stated
        (72001, True),  # a delay: a slow rise at the end of its tolerance held it a third off
        (72006, True),  # an analogue low-pass: a digital one leaves less before all is settled
        (72007, True),  # a link: too heavy at first, it fitted worse than none
        (72010, True),  # a half-sine that begins late
    ],
)
def test_single_causes_that_another_stood_for(draw, alone):
    """What was named, or found far off, in worlds a little wrong before it was settled by itself.

    Seen while mending; the numbers of blind draws are in docs/validation.
    """
    sensors = {"sensors": ["accelerometer.tool"]} if alone else {}
    case = {"robot": ARM, "kind": "single", "snr": 40, "draw": draw, "mismatch": 1.0, **sensors}
    row = trial.run(case, 1)
    assert (row["outcome"], row["verdict"]) == ("right", "named")
    assert all(pull < 3.0 for _, pull in row["errors"].values())


def test_a_blow_of_another_shape_rises_with_the_one_that_is_stated(wrong_everywhere):
    """Its middle stays where that of the slowly rising rectangle is."""
    robot, campaign = wrong_everywhere
    problem = Problem(robot, campaign)
    record = problem.records[0]
    (rise,) = (x for x in inexact(problem, record, campaign.tolerance) if x.key == "rise_time")
    blows = record.setup.blows.change(blend=0.5)
    late = rise.change(blows, 2.0)
    half = 0.5 * 2.0 * campaign.tolerance.rise_time
    times = np.linspace(0.0, 2.0 * blows.shape.end, 997)
    before = np.where(times > half, blows.other(np.maximum(times - half, 0.0)), 0.0)
    assert np.allclose(late.other(times), before)
    assert late.shape.end == pytest.approx(blows.shape.end + 2.0 * half)


def test_a_better_fit_is_decisive_only_if_little_is_left_of_it():
    def left(share, held=None):
        """A fit that leaves so much of the signal at six poses, and what tolerances cost in it."""
        signal = 100.0 * np.sin(np.arange(1000.0))
        records = [
            SimpleNamespace(pose=pose, values={"x": signal}, noise={"x": SimpleNamespace(std=1.0)})
            for pose in range(6)
        ]
        power = 1.0 + (share * signal.std()) ** 2
        residuals = [np.full((1, 1000), math.sqrt(power)) for _ in records]
        cost = 6000.0 * power
        return Fit(None, residuals, None, cost, tuple(records), None, held=held)

    assert decisive_gain(left(0.1), left(0.001)) > 50.0
    assert decisive_gain(left(0.004), left(0.003)) < 8.0
    assert decisive_gain(left(0.2), left(0.1)) > 50.0  # more than an honest model leaves
    assert abs(decisive_gain(left(0.0001), left(0.0))) < 0.5
    # What is known beforehand counts in full, whatever the remainder.
    assert decisive_gain(left(0.0, 90.0), left(0.0, 40.0)) == pytest.approx(50.0, abs=3.0)
    assert decisive_gain(left(0.0, 90.0), left(0.0)) == pytest.approx(0.0, abs=1e-9)


def test_what_a_stretch_leaves_is_compared_with_the_signal_in_it():
    """A signal that begins late: in the first half there is a tenth of it."""
    signal = np.concatenate([10.0 * np.sin(np.arange(500.0)), 100.0 * np.sin(np.arange(500.0))])
    half = SimpleNamespace(samples=SimpleNamespace(count=500))
    record = SimpleNamespace(
        values={"x": signal}, noise={"x": SimpleNamespace(std=2.0)}, until=lambda end: half
    )
    first = 0.25 * 500 * signal[:500].var()
    assert signal_power([record, record], 0.1) == pytest.approx(2.0 * first)
    assert signal_power([record]) == pytest.approx(0.25 * 1000 * signal.var())


def test_numbers_that_are_absurdly_far_off_speak_for_no_model():
    """A cause that leaves a tenth is not refuted by slopes, followed far beyond where they lead."""
    rng = np.random.default_rng(3)
    signal = 100.0 * np.sin(np.arange(1000.0))
    records = tuple(
        SimpleNamespace(pose=pose, values={"x": signal}, noise={"x": SimpleNamespace(std=1.0)})
        for pose in range(6)
    )
    names = [str(pose) for pose in range(6)]
    slope, other = np.linalg.qr(rng.normal(size=(1000, 2)))[0].T
    what = (_number("own", False),)
    marginal = Marginal({n: Slopes.of(what, 1, 10.0 * slope[None, :, None]) for n in names})

    def left(along, beside):
        """A fit that leaves so many deviations of what is not exact, and as much of something."""
        noise = rng.normal(size=(6, 1, 1000))
        raw = [10.0 * (along * slope + beside * other) + each for each in noise]
        whitened, taken = marginal.whitened(raw, names), marginal.taken_up(raw, names)
        cost = float(sum((rows**2).sum() for rows in whitened))
        fit = Fit(SimpleNamespace(effects=()), whitened, None, cost, records, None, held=taken.held)

        def taken_up(effects, records, temper):
            return marginal.taken_up(raw, names, temper)

        return fit, tempered_evidence(SimpleNamespace(taken_up=taken_up), fit), taken.is_absurd

    nothing, before, _ = left(100.0, 300.0)
    cause, after, absurd = left(150.0, 30.0)
    assert absurd and decisive_gain(nothing, cause) < 0.0 < before - after


@pytest.mark.slow
def test_tolerances_that_make_up_for_a_turned_sensor_are_improbable(wrong_everywhere):
    robot, campaign = wrong_everywhere
    turned = {"rx": 0.06, "ry": -0.05, "rz": 0.05}
    cause = ("sensor_misalignment", "accelerometer.tool", turned)
    other, _ = worlds.make(ARM, seed=4, records=9, mismatch=1.0, causes=[cause])
    found = {}
    for name, each in (("nothing", campaign), ("turned", other)):
        problem = Problem(robot, each)
        with one_thread():
            raw = fit_growing(problem, Hypothesis.baseline(robot, each.tolerance))
            found[name] = exceeded(problem, settled(problem, raw, problem.records))
    assert not found["nothing"].improbable
    assert found["turned"].improbable
    assert "sensor_angle" in found["turned"].told()
