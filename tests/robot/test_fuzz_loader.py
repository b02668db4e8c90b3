"""The fuzzer for a bounded time, in a process of its own."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).with_name("fuzz_loader.py")


def fuzz(seconds: int, seed: int) -> None:
    done = subprocess.run(
        [sys.executable, str(SCRIPT), str(seconds), str(seed)],
        capture_output=True, text=True, timeout=seconds + 60, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    # It must have got somewhere: plainly more than the lines of one good file.
    tries, kept, lines = (int(word) for word in done.stdout.split() if word.isdigit())
    assert tries > 20 * seconds
    assert kept > 10
    assert lines > 300


def test_three_seconds():
    fuzz(3, 1)


@pytest.mark.slow
def test_forty_seconds():
    fuzz(40, 2)
