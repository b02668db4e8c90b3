"""A robot of which only the URDF is known, at every command: an answer, marked as an estimate."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest

import picchio
from picchio.cli.main import run
from picchio.robot.loading.find import find_robot
from picchio.robot.varied import drawn_robots
from picchio.studies.envelopes import ENDS
from picchio.studies.tasks import ASSUMED_BLOWS

BLOWS = picchio.PulseTrain(300.0, 0.04, 0.004)
POSE = [0.2, 0.9, -1.1]


@pytest.fixture(scope="module")
def bare(tmp_path_factory):
    """The three-joint arm's URDF, its annotations left out."""
    path = tmp_path_factory.mktemp("bare") / "arm.urdf"
    text = find_robot("fanuc_like_3dof").urdf.read_text()
    path.write_text(re.sub(r"<picchio:[^>]*>", "", text))
    return path


def told(capsys) -> str:
    return " ".join(capsys.readouterr().out.split())


def test_assess_says_first_what_it_assumes(bare, tmp_path, capsys):
    page, out = tmp_path / "r.html", tmp_path / "a.json"
    assert run(["assess", str(bare), "--payload", "10", "--report", str(page),
                "--json", str(out), "-v"]) == 0  # fmt: skip
    printed = capsys.readouterr()
    said = " ".join(printed.out.split())
    notice = said.index("Estimated: nobody measured the stiffness, damping and strength")
    assert "Estimated" not in printed.err
    assert "No task was given" in said
    told = "12 hits a rivet: rectangular pulses of 300 N, 4 ms wide, every 40 ms, assumed"
    assert said.index(told) < said.index("The joints, 80 % ranges")
    assert said.index("Allowable force of one blow") < said.index("The joints, 80 % ranges")
    assert notice < said.index("The joints, 80 % ranges") < said.index("pose 5, rad")
    assert "What to measure first" in said
    found = json.loads(out.read_text())
    assert found["estimated"] and found["verdict"]["estimated"]
    assert 0.0 < found["utilisation"]["p10"] < found["utilisation"]["p90"]
    assert sum(joint["ends_first"] for joint in found["joints"]) == pytest.approx(1.0)
    assert any("No task was given" in line for line in found["verdict"]["reasons"])
    assert found["operations"][0]["excitation"].startswith("rectangular pulses of 300 N")
    html = page.read_text()
    assert html.count('<tr class="estimate') == 3
    assert html.index("Allowable force of one blow") < html.index('id="joints"')
    assert html.index("Tool: frame tool") < html.index('id="joints"')
    assert "rectangular pulses of 300 N, 4 ms wide, every 40 ms" in html
    assert html.count("nobody measured") == 1 and 'id="measure"' in html


@pytest.mark.parametrize(
    ("option", "value"), [("--payload", "-1"), ("--reach", "0"), ("--class", "belt")]
)
def test_what_narrows_an_estimate_is_checked(bare, capsys, option, value):
    assert run(["assess", str(bare), option, value]) == 2
    assert capsys.readouterr().err.splitlines()[-1].startswith(f"picchio: error: {option}: ")


def test_what_is_known_changes_the_estimate(bare):
    free, heavy, geared = (
        picchio.load_robot(bare, **known)
        for known in ({}, {"payload": 400.0}, {"drive_class": "strain-wave"})
    )
    assert (heavy.stiffness > 1.2 * free.stiffness).all()
    assert (geared.stiffness != free.stiffness).all()


def test_an_envelope_is_a_band(bare, tmp_path, capsys):
    robot = picchio.load_robot(bare)
    found = picchio.envelope(robot, POSE, BLOWS, hits=12)
    directions = np.eye(3)
    every = [picchio.envelope(one, POSE, BLOWS, hits=12) for one in drawn_robots(robot, 64)]
    assert not every[0].estimated
    brute = np.quantile([one.support(directions) for one in every], ENDS, axis=0)
    np.testing.assert_allclose(found.band(directions), brute, rtol=0.02)
    torque = np.quantile([one.peak("torque") for one in every], ENDS, axis=0).T
    np.testing.assert_allclose(found.peak_interval("torque"), torque, rtol=0.02)
    out = tmp_path / "e.json"
    assumed = (
        f"of the blows, force {ASSUMED_BLOWS.force:g} N, period 0.04 s, width 0.004 s are assumed"
    )
    with pytest.warns(picchio.PicchioWarning, match=assumed):
        assert run(["envelope", str(bare), "--pose=0.2,0.9,-1.1", "--json", str(out)]) == 0
    assert "Estimated: P10 to P90" in told(capsys)
    content = json.loads(out.read_text())
    assert content["estimated"]
    low, high = content["joints"][1]["peak_torque_interval"]
    assert 0.0 < low < high


def test_a_scene_has_one_envelope_and_its_range_in_words(bare):
    from picchio.visuals.scene.page import scene_html

    scene = picchio.view(bare, pose=POSE, excitation=BLOWS)
    assert sum(item.layer == "envelope" for item in scene.items) == 3
    for k, label in enumerate(label for label in scene.labels if label["layer"] == "worst"):
        low, high = 1e3 * scene.envelope.peak_interval()[k]
        assert f"mrad ({low:.2g} to {high:.2g}) along" in label["text"]
    assert "nobody measured" in scene_html(scene)
    known = picchio.view("fanuc_like_3dof", pose=POSE, excitation=BLOWS)
    assert not known.notice
    assert not any("(" in label["text"].partition("along")[0] for label in known.labels)


def test_a_map_and_its_plot_say_it(bare, tmp_path, capsys):
    from picchio.visuals.plots.workspace import plot_workspace_map

    path, out = tmp_path / "m.nc", tmp_path / "m.json"
    command = ["map", str(bare), "--joint-grid", "2", "--out", str(path), "--json", str(out)]
    assert run(command) == 0
    content = json.loads(out.read_text())
    assert content["estimated"]
    said = capsys.readouterr()
    assert said.out.startswith("Estimated: nobody measured") and "Estimated" not in said.err
    assert "P10 to P90" in said.out
    from picchio.studies.maps.stored import open_map

    with open_map(path) as found:
        ax = plot_workspace_map(found, "joint_2")
        torque = found["peak_torque_quantiles"].values
        pose = found["pose"].values[5]
    assert "estimated" in ax.get_title(loc="left")
    assert any(patch.get_hatch() for patch in ax.patches)
    assert (torque[..., 0] < torque[..., 1]).all() and (torque[..., 1] < torque[..., 2]).all()
    # Against the envelope of the same drawn robots: exact in time and direction.
    envelope = picchio.envelope(picchio.load_robot(bare), pose, BLOWS)
    np.testing.assert_allclose(torque[5][:, [0, 2]], envelope.peak_interval("torque"), rtol=0.02)
    told_by = content["joints"][1]["estimate"]
    assert told_by["peak_torque"]["P90"] <= torque[:, 1, 2].max()
    assert told_by["peak_deflection"]["P10"] < told_by["peak_deflection"]["P90"]


def test_a_map_of_known_springs_has_no_band(tmp_path):
    from picchio.studies.maps.places import joint_grid

    robot = picchio.load_robot("fanuc_like_3dof")
    with picchio.workspace_map(robot, joint_grid(robot, 2), BLOWS, tmp_path / "m.nc") as found:
        assert not {"level", "peak_torque_quantiles"} & set(found.dataset.variables)
        assert not any("p90" in column for column in found.to_frame().columns)


def test_hatched_bars_reach_from_p10_to_p90(bare):
    from picchio.visuals.plots.life import plot_utilisation

    robot = picchio.load_robot(bare)
    found = picchio.assess(robot, picchio.load_task(find_robot("fanuc_like_3dof").task, robot))
    boxes = [patch for patch in plot_utilisation(found).patches if patch.get_hatch()]
    keys = ("utilisation", "reducer_utilisation")
    ends = [max(joint.intervals[key][1] for key in keys) for joint in found.joints]
    assert len(boxes) == 3
    for box, high in zip(boxes, ends, strict=True):
        assert box.get_x() + box.get_width() == pytest.approx(100 * high, rel=1e-6)
    assert "estimated: P10 to P90" in found._repr_html_()


@pytest.mark.slow
def test_work_that_nobody_gave_is_placed_and_written(bare, tmp_path, capsys):
    out = tmp_path / "moved.toml"
    assert run(["place", str(bare), "--move", "0.1,0.1,0.1,10", "--placements", "4",
                "--no-self-collision", "--out", str(out)]) == 0  # fmt: skip
    said = told(capsys)
    assert said.startswith("Estimated: ") and "No task was given" in said
    assert "The best place is the better one in" in said
    task = picchio.load_task(out, picchio.load_robot(bare))
    assert [operation.name for operation in task.operations] == ["along x", "along y", "along z"]


@pytest.mark.slow
def test_what_a_life_allows_is_by_the_estimated_drives(bare):
    robot = picchio.load_robot(bare)
    task = picchio.load_task(find_robot("fanuc_like_3dof").task, robot)

    def harder(factor):
        return replace(task, operations=tuple(
            replace(op, excitation=op.excitation.scaled(force=factor)) for op in task.operations
        ))  # fmt: skip

    found = picchio.allowable(robot, harder(0.1), 1e4, gravity_balanced=True)
    assert {joint.governed_by for joint in found} == {"reducer"}
    least = min(found, key=lambda joint: joint.force_factor)
    assert 0.0 < least.force_factor < np.inf
    for factor, holds in ((0.999, True), (1.02, False)):
        joint = picchio.assess(
            robot, harder(0.1 * factor * least.force_factor), gravity_balanced=True,
            uncertainty=False, steady_check=False,
        ).joint(least.joint)  # fmt: skip
        assert (joint.reducer_utilisation <= 1.0 and joint.rivets_to_failure >= 1e4) == holds
    # A yes by estimates is no promise.
    easy = picchio.allowable(robot, harder(1e-4), 1e4, gravity_balanced=True)
    assert easy.met and easy.answer.startswith("Probably: ") and not easy.yes


def test_what_a_slide_bears_is_estimated_from_its_effort_limit(capsys):
    assert run(["assess", "emps", "-v"]) == 0
    said = told(capsys)
    assert "Estimated: nobody measured the strength of the drives of emps" in said
    assert "unlimited" in said and "%" in said
    assert "what the drive of slide bears, from its maker" in said and "--reducer" not in said
    robot = picchio.load_robot("emps")
    (joint,) = robot.flexible_joints
    spread = robot.spreads["strength.repeated_peak_torque.slide"]
    assert joint.effort_limit < joint.strength.repeated_peak_torque < 3.0 * joint.effort_limit
    assert spread.size == pytest.approx(np.log(2.5), rel=0.1)
