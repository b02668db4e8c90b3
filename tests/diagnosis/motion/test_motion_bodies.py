"""Bodies that are not the files', and drives that turn two joints, in a world of its own."""

import numpy as np
import pinocchio as pin
import pytest

from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record
from picchio.diagnosis.motion.diagnosis import diagnose_motion
from picchio.model.inertia import (
    body,
    in_frame,
    point_masses,
    pseudo_inertia,
    stretched,
    ten_numbers,
)
from picchio.robot.loading.load import load_robot
from worlds import moving, robots
from worlds.chain import from_pinocchio, merge

ARM = "ur10"


@pytest.fixture(scope="module")
def robot():
    return load_robot(ARM)


@pytest.fixture(scope="module")
def chain():
    world = robots.load(ARM)
    return from_pinocchio(world.model, world.joints, world.tool)


def causes(diagnosis):
    return {(c.effect, c.target): c.parameters for c in diagnosis.causes}


def with_load(chain, mass, centre, inertia):
    """A body at the tool; `centre` and `inertia` in the tool frame's axes."""
    turn, at = chain.tool_rotation, chain.tool_offset
    own = chain.mass[chain.tool], chain.com[chain.tool], chain.inertia[chain.tool]
    load = mass, at + turn @ centre, turn @ inertia @ turn.T
    return chain.with_body(chain.tool, *merge(own, load))


def test_the_world_is_pinocchios(chain):
    model = robots.load(ARM).model
    q, v, a = moving.waves(np.random.default_rng(1), 6, np.arange(20) / 20.0)
    theirs = np.array(
        [pin.rnea(model, model.createData(), *x) for x in zip(q.T, v.T, a.T, strict=True)]
    ).T
    np.testing.assert_allclose(moving.torques(chain, q, v, a), theirs, atol=1e-9)


def test_a_perfect_model_has_nothing_wrong(robot, chain):
    assert diagnose_motion(robot, moving.campaign(chain, 3)).verdict == "nothing-wrong"


def test_a_load_tells_its_mass_and_where_it_is(robot, chain):
    centre, inertia = np.array([0.08, -0.05, 0.12]), np.diag([0.03, 0.02, 0.015])
    world = with_load(chain, 4.0, centre, inertia)
    found = diagnose_motion(robot, moving.campaign(world, 4))
    (label,) = causes(found)
    assert label == ("payload_body", "tool")
    values = causes(found)[label]
    assert values["mass"].value == pytest.approx(4.0, rel=0.01)
    where = [values[a].value for a in "xyz"]
    np.testing.assert_allclose(where, centre, atol=0.005)
    assert all(
        abs(values[a].value - c) < 5.0 * values[a].std for a, c in zip("xyz", centre, strict=True)
    )
    assert found.gain.explained > 0.999


@pytest.mark.parametrize("told", [0.0, 0.1])
def test_a_load_is_known_no_better_than_the_drives_that_weigh_it(robot, chain, told):
    """Drives that report 5 % too much: the true mass lies within what their tolerance leaves."""
    world = with_load(chain, 4.0, np.zeros(3), np.zeros((3, 3)))
    bare, loaded = (moving.campaign(each, 5) for each in (chain, world))
    records = []
    for off, on in zip(bare, loaded, strict=True):
        read, own = on.read(), off.read()
        time = read.pop("time")
        for name in read:
            if name.startswith("torque"):
                read[name] = own[name] + 1.05 * (read[name] - own[name])
        records.append(Record.from_arrays(on.file, time, read, kind="motion"))
    changed = Campaign.from_records(records, tolerance={"torque_gain": told})
    mass = causes(diagnose_motion(robot, changed))["payload", "tool"]["mass"]
    assert mass.value == pytest.approx(4.2, rel=0.01)
    assert (mass.value - 4.0 < 2.0 * mass.std) == (told > 0.0)


def test_what_a_model_lacks_widens_the_spread(robot, chain):
    """A slow torque of the second joint that nothing in the catalogue makes."""

    def lacking(v, a, q):
        found = np.zeros_like(v)
        found[1] = 6.0 * np.sin(np.linspace(0.0, 25.0, v.shape[1]))
        return found

    world = with_load(chain, 4.0, np.zeros(3), np.zeros((3, 3)))
    found = diagnose_motion(
        robot, Campaign.from_records(list(moving.campaign(world, 5, lacking)),
                                     tolerance={"torque_gain": 0.0})
    )  # fmt: skip
    mass = next(c for c in found.causes if c.target == "tool").parameters["mass"]
    assert abs(mass.value - 4.0) < 3.0 * mass.std


def test_a_load_at_the_tool_frame_is_told_as_that(robot, chain):
    world = with_load(chain, 4.0, np.zeros(3), np.zeros((3, 3)))
    found = diagnose_motion(robot, moving.campaign(world, 5))
    assert set(causes(found)) == {("payload", "tool")}


@pytest.mark.parametrize("body", [1, 2])
def test_a_link_that_is_not_the_files_is_found_whole(robot, chain, body):
    mass, centre = 1.4 * chain.mass[body], chain.com[body] + [0.02, -0.03, 0.05]
    inertia = 1.7 * chain.inertia[body]
    world = chain.with_body(body, mass, centre, inertia)
    found = diagnose_motion(robot, moving.campaign(world, 6 + body))
    link = robots.load(ARM).links()[body]
    assert set(causes(found)) == {("link_inertia", link)}
    assert found.verdict == "named"
    assert found.gain.explained > 0.999


def rubbing(coupled):
    """Friction and rotors of the wrist, whose last motor may turn with the fifth joint, too."""

    def torque(v, a, q):
        found = np.zeros_like(v)
        found[4] += 2.0 * np.sign(v[4]) + 3.0 * v[4]
        turn, speed_up = (v[5] + v[4], a[5] + a[4]) if coupled else (v[5], a[5])
        both = 1.5 * np.sign(turn) + 2.0 * turn + 0.3 * speed_up
        found[5] += both
        if coupled:
            found[4] += both
        return found

    return torque


def test_a_motor_that_turns_two_joints_is_found(robot, chain):
    found = diagnose_motion(robot, moving.campaign(chain, 9, rubbing(True)))
    values = causes(found)["coupled_drive", "wrist_3_joint"]
    assert values["torque"].value == pytest.approx(1.5, rel=0.1)
    assert values["coefficient"].value == pytest.approx(2.0, rel=0.1)
    assert values["inertia"].value == pytest.approx(0.3, rel=0.1)
    assert found.gain.explained > 0.99


def test_a_wrist_whose_joints_have_motors_of_their_own_is_not_said_to_be_coupled(robot, chain):
    found = diagnose_motion(robot, moving.campaign(chain, 10, rubbing(False)))
    assert ("coulomb_friction", "wrist_3_joint") in causes(found)
    assert "coupled_drive" not in {effect for effect, _ in causes(found)}


@pytest.mark.parametrize("gone", ["viscous_friction", "joint_inertia"])
def test_a_coupling_does_not_stand_in_for_what_each_joint_has_by_itself(robot, chain, gone):
    found = diagnose_motion(robot, moving.campaign(chain, 10, rubbing(False)), without=[gone])
    assert "coupled_drive" not in {effect for effect, _ in causes(found)}


def carried(chain, size):
    """A gas spring on the second joint: what its lever makes of a force, less half of its rise."""

    def torque(v, a, q):
        found = np.zeros_like(v)
        found[1] = -size * np.sin(q[1] + 0.4) - 0.1 * size * q[1]
        return found

    return torque


def test_a_counterbalance_is_found(robot, chain):
    found = diagnose_motion(robot, moving.campaign(chain, 11, carried(chain, 40.0)))
    values = causes(found)["counterbalance", "shoulder_lift_joint"]
    sizes = [values[name].value for name in ("cosine", "sine", "spring")]
    np.testing.assert_allclose(sizes, [40.0 * np.sin(0.4), 40.0 * np.cos(0.4), 4.0], atol=1.0)
    assert found.gain.explained > 0.99


def test_no_change_makes_a_body_that_cannot_exist():
    rng = np.random.default_rng(0)
    # Pinocchio's random inertias need not be those of a body that can exist.
    own = body(3.0, [0.1, -0.2, 0.3], [0.02, 0.05, 0.01])
    np.testing.assert_allclose(stretched(own, np.zeros(10)), own, atol=1e-12)
    for _ in range(100):
        ten = stretched(own, rng.uniform(-2.5, 2.5, 10))
        assert np.linalg.eigvalsh(pseudo_inertia(ten))[0] > 0.0
    heavier = stretched(own, [np.log(2.0), *np.zeros(9)])
    np.testing.assert_allclose(heavier, 2.0 * own, rtol=1e-9)


def test_a_bodys_numbers_in_another_frame_are_pinocchios():
    body, place = pin.Inertia.Random(), pin.SE3.Random()
    own = body.toDynamicParameters()
    there = in_frame(place.rotation, place.translation) @ own
    np.testing.assert_allclose(there, place.act(body).toDynamicParameters(), atol=1e-12)
    np.testing.assert_allclose(ten_numbers(pseudo_inertia(own)), own, atol=1e-14)


def test_ten_point_masses_are_the_body():
    own = pin.Inertia.Random().toDynamicParameters()
    total = np.zeros(10)
    for mass, point in point_masses(own, 0.1):
        one = pin.Inertia(1.0, np.array(point), np.zeros((3, 3)))
        total += mass * one.toDynamicParameters()
    np.testing.assert_allclose(total, own, atol=1e-9)
