"""Every effect: nothing at size zero, something at its typical size, and only where it belongs."""

import numpy as np
import pytest

from worlds import campaign, draw, effects, outside, robots
from worlds import plan as plans

NAME = "fanuc_like_3dof"
GROUPS = ("accelerometer.tool", "deflection", "force", "displacement.tool")
# Sizes at which an effect must vanish; compliances vanish as they get stiff, and have their own.
ZERO = {
    "joint_stiffness": {"scale": 1.0},
    "modal_damping": {"scale": 1.0},
    "joint_damping": {"damping": 0.0},
    "payload": {"mass": 0.0},
    "link_mass": {"scale": 1.0},
    "joint_inertia": {"inertia": 0.0},
    "tool_offset": {"x": 0.0, "y": 0.0, "z": 0.0},
    "cable": {"stiffness": 0.0, "damping": 0.0},
    "backlash": {"gap": 0.0},
    "hardening": {"cubic": 0.0},
    "hysteresis": {"torque": 0.0, "deflection": 1e-4},
    "coulomb_friction": {"torque": 1e-9},
    "workpiece_contact": {"stiffness": 0.0, "damping": 0.0, "preload": 10.0},
    "force_amplitude": {"scale": 1.0},
    "force_drift": {"per_hit": 0.0},
    "pulse_width": {"scale": 1.0},
    "pulse_shape": {"blend": 0.0},
    "pulse_rate": {"scale": 1.0},
    "pulse_jitter": {"std": 0.0},
    "missed_hits": {"fraction": 0.0},
    "rebound": {"ratio": 0.0, "delay": 0.015},
    "force_direction": {"rx": 0.0, "ry": 0.0, "rz": 0.0},
    "stiffness_drift": {"per_day": 0.0},
    "thermal_stiffness": {"per_kelvin": 0.0},
    "sensor_gain": {"gain": 1.0},
    "sensor_axes": {"axes": "xyz"},
    "sensor_misalignment": {"rx": 0.0, "ry": 0.0, "rz": 0.0},
    "sensor_delay": {"delay": 0.0},
    "clock_drift": {"rate": 0.0},
    "sensor_highpass": {"frequency": 1e-9},
    "sensor_lowpass": {"frequency": 1e7},
    "sensor_clipping": {"limit": 1e9},
    "mount_resonance": {"frequency": 1e6, "damping_ratio": 0.7},
    "mains_hum": {"amplitude": 0.0, "frequency": 50.0},
    "tuned_mass": {"mass": 1e-7, "frequency": 15.0, "damping_ratio": 0.02, "x": 1, "y": 0, "z": 0},
    "coupled_joints": {"stiffness": 0.0},
    "quadratic_damping": {"damping": 0.0},
    "loose_bolt": {"stiffness": 0.0},
    "gyroscopic_spindle": {"x": 0.0, "y": 0.0, "z": 0.0},
    "swinging_direction": {"x": 0.0, "y": 0.0, "z": 0.0},
    "softening_quadratic": {"quadratic": 0.0},
    "delayed_feedback": {"stiffness": 0.0, "delay": 0.02},
    "second_touch": {"stiffness": 0.0, "damping": 0.0, "x": 0.0, "y": 0.0, "z": 1.0},
    "nonlinear_sensor": {"square": 0.0},
    "floor_vibration": {"x": 0.0, "y": 0.0, "z": 1e-9, "frequency": 9.0},
    "uneven_blows": {"share": 0.0},
    "fading_gain": {"rate": 0.0},
    "cross_talk": {"into": "x", "from": "y", "share": 0.0},
    "counterbalance": {"stiffness": 0.0, "angle": 0.0},
}
COMPLIANCES = (
    "servo_compliance", "base_compliance", "transverse_compliance", "mid_link_bending",
)  # fmt: skip
ALL = [*effects.EFFECTS, *outside.EFFECTS]
OF_SENSORS = ("sensor_gain", "sensor_axes", "sensor_misalignment", "sensor_delay", "clock_drift",
              "sensor_highpass", "sensor_lowpass", "sensor_clipping", "mount_resonance",
              "mains_hum", "nonlinear_sensor", "fading_gain", "cross_talk")  # fmt: skip
OF_BLOWS = ("force_amplitude", "force_drift", "pulse_width", "pulse_shape", "pulse_rate",
            "pulse_jitter", "missed_hits", "rebound", "uneven_blows")  # fmt: skip


@pytest.fixture(scope="module")
def plan():
    return plans.make(NAME, np.random.default_rng(21), 2, hits=5, ring=0.1, quiet=0.02)


@pytest.fixture(scope="module")
def nuisances():
    return campaign.Nuisances.draw(3, np.random.default_rng(22))


@pytest.fixture(scope="module")
def healthy(plan, nuisances):
    return stacked(plan, nuisances, ())


def stacked(plan, nuisances, causes):
    data = campaign.clean(campaign.World(plan, nuisances, causes, seed=1), GROUPS)
    return {g: np.concatenate([record[g] for record in data]) for g in GROUPS}


def changes(data, healthy):
    return {g: np.abs(data[g] - healthy[g]).max() / np.abs(healthy[g]).max() for g in GROUPS}


def typical(effect, plan, seed=23):
    rng = np.random.default_rng([seed, ALL.index(effect)])
    return draw.draw(effect, NAME, rng, "typical", plan, GROUPS)


def test_the_catalogue_is_the_contracts():
    assert tuple(outside.EFFECTS)[: len(outside.FIRST)] == outside.FIRST
    assert len(effects.EFFECTS) == 37 and len(outside.EFFECTS) >= 10
    assert set(ALL) == {*ZERO, *COMPLIANCES}


@pytest.mark.parametrize("effect", ALL)
def test_size_zero_is_the_healthy_arm(effect, plan, nuisances, healthy):
    target, p = typical(effect, plan)
    # a jump goes through a fast filter in no time, but not through the parabolas it is drawn with
    bound = 0.05 if effect in ("sensor_lowpass", "mount_resonance") else 1e-6
    if effect in COMPLIANCES:
        # twenty times as stiff: a fifth of what the typical one does, or less, in the slow
        # channels; at the very jump of the force a mass behind a spring moves freely all the same
        typically = changes(stacked(plan, nuisances, ((effect, target, p),)), healthy)
        factor = {"stiffness": 20.0, "rotor_inertia": 0.05, "damping": 4.0, "angle": 1.0}
        p, bound = {k: v * factor[k] for k, v in p.items()}, 0.2 * typically["deflection"]
    else:
        p = ZERO[effect]
    found = changes(stacked(plan, nuisances, ((effect, target, p),)), healthy)
    if effect in COMPLIANCES:
        found.pop("accelerometer.tool")
    assert max(found.values()) < bound, found


@pytest.mark.parametrize("effect", ALL)
def test_a_typical_size_shows_and_only_where_it_belongs(effect, plan, nuisances, healthy):
    target, p = typical(effect, plan)
    if effect == "missed_hits":
        p = {"fraction": 0.6}  # of so few blows
    found = changes(stacked(plan, nuisances, ((effect, target, p),)), healthy)
    if effect in OF_SENSORS:
        assert found[target] > 0.004
        assert all(value < 1e-6 for group, value in found.items() if group != target), found
    else:
        shows = found["accelerometer.tool"], found["deflection"]
        assert max(shows) > 0.01 and min(shows) > 0.001, found
        assert (found["force"] > 0.01) == (effect in OF_BLOWS), found


def test_modal_damping_of_all_coordinates_is_another_world_only_where_there_are_more(plan, healthy):
    """And there the difference is in the damping: small."""
    nominal = campaign.Nuisances.none(3)
    for effect, bound in (("payload", 0.0), ("base_compliance", 1e-4), ("cable", 1e-4)):
        cause = (effect, *typical(effect, plan))
        worlds = [
            campaign.World(plan, nominal, (cause,), modal=modal) for modal in ("joints", "all")
        ]
        one, other = (campaign.clean(world, ("deflection",))[1]["deflection"] for world in worlds)
        error = np.abs(one - other).max() / np.abs(one).max()
        assert error < 1e-9 if bound == 0.0 else bound < error < 0.2, effect


def test_draws_are_of_the_contracts_parameters_and_plain_numbers(plan):
    for effect in ALL:
        for strength in ("typical", "weak"):
            rng = np.random.default_rng(1)
            _, p = draw.draw(effect, NAME, rng, strength, plan, GROUPS)
            assert all(type(v) in (float, str) for v in p.values()), (effect, p)


def test_weak_is_weaker(plan, nuisances, healthy):
    for effect in ("payload", "backlash", "sensor_delay", "rebound", "base_compliance"):
        size = []
        for strength in ("weak", "typical"):
            rng = np.random.default_rng(5)
            cause = (effect, *draw.draw(effect, NAME, rng, strength, plan, GROUPS))
            size.append(max(changes(stacked(plan, nuisances, (cause,)), healthy).values()))
        assert 0.02 * size[1] < size[0] < 0.5 * size[1]


def test_payload_and_offset_do_what_the_tool_frame_says(plan, nuisances):
    """A mass at the tool frame changes the arm's mass matrix by J^T m J, and nothing else."""
    world = campaign.World(plan, nuisances)
    bench = world.bench(0)
    before = bench.nominal_mass()
    effects.EFFECTS["payload"](bench, "tool", {"mass": 3.0})
    import pinocchio as pin

    model = robots.load(NAME).model
    jacobian = pin.computeFrameJacobian(
        model, model.createData(), bench.pose, model.getFrameId("tool"),
        pin.ReferenceFrame.LOCAL_WORLD_ALIGNED,
    )[:3]  # fmt: skip
    assert np.allclose(bench.nominal_mass() - before, 3.0 * jacobian.T @ jacobian, atol=1e-10)


def test_the_order_of_the_causes_does_not_matter(plan, nuisances):
    causes = (
        ("payload", "tool", {"mass": 3.0}),
        ("link_mass", "link_3", {"scale": 1.15}),
        ("base_compliance", "rx", {"stiffness": 1e6, "damping": 400.0}),
        ("joint_inertia", "joint_2", {"inertia": 4.0}),
    )
    one, other = (stacked(plan, nuisances, c)["deflection"] for c in (causes, causes[::-1]))
    assert np.abs(one - other).max() < 1e-9 * np.abs(one).max()


def test_axes_words():
    assert np.array_equal(effects.axes("y-xz"), [[0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    assert np.array_equal(effects.axes("-xyz"), np.diag([-1, 1, 1]))
