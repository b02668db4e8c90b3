"""A joint's kind decides its units, in every table and page: an arm that turns and slides."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

import picchio as api
from picchio.robot.units import SLIDING, column

URDF = """<robot name="gantry"><link name="base"/>{joints}</robot>"""
LINK = """<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{name}_link"/>
<origin xyz="0 0 0.4"/><axis xyz="{axis}"/>
<limit lower="-1" upper="1" effort="{mass}e2" velocity="1"/></joint>
<link name="{name}_link"><inertial><origin xyz="0.1 0 0.2"/><mass value="{mass}"/>
<inertia ixx="0.2" ixy="0" ixz="0" iyy="0.{mass}" iyz="0" izz="0.1"/></inertial></link>"""
JOINTS = [("rail", "prismatic", "1 0 0", 20), ("turn", "revolute", "0 0 1", 11),
          ("lift", "prismatic", "0 0 1", 7), ("wrist", "revolute", "0 1 0", 3)]  # fmt: skip


@pytest.fixture(scope="module")
def gantry(tmp_path_factory):
    folder = tmp_path_factory.mktemp("gantry")
    parents = ["base", *(f"{name}_link" for name, *_ in JOINTS)]
    joints = "".join(
        LINK.format(name=name, kind=kind, parent=parent, axis=axis, mass=mass)
        for (name, kind, axis, mass), parent in zip(JOINTS, parents, strict=False)
    )
    (folder / "robot.urdf").write_text(URDF.format(joints=joints))
    flex = "".join(
        f"[joint.{name}]\nstiffness = {'2e6' if kind == 'prismatic' else '2e4'}\n"
        for name, kind, *_ in JOINTS
    )
    (folder / "flex.toml").write_text('format = "picchio-sidecar/1"\n' + flex)
    (folder / "task.toml").write_text(
        'format = "picchio-task/1"\n[excitation]\nkind = "pulse_train"\nforce = 300.0\n'
        'period = 0.04\nwidth = 0.004\n[[operation]]\nname = "side"\ndirection = [1.0, 1.0, 1.0]\n'
        "poses = [[0.1, 0.3, 0.1, 0.4]]\n"
    )
    return folder


def test_a_column_is_in_the_unit_of_most():
    assert column(["mrad", "mm", "mrad"], ["1", "2", "-"]) == ("mrad", ["1", "2 mm", "-"])
    assert column(["mm"], ["1"]) == ("mm", ["1"])
    assert SLIDING.of("N*m*s/rad") == "N*s/m"
    assert SLIDING.of("N*m/rad^3") == "N/m^3"


@pytest.mark.parametrize(
    "command",
    [
        ["envelope", "--pose=0.1,0.3,0.1,0.4"],
        ["assess", "-v"],
        ["map", "--joint-grid", "2", "--out", "OUT"],
    ],
    ids=lambda command: command[0],
)
def test_tables_say_what_a_slide_is_measured_in(picchio, tables, gantry, tmp_path, command):
    out = [part.replace("OUT", str(tmp_path / "m.nc")) for part in command[1:]]
    done = picchio(command[0], str(gantry / "robot.urdf"), *out, "--json", str(tmp_path / "j.json"))
    assert done.returncode == 0, done.stderr
    # Two kinds alike: the head is that of the first, and the others carry their units. What the
    # drives bear is an estimate: assess tells loads as intervals, in its last column.
    small = command[0] != "assess"
    for first, unit in (("joint", ("mm", "N")), ("rail", ("", "")), ("turn", ("mrad", "N m"))):
        if small:
            number = "" if first == "joint" else r" +[\d.]+ ?"
            cells = "".join(f"{number or ' +'}{text}" for text in unit) + " "
        else:
            cells = " .*" + (r"[\d.,]+ to [\d.,]+ ?" if first != "joint" else "") + unit[1] + "$"
        assert re.search(f"^{first}{cells}", done.stdout, re.M), (first, cells)
    kinds = [joint["kind"] for joint in json.loads((tmp_path / "j.json").read_text())["joints"]]
    assert kinds == [kind for _, kind, *_ in JOINTS]


def test_pages_and_plots_say_it(gantry):
    from picchio.visuals.plots.life import plot_peak_torque
    from picchio.visuals.plots.polar import plot_polar_envelope

    robot = api.load_robot(gantry / "robot.urdf")
    task = api.load_task(gantry / "task.toml", robot)
    found = api.assess(robot, task)
    page = api.report(found, robot=robot, task=task).html()
    cells = re.sub(r"<[^>]*>", " ", page)
    assert re.search(
        r"turn\s.*? [\d.,]+ to [\d.,]+ N m\s", cells
    )  # what its drive bears is estimated
    assert "mrad or mm" not in cells
    shafted = api.load_robot(gantry / "robot.urdf", allow_rigid=True)
    known = api.report(api.assess(shafted, task), robot=shafted, task=task).html()
    assert re.search(r"turn\s+[\d.]+ mrad\s+[\d.]+ N m", re.sub(r"<[^>]*>", " ", known))
    ax = plot_peak_torque(found)
    assert ax.get_xlabel().endswith("[N]")
    assert [text.get_text() for text in ax.get_yticklabels()][1] == "turn [N m]"
    envelope = api.envelope(robot, np.array([0.1, 0.3, 0.1, 0.4]), api.PulseTrain(300, 0.04, 0.004))
    labels = plot_polar_envelope(envelope).get_legend_handles_labels()[1]
    assert labels == ["rail", "turn [mrad]", "lift", "wrist [mrad]"]
