"""Percussion and motion records of one robot: one set of causes, one verdict.

The blows come from the independent simulators in `worlds`, the motions from Pinocchio's inverse
dynamics (`motion_records`): neither uses the model that is diagnosed.
"""

from __future__ import annotations

import json
import math
import re
import tomllib

import motion_records
import numpy as np
import pinocchio as pin
import pytest
from lxml import html as lxml_html

import picchio
from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record
from picchio.diagnosis.identify import identification
from picchio.diagnosis.mixed import _agreement, joint_verdict
from picchio.diagnosis.result import Estimate, Gain, Value
from picchio.model.effects.registry import effect_class
from worlds import campaign as worlds

ARM = motion_records.ARM
PAYLOAD = ("payload", "tool", {"mass": 5.0})
SOFTER = ("joint_stiffness", "joint_1", {"scale": 0.7})


def mixed(blows, moves, seed=5, records=6):
    """(robot, campaign of both kinds, truth of the blows)."""
    robot = picchio.load_robot(ARM)
    hit, truth = worlds.make(
        robot=ARM, seed=seed, causes=blows, sensors=("accelerometer.tool", "deflection"),
        records=records,
    )  # fmt: skip
    moving = motion_records.campaign(robot, moves, seed)
    table = hit.table.model_dump(exclude_none=True)
    kept = {key: value for key, value in table.items() if key not in ("format", "record")}
    return robot, Campaign.from_records([*hit, *moving], **kept), truth


def pairs(found):
    return {(c.effect, c.target) for c in found.causes}


@pytest.fixture(scope="module")
def case():
    """A payload that both kinds show, a soft joint that blows show, friction that motions show."""
    return mixed([PAYLOAD, SOFTER], {"payload": 5.0, ("viscous", 2): 30.0})


@pytest.fixture(scope="module")
def found(case):
    robot, campaign, _ = case
    return picchio.diagnose(robot, campaign, workers=1)


@pytest.mark.slow
def test_both_kinds_of_records_are_used(case, found):
    _, campaign, _ = case
    gain = found.gain
    assert {*gain.train_records, *gain.held_out_records} == {r.file for r in campaign}
    assert found.verdict == "named"
    assert pairs(found) == {
        ("payload", "tool"), ("joint_stiffness", "joint_1"), ("viscous_friction", "joint_3"),
    }  # fmt: skip
    assert gain.explained > 0.99
    assert any(name.startswith("stiffness.") for name in found.nuisances)
    assert set(found.details["motion"].nuisances) <= set(found.nuisances)


@pytest.mark.slow
def test_what_both_show_has_one_value_that_both_determine(found):
    (told,) = (s for s in found.shared if s["effect"] == "payload")
    assert told["status"] == "both"
    (cause,) = (c for c in found.causes if c.effect == "payload")
    own, other = (told[kind]["mass"] for kind in ("percussion", "motion"))
    mass = cause.parameters["mass"]
    weights = [1.0 / v["std"] ** 2 for v in (own, other)]
    mean = (own["value"] * weights[0] + other["value"] * weights[1]) / sum(weights)
    assert mass.value == pytest.approx(mean, abs=0.3 / math.sqrt(sum(weights)))
    assert mass.std < 1.05 * min(own["std"], other["std"])
    assert mass.value == pytest.approx(5.0, abs=5.0 * mass.std)
    apart = {s["effect"]: s["status"] for s in found.shared}
    assert apart["joint_stiffness"] == "percussion"


@pytest.mark.slow
def test_the_extended_model_and_the_json_are_whole(found, tmp_path):
    said = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert said["format"] == "picchio-diagnosis/1"
    assert {kind: told["verdict"] for kind, told in said["records"].items()} == {
        "percussion": "named", "motion": "named",
    }  # fmt: skip
    assert said["life"]["extended"]["utilisation"] != said["life"]["baseline"]["utilisation"]
    path = tmp_path / "found.toml"
    path.write_text(found.model_text(tmp_path))
    robot = picchio.load_robot(path)
    told = {t["effect"] for t in robot.effect_tables}
    assert {"payload", "joint_stiffness"} <= told and "viscous_friction" not in told
    assert "viscous_friction of joint_3" in path.read_text()
    assert (
        "as stated here" not in path.read_text()
    )  # where all else is exact, values are those told
    (load,) = (table for table in robot.effect_tables if table["effect"] == "payload")
    (cause,) = (each for each in found.causes if each.effect == "payload")
    assert load["parameters"]["mass"] == pytest.approx(cause.parameters["mass"].value, rel=1e-9)
    life = picchio.assess(robot, picchio.load_task(robot.task_path, robot))
    after = said["life"]["extended"]["joints"]
    for joint in life.joints:
        assert after[joint.name]["utilisation"] == pytest.approx(joint.utilisation, rel=1e-9)
    page = picchio.report(found).text
    assert "The motion records" in page and "viscous friction" in page
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert "motion-left" in ids and len(ids) == len(set(ids))
    assert repr(found).startswith("<Diagnosis: named, ") and "payload" in found._repr_html_()


@pytest.mark.slow
def test_identified_joints_hold_what_both_kinds_say(case, found):
    robot, campaign, truth = case
    told = identification(campaign, found)
    said = json.loads(json.dumps(told.to_dict(), allow_nan=False))
    assert said["format"] == "picchio-identification/1"
    joints = {j["name"]: j for j in said["joints"]}
    assert set(joints) == set(robot.flexible_names)
    drawn = truth["nuisances"]["stiffness"]
    for name, nominal in zip(robot.flexible_names, robot.stiffness, strict=True):
        true = nominal * drawn[name] * (0.7 if name == "joint_1" else 1.0)
        stiffness = joints[name]["stiffness"]
        assert stiffness["low"] < stiffness["value"] < stiffness["high"]
        assert stiffness["told"] and stiffness["value"] == pytest.approx(true, rel=0.01)
    assert {c["effect"] for c in said["also"]} == {"payload", "viscous_friction"}
    assert said["residual"]["after"] < 0.2 * said["residual"]["before"]
    sidecar = tomllib.loads(told.sidecar_text())
    assert sidecar["joint"]["joint_1"]["stiffness"] == joints["joint_1"]["stiffness"]["value"]
    assert sidecar["tool"]["mass"] == pytest.approx(robot.tool.mass + 5.0, rel=0.01)
    assert "viscous_friction of joint_3" in told.sidecar_text()
    assert list(told.to_frame().index) == list(robot.flexible_names)


@pytest.mark.slow
def test_records_that_contradict_each_other_claim_nothing():
    """The arm carried something while it moved that it did not carry when it was hit."""
    robot, campaign, _ = mixed([], {"payload": 8.0})
    found = picchio.diagnose(robot, campaign, workers=1)
    assert found.verdict == "unexplained"
    assert not found.causes and ("payload", "tool") in found.leads
    assert "contradict" in found.note and "payload of tool" in found.note
    assert found.life is None


@pytest.mark.slow
def test_friction_that_only_a_motion_shows_is_in_the_drive():
    robot, campaign, truth = mixed(
        [("joint_stiffness", "joint_2", {"scale": 0.75})], {("coulomb", 1): 30.0}
    )
    found = picchio.diagnose(robot, campaign, workers=1)
    assert found.verdict == "named"
    assert pairs(found) == {("joint_stiffness", "joint_2"), ("coulomb_friction", "joint_2")}
    assert {s["effect"]: s["status"] for s in found.shared} == {
        "joint_stiffness": "percussion", "coulomb_friction": "drive",
    }  # fmt: skip
    scale = next(c for c in found.causes if c.effect == "joint_stiffness").parameters["scale"]
    assert scale.value == pytest.approx(0.75 * truth["nuisances"]["stiffness"]["joint_2"], rel=0.01)


def turning(robot, mass, seed):
    """Only the first joint moves: a payload, an inertia of that joint and a gain are one."""
    rng = np.random.default_rng(seed)
    model = robot.rigid._model.copy()
    frame = model.frames[model.getFrameId(robot.tool_frame)]
    point = pin.Inertia(mass, np.zeros(3), np.zeros((3, 3)))
    model.appendBodyToJoint(frame.parentJoint, point, frame.placement)
    time = np.arange(5000) / motion_records.RATE
    records = []
    for number in range(2):
        first = motion_records.wave(rng, time)
        q = np.array([first, np.full(time.size, 0.4), np.full(time.size, -0.6)])
        v = np.gradient(q, 1.0 / motion_records.RATE, axis=1)
        a = np.gradient(v, 1.0 / motion_records.RATE, axis=1)
        data = model.createData()
        states = zip(q.T, v.T, a.T, strict=True)
        torque = np.array([pin.rnea(model, data, *state)[0] for state in states])
        torque += 0.02 * torque.std() * rng.normal(size=time.size)
        channels = {f"motor_position.{name}": x
                    for name, x in zip(robot.joint_names, q, strict=True)}  # fmt: skip
        channels["torque.joint_1"] = torque
        records.append(Record.from_arrays(f"m{number}.csv", time, channels, kind="motion"))
    return records


@pytest.mark.slow
def test_blows_tell_apart_what_a_motion_cannot():
    robot, campaign, _ = mixed([("payload", "tool", {"mass": 12.0})], {})
    moving = turning(robot, 12.0, 1)
    alone = picchio.diagnose(robot, Campaign.from_records(moving))
    assert alone.verdict == "ambiguous"
    every = pairs(alone) | {pair for each in alone.alternatives for pair in each}
    assert {("payload", "tool"), ("joint_inertia", "joint_1")} <= every
    hit = [record for record in campaign if record.kind == "percussion"]
    table = campaign.table.model_dump(exclude_none=True)
    kept = {key: value for key, value in table.items() if key not in ("format", "record")}
    found = picchio.diagnose(robot, Campaign.from_records([*hit, *moving], **kept), workers=1)
    assert (found.verdict, pairs(found)) == ("named", {("payload", "tool")})
    assert not found.alternatives
    assert found.kinds["motion"]["verdict"] == "named"
    mass = found.causes[0].parameters["mass"]
    assert mass.value == pytest.approx(12.0, rel=0.01)


@pytest.mark.slow
def test_nothing_wrong_in_either_kind_is_nothing_wrong():
    robot, campaign, _ = mixed([], {})
    found = picchio.diagnose(robot, campaign, workers=1)
    assert found.verdict == "nothing-wrong"
    assert not found.causes and not found.leads


@pytest.mark.slow
def test_a_checks_page_shows_both_kinds_of_records():
    robot, campaign, _ = mixed([PAYLOAD], {("viscous", 2): 30.0}, records=3)
    html = picchio.report(picchio.check(campaign, robot=robot)).text
    page = lxml_html.fromstring(html)
    heads = [h.text_content() for h in page.iter("h2", "h3")]
    assert "The motion records" in heads and heads.count("Where it shows") == 2
    ids = [e.get("id") for e in page.iter() if e.get("id")]
    assert len(ids) == len(set(ids))
    for link in page.xpath("//nav/a"):  # leads to a part of the page
        assert link.get("href")[1:] in ids
    assert "torque" in page.get_element_by_id("moves").getparent().text_content()


GOOD = Gain(("a",), ("b",), 0.3, 0.011, 0.010, 4)
POOR = Gain(("c",), ("d",), 0.3, 0.29, 0.010, 4)


@pytest.mark.parametrize(
    ("blows", "moves", "gain", "causes", "contradicted", "verdict"),
    [
        ("nothing-wrong", "nothing-wrong", GOOD, False, False, "nothing-wrong"),
        ("named", "nothing-wrong", GOOD, True, False, "named"),
        ("ambiguous", "named", GOOD, True, False, "ambiguous"),
        ("named", "partial", GOOD, True, False, "partial"),
        ("named", "unexplained", GOOD, True, False, "partial"),
        ("named", "unexplained", POOR, True, False, "unexplained"),
        ("unexplained", "nothing-wrong", GOOD, False, False, "unexplained"),
        ("named", "named", GOOD, True, True, "unexplained"),
    ],
)
def test_the_verdict_of_both(blows, moves, gain, causes, contradicted, verdict):
    verdicts = {"percussion": blows, "motion": moves}
    assert joint_verdict(verdicts, gain, causes, contradicted) == verdict


def test_gains_are_put_together_channel_by_channel():
    whole = GOOD.plus(POOR)
    assert whole.channels == 8
    assert whole.baseline_nrmse == pytest.approx(0.3)
    assert whole.noise_floor_nrmse == pytest.approx(0.010)
    assert whole.extended_nrmse == pytest.approx(math.sqrt((0.011**2 + 0.29**2) / 2))
    assert whole.held_out_records == ("b", "d")


def estimate(effect, value, std, name="mass"):
    kind = effect_class(effect)
    told = kind("tool" if effect == "payload" else "joint_1", **{name: value})
    return Estimate(told, {name: std}, {name: Value(value, std, "kg")})


@pytest.mark.parametrize(
    ("own", "other", "beyond", "status"),
    [
        ((5.0, 0.01), (5.01, 0.01), True, "both"),
        ((5.0, 0.01), (5.2, 0.01), True, "both"),  # masses are no better known than that
        ((5.0, 0.01), (6.0, 0.01), True, "contradiction"),
        ((5.0, 0.5), (6.0, 0.2), True, "both"),
        ((5.0, 0.01), (6.0, 0.01), False, "drive"),  # the rotor turns while the arm moves
        ((6.0, 0.01), (5.0, 0.01), False, "contradiction"),
    ],
)
def test_when_two_values_are_one(own, other, beyond, status):
    told, why = _agreement(estimate("payload", *own), estimate("payload", *other), beyond)
    assert told == status
    assert bool(why) == (status == "contradiction")
