"""Hostile URDFs and sidecars, in a process of their own so that a crash would be seen."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

from picchio.core.errors import InputError
from picchio.robot.loading.load import load_robot

SCRIPT = Path(__file__).with_name("hostile_urdfs.py")
_spec = importlib.util.spec_from_file_location("hostile_urdfs", SCRIPT)
assert _spec is not None
assert _spec.loader is not None
hostile = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(hostile)


def test_there_are_more_than_sixty():
    assert sum(word is not None for _, _, word in hostile.FILES.values()) >= 60


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory) -> dict[str, tuple[float, int, str]]:
    """Every file's seconds, peak memory in MB and outcome; a crash restarts after its file."""
    left = list(hostile.FILES)
    found: dict[str, tuple[float, int, str]] = {}
    while left:
        folder = tmp_path_factory.mktemp("hostile")
        done = subprocess.run(
            [sys.executable, str(SCRIPT), str(folder), *left],
            capture_output=True, text=True, timeout=300, check=False,
        )  # fmt: skip
        name = ""
        for line in done.stdout.splitlines():
            kind, _, rest = line.partition(" ")
            if kind == "BEGIN":
                name = rest
                found[name] = (0.0, 0, f"CRASH {done.returncode} {done.stderr[-2000:]}")
            elif kind == "END":
                seconds, peak, outcome = rest.split(" ", 2)
                found[name] = (float(seconds), int(peak), outcome)
            else:
                found[name] = (0.0, 0, f"STRAY OUTPUT {line}")
        if name not in left:
            pytest.fail(done.stderr)
        left = left[left.index(name) + 1 :]
    return found


@pytest.mark.parametrize("name", sorted(hostile.FILES))
def test_one_clear_line_or_a_robot(outcomes, name):
    seconds, peak, outcome = outcomes[name]
    word = hostile.FILES[name][2]
    if word is None:
        assert outcome == "LOADED"
    else:
        assert outcome.startswith("INPUT ")
        assert word in outcome
        assert len(outcome) < 1000
    assert seconds < 5.0
    assert peak < 1000


def test_a_file_of_100_mb_is_not_even_read(tmp_path):
    path = tmp_path / "big.urdf"
    with path.open("wb") as stream:
        stream.truncate(100_000_000)
    with pytest.raises(InputError, match="is too large"):
        load_robot(path)


@pytest.mark.parametrize("name", ["", "no/such/robot.urdf", "nul\0byte", ".", "/", "/dev/null",
                                  "../../etc", "~", "fanuc_like_3dof "])  # fmt: skip
def test_odd_robot_names(name):
    with pytest.raises(InputError):
        load_robot(name)


def test_a_folder_in_place_of_a_file(tmp_path):
    (tmp_path / "robot.urdf").mkdir()
    with pytest.raises(InputError, match="is a folder"):
        load_robot(tmp_path / "robot.urdf")
