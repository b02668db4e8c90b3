"""`picchio map` and `picchio annotate` as programs meet them; --version of every command."""

import json

import pytest


def test_a_map_as_json(picchio, tmp_path):
    done = picchio(
        "map", "fanuc_like_3dof", "--joint-grid", "1,4,4", "--out", "m.nc", "--json", "-",
        cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["poses"] == 16
    assert [joint["name"] for joint in found["joints"]] == ["joint_1", "joint_2", "joint_3"]
    for joint in found["joints"]:
        one = picchio(
            "envelope", "fanuc_like_3dof", "--json", "-",
            "--pose=" + ",".join(map(str, joint["pose"])),
        )  # fmt: skip
        same = {j["name"]: j for j in json.loads(one.stdout)["joints"]}[joint["name"]]
        assert same["peak_deflection"] == pytest.approx(joint["peak_deflection"], rel=1e-9)


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["--spacing", "nan"], "--spacing"),
        (["--spacing", "1e-9"], "too many"),
        (["--joint-grid", "100000"], "more than"),
        (["--joint-grid", "2.5"], "whole numbers"),
        (["--workers", "-1"], "--workers"),
        (["--hits", "0"], "--hits"),
        (["--plane", "xa"], "plane"),
        (["--plane", "xz", "--box"], "choose one"),
        (["--force", "nan"], "--force"),
    ],
)
def test_a_bad_map_is_one_line_and_leaves_nothing(picchio, tmp_path, arguments, part):
    done = picchio("map", "fanuc_like_3dof", *arguments, "--out", "m.nc", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1, done.stderr
    assert part in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_annotate_does_not_overwrite_what_it_reads(picchio, tmp_path, repository):
    arm = tmp_path / "arm.urdf"
    arm.write_bytes((repository / "robots" / "fanuc_like_3dof" / "robot.urdf").read_bytes())
    flex = repository / "robots" / "fanuc_like_3dof" / "flex.toml"
    before = arm.read_bytes()
    done = picchio("annotate", arm, "--flex", flex, "--out", arm)
    assert done.returncode == 2
    assert "would overwrite an input" in done.stderr
    assert arm.read_bytes() == before


@pytest.mark.parametrize("command", ["assess", "map", "robots", "annotate", "fit-sn"])
def test_every_command_tells_version_and_shows_an_example(picchio, command):
    assert picchio(command, "--version").stdout.startswith("picchio 0.")
    assert "Examples:\n  picchio" in picchio(command, "--help").stdout


def test_damage_on_a_mesh(picchio, tmp_path):
    """A panel whose normals point at the robot: pushes along them, and the life they cost."""
    (tmp_path / "panel.obj").write_text(
        "v 1.3 -0.2 0.4\nv 1.3 0.2 0.4\nv 1.3 0.2 0.6\nv 1.3 -0.2 0.6\nf 1 3 2\nf 1 4 3\n"
    )
    common = ("map", "fanuc_like_3dof", "--surface", "panel.obj", "--out", "m.nc")
    done = picchio(*common, "--spacing", "0.2", "--damage", "--force", "20000", "--json", "-",
                   cwd=tmp_path)  # fmt: skip
    assert done.returncode == 0, done.stderr
    joints = json.loads(done.stdout)["joints"]
    assert max(joint["damage_per_rivet"] for joint in joints) > 0.0
    for joint in joints:
        assert joint["worst_direction"] == pytest.approx([-1, 0, 0], abs=1e-9)
    told = picchio(*common, "--spacing", "0.2", "--damage", cwd=tmp_path).stdout
    assert "none does any" in told and "along the surface's normal" in told
    refused = picchio(*common, cwd=tmp_path)
    assert refused.returncode == 2 and "--spacing" in refused.stderr
    both = picchio(*common, "--plane", "xz", cwd=tmp_path)
    assert both.returncode == 2 and "choose one" in both.stderr
