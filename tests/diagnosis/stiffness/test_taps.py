"""Taps in time: an instrumented hammer, ring-downs of unknown blows, and what is refused."""

import math

import numpy as np
import pytest

import picchio
from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record
from picchio.campaign.tables import Tolerance
from picchio.diagnosis.stiffness.prior import prior_of
from picchio.diagnosis.stiffness.responses import make_problem
from picchio.diagnosis.stiffness.taps import spectra


@pytest.fixture(scope="module")
def taps():
    """The independent world of taps."""
    from worlds import taps

    return taps


def campaign(world, **table) -> Campaign:
    records = []
    for k, (held, told) in enumerate(world.records):
        channels = {name: x for name, x in held.items() if name != "time"}
        records.append(Record.from_arrays(f"t{k}.csv", held["time"], channels, **told))
    return Campaign.from_records(records, robot=world.robot, **table)


@pytest.mark.parametrize("late", [0.0, 0.25, 0.5])
def test_the_prediction_is_the_worlds(taps, late):
    """A record cut off while the arm still rings, too: the window's line needs no correction."""
    for length in (2.0, 0.8):
        world = taps.draw(3, 2, exact=True, noise=1e-6, poses=1, taps=1, length=length, late=late)
        robot = picchio.load_robot(world.robot)
        made = make_problem(robot, campaign(world).records, Tolerance.zero(), prior_of(robot))
        at = np.zeros(len(made.precision))
        at[:3] = np.log(world.truth / world.nominal)
        at[3:6] = np.log(world.damping / made.damping_ratio)
        before, after = [], []
        for part, table in zip(made.predict(at), made.tables, strict=True):
            before.append(relative(part.residual, table))
        # What is left is that a sum over samples is no integral where the force bends.
        flat = [(p.slope[..., 6:].reshape(-1, 2), p.residual.ravel()) for p in made.predict(at)]
        slope, left = (np.concatenate(each) for each in zip(*flat, strict=True))
        at[6:] = np.linalg.lstsq(slope, left)[0]
        for part, table in zip(made.predict(at), made.tables, strict=True):
            after.append(relative(part.residual, table))
        assert max(before) < 0.01 and max(after) < 0.5 * max(before)
        # Where between two samples the blow begins says by how much (Euler and Maclaurin).
        bend = 0.5 * (late**2 - late + 1.0 / 6.0)
        assert at[6] == pytest.approx(-math.sqrt(720.0) * bend, abs=0.25) and abs(at[7]) < 2.5


def relative(residual, table):
    """What is left of a function, over it."""
    left = np.linalg.norm(residual * table.scale[:, None])
    return left / np.linalg.norm(table.measured)


@pytest.mark.slow
@pytest.mark.parametrize("known", [True, False])
def test_stiffness_and_damping_by_taps(taps, known):
    world = taps.draw(3, 4, known=known)
    found = picchio.identify(world.robot, campaign(world))
    for joint, stiffness, ratio in zip(found.joints, world.truth, world.damping, strict=True):
        k = joint.stiffness
        assert k.told and abs(math.log(k.value / stiffness)) < 0.04
        assert k.low / 1.02 < stiffness < k.high * 1.02
        assert abs(math.log(joint.damping_ratio.value / ratio)) < 0.4
    assert not found.doubt and found.convention == "modal"


def test_slopes_of_an_unknown_blow_are_those_of_differences(taps):
    world = taps.draw(3, 5, known=False, poses=1, taps=1)
    robot = picchio.load_robot(world.robot)
    made = make_problem(robot, campaign(world).records, Tolerance(), prior_of(robot))
    at = 0.2 * np.random.default_rng(0).standard_normal(len(made.precision))
    parts = made.predict(at)
    names = [name for name in made.steps if name.startswith(("impulse", "blow"))]
    assert len(names) == 5
    for name in names:
        k = 6 + made.steps.index(name)
        step = 1e-5 * (np.arange(len(at)) == k)
        plus, minus = made.predict(at + step), made.predict(at - step)
        for part, more, less in zip(parts, plus, minus, strict=True):
            found = -(more.residual - less.residual) / 2e-5
            np.testing.assert_allclose(part.slope[..., k], found,
                                       atol=1e-4 * max(1e-3, np.abs(found).max()))  # fmt: skip


def test_what_a_phone_folds_is_refused(taps):
    world = taps.draw(7, 1, rate=200.0, poses=1, taps=1)
    with pytest.raises(picchio.InputError, match=r"sampled at 200 Hz: a mode near .* folds"):
        picchio.identify(world.robot, campaign(world))
    slow = taps.draw(3, 1, rate=400.0, poses=1, taps=1)
    with pytest.raises(picchio.InputError, match=r"the blow lasts . samples .* ring-down"):
        picchio.identify(slow.robot, campaign(slow))


def test_what_may_fold_is_refused_until_more_is_known(taps):
    """Modes of 7 to 22 Hz as stated; at twice that one of them is beyond half of 80 Hz."""
    world = taps.draw(3, 1, known=False, rate=80.0, poses=1, taps=1)
    with pytest.raises(picchio.InputError, match=r"if joint_\d is as stiff as it may be.*loads"):
        picchio.identify(world.robot, campaign(world))
    nominal = picchio.load_robot(world.robot)
    sure = {joint.name: {"stiffness": joint.stiffness, "stiffness_spread": 1.1,
                         "damping_ratio": joint.damping_ratio}
            for joint in nominal.flexible_joints}  # fmt: skip
    known = picchio.load_robot(world.robot, values=sure)
    record = campaign(world).records[0]
    assert len(spectra(known, record, known.pose(record.pose))) == 3


def test_a_tap_needs_a_sensor(taps):
    world = taps.draw(3, 1, poses=1, taps=1)
    held, told = world.records[0]
    only = {"force": held["force"]}
    record = Record.from_arrays("t.csv", held["time"], only, **told)
    with pytest.raises(picchio.InputError, match="no channel of this tap"):
        picchio.identify(world.robot, Campaign.from_records([record]))


@pytest.mark.slow
def test_a_wrist_at_a_false_mode_is_looked_for_elsewhere(taps):
    """With masses and places held, no other stiffness of the last joint did better; met blind."""
    world = taps.draw(7, 94016)
    found = picchio.identify(world.robot, campaign(world))
    for joint, truth in zip(found.joints, world.truth, strict=True):
        assert joint.stiffness.value == pytest.approx(truth, rel=0.10)
