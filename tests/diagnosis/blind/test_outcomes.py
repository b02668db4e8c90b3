"""Verdicts in worlds that are a little wrong, judged."""

import math
from types import SimpleNamespace

import numpy as np
import outcomes
import pytest
import trial
import trial_tables

import picchio
from picchio.diagnosis.result import Value
from worlds import campaign as worlds

BOTH = ("accelerometer.tool", "deflection")
SOFT = ("joint_stiffness", "joint_2")
HEAVY = ("payload", "tool")


def judged(hidden, verdict, claimed=(), alternatives=(), kind="single", errors=None, groups=BOTH):
    truth = {
        "causes": [{"effect": e, "target": t, "parameters": {}} for e, t in hidden],
        "noise": dict.fromkeys(groups, 1.0),
        "nuisances": {"stiffness": {"joint_1": 1.0, "joint_2": 1.0}},
        "errors": errors or {},
    }
    row = {"verdict": verdict, "claimed": list(map(list, claimed)),
           "alternatives": [list(map(list, each)) for each in alternatives]}  # fmt: skip
    return outcomes.judge({"kind": kind}, truth, row)


def test_the_claimed_set_or_one_of_at_most_three_alternatives_is_right():
    for verdict in ("named", "partial", "ambiguous"):
        assert judged([HEAVY], verdict, [HEAVY])["outcome"] == "right"
    others = [[SOFT], [HEAVY]]
    assert judged([HEAVY], "ambiguous", [("cable", "link_2")], others)["outcome"] == "right"
    many = [[SOFT], [("cable", "link_2")], [("cable", "link_3")], [HEAVY]]
    assert judged([HEAVY], "ambiguous", [("hysteresis", "joint_1")], many)["outcome"] == "undecided"
    assert judged([HEAVY, SOFT], "named", [SOFT, HEAVY])["outcome"] == "right"
    assert judged([HEAVY, SOFT], "named", [HEAVY])["outcome"] == "undecided"
    assert judged([HEAVY], "unexplained")["outcome"] == "undecided"
    assert judged([HEAVY], "nothing-wrong")["outcome"] == "undecided"


def test_what_is_neither_hidden_nor_alike_is_a_wrong_name_where_it_is_claimed():
    for verdict in ("named", "partial"):
        found = judged([HEAVY], verdict, [HEAVY, SOFT])
        assert found["outcome"] == "wrong" and found["false"] == [list(SOFT)]
    assert judged([HEAVY], "ambiguous", [SOFT])["outcome"] == "undecided"
    assert judged([], "partial", [SOFT], kind="null")["outcome"] == "wrong"
    assert judged([], "unexplained", kind="null")["outcome"] == "undecided"
    assert judged([], "nothing-wrong", kind="null")["outcome"] == "right"
    mass = ("tuned_mass", "tool")
    assert judged([mass], "unexplained", kind="outside")["outcome"] == "right"
    assert judged([mass], "partial", [SOFT], kind="outside")["outcome"] == "wrong"
    assert judged([HEAVY], "named", [HEAVY], kind="left-out")["outcome"] == "wrong"


def test_what_the_catalogue_has_learnt_since_is_taken_out_of_it():
    for outside in (("tuned_mass", "tool"), ("counterbalance", "joint_2")):
        assert judged([outside], "unexplained", kind="outside")["outcome"] == "right"
        assert (
            judged([outside], "named", [("payload", "tool")], kind="outside")["outcome"] == "wrong"
        )


def test_a_cause_is_right_up_to_what_the_records_cannot_tell():
    servo = ("servo_compliance", "joint_2")
    assert judged([SOFT], "named", [servo])["outcome"] == "right"
    assert judged([SOFT], "named", [("servo_compliance", "joint_1")])["outcome"] == "wrong"
    turns = ("base_compliance", "rz")
    assert judged([turns], "named", [("joint_stiffness", "joint_1")])["outcome"] == "right"
    force, gain = ("force_amplitude", "tool"), ("sensor_gain", "accelerometer.tool")
    assert judged([force], "named", [gain], groups=BOTH[:1])["outcome"] == "right"
    assert judged([force], "named", [gain])["outcome"] == "wrong"


def test_a_tolerance_truly_exceeded_may_be_told():
    off = {
        "stiffness": {"joint_1": 0.0, "joint_2": 0.2},
        "direction": {"r01.csv": [0.0, 0.021, 0.0]},
    }
    for cause in (SOFT, ("force_direction", "tool")):
        found = judged([], "named", [cause], errors=off, kind="null")
        assert found["outcome"] == "undecided" and not found["false"]
    assert len(found["exceeded"]) == 2
    assert judged([HEAVY], "named", [HEAVY, SOFT], errors=off)["outcome"] == "right"
    assert judged([HEAVY], "named", [SOFT], errors=off)["outcome"] == "undecided"
    assert judged([SOFT], "named", [SOFT], errors=off)["outcome"] == "right"
    assert judged([], "named", [("joint_stiffness", "joint_1")], errors=off)["outcome"] == "wrong"


def test_true_values_hold_what_was_drawn_of_their_tolerance():
    _, truth = worlds.make(seed=2, mismatch=1.0, records=3, hits=1, ring=0.1, causes=[
        ("sensor_gain", "deflection", {"gain": 1.2}),
        ("tool_offset", "tool", {"x": 0.03, "y": 0.0, "z": 0.0}),
        ("sensor_misalignment", "accelerometer.tool", {"rx": 0.1, "ry": 0.0, "rz": 0.0}),
        ("payload", "tool", {"mass": 2.0}),
    ])  # fmt: skip
    gain, offset, angle, load = truth["causes"]
    drawn = truth["errors"]
    true = outcomes.true_value(gain, "gain", truth)
    assert true == pytest.approx(1.2 * (1.0 + drawn["sensor_gain"]["deflection"]))
    x = outcomes.true_value(offset, "x", truth)
    assert x == pytest.approx(0.03 + drawn["tool_point"]["tool"][0])
    near = drawn["sensor_angle"]["accelerometer.tool"][0]
    rx = outcomes.true_value(angle, "rx", truth)
    assert rx == pytest.approx(0.1 + near, abs=1e-4)
    assert outcomes.true_value(load, "mass", truth) == 2.0
    world = truth["world"]
    assert world.sensor(world.bench(0), "deflection").gain == pytest.approx(true)


def test_cases_of_all_sizes_of_mismatch_share_their_draw():
    case = {"robot": "fanuc_like_3dof", "kind": "null", "snr": 40, "draw": 3, "records": 3}
    twice = {**case, "mismatch": 2, "only": ["pose"], "sensors": ["accelerometer"]}
    assert trial.name_of(twice).endswith("/3/2 times wrong/pose/accelerometer")
    assert trial.seed_of(case, 7) == trial.seed_of(twice, 7)
    made, truth = trial.make(twice, 7)
    assert made.tolerance.pose == 3.5e-4 and truth["mismatch"] == 2.0
    assert truth["errors"]["force"] == {"tool": 0.0} and truth["errors"]["pose"]["joint_1"] != 0.0
    assert {c.split(".")[0] for c in made.records[0].channels} == {"accelerometer"}


def test_the_table_counts_what_was_judged(capsys):
    rows = [
        {"robot": "ur10", "kind": "single", "mismatch": 1.0, "sensors": "all", "verdict": verdict,
         "outcome": outcome, "seconds": 10.0 + i, "errors": {"payload.mass": [0.01, pull]},
         "burst": {"extended": {"peak": [0.02, -0.3], "life": [0.1]}}}
        for i, (verdict, outcome, pull) in enumerate(
            [("named", "right", 1.7), ("named", "wrong", 0.1), ("partial", "undecided", math.nan)])
    ]  # fmt: skip
    rows.append(rows[2] | {"kind": "null", "verdict": "unexplained", "errors": {}})
    trial_tables.print_mismatch(rows)
    head, null, single = capsys.readouterr().out.strip().splitlines()[:3]
    assert null.split()[:8] == ["ur10", "null", "1", "all", "1", "0", "0", "1"]
    assert single.split()[:8] == ["ur10", "single", "1", "all", "3", "1", "1", "1"]
    assert "1/2" in single and "2/2" in single and head.split()[-1] == "seconds"


def test_what_is_told_of_springs_and_lives_is_held_against_the_truth(capsys):
    robot = picchio.load_robot("fanuc_like_3dof")
    spring = robot.flexible_joints[0]
    ratio = float(np.mean(robot.damping_ratio))
    drawn = dict.fromkeys(robot.flexible_names, 1.0) | {spring.name: 1.02}
    truth = {"nuisances": {"stiffness": drawn, "damping_ratio": 1.0}, "causes": []}
    told = {
        f"stiffness.{spring.name}": Value(1.04 * spring.stiffness, 0.01 * spring.stiffness, ""),
        "damping_ratio": Value(0.7 * ratio, 0.1 * ratio, "1"),
        "force": Value(300.0, 3.0, "N"),
    }
    known = outcomes.known(SimpleNamespace(nuisances=told), robot, truth)
    assert known == {f"stiffness.{spring.name}": 2.0, "damping_ratio": -3.0}
    truth["causes"] = [{"effect": "joint_stiffness", "target": spring.name}]
    judged = outcomes.known(SimpleNamespace(nuisances=told), robot, truth)
    assert judged == {"damping_ratio": -3.0}  # the spring is judged as a cause
    lives = {"joint_1": [0.1, -0.2, 0.2], "robot": [0.3, -0.2, 0.2]}
    trial_tables.print_known([{"known": known, "lives": lives}, {"known": {"damping_ratio": 0.1}}])
    springs, arm, joints = capsys.readouterr().out.strip().splitlines()
    assert "3 values of 2 campaigns: 33.3 % within the 90 % interval, 33.3 %" in springs
    assert arm.startswith("robot's life") and "0 of 1 within" in arm
    assert joints.startswith("joint's life") and "1 of 1 within" in joints and "20 %" in joints
