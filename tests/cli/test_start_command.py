from __future__ import annotations

import json
import math
import shlex
import tomllib
from pathlib import Path

import pytest

import picchio
from picchio.cli.main import run
from picchio.robot.annotations.flexibility import estimate_notice
from picchio.robot.annotations.sidecar import Sidecar, read_sidecar
from picchio.robot.loading.find import typed_name

ARM = """<robot name="bare [arm]">
<link name="base"/>
<link name="a"><inertial><mass value="10"/><inertia ixx="0.2" iyy="0.2" izz="0.1" ixy="0" ixz="0"
iyz="0"/></inertial></link>
<link name="b"><inertial><mass value="6"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0"
iyz="0"/></inertial></link>
<link name="c"><inertial><mass value="3"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0"
iyz="0"/></inertial></link>
<joint name="joint 1" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
</joint>
<joint name="joint.2" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0.1 0 0.4"/>
<axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="0" velocity="0"/></joint>
<joint name="slide" type="prismatic"><parent link="b"/><child link="c"/><origin xyz="0 0 0.3"/>
<axis xyz="0 0 1"/><limit lower="0" upper="0.3" effort="500" velocity="1"/></joint>
</robot>"""


def unsourced(sidecar: Sidecar) -> Sidecar:
    joints = {name: entry.model_copy(update={"source": None})
              for name, entry in sidecar.joint.items()}  # fmt: skip
    return sidecar.model_copy(update={"joint": joints})


@pytest.mark.parametrize("name", ["bare"])
def test_the_files_say_what_is_in_memory(name: str, tmp_path: Path) -> None:
    if name == "bare":
        (tmp_path / "bare.urdf").write_text(ARM)
        name = str(tmp_path / "bare.urdf")
    found = picchio.start(name, payload=3.0)
    flex, task = found.save(tmp_path)
    assert unsourced(read_sidecar(flex)) == unsourced(found.sidecar)
    assert tomllib.loads(task.read_text()) == {
        **found.task, "operation": [{**op, "rivets": 1} for op in found.task["operation"]],
    }  # fmt: skip
    robot = picchio.load_robot(name, flex=flex)
    assert set(robot.flexible_names) == set(found.sidecar.joint)
    assert all(joint.estimated for joint in robot.flexible_joints)
    spread = getattr(found.sidecar.joint[robot.flexible_names[0]], "stiffness_spread")  # noqa: B009
    assert robot.spreads[f"stiffness.{robot.flexible_names[0]}"].size == pytest.approx(
        math.log(spread)
    )
    assert picchio.load_task(task, robot).operations[0].excitation.peak_force == 300.0


def test_a_robot_is_the_same_from_the_file_and_without_one(tmp_path: Path) -> None:
    (tmp_path / "bare.urdf").write_text(ARM)
    flex, _ = picchio.start(tmp_path / "bare.urdf", payload=3.0).save(tmp_path)
    with pytest.warns(picchio.PicchioWarning, match="nobody measured the stiffness"):
        without = picchio.load_robot(tmp_path / "bare.urdf", payload=3.0)
    given = picchio.load_robot(tmp_path / "bare.urdf", flex=flex)
    assert given.flexible_joints == without.flexible_joints
    assert given.posterior == without.posterior
    assert {name: (s.value, s.size) for name, s in given.spreads.items()} == {
        name: (s.value, s.size) for name, s in without.spreads.items()
    }
    assert estimate_notice("x", given.origins) == estimate_notice("x", without.origins) != ""


def test_what_is_written_reads_well(tmp_path: Path) -> None:
    (tmp_path / "bare.urdf").write_text(ARM)
    flex, task = picchio.start(tmp_path / "bare.urdf").save(tmp_path)
    text = flex.read_text()
    assert all(len(line) <= 80 for line in [*text.splitlines(), *task.read_text().splitlines()])
    assert "# Left rigid: slide: it slides, and no drive of a slide was measured." in text
    assert "# Stiffness: from the inertia it carries" in text
    assert '[joint."joint.2"]' in text
    entry = read_sidecar(flex).joint["joint 1"]
    factor = getattr(entry, "stiffness_spread") ** 1.645  # noqa: B009
    low, high = (float(f"{x:.2g}") for x in (entry.stiffness / factor, entry.stiffness * factor))
    assert f"# N m/rad; {low:,.0f} to {high:,.0f}\n" in text
    assert "in the order joint 1, joint.2, slide." in " ".join(
        task.read_text().replace("\n#", " ").split()
    )


def test_the_command_writes_says_what_and_what_next(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    folder = tmp_path / "two words"
    folder.mkdir()
    urdf = folder / "my arm.urdf"
    urdf.write_text(ARM)
    assert run(["start", str(urdf), "--out", str(folder), "--json", str(folder / "s.json")]) == 0
    screen = capsys.readouterr()
    assert "bare [arm]: 2 drives estimated from the URDF. Nothing was measured." in screen.out
    assert all(len(line) <= 80 for line in screen.out.splitlines() if "picchio assess" not in line)
    assert f"picchio: wrote {folder / 'my arm.flex.toml'}" in screen.err
    command = shlex.split(screen.out.split("Then:")[1])
    assert command[:3] == ["picchio", "assess", str(urdf)]
    assert [Path(command[4]), Path(command[6])] == [folder / "my arm.flex.toml",
                                                    folder / "my arm.task.toml"]  # fmt: skip
    content = json.loads((folder / "s.json").read_text())
    assert content["format"] == "picchio-start/1"
    assert content["rigid"] == {"slide": "slides, and no drive of a slide was measured"}
    before = (folder / "my arm.flex.toml").read_bytes()
    assert run(["start", str(urdf), "--out", str(folder), "--seed", "1"]) == 2
    assert "is there already; --force writes over it" in capsys.readouterr().err
    assert (folder / "my arm.flex.toml").read_bytes() == before
    assert run(["start", str(urdf), "--out", str(folder), "--seed", "1", "--force"]) == 0


def test_what_a_user_may_add(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = ["--payload", "165", "--reach", "2.6", "--class", "cycloidal"]
    typed = ["start", "fanuc_r2000ic", *given, "--reducer", "joint_2=RV-80E-121"]
    assert run([*typed, "--out", str(tmp_path)]) == 0
    assert "RV-80E-121" in capsys.readouterr().out
    text = (tmp_path / "fanuc_r2000ic.flex.toml").read_text()
    for word in ("a payload of 165 kg", "a reach of 2.6 m", "cycloidal drives",
                 'reducer = "RV-80E-121"', "What its own files say"):  # fmt: skip
        assert word in " ".join(text.replace("\n#", " ").split()), word


@pytest.mark.parametrize("name", ["ur10", "panda", "fanuc_r2000ic"])
def test_what_its_own_files_say_stands(name: str, tmp_path: Path) -> None:
    flex, _ = picchio.start(name).save(tmp_path)
    with_file, without = picchio.load_robot(name, flex=flex), picchio.load_robot(name)
    assert with_file.flexible_names == without.flexible_names
    for mine, own in zip(with_file.flexible_joints, without.flexible_joints, strict=True):
        for key in ("stiffness", "stiffness_curve", "damping_ratio", "reducer", "shaft"):
            assert getattr(mine, key) == getattr(own, key), (mine.name, key)
    spring = [key for key in without.spreads if key.startswith(("stiffness", "damping"))]
    assert {with_file.spreads[key].size for key in spring} == {
        without.spreads[key].size for key in spring
    }
    notice = estimate_notice(name, without.origins)
    assert estimate_notice(name, with_file.origins) == notice


def test_a_robot_is_called_by_what_finds_it(tmp_path: Path) -> None:
    for name in ("ur10", "fanuc_r2000ic"):
        robot = picchio.load_robot(name, allow_rigid=True)
        assert typed_name(robot.name, robot.source) == name
    copy = tmp_path / "ur10.urdf"
    copy.write_text(ARM.replace("bare [arm]", "ur10"))
    robot = picchio.load_robot(copy, allow_rigid=True)
    assert typed_name(robot.name, robot.source) == str(copy)


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        (["--class", "belt"], "--class: no such class of drives, got 'belt'"),
        (["--payload", "0"], "--payload: must be positive"),
        (["--reducer", "joint_2"], "--reducer: must be JOINT=NAME"),
        (["--reducer", "joint_9=CSG-25-100-2UH"], "--reducer: no such joint"),
        (["--reducer", "a=b", "--reducer", "a=c"], "--reducer: the joint is given twice"),
        (["--tool", "hand"], "--tool: the robot has no frame of this name"),
        (["--out", "nowhere"], "cannot write here: the folder does not exist"),
    ],
)
def test_what_is_refused(
    typed: list[str], said: str, capsys: pytest.CaptureFixture[str], tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert run(["start", "fanuc_r2000ic", *typed]) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
