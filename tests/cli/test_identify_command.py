"""`picchio identify`: from a motion log to a sidecar that `assess` takes."""

import subprocess
import sys

import pytest

import picchio.datasets
from picchio.robot.annotations.sidecar import read_sidecar
from picchio.robot.loading.load import load_robot

MAIN = "from picchio.cli.main import main; main()"


def run(*arguments, cwd):
    return subprocess.run([sys.executable, "-c", MAIN, *map(str, arguments)], cwd=cwd,
                          capture_output=True, text=True, timeout=300)  # fmt: skip


@pytest.mark.slow
def test_stiffness_and_payload_of_the_kuka(measured_data, tmp_path):
    picchio.datasets.load("kuka-kr300", measured_data).save(tmp_path / "motions")
    done = run("identify", "kuka_kr300_r2500", "--data", "motions", "--out", "found.toml",
               cwd=tmp_path)  # fmt: skip
    assert done.returncode == 0, done.stderr
    sidecar = read_sidecar(tmp_path / "found.toml")
    entry = sidecar.joint["joint_a3"]
    assert entry.stiffness == pytest.approx(4.1e6, rel=0.3)
    assert "motions" in entry.source and "+-" in entry.source
    assert sidecar.tool.mass > 130.0
    text = (tmp_path / "found.toml").read_text()
    assert "encoder_delay of position" in text
    robot = load_robot("kuka_kr300_r2500", flex=tmp_path / "found.toml")
    assert robot.stiffness[2] == pytest.approx(entry.stiffness)
    assessed = run("assess", "kuka_kr300_r2500", "--flex", "found.toml", "--json", "-",
                   cwd=tmp_path)  # fmt: skip
    assert assessed.returncode == 0, assessed.stderr


def test_bad_input_leaves_nothing(tmp_path):
    done = run("identify", "emps", "--data", "nowhere", "--out", "x.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert "no such campaign" in done.stderr
    assert not list(tmp_path.iterdir())
    done = run("identify", "emps", "--data", "nowhere", "--out", "no/x.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert "folder does not exist" in done.stderr
