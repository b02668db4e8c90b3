"""Effects that a world has, too: both predict the same records, from equations of their own."""

import numpy as np
import pytest
import trial

import picchio
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.diagnosis import diagnose_percussion
from picchio.model.effects.registry import effect_class, from_dict
from picchio.model.geometry import Geometry
from picchio.model.model import Model
from picchio.robot.loading.saved_model import saved_model_text
from worlds import campaign as worlds
from worlds import outside
from worlds.chain import merge

SENSORS = ("accelerometer.tool", "deflection")
ARM = "fanuc_like_3dof"
POSE = [0.3, 0.5, -0.8]


@pytest.fixture(scope="module")
def robot():
    return picchio.load_robot(ARM)


@pytest.fixture(autouse=True)
def _pack(monkeypatch):
    monkeypatch.setitem(outside.EFFECTS, "sprung_pack", sprung_pack)


def sprung_pack(bench, _, p):
    """A mass on a spring at the tool, the same along x, y and z: kg, N/m, N s/m."""
    body, turn, offset = bench.chain.tool, bench.chain.tool_rotation, bench.chain.tool_offset
    for number, axis in enumerate(np.eye(3)):
        name, mass = f"pack {number}", p["mass"] if number == 2 else 0.0
        bench.chain = bench.chain.hang(name, body, turn, offset, axis, True, mass)
        bench.soft[name] = p["stiffness"], p["damping"]
        body, turn, offset = len(bench.chain.names) - 1, np.eye(3), np.zeros(3)


def left(robot, cause, effect):
    """Residual with the effect over that without it, no noise: how far world and model agree.

    Stiffness, damping and force are the world's own.
    """
    campaign, truth = worlds.make(
        robot=ARM, seed=5, causes=[cause], snr_db=90.0, sensors=SENSORS, records=3
    )
    problem, given = Problem(robot, campaign), truth["nuisances"]
    own = [effect_class("joint_stiffness")(j, scale=s) for j, s in given["stiffness"].items()]
    own.append(effect_class("modal_damping")("robot", scale=given["damping_ratio"]))
    own.append(effect_class("force_amplitude")("tool", scale=given["force"]))

    def size(effects):
        return np.sqrt(sum(float((row**2).sum()) for row in problem.residuals(effects)))

    return size((*own, effect)) / size(tuple(own))


CASES = {
    "absorber": (  # sqrt(6e4 / 6) = 100 rad/s
        ("sprung_pack", "tool", {"mass": 6.0, "stiffness": 6e4, "damping": 60.0}),
        (
            "tool",
            {"mass": 6.0, "frequency": 50.0 / np.pi, "damping_ratio": 0.05, "modal_share": 0.0},
        ),
        0.003,
    ),
    "belt_coupling": (
        ("coupled_joints", ("joint_2", "joint_3"), {"stiffness": 3e4}),
        ("joint_3", {"stiffness": 3e4, "modal_share": 0.0}),
        0.0005,
    ),
    "loose_bolt": (
        ("loose_bolt", "joint_2", {"stiffness": -8e4}),
        ("joint_2", {"change": -8e4}),
        0.0005,
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_world_and_the_model_agree(robot, name):
    cause, (target, values), share = CASES[name]
    assert left(robot, cause, effect_class(name)(target, **values)) < share


def test_a_link_that_bends_is_the_worlds(robot):
    """The world's link yields about one axis only."""
    bent = {"stiffness": 2e5, "damping": 40.0, "angle": 0.7}
    end = np.array(robot.rigid._model.jointPlacements[3].translation)
    one, other = np.linalg.svd(end[None])[2][1:]
    axis = np.cos(0.7) * one + np.sin(0.7) * other
    first = np.cross(end, np.eye(3)[int(np.abs(end).argmin())])
    first /= np.linalg.norm(first)
    second = np.cross(end / np.linalg.norm(end), first)
    angle = float(np.arctan2(axis @ second, axis @ first))
    own = {"stiffness": 2e5, "damping": 40.0, "angle": angle, "modal_share": 0.0}
    own["apart"] = 0.8 / np.sqrt(0.75)
    cause = ("mid_link_bending", "link_2", bent)
    effect = effect_class("link_bending")
    assert left(robot, cause, effect("joint_2", ratio=0.002, **own)) < 0.005
    assert left(robot, cause, effect("joint_2", ratio=1.0, **own)) > 0.3


@pytest.mark.parametrize("order", [1.0, 2.0])
@pytest.mark.parametrize("digital", [0.0, 1.0])
def test_a_loggers_filter_is_the_worlds(robot, order, digital):
    values = {"frequency": 2.0, "order": order, "digital": digital}
    group = "accelerometer.tool"
    effect = effect_class("sensor_highpass")
    assert left(robot, ("sensor_highpass", group, values), effect(group, **values)) < 0.002
    other = values | {"order": 3.0 - order}
    assert left(robot, ("sensor_highpass", group, values), effect(group, **other)) > 0.05


@pytest.mark.slow
def test_the_order_of_a_filter_is_found(robot):
    values = {"frequency": 2.5, "order": 2.0, "digital": 1.0}
    campaign, _ = worlds.make(
        robot=ARM, seed=104, causes=[("sensor_highpass", "accelerometer.tool", values)],
        snr_db=40.0, sensors=SENSORS, records=9,
    )  # fmt: skip
    found = diagnose_percussion(robot, campaign, workers=1).diagnosis
    (cause,) = found.causes
    assert (found.verdict, cause.effect) == ("named", "sensor_highpass")
    assert cause.parameters["frequency"].value == pytest.approx(2.5, rel=0.005)
    assert cause.parameters["order"].value == 2.0


FOUND = {
    "coupled_joints": ("belt_coupling", "stiffness", "stiffness"),
    "loose_bolt": ("loose_bolt", "change", "stiffness"),
}


@pytest.mark.slow
@pytest.mark.parametrize("hidden", FOUND)
def test_it_is_found_from_blows(robot, hidden):
    effect, parameter, known = FOUND[hidden]
    case = {"robot": ARM, "kind": "outside", "effect": hidden, "snr": 40, "draw": 0, "records": 9}
    campaign, truth = trial.make(case)
    found = diagnose_percussion(robot, campaign, workers=1).diagnosis
    (cause,) = found.causes
    assert cause.effect == effect
    assert cause.parameters[parameter].value == pytest.approx(
        truth["causes"][0]["parameters"][known], rel=0.01
    )


@pytest.mark.slow
def test_an_absorber_is_found_from_blows(robot):
    pack = {"mass": 5.0, "stiffness": 1.3e4, "damping": 10.0}
    campaign, _ = worlds.make(
        robot=ARM, seed=7, causes=[("sprung_pack", "tool", pack)], snr_db=40.0, sensors=SENSORS,
        records=9,
    )  # fmt: skip
    found = diagnose_percussion(robot, campaign, workers=1).diagnosis
    (cause,) = found.causes
    assert (cause.effect, cause.target) == ("absorber", "tool")
    assert cause.parameters["mass"].value == pytest.approx(5.0, rel=0.02)
    frequency = np.sqrt(1.3e4 / 5.0) / (2.0 * np.pi)
    assert cause.parameters["frequency"].value == pytest.approx(frequency, rel=0.01)


def test_what_a_trial_leaves_out_is_in_the_catalogue():
    for hidden, names in outside.IN_CATALOGUE.items():
        assert hidden in outside.EFFECTS
        assert trial.outside(hidden) == names
        assert all(effect_class(name) for name in names)


def body_at(chain, body, mass, centre, inertia):
    own = chain.mass[body], chain.com[body], chain.inertia[body]
    return chain.with_body(body, *merge(own, (mass, centre, inertia)))


EXTENT = np.array([0.004, 0.001, 0.002])


def off_centre(bench, _, p):
    """A body at the tool whose centre of mass is beside it: kg."""
    chain = bench.chain
    at, turn = chain.tool_offset, chain.tool_rotation
    inertia = p["mass"] * (EXTENT.sum() * np.eye(3) - np.diag(EXTENT))
    centre = at + turn @ [0.1, -0.05, 0.2]
    bench.chain = body_at(chain, chain.tool, p["mass"], centre, turn @ inertia @ turn.T)


def test_a_load_away_from_the_tool_frame_is_the_worlds(robot, monkeypatch):
    monkeypatch.setitem(outside.EFFECTS, "load", off_centre)
    values = {"mass": 4.0, "x": 0.1, "y": -0.05, "z": 0.2, "xx": 0.004, "yy": 0.001, "zz": 0.002}
    effect = effect_class("payload_body")("tool", **values)
    assert left(robot, ("load", "tool", {"mass": 4.0}), effect) < 0.0005


@pytest.mark.minutes
@pytest.mark.slow
def test_a_load_away_from_the_tool_frame_is_found_from_blows(robot, monkeypatch):
    monkeypatch.setitem(outside.EFFECTS, "load", off_centre)
    campaign, _ = worlds.make(
        robot=ARM, seed=12, causes=[("load", "tool", {"mass": 3.0})], snr_db=40.0,
        sensors=SENSORS, records=18,
    )  # fmt: skip
    found = diagnose_percussion(robot, campaign, workers=1).diagnosis
    (cause,) = found.causes
    assert (found.verdict, cause.effect) == ("named", "payload_body")
    true = {"mass": 3.0, "x": 0.1, "y": -0.05, "z": 0.2}
    for name, value in true.items():
        given = cause.parameters[name]
        assert abs(given.value - value) < 3.0 * given.std
    assert cause.parameters["mass"].std < 0.1 * true["mass"]


def test_a_link_changed_whole_is_the_worlds(robot, monkeypatch):
    """The world's body is what the effect says of the link: heavier, turned and moved."""
    effect = effect_class("link_inertia")(
        "link_3", mass=0.3, x=0.4, y=-0.2, z=0.1, xx=0.2, yy=-0.1, zz=0.05, xy=0.2, yz=-0.3
    )
    told = effect.follows(robot)
    ten = {}

    def heavier(bench, link, p):
        from picchio.robot.dynamics.rigid_model import unit_inertia

        own = unit_inertia(robot.tree, link, None).toDynamicParameters()
        new = own + effect._added(own)
        body, centre = bench.body(link), new[1:4] / new[0]
        about = np.array([[new[4], new[5], new[7]], [new[5], new[6], new[8]],
                          [new[7], new[8], new[9]]])  # fmt: skip
        about -= new[0] * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        ten["mass"], ten["com"] = new[0], centre
        bench.chain = bench.chain.with_body(body, new[0], centre, about)

    monkeypatch.setitem(outside.EFFECTS, "heavier", heavier)
    assert left(robot, ("heavier", "link_3", {"scale": 1.0}), effect) < 0.0005
    assert told["link_mass"][0] == pytest.approx(ten["mass"])
    assert [told[f"com_{a}"][0] for a in "xyz"] == pytest.approx(list(ten["com"]))


def test_a_counterbalance_is_a_spring_with_its_torques_slope(robot):
    geometry = Geometry.of(robot, robot.pose(POSE))

    def torque(q):
        return 800.0 * np.cos(q) - 300.0 * np.sin(q) + 1500.0 * q

    effect = effect_class("counterbalance")("joint_2", cosine=800.0, sine=-300.0, spring=1500.0)
    along = np.array([1.0, 0.0, 0.0])
    plain, changed = (
        Model(robot, True).with_effects(effects).plant(geometry).build(along)
        for effects in ((), (effect,))
    )
    slope = (torque(POSE[1] + 1e-6) - torque(POSE[1] - 1e-6)) / 2e-6
    expected = np.diag([0.0, -slope, 0.0])
    np.testing.assert_allclose(changed.stiffness - plain.stiffness, expected, atol=1e-3)


NEW = {
    "absorber": ("tool", {"mass": 2.0, "frequency": 15.0, "damping_ratio": 0.1}),
    "belt_coupling": ("joint_3", {"stiffness": 2e4}),
    "counterbalance": ("joint_2", {"cosine": 400.0, "spring": -100.0}),
    "coupled_drive": ("joint_3", {"coefficient": 2.0, "ratio": -1.0}),
    "link_bending": ("joint_2", {"stiffness": 3e5, "damping": 20.0, "angle": 0.5, "ratio": 0.3}),
    "link_inertia": ("link_2", {"mass": 0.1, "xz": 0.2}),
    "loose_bolt": ("joint_1", {"change": -1e4}),
    "payload_body": ("tool", {"mass": 2.0, "x": 0.1, "zz": 0.01}),
}


@pytest.mark.parametrize("name", NEW)
def test_it_is_in_the_list_and_goes_through_a_file(tmp_path, robot, name):
    target, values = NEW[name]
    effect = effect_class(name)(target, **values)
    file = tmp_path / "model.toml"
    file.write_text(saved_model_text(ARM, [effect.to_dict()]))
    again = picchio.load_robot(file)
    assert Model(again).effects == (effect,)
    assert from_dict(effect.to_dict(), robot) == effect
    assert picchio.effects(name).to_dict()["effects"][0]["name"] == name
