"""What a verdict does not cover is named, and no safety is promised over it."""

from __future__ import annotations

import dataclasses
import json
import re

import numpy as np
import pytest

import picchio
from picchio.cli.life.assess import show
from picchio.cli.main import run
from picchio.robot.annotations.tool_choice import tool_place
from picchio.studies.default_task import default_task, task_of

pytestmark = pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")

LINK = (
    '<link name="l{k}"><inertial><origin xyz="0 0 {half}"/><mass value="{mass}"/><inertia '
    'ixx="{i}" ixy="0" ixz="0" iyy="{i}" iyz="0" izz="{z}"/></inertial></link>'
)
JOINT = (
    '<joint name="j{k}" type="{type}"><parent link="{parent}"/><child link="l{k}"/>'
    '<origin xyz="0 0 {at}"/><axis xyz="{axis}"/><limit lower="-2.5" upper="2.5" '
    'effort="{effort}" velocity="2"/></joint>'
)
# mass kg, length m, axis, effort N m
ARM = [
    (9.0, 0.3, "0 0 1", 900.0),
    (14.0, 0.6, "0 1 0", 900.0),
    (6.0, 0.5, "0 1 0", 500.0),
    (2.0, 0.1, "0 0 1", 300.0),
    (1.5, 0.1, "0 1 0", 300.0),
    (0.5, 0.1, "0 0 1", 200.0),
]


def urdf(wrong=(), slides=(), massless=(), planar=(), links=ARM, tool=True, tip=0.08):
    """Rods along z: links by number with an impossible tensor or none, joints that slide."""
    text, parent, at = ['<robot name="rods"><link name="l0"/>'], "l0", 0.1
    for k, (mass, length, axis, effort) in enumerate(links, 1):
        i = mass * length**2 / 12
        text.append(
            f'<link name="l{k}"/>' if k in massless else
            LINK.format(k=k, half=length / 2, mass=mass, i=i, z=-i if k in wrong else 0.1 * i)
        )  # fmt: skip
        kind = "prismatic" if k in slides else "planar" if k in planar else "revolute"
        text.append(JOINT.format(k=k, type=kind, parent=parent, at=at, axis=axis, effort=effort))
        parent, at = f"l{k}", length
    if tool:
        text.append(
            f'<link name="tool0"/><joint name="t" type="fixed"><parent link="{parent}"/>'
            f'<child link="tool0"/><origin xyz="0 0 {tip}"/></joint>'
        )
    return "".join(text) + "</robot>"


def one_blow(robot, **changed):
    """A task of one blow at one place."""
    task = default_task(robot)
    (first, *_) = task.operations
    short = dataclasses.replace(first, poses=first.poses[:1], hits_per_rivet=1)
    return dataclasses.replace(task, operations=(short,), **changed)


def assessed(tmp_path, text, **given):
    """At the stated values: what is looked at does not depend on the intervals."""
    file = tmp_path / "rods.urdf"
    file.write_text(text)
    robot = picchio.load_robot(file, **given)
    return picchio.assess(robot, one_blow(robot), uncertainty=False, steady_check=False)


LEFT_OUT = {
    "a tensor that cannot be, in the middle": ({"wrong": [2]}, {"j1", "j2"}, "l2"),
    "a tensor that cannot be, near the base": ({"wrong": [1]}, {"j1"}, "l1"),
    "a tensor that cannot be, in the wrist": ({"wrong": [4]}, {"j1", "j2", "j3", "j4"}, "l4"),
    "a rail below it": ({"slides": [1]}, {"j1"}, "slides"),
    "a slide in the middle": ({"slides": [3]}, {"j3"}, "slides"),
    "no mass at the end": ({"massless": [6]}, {"j6"}, "moves no mass"),
}


@pytest.mark.parametrize("case", LEFT_OUT)
def test_a_joint_left_out_is_named_and_nothing_is_safe_over_it(tmp_path, case, capsys):
    how, names, why = LEFT_OUT[case]
    found = assessed(tmp_path, urdf(**how))
    told = found.verdict
    left = {gap.joint: gap.why for gap in told.not_assessed if gap.part == "joint"}
    assert left.keys() == names
    assert {j.name for j in found.joints} | names == {f"j{k}" for k in range(1, 7)}
    assert all(why in text for text in left.values())
    assert told.status == "cannot-be-told" and told.governed_by == "input"
    content = json.loads(json.dumps(found.to_dict()))["verdict"]["not_assessed"]
    assert {"joint", "part", "why"} == set(content[0])
    show(found, one_blow(picchio.load_robot(tmp_path / "rods.urdf")))
    text = " ".join(capsys.readouterr().out.split())
    for name in names:
        assert re.search(rf"\b{name}\b[^.]*(left out|left rigid)", text), name


def test_the_same_arm_with_nothing_wrong_is_judged_by_its_parts(tmp_path):
    told = assessed(tmp_path, urdf()).verdict
    assert not [gap for gap in told.not_assessed if gap.part == "joint"]
    assert told.governed_by == "reducer" and told.covers == ("reducer",)


@pytest.mark.parametrize(
    ("lacking", "covers", "headline"),
    [
        ("reducer", ("shaft",), r"Shafts: unlimited life; reducers: not checked\."),
        ("", ("shaft", "reducer"), r"Shafts: unlimited life; reducers: within their limits\."),
        ("shaft", ("reducer",), r"Shafts: not checked; reducers: within their limits\."),
        ("some", ("shaft",), r"reducers: within their limits \(not checked in joint_1\)\."),
    ],
)
def test_the_headline_says_what_is_safe_and_what_was_not_checked(
    tmp_path, lacking, covers, headline
):
    # fmt: off
    rows = ['format = "picchio-sidecar/1"']
    for k in (1, 2, 3):
        rows += [f"[joint.joint_{k}]", "stiffness = 2.4e5", "damping_ratio = 0.03"]
        if lacking != "shaft":
            rows.append("shaft = { radius = 0.0245, length = 0.187, shear_modulus = 79.3e9 }")
        if lacking != "reducer" and (lacking, k) != ("some", 1):
            rows.append('reducer = "RV-80E-121"')
    # fmt: on
    (tmp_path / "f.toml").write_text("\n".join(rows))
    robot = picchio.load_robot("fanuc_like_3dof", flex=tmp_path / "f.toml")
    if lacking == "shaft":  # the URDF has shafts of its own
        bare = tuple(dataclasses.replace(joint, shaft=None) for joint in robot.flexible_joints)
        robot = dataclasses.replace(robot, flexible_joints=bare)
    told = picchio.assess(robot, one_blow(robot), steady_check=False).verdict
    assert told.status == "safe" and told.covers == covers
    assert re.search(headline, told.headline), told.headline
    missing = {
        (gap.joint, gap.part) for gap in told.not_assessed if gap.part in ("shaft", "reducer")
    }
    every = {f"joint_{k}" for k in (1, 2, 3)}
    assert {name for name, part in missing if part == "reducer"} == (
        every if lacking == "reducer" else {"joint_1"} if lacking == "some" else set()
    )


@pytest.mark.parametrize("wrong", [[2], [5], [1, 3]])
def test_an_impossible_value_waits_whatever_else_fails(tmp_path, wrong):
    # Joints so weak that the arm would fail.
    weak = [(mass, length, axis, 1.2 * effort) for mass, length, axis, effort in ARM]
    found = assessed(tmp_path, urdf(wrong=wrong, links=weak))
    assert found.verdict.status == "cannot-be-told"
    assert "cannot be right" in found.verdict.headline
    robot = picchio.load_robot(tmp_path / "rods.urdf")
    bare = dataclasses.replace(robot, spreads={})
    allowed = picchio.allowable(bare, one_blow(robot), 1e6, thorough=False)
    assert not allowed.yes and allowed.tone == "cannot-be-told"


TOOLS = {
    "a flange ahead of a wrist that rolls": ({}, None, (0, 0, 0.08), "l6", "j6", False),
    "no frame: the last link's own": ({"tool": False}, None, (0, 0, 0), "l6", "j6", True),
    "on the hinge of an elbow": (
        {"links": ARM[:3], "tip": 0.0}, None, (0, 0, 0), "l3", "j3", True,
    ),
    "ahead of the elbow": ({"links": ARM[:3], "tip": 0.5}, None, (0, 0, 0.5), "l3", "", False),
    "asked for": ({"tool": False}, "l6", (0, 0, 0), "l6", "j6", False),
}  # fmt: skip


@pytest.mark.parametrize("case", TOOLS)
def test_the_tool_frame_is_told_first_with_its_reason(tmp_path, case, capsys):
    how, asked, xyz, link, joint, doubt = TOOLS[case]
    (tmp_path / "rods.urdf").write_text(urdf(**how))
    place = tool_place(picchio.load_robot(tmp_path / "rods.urdf", tool=asked))
    assert (place.link, place.joint, bool(place.doubt)) == (link, joint, doubt)
    np.testing.assert_allclose(place.xyz, xyz, atol=1e-9)
    found = assessed(tmp_path, urdf(**how), tool=asked)
    content = found.to_dict()
    assert content["tool"]["link"] == link and content["tool"]["why"]
    assert any("lies on the axis" in line for line in content["warnings"]) == doubt
    show(found, one_blow(picchio.load_robot(tmp_path / "rods.urdf", tool=asked)))
    first = " ".join(capsys.readouterr().out.split("\njoint ")[0].split())
    assert ("lies on the axis of" in first) == bool(joint)
    at = ", ".join(f"{part:g}" for part in xyz)
    assert f"frame {place.frame}, at ({at}) m in {link}, because " in first


@pytest.mark.parametrize("name", ["fanuc_like_3dof", pytest.param("ur10", marks=pytest.mark.slow)])
def test_an_answer_without_a_task_leads_with_the_force_allowed(name, capsys, tmp_path):
    path = tmp_path / "o.json"
    assert run(["assess", name, "--json", str(path)]) == 0
    out = capsys.readouterr().out
    assert out.index("Allowable force of one blow") < out.index("\njoint ")
    found = json.loads(path.read_text())["allowable"]
    assert {"met", "life", "survival", "force", "hits", "rivets", "radius", "reducer"} <= set(found)
    # At that force the robot just holds, at 1 % more it does not: from the forward computation.
    robot = picchio.load_robot(name)
    for factor, holds in ((0.999, True), (1.01, False)):
        life = picchio.allowable(
            robot, task_of(robot, force=factor * found["force"]), found["life"], thorough=False
        )
        assert all(joint.met for joint in life) == holds
