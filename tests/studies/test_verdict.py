"""The verdict: the part that governs is the one that is nearest to its limit, or beyond it."""

from __future__ import annotations

import dataclasses
import html
import json
import math

import pytest

import picchio
from picchio.fatigue.sn.curve import SNCurve
from picchio.visuals.report.assessment import assessment_report
from picchio.visuals.view import view

FINITE = SNCurve(name="finite", strength=60e6, cycles=1e6, slopes=(5.0,), yield_shear=400e6)
TASK = {
    "hits_per_rivet": 3,
    "excitation": {"kind": "pulse_train", "force": 300.0, "period": 0.04, "width": 0.004},
    "operation": [
        {"name": "up", "direction": [0, 0, 1], "poses": [[0.3, 0.2, -0.4], [0.3, 0.9, -1.0]]},
        {"name": "side", "direction": [0, 1, 0], "poses": [[0.7, 0.0, 0.0]]},
    ],
}
BARE = {"stiffness": 1e5, "damping_ratio": 0.03}


def arm(tmp_path, joints):
    """The three-joint arm with these entries in a sidecar, and no other shafts."""
    lines = ['format = "picchio-sidecar/1"']
    for number, entry in joints.items():
        lines.append(f"[joint.joint_{number}]")
        for key, value in ({**BARE, **entry}).items():
            text = json.dumps(value)
            if isinstance(value, dict):
                text = "{ " + ", ".join(f"{k} = {v}" for k, v in value.items()) + " }"
            lines.append(f"{key} = {text}")
    file = tmp_path / "flex.toml"
    file.write_text("\n".join(lines))
    robot = picchio.load_robot("fanuc_like_3dof", flex=file)
    # The URDF has shafts of its own, which a sidecar does not take away.
    return dataclasses.replace(
        robot,
        flexible_joints=tuple(
            j if "shaft" in joints[n] else dataclasses.replace(j, shaft=None)
            for n, j in enumerate(robot.flexible_joints, 1)
        ),
    )


def shaft(radius=0.018, length=0.04):
    return {"shaft": {"radius": radius, "length": length, "shear_modulus": 79.3e9}}


GOOD = {n: shaft() for n in (1, 2, 3)}
CASES = {
    "every shaft is fine": (GOOD, {}, "safe", "yield", 2),
    "a shaft yields": (GOOD | {2: shaft(0.0095, 0.005)}, {}, "fails", "yield", 2),
    "a shaft is softer than its joint": (
        GOOD | {3: shaft(0.018, 0.4)}, {}, "cannot-be-told", "input", 3,
    ),
    "it yields and cannot be": (GOOD | {2: shaft(0.0095, 0.2)}, {}, "fails", "yield", 2),
    "a reducer is exceeded, shafts are fine": (
        GOOD | {2: {**shaft(), "reducer": "CSG-17-100-2UH"}}, {}, "fails", "reducer", 2,
    ),
    "no part is known": ({1: {}, 2: {}, 3: {}}, {}, "cannot-be-told", "input", None),
    "one joint has no part": (GOOD | {1: {}}, {}, "cannot-be-told", "input", 1),
    "one has no part, another yields": (
        GOOD | {1: {}, 2: shaft(0.0095, 0.005)}, {}, "fails", "yield", 2,
    ),
    "a finite life": (GOOD, {"sn_curve": FINITE}, "limited", "shaft", 2),
    "reducers alone": (
        {n: {"reducer": "RV-80E-121"} for n in (1, 2, 3)},
        {}, "safe", "reducer", None,
    ),
}  # fmt: skip


@pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")
@pytest.mark.parametrize("case", CASES)
def test_the_part_that_governs(tmp_path, case):
    joints, options, status, governor, number = CASES[case]
    robot = arm(tmp_path, joints)
    found = picchio.assess(robot, picchio.task_from_dict(TASK, robot), **options)
    told = found.verdict
    assert (told.status, told.governed_by) == (status, governor), told
    if number is not None:
        assert told.joint == f"joint_{number}"
    joint, k = found.joint(told.joint), robot.flexible_names.index(told.joint)
    (operation,) = [op for op in found.operations if op.name == told.operation]
    if governor == "yield":
        strength = (
            options.get("sn_curve") or picchio.load_sn_curve("42CrMo4-QT-shaft")
        ).yield_shear
        assert told.margin == pytest.approx(strength / joint.peak_total_stress)
        assert operation.peak_total_stress[told.pose, k] == joint.peak_total_stress
    elif governor == "reducer":
        assert told.margin == pytest.approx(1.0 / joint.reducer_utilisation)
        assert operation.reducer_utilisation[told.pose, k] == joint.reducer_utilisation
    else:
        assert math.isnan(told.margin)
    assert (told.margin < 1.0) == (status == "fails")
    if status != "safe":
        assert "No part fails" not in told.headline
    # One verdict, in the JSON and on every page.
    as_json = json.loads(json.dumps(found.to_dict()))["verdict"]
    assert as_json["headline"] == told.headline and as_json["status"] == status
    assert (as_json["margin"] is None) == (not math.isfinite(told.margin))
    assert html.escape(told.headline) in found._repr_html_()


def test_every_reason_that_lowers_trust_is_told(tmp_path):
    joints = GOOD | {1: {**shaft(), "estimated": True}, 2: {"reducer": "RV-80E-121"}}
    joints[3] = {**shaft(length=0.01)}
    robot = arm(tmp_path, {n: {"estimated": False, **entry} for n, entry in joints.items()})
    work = TASK | {"operation": [TASK["operation"][0] | {"poses": [[9.0, 0.2, -0.4]]}]}
    with pytest.warns(picchio.PicchioWarning):
        found = picchio.assess(robot, picchio.task_from_dict(work, robot))
    reasons = "\n".join(found.verdict.reasons)
    for part in ("joint_1 is beyond its limits",
                 "reducers not checked in joint_1, joint_3: none given",
                 "joint_1: stiffness and damping are estimates", "within a factor of 2 (one",
                 "42CrMo4-QT-shaft: engineering assumption, no source",
                 "no shaft is given for joint_2", "false brinelling", "times stiffer"):  # fmt: skip
        assert part in reasons, part
    content = found.to_dict()
    assert any("beyond its limits" in line for line in content["warnings"])
    assert any("no shaft is given for joint_2" in line for line in content["warnings"])
    assert set(content["warnings"]) <= set(content["verdict"]["reasons"])


def test_warnings_of_loading_are_kept(tmp_path):
    robot = arm(tmp_path, GOOD | {1: {**shaft(), "damping_ratio": 1.5}})
    assert any("overdamped" in line for line in robot.warnings)
    found = picchio.assess(robot, picchio.task_from_dict(TASK, robot))
    assert set(robot.warnings) <= set(found.to_dict()["warnings"])


@pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")
def test_a_limit_kept_only_at_the_stated_rate_cannot_be_told(tmp_path):
    robot = arm(tmp_path, {n: {**entry, "damping_ratio": 0.003} for n, entry in GOOD.items()})
    work = TASK | {"hits_per_rivet": 60, "operation": [TASK["operation"][1]]}
    own = picchio.assess(robot, picchio.task_from_dict(work, robot)).operations[0]
    period = 1.0 / own.natural_frequencies[0, 0]
    # 4 % off the resonance, so that a little faster or slower is on it.
    blows = TASK["excitation"] | {"period": float(1.04 * period), "width": float(0.1 * period)}
    task = picchio.task_from_dict(work | {"excitation": blows}, robot)
    found = picchio.assess(robot, task)
    assert found.joints[0].rate_sensitivity > 2.0
    # What was computed is what blows at the other rate give.
    faster = blows | {"period": 0.95 * blows["period"]}
    there = picchio.assess(robot, picchio.task_from_dict(work | {"excitation": faster}, robot))
    ratio = there.joints[0].peak_deflection / found.joints[0].peak_deflection
    assert found.joints[0].rate_sensitivity == pytest.approx(ratio)
    assert any("a resonance is near" in line for line in found.verdict.reasons)
    # Just below the endurance limit as stated, far above it at the other rate.
    force = 0.9 * blows["force"] / found.joints[0].utilisation
    task = picchio.task_from_dict(work | {"excitation": blows | {"force": force}}, robot)
    strong = SNCurve(name="strong", strength=259.65e6, cycles=1e6, slopes=(8.0,), knees=(1e6,))
    told = picchio.assess(robot, task, sn_curve=strong).verdict
    assert (told.status, told.governed_by, told.joint) == ("cannot-be-told", "resonance", "joint_1")


def test_report_and_scene_say_the_same(tmp_path):
    robot = arm(tmp_path, GOOD)
    task = picchio.task_from_dict(TASK, robot)
    found = picchio.assess(robot, task)
    assert found.verdict.headline in assessment_report(found, robot, task)
    scene = view(robot, task=task)
    assert scene.verdict == found.verdict.headline == scene.to_dict()["verdict"]
    assert found.verdict.headline in scene.html()
    # A change of the joints changes the verdict: it is not a text that was kept.
    worn = [dataclasses.replace(j, rivets_to_failure=2e3) for j in found.joints]
    assert dataclasses.replace(found, joints=tuple(worn)).verdict.status == "limited"


def test_poses_are_counted_from_one_everywhere(tmp_path):
    robot = arm(tmp_path, GOOD)
    found = picchio.assess(robot, picchio.task_from_dict(TASK, robot))
    told = found.to_dict()
    joint = next(j for j in told["joints"] if j["name"] == told["verdict"]["joint"])
    place = f"{joint['worst_operation']}, pose {joint['worst_pose']}"
    assert place in assessment_report(found, robot, picchio.task_from_dict(TASK, robot))
    assert told["verdict"]["pose"] == found.verdict.pose + 1
    assert (found.to_frame()["worst_pose"] == [j["worst_pose"] for j in told["joints"]]).all()
    assert all(entry["pose"] >= 1 for entry in told["false_brinelling"])


@pytest.mark.parametrize(
    ("robot", "case", "code"),
    [
        ("fanuc_like_3dof", "every shaft is fine", 0),
        ("fanuc_like_3dof", "a shaft yields", 3),
        ("panda", None, 3),
    ],
)
def test_strict_says_it_by_the_exit_status(tmp_path, in_process, robot, case, code):
    command = ["assess", robot]
    if case:
        arm(tmp_path, CASES[case][0])
        command += ["--flex", tmp_path / "flex.toml"]
    out = tmp_path / "life.json"
    done = in_process(*command, "--strict", "--json", out)
    assert done.returncode == code, done.stderr
    told = json.loads(out.read_text())["verdict"]
    # Safe by picchio's own estimate of the drives is no promise, and is not called one.
    assert told["estimated"] == (robot == "panda")
    assert told["headline"].startswith("Probably safe. ") == (robot == "panda")
    assert told["headline"] in " ".join(done.stdout.split())
    assert in_process(*command).returncode == 0


def test_a_guns_recoil_spring_is_no_joint_that_lacks_a_part(tmp_path):
    """It is a part of the tool: neither shaft nor reducer is missing there."""
    sidecar = tmp_path / "gun.toml"
    sidecar.write_text(
        'format = "picchio-sidecar/1"\n[tool]\nframe = "tool"\n[gun]\nmass = 1.5\n'
        "recoil_stiffness = 3e4\ndamping_ratio = 0.1\n"
    )
    robot = picchio.load_robot("fanuc_like_3dof", flex=sidecar)
    task = picchio.load_task(robot.task_path, robot)
    found = picchio.assess(robot, task, steady_check=False)
    assert found.verdict.status == "safe"
    assert not any("gun_recoil" in reason for reason in found.verdict.reasons)
    allowed = picchio.allowable(robot, task, 1e4)
    assert [joint.joint for joint in allowed] == ["joint_1", "joint_2", "joint_3"]
    assert "gun_recoil" not in " ".join(allowed.notes)


@pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")
@pytest.mark.parametrize(
    ("part", "key"),
    [({"reducer": "CSG-40-100-2UH"}, "reducer"), (shaft(0.018, 0.04), "yield")],
)
def test_a_limit_that_drawn_cases_exceed_is_not_safe(tmp_path, part, key):
    robot = arm(tmp_path, {n: {**part, "estimated": n == 3} for n in (1, 2, 3)})
    curve = picchio.load_sn_curve("42CrMo4-QT-shaft")
    curve = dataclasses.replace(curve, yield_shear=60e6)  # so that it governs, and not fatigue

    def at(force):
        work = TASK | {"excitation": TASK["excitation"] | {"force": force}}
        task = picchio.task_from_dict(work, robot)
        return picchio.assess(
            robot, task, gravity_balanced=True, steady_check=False, sn_curve=curve
        )

    def used(joint):
        return getattr(joint, f"{key}_utilisation")

    weak = at(300.0)
    told, joint = weak.verdict, weak.joint(weak.verdict.joint)
    assert (told.status, told.governed_by) == ("safe", key)
    low, high = told.margin_interval
    assert low < told.margin and 1.0 < low < high
    assert " to " in told.headline.partition("%")[0]
    entry = next(
        e for e in json.loads(json.dumps(weak.to_dict()))["joints"] if e["name"] == told.joint
    )
    assert entry[f"{key}_utilisation_interval"] == pytest.approx([1.0 / high, 1.0 / low])
    assert entry["peak_torque_interval"][0] < entry["peak_torque_interval"][1]
    # Just below its limit as stated, beyond it in more than a tenth of the cases: a linear arm.
    force = 300.0 * 0.99 / max(used(j) for j in weak.joints)
    told = at(force).verdict
    assert (told.status, told.governed_by) == ("cannot-be-told", key)
    if told.joint == joint.name:
        assert told.margin_interval == pytest.approx((low * 300.0 / force, high * 300.0 / force))
    assert told.margin_interval[0] < 1.0 < told.margin
    assert at(1.02 * force).verdict.status == "fails"
