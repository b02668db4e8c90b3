"""From motion records to a page, a model file and a life."""

import html.parser
import json
import re
import subprocess
import sys
from dataclasses import replace

import pytest
from motion_records import ARM, campaign

import picchio
from picchio.diagnosis.life import NO_SHAFT
from picchio.diagnosis.motion.conclude.during_blows import (
    NO_TASK,
    STANDS,
    effects_during_blows,
    motion_life,
)
from picchio.diagnosis.motion.diagnosis import diagnose_motion
from picchio.diagnosis.result import differences, in_words
from picchio.robot.loading.load import load_robot
from picchio.studies.assessment.run import assess
from picchio.studies.tasks import load_task

MAIN = "from picchio.cli.main import main; main()"
MASS = 8.0


@pytest.fixture(scope="module")
def robot():
    return load_robot(ARM)


@pytest.fixture(scope="module")
def heavy(robot):
    """A payload and dry friction."""
    return campaign(robot, {"payload": MASS, ("coulomb", 1): 30.0}, 5)


@pytest.fixture(scope="module")
def diagnosis(robot, heavy):
    return diagnose_motion(robot, heavy)


def page_of(diagnosis, robot, folder=None):
    task = load_task(robot.task_path, robot)
    details = {
        "motion": diagnosis, "motion_life": motion_life(robot, task, diagnosis),
        "during_blows": effects_during_blows(diagnosis), "folder": folder,
        "saved": {"robot": ARM, "effects": []},
    }  # fmt: skip
    return picchio.report(replace(diagnosis, details=details)).text


def test_only_what_acts_while_the_tool_hits_is_carried_over(diagnosis):
    assert {(c.effect, c.target) for c in diagnosis.causes} == {
        ("payload", "tool"), ("coulomb_friction", "joint_2")
    }  # fmt: skip
    sorted_ = effects_during_blows(diagnosis)
    assert [e.name for e in sorted_.effects] == ["payload"]
    assert [(e.name, why) for e, why in sorted_.left] == [("coulomb_friction", STANDS)]


def test_the_life_is_that_of_a_robot_with_the_mass_at_its_tool(robot, diagnosis, tmp_path):
    """Against a robot whose sidecar says that the tool weighs so much."""
    task = load_task(robot.task_path, robot)
    found = motion_life(robot, task, diagnosis)
    added = next(c for c in diagnosis.causes if c.effect == "payload").parameters["mass"].value
    assert added == pytest.approx(MASS, rel=0.02)
    sidecar = tmp_path / "heavy.toml"
    flex = (robot.source.parent / "flex.toml").read_text()
    assert "mass" not in flex.partition("[tool]")[2]
    sidecar.write_text(f"{flex.rstrip()}\nmass = {added!r}\n")
    other = assess(load_robot(ARM, flex=sidecar), task)
    for joint in other.joints:
        told = found.life["extended"]["joints"][joint.name]
        assert told["peak_deflection"] == pytest.approx(joint.peak_deflection, rel=1e-6)
        assert told["utilisation"] == pytest.approx(joint.utilisation, rel=1e-6)
    assert found.life["extended"]["utilisation"] != found.life["baseline"]["utilisation"]
    assert "payload of tool" in found.why


def test_why_there_is_no_life(robot, diagnosis):
    assert motion_life(robot, None, diagnosis).why == NO_TASK
    emps = load_robot("emps")
    task = load_task(emps.task_path, emps)
    shown = motion_life(emps, task, replace_causes(diagnosis, emps))
    assert (shown.life, shown.why) == (None, NO_SHAFT)
    assert set(shown.blows["baseline"]) == {"slide"}


def replace_causes(diagnosis, robot):
    """The diagnosis, with nothing in it that this robot lacks."""
    state = replace(diagnosis.details["extended"], effects=())
    return replace(diagnosis, details={**diagnosis.details, "extended": state})


class Reader(html.parser.HTMLParser):
    def __init__(self):
        super().__init__()
        self.headings, self.addresses, self.alts, self.into = [], [], [], None

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.into = tag if tag in ("h1", "h2") else self.into
        self.addresses += [v for k, v in found.items() if k in ("href", "src") and v[:1] != "#"]
        if tag == "svg":
            self.alts.append(found["aria-label"])

    def handle_endtag(self, tag):
        self.into = None if tag == self.into else self.into

    def handle_data(self, data):
        if self.into:
            self.headings.append(data)


def test_the_page_has_every_part_and_needs_nothing_from_outside(robot, diagnosis):
    page = page_of(diagnosis, robot, folder="logs")
    seen = Reader()
    seen.feed(page)
    assert seen.headings == [
        f"What the simulation of {ARM} gets wrong", "Where it shows", "The causes",
        "Before and after, on a record held out", "The candidates",
        "What is left, channel by channel", "What it means for the robot’s life",
        "What to do next", "Details",
    ]  # fmt: skip
    assert seen.addresses == []
    assert all(seen.alts)
    assert "nan" not in re.sub(r"<[^>]*>", " ", page).split()
    assert "coulomb friction" in page
    assert "payload" in page
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(ids) == len(set(ids))


def test_names_are_escaped(robot, diagnosis):
    page = page_of(diagnosis, robot, folder="<script>alert(1)</script>")
    assert "<script>alert" not in page and "&lt;script&gt;alert(1)" in page


def test_a_page_of_a_good_simulation(robot):
    diagnosis = diagnose_motion(robot, campaign(robot, {}, 0))
    page = page_of(diagnosis, robot)
    assert "Nothing wrong" in page
    assert "The causes" not in page
    assert "Before and after" not in page


def test_alternatives_are_told_by_what_differs(diagnosis):
    other = (("joint_inertia", "joint_1"), ("coulomb_friction", "joint_2"))
    both = (*other, ("payload", "tool"))
    changed = replace(diagnosis, alternatives=(other, other, both))
    assert [in_words(d) for d in differences(changed)] == [
        "joint inertia of joint_1 in place of payload of tool", "joint inertia of joint_1 as well",
    ]  # fmt: skip


def run(*arguments, cwd):
    return subprocess.run([sys.executable, "-c", MAIN, *map(str, arguments)], cwd=cwd,
                          capture_output=True, text=True, timeout=300)  # fmt: skip


@pytest.mark.slow
def test_the_command_writes_page_model_and_json(robot, heavy, tmp_path):
    heavy.save(tmp_path / "logs")
    done = run("diagnose", ARM, "--data", "logs", "--report", "why.html", "--model", "found.toml",
               "--json", "why.json", cwd=tmp_path)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "Life: the life after takes payload of tool into account" in " ".join(
        done.stdout.split()
    )
    said = json.loads((tmp_path / "why.json").read_text())
    assert said["format"] == "picchio-diagnosis/1"
    assert said["life"]["extended"]["utilisation"] != said["life"]["baseline"]["utilisation"]
    assert "payload of tool" in said["life_note"]
    assert "Before and after" in (tmp_path / "why.html").read_text()
    model = (tmp_path / "found.toml").read_text()
    assert 'effect = "payload"' in model
    assert 'effect = "coulomb_friction"' not in model
    assert "coulomb_friction of joint_2" in model
    # The model is a robot like any other: its life is the one told.
    assessed = run("assess", "found.toml", "--task", robot.task_path, "--json", "-", cwd=tmp_path)
    assert assessed.returncode == 0, assessed.stderr
    joints = json.loads(assessed.stdout)["joints"]
    for joint in joints:
        told = said["life"]["extended"]["joints"][joint["name"]]
        assert joint["utilisation"] == pytest.approx(told["utilisation"], rel=1e-9)
