"""The command as a stranger meets it: what is printed where, and every bad input."""

import json
import os
import shutil
import subprocess
import sys

import pytest

TASK = """format = "picchio-task/1"
[excitation]
force = 300.0
period = 0.04
width = 0.004
[[operation]]
name = "forward"
direction = [1.0, 0.0, 0.0]
poses = [[0.0, 0.5, -0.8]]
"""


@pytest.fixture
def robot(tmp_path, repository):
    """A copy of the arm that a test may break."""
    folder = tmp_path / "arm"
    shutil.copytree(repository / "robots" / "fanuc_like_3dof", folder)
    return folder / "robot.urdf"


def test_the_main_job_prints_a_table_and_a_verdict(picchio, tmp_path):
    done = picchio("assess", "fanuc_like_3dof", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    for word in ("joint_1", "joint_2", "joint_3", "rivets", "forward", "left", "upward"):
        assert word in done.stdout
    assert "\x1b" not in done.stdout
    assert os.listdir(tmp_path) == []


def test_json_has_the_contracts_keys_and_no_number_that_json_lacks(picchio, tmp_path):
    done = picchio("assess", "fanuc_like_3dof", "--json", "-", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout, parse_constant=lambda name: pytest.fail(name))
    assert found["format"] == "picchio-assessment/1"
    assert {"robot", "method", "sn_curve", "limiting_joint", "rivets_to_failure"} <= set(found)
    assert found["method"] == "rainflow"
    assert found["rivets_to_failure"] is None
    for joint in found["joints"]:
        assert {
            "name",
            "peak_deflection",
            "peak_shear_stress",
            "gravity_shear_stress",
            "utilisation",
            "damage_per_rivet",
            "rivets_to_failure",
        } <= set(joint)
        assert 0 < joint["utilisation"] < 1
    for operation in found["operations"]:
        assert len(operation["poses"]) == 15
        for key in ("natural_frequencies", "peak_deflection", "peak_shear_stress"):
            assert [len(row) for row in operation[key]] == [3] * 15
        assert [len(row) for row in operation["damage_per_rivet"]] == [3] * 15
    assert found["provenance"]["inputs"]


def test_json_to_a_file_and_the_table_to_stdout(picchio, tmp_path):
    target = tmp_path / "life.json"
    done = picchio("assess", "fanuc_like_3dof", "--method", "paper", "--json", target)
    assert done.returncode == 0, done.stderr
    found = json.loads(target.read_text())
    assert found["method"] == "paper"
    assert found["rivets_to_failure"] == min(j["rivets_to_failure"] for j in found["joints"])
    rounded = float(f"{found['rivets_to_failure']:.3g}")
    assert f"The robot survives {rounded:,.0f} rivets; joint_2 fails first" in done.stdout


def test_help_shows_an_example_and_version_a_version(picchio):
    assert "Examples:" in picchio("assess", "--help").stdout
    assert picchio("--version").stdout.startswith("picchio 0.")
    listed = picchio("robots")
    assert "fanuc_like_3dof" in listed.stdout
    found = json.loads(picchio("robots", "--json", "-").stdout)
    entry = next(r for r in found["robots"] if r["name"] == "fanuc_like_3dof")
    assert entry["dof"] == 3
    assert entry["flexible"] == ["joint_1", "joint_2", "joint_3"]
    assert entry["stiffness_source"]


def edit(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


BAD_URDFS = {
    "broken XML": ("</robot>", "", ["robot.urdf", "line"]),
    "an undeclared prefix": (' xmlns:picchio="urn:picchio:1"', "", ["picchio", "prefix"]),
    "negative stiffness": ('stiffness="2.4e5"', 'stiffness="-1"', ["joint_1", "stiffness", "-1"]),
    "NaN stiffness": ('stiffness="2.4e5"', 'stiffness="nan"', ["joint_1", "stiffness", "nan"]),
    "a number that is none": ('stiffness="2.4e5"', 'stiffness="a"', ["joint_1", "stiffness"]),
    "a misspelt attribute": ("damping_ratio=", "dampig_ratio=", ["dampig_ratio", "damping_ratio"]),
    "negative damping": ('damping_ratio="0.03"', 'damping_ratio="-0.1"', ["damping_ratio"]),
    "negative radius": ('radius="0.01765"', 'radius="-1"', ["joint_1", "radius"]),
    "negative mass": ('mass value="30"', 'mass value="-30"', ["mass", "-30"]),
    "an unknown S-N curve": ('"42CrMo4-QT-shaft"', '"42CrMo4"', ["42CrMo4", "valid"]),
}


@pytest.mark.parametrize("name", BAD_URDFS)
def test_a_bad_urdf_gives_one_line_and_exit_2(picchio, robot, tmp_path, name):
    old, new, parts = BAD_URDFS[name]
    edit(robot, old, new)
    task = tmp_path / "task.toml"
    task.write_text(TASK)
    check_refused(picchio("assess", robot, "--task", task), parts)


def check_refused(done, parts):
    assert done.returncode == 2, done.stdout + done.stderr
    lines = [line for line in done.stderr.splitlines() if "warning" not in line]
    assert len(lines) == 1, done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
    for part in parts:
        assert part in lines[0], lines[0]


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["no_such_robot"], ["no_such_robot", "fanuc_like_3dof"]),
        (["no/such.urdf"], ["no/such.urdf", "no such file"]),
        (["fanuc_like_3dof", "--tool", "tol"], ["tol", "did you mean 'tool'"]),
        (["fanuc_like_3dof", "--task", "none.toml"], ["none.toml", "no such file"]),
        (["fanuc_like_3dof", "--flex", "none.toml"], ["none.toml", "no such file"]),
        (["fanuc_like_3dof", "--method", "papier"], ["papier", "paper", "rainflow"]),
        (["fanuc_like_3dof", "--residue", "half"], ["half", "half-cycles"]),
        (["fanuc_like_3dof", "--sn-curve", "steel"], ["steel", "nie-2016"]),
        (["fanuc_like_3dof", "--json", "no/where.json"], ["no/where.json"]),
        (["fanuc_like_3dof", "--nonsense"], ["--nonsense"]),
        ([], ["ROBOT"]),
    ],
)
def test_bad_arguments_give_one_line_and_exit_2(picchio, arguments, parts, tmp_path):
    check_refused(picchio("assess", *arguments, cwd=tmp_path), parts)
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(
    ("sidecar", "parts"),
    [
        ('format = "picchio-sidecar/9"\n', ["flex.toml", "picchio-sidecar/1"]),
        (
            'format = "picchio-sidecar/1"\n[joint.joint_7]\nstiffness = 1e5\n',
            ["joint_7", "joint_1"],
        ),
        (
            'format = "picchio-sidecar/1"\n[joint.joint_1]\nstifness = 1\n',
            ["stifness", "stiffness"],
        ),
        ('format = "picchio-sidecar/1"\n[joint.joint_1]\nstiffness = -1\n', ["joint_1", "-1"]),
        ('format = "picchio-sidecar/1"\n[tool]\nframe = "flange"\n', ["flange", "tool"]),
    ],
)
def test_a_bad_sidecar_gives_one_line_and_exit_2(picchio, sidecar, parts, tmp_path):
    path = tmp_path / "flex.toml"
    path.write_text(sidecar)
    check_refused(picchio("assess", "fanuc_like_3dof", "--flex", path), parts)


def test_a_pose_beyond_the_limits_is_a_warning(picchio, tmp_path):
    task = tmp_path / "task.toml"
    task.write_text(TASK.replace("-0.8", "-2.0"))
    done = picchio("assess", "fanuc_like_3dof", "--task", task)
    assert done.returncode == 0
    assert "joint_3" in done.stderr
    assert "limits" in done.stderr


def test_import_is_light_and_the_example_is_quick():
    """Neither pinocchio nor scipy, numba or xarray may load with `import picchio`."""
    code = (
        "import sys, picchio\n"
        "heavy = {'pinocchio', 'scipy', 'numba', 'meshcat', 'pydantic', 'xarray', 'pandas'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["--method", "paper", "--mean-stress", "goodman"], "--mean-stress"),
        (["--method", "paper", "--for-life", "1e6"], "--for-life"),
        (["--survival", "0.9"], "--survival"),
        (["--for-life", "-1"], "--for-life"),
        (["--for-life", "1e6", "--survival", "99"], "--survival"),
        (["--seed", "3"], "--seed"),
        (["--paper-mean-stress"], "--paper-mean-stress"),
    ],
)
def test_options_that_do_not_belong_are_refused_not_ignored(picchio, arguments, part):
    check_refused(picchio("assess", "fanuc_like_3dof", *arguments), [part])


def test_no_output_destroys_an_input(picchio, robot, tmp_path):
    task = tmp_path / "task.toml"
    task.write_text(TASK)
    for target in (robot, task):
        before = target.read_bytes()
        done = picchio("assess", robot, "--task", task, "--json", target)
        check_refused(done, ["would overwrite an input"])
        assert target.read_bytes() == before


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ("force = 300.0", "force = -300.0", "excitation.force"),
        ("force = 300.0", "force = '300'", "excitation.force"),
        ("[excitation]", "hits_per_rivet = 100000000\n[excitation]", "hits_per_rivet"),
    ],
)
def test_slips_in_a_task_are_refused(picchio, tmp_path, old, new, part):
    task = tmp_path / "task.toml"
    task.write_text(TASK.replace(old, new))
    check_refused(picchio("assess", "fanuc_like_3dof", "--task", task), [part])


def test_an_absurd_force_ends_in_words_not_in_a_traceback(picchio, tmp_path):
    task = tmp_path / "task.toml"
    task.write_text(TASK.replace("300.0", "1e300"))
    done = picchio("assess", "fanuc_like_3dof", "--task", task)
    assert "Traceback" not in done.stderr


def test_two_runs_write_the_same_bytes():
    command = (
        "from picchio.cli.main import main; main(['assess', 'fanuc_like_3dof', '--json', '-'])"
    )
    written = [
        subprocess.run(
            [sys.executable, "-c", command],
            capture_output=True,
            check=True,
            env=os.environ | {"PYTHONHASHSEED": seed},
        ).stdout
        for seed in ("1", "2")
    ]
    assert written[0] == written[1]


def test_a_report_that_opens_offline(picchio, tmp_path):
    out = tmp_path / "report.html"
    done = picchio("assess", "fanuc_like_3dof", "--report", out)
    assert f"picchio: wrote {out}" in done.stderr
    assert done.returncode == 0, done.stderr
    page = out.read_text()
    assert page.lower().startswith("<!doctype html>")
    for word in ("joint_2", "8.68", "42CrMo4-QT-shaft", "picchio assess", "rainflow"):
        assert word in page
    missing = picchio("assess", "fanuc_like_3dof", "--report", tmp_path / "no" / "report.html")
    check_refused(missing, ["folder does not exist"])


def test_for_life_answers_first_and_strict_asks_for_a_yes(in_process, tmp_path):
    # At 300 N the reducer is past its limit; its shafts alone would allow 13 times the force.
    flex = tmp_path / "flex.toml"
    flex.write_text('format = "picchio-sidecar/1"\n[joint.joint_2]\nreducer = "RV-20E"\n')
    out = tmp_path / "life.json"
    command = ["assess", "fanuc_like_3dof", "--for-life", "1e6", "--survival", "0.99", "--strict"]
    command += ["--json", out]
    done = in_process(*command, "--flex", flex)
    assert done.returncode == 3, done.stderr
    assert done.stdout.startswith("No: gravity and blows take the reducer RV-20E of joint_2")
    found = json.loads(out.read_text())
    assert found["verdict"]["status"] == "fails"
    assert not found["allowable"]["met"] and found["allowable"]["governed_by"] == "reducer"
    assert in_process(*command).returncode == 0
    assert json.loads(out.read_text())["allowable"]["met"] is True
