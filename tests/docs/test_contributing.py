"""The additions that CONTRIBUTING.md shows work as they stand there, from a package outside."""

import json
import re
import shutil
import subprocess
import sys

import pytest

BLOCK = re.compile(r"^```(python|toml)\n(.*?)^```", re.MULTILINE | re.DOTALL)
PLAN = """format = "picchio-plan/1"
poses = [[0.3, 0.5, -0.8], [0.0, 0.9, -0.5]]
directions = [[1.0, 0.0, 0.0]]
sample_rate = 2000.0
length = 0.6
hits = 4
[excitation]
kind = "triangle_train"
force = 300.0
period = 0.040
width = 0.004
[[sensor]]
channels = "speed.tool"
noise = 1e-6
[[effect]]
effect = "tool_shaft"
target = "tool"
parameters = { mass = 2.0, distance = 0.2 }
[[effect]]
effect = "uneven_blows"
target = "tool"
parameters = { std = 0.1 }
"""


@pytest.fixture(scope="module")
def package(repository, tmp_path_factory):
    """Every block of the page as the file that its first line names, and the entry points."""
    folder = tmp_path_factory.mktemp("contributing")
    entries = []
    for _, text in BLOCK.findall((repository / "CONTRIBUTING.md").read_text()):
        if "[project.entry-points" in text:
            entries.append(re.sub(r'\[project\.entry-points\."(.*)"\]', r"[\1]", text))
            continue
        name = re.match(r"# ([\w.-]+)", text)[1]
        with (folder / name).open("a") as stream:
            stream.write(text)
    about = folder / "mine-0.1.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 0.1\n")
    points = "\n".join(entries).replace('"', "")
    (about / "entry_points.txt").write_text(re.sub(r"^#.*\n", "", points, flags=re.MULTILINE))
    shutil.copy(repository / "robots/fanuc_like_3dof/robot.urdf", folder)
    (folder / "plan.toml").write_text(PLAN)
    return folder


def picchio(folder, *arguments):
    main = "import sys; sys.path.insert(0, '.'); from picchio.cli.main import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", main, *arguments], cwd=folder, capture_output=True, text=True,
        timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_effects_are_listed(package):
    text = picchio(package, "effects")
    assert "tool_shaft" in text and "uneven_blows" in text
    assert "relative force of each blow" in picchio(package, "effects", "uneven_blows")


def test_a_record_of_them_is_simulated(package):
    found = json.loads(
        picchio(package, "simulate", "robot.urdf", "--plan", "plan.toml", "--to", "made", "--json",
                "-")
    )  # fmt: skip
    assert found["channels"] == ["speed.tool"]
    assert {effect["effect"] for effect in found["effects"]} == {"tool_shaft", "uneven_blows"}
    first = (package / "made" / found["records"][0]).read_text().splitlines()
    assert first[0] == "time [s],speed.tool [m/s]"
    assert max(float(row.split(",")[1]) for row in first[1:]) > 1e-3


def test_the_robot_is_assessed_with_the_curve_and_the_blows(package):
    found = json.loads(
        picchio(package, "assess", "robot.urdf", "--flex", "flex.toml", "--task", "task.toml",
                "--json", "-")
    )  # fmt: skip
    joint = next(entry for entry in found["joints"] if entry["name"] == "joint_1")
    assert joint["sn_curve"] == "my-steel"
    assert found["operations"][0]["excitation"].startswith("triangular blows of 300 N")


def test_the_reducer_can_be_loaded(package):
    from picchio.robot.drives.reducer import load_reducer

    found = load_reducer("EX-40", catalogues=[package / "my-reducers.toml"])
    assert found.repeated_peak_torque == 1029.0
