"""Units against CODATA's and NIST SP 811's factors; names against the contract's grammar."""

import numpy as np
import pytest

from picchio.campaign import channels as channels_module
from picchio.campaign.campaign import Campaign
from picchio.campaign.channels import (
    ChannelKind,
    parse_channel,
    parse_header,
)
from picchio.campaign.readers import velocity
from picchio.campaign.record import Record
from picchio.core.errors import InputError, PicchioWarning
from picchio.core.units import conversion
from picchio.model.effects.registry import effect_class
from picchio.model.model import Model
from picchio.prediction.percussion import percussion_setups
from picchio.robot.loading.load import load_robot

# NIST SP 811 (2008), appendix B: exact factors, or to the digits printed there.
FACTORS = [
    ("time [ms]", 1e-3),
    ("time [min]", 60.0),
    ("force [kN]", 1e3),
    ("force [lbf]", 4.4482216152605),
    ("force [kgf]", 9.80665),
    ("deflection.j [deg]", np.pi / 180),
    ("deflection.j [°]", np.pi / 180),
    ("deflection.j [mrad]", 1e-3),
    ("deflection.j [arcmin]", np.pi / 180 / 60),
    ("deflection.j [mm]", 1e-3),
    ("deflection.j [µm]", 1e-6),
    ("acceleration.tool.x [g]", 9.80665),
    ("acceleration.tool.x [mg]", 9.80665e-3),
    ("acceleration.tool.x [m/s2]", 1.0),
    ("acceleration.tool.x [m s^-2]", 1.0),
    ("acceleration.tool.x [mm/s**2]", 1e-3),
    ("acceleration.tool.x [Gal]", 1e-2),
    ("velocity.tool.y [mm/s]", 1e-3),
    ("velocity.tool.y [in/s]", 0.0254),
    ("velocity.j [rpm]", 2 * np.pi / 60),
    ("velocity.j [deg/s]", np.pi / 180),
    ("velocity.j [m/min]", 1 / 60),
    ("torque.j [Nm]", 1.0),
    ("torque.j [kN*m]", 1e3),
    ("torque.j [N·m]", 1.0),
    ("torque.j [ft*lbf]", 0.3048 * 4.4482216152605),
    ("torque.j [N.m]", 1.0),
    ("torque.j [N-m]", 1.0),
    ("torque.j [N m]", 1.0),
    ("torque.j [lbf.in]", 0.0254 * 4.4482216152605),
    ("torque.j [ft-lb]", 0.3048 * 4.4482216152605),
    ("torque.j [kgf.cm]", 0.0980665),
    ("torque.j [cNm]", 1e-2),
    ("torque.j [NM]", 1.0),
    ("force [KN]", 1e3),
    ("force [MN]", 1e6),
    ("deflection.j [MM]", 1e-3),
    ("force [lb]", 4.4482216152605),
    ("velocity.j [°/s]", np.pi / 180),
    ("acceleration.tool.x [m·s⁻²]", 1.0),
    ("acceleration.tool.x [M/S^2]", 1.0),
    ("acceleration.tool.x [m s-2]", 1.0),
    ("acceleration.tool.x [in/s^2]", 0.0254),
    ("acceleration.tool.x [G]", 9.80665),
    ("displacement.tool.x [μm]", 1e-6),
    ("torque.j [kN]", 1e3),
]


@pytest.mark.parametrize(("header", "factor"), FACTORS)
def test_units_become_si(header, factor):
    _, convert = parse_header(header)
    np.testing.assert_allclose(convert(np.array([0.0, 2.0])), [0.0, 2.0 * factor], rtol=5e-16)


# Functions of an accelerometer, of a velocity and of a displacement by a hammer, over m/s^2/N,
# m/s/N and m/N; the pound force and the inch as above.
QUOTIENTS = [
    ("g/N", 9.80665),
    ("G/N", 9.80665),
    ("mg/N", 9.80665e-3),
    ("(1/N)*(m/s^2)", 1.0),
    ("(1/N)*(m/s²)", 1.0),
    ("(1/N)*(m/s\ufffd)", 1.0),  # Latin-1 read as UTF-8
    ("(m/s2)/kN", 1e-3),
    ("g/lbf", 9.80665 / 4.4482216152605),
    ("in/s^2/lb", 0.0254 / 4.4482216152605),
    ("mm/s/N", 1e-3),
    ("m/Ns", 1.0),
    ("µm/N", 1e-6),
]


@pytest.mark.parametrize(("unit", "factor"), QUOTIENTS)
def test_units_of_frequency_response_functions(unit, factor):
    target, convert = conversion(unit, ("m/s^2/N", "m/s/N", "m/N"))
    assert convert.scale == pytest.approx(factor, rel=1e-12)
    assert target == ("m/s/N" if unit in ("mm/s/N", "m/Ns") else
                      "m/N" if unit == "µm/N" else "m/s^2/N")  # fmt: skip


@pytest.mark.parametrize(
    ("unit", "targets", "factor"),
    [
        ("%", ("1",), 0.01),
        ("percent", ("1",), 0.01),
        ("1/min", ("rad/s", "m/s"), 2.0 * np.pi / 60.0),
        ("min⁻¹", ("rad/s",), 2.0 * np.pi / 60.0),
        ("1/min", ("Hz",), 1.0 / 60.0),
    ],
)
def test_shares_and_turns_a_minute(unit, targets, factor):
    target, convert = conversion(unit, targets)
    assert (target, convert.scale) == (targets[0], pytest.approx(factor, rel=1e-12))


def test_temperatures_have_their_own_zero():
    for unit, value in (("K", 293.15), ("degF", 68.0), ("°C", 20.0)):
        _, convert = parse_header(f"temperature.j [{unit}]")
        assert convert(np.array([value]))[0] == pytest.approx(20.0, abs=1e-9)


@pytest.mark.parametrize(
    ("header", "words"),
    [
        ("force [mm]", ["force", "'mm'", "N"]),
        ("force [g]", ["force", "'g'"]),
        ("deflection.j [%]", ["deflection.j", "multiple of rad"]),
        ("deflection.j [1]", ["not a unit"]),
        ("velocity.j [Hz]", ["rad/s", "'Hz'"]),
        ("torque.j [N*m/rad]", ["torque.j"]),
        ("torque.j [J/K]", ["torque.j"]),
        ("acceleration.tool.x [rad/s^2]", ["m/s^2"]),
        ("time [9**9**9*s]", ["not a unit"]),
        ("force [Ns]", ["multiple of N", "'Ns'"]),
        ("force [counts]", ["not a unit", "valid: N, kN, lbf"]),
        ("acceleration.tool.x [V]", ["not a unit", "m/s^2, g, mm/s^2"]),
        ("deflection.j [Grad]", ["not a unit", "deg"]),
        ("deflection.j [Mm]", ["not a unit", "mm"]),
        ("displacement.tool.x [min]", ["multiple of m"]),
        ("time [__import__('os')]", ["not a unit"]),
        ("force", ["channel [unit]"]),
        ("force [N", ["channel [unit]"]),
        ("force []", ["not a unit"]),
        ("deflexion.j [rad]", ["unknown channel", "'deflection'"]),
        ("deflection [rad]", ["deflection.<joint>"]),
        ("force.x [N]", ["named force"]),
        ("acceleration.tool [m/s^2]", ["acceleration.<frame>.x"]),
        ("acceleration.tool.w [m/s^2]", ["acceleration.<frame>.x"]),
        ("deflection. [rad]", ["deflection.<joint>"]),
        (" [N]", ["unknown channel"]),
    ],
)
def test_bad_headers_are_refused_in_one_line(header, words):
    with pytest.raises(InputError) as caught:
        parse_header(header)
    text = str(caught.value)
    assert "\n" not in text
    assert all(word in text for word in words), text


def test_the_grammar_tells_a_joint_from_a_frame():
    frame, _ = parse_header("velocity.tool.x [m/s]")
    assert (frame.subject, frame.axis, frame.group) == ("tool", "x", "velocity.tool")
    dotted, _ = parse_header("acceleration.arm.tip.z [m/s^2]")
    assert (dotted.subject, dotted.axis) == ("arm.tip", "z")
    joint, _ = parse_header("velocity.arm.x [rad/s]")
    assert (joint.subject, joint.axis) == ("arm.x", None)
    slide, _ = parse_header("motor_position.slide [mm]")
    assert (slide.unit, slide.kind.free_offset) == ("m", True)
    assert parse_channel("force")[0].header == "force [N]"


def struck(**channels):
    """What is needed to predict one percussion record that holds such channels."""
    time = np.arange(-50, 250) * 1e-3
    record = Record.from_arrays(
        "r01.csv", time, {name: np.zeros(time.size) for name in channels},
        pose=[0.1, 0.2, 0.3], direction=[0.0, 1.0, 0.0],
    )  # fmt: skip
    blows = {"force": 300.0, "period": 0.04, "width": 0.004, "hits": 3}
    robot = load_robot("fanuc_like_3dof")
    campaign = Campaign.from_records([record], robot=robot.name, excitation=blows)
    return robot, percussion_setups(robot, campaign)[0]


def test_a_channel_that_nothing_predicts_is_told_by_name():
    with pytest.warns(PicchioWarning, match=r"r01.csv: torque.joint_1 is not used"):
        _, setup = struck(**{"torque.joint_1": 0, "deflection.joint_1": 0})
    assert setup.groups == ("deflection",)


def test_a_kind_that_is_ac_coupled_reads_through_its_corner(monkeypatch):
    """As the same reading behind a high-pass, whose corner a sensor of its own may move."""
    kind = ChannelKind("geophone", "frame", ("m/s",), True, reader=velocity, ac_corner=4.5)
    monkeypatch.setattr(channels_module, "KINDS", [*channels_module.KINDS, kind])
    parse_channel.cache_clear()
    robot, setup = struck(**{"geophone.tool.x": 0, "velocity.tool.x": 0})
    parse_channel.cache_clear()
    highpass = effect_class("sensor_highpass")
    behind = setup.predict(Model(robot).with_effects([highpass("velocity.tool", frequency=4.5)]))
    found = setup.predict(Model(robot))
    assert np.array_equal(found["geophone.tool.x"], behind["velocity.tool.x"])
    assert not np.allclose(found["geophone.tool.x"], found["velocity.tool.x"])
    lower = setup.predict(Model(robot).with_effects([highpass("geophone.tool", frequency=1.0)]))
    assert not np.allclose(lower["geophone.tool.x"], found["geophone.tool.x"])


def test_values_in_si_keep_their_bits():
    _, convert = conversion("rad", ("rad", "m"))
    values = np.random.default_rng(1).normal(size=50)
    assert (convert(values) == values).all()
