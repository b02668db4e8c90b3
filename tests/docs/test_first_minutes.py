"""The page of the first ten minutes: its files and commands do what it says."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

import picchio
from picchio.cli.main import run

pytestmark = pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")


@pytest.fixture
def blocks(
    repository: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> dict[str, list[str]]:
    """The page's code by language, in an empty folder."""
    monkeypatch.chdir(tmp_path)
    found: dict[str, list[str]] = {}
    page = (repository / "docs" / "first_minutes.md").read_text()
    for language, code in re.findall(r"```(\w+)\n(.*?)```", page, re.S):
        found.setdefault(language, []).append(code)
    return found


def commands(text: str) -> list[list[str]]:
    """The words of its picchio commands."""
    lines = [line.partition("#")[0].split() for line in text.splitlines()]
    return [words[1:] for words in lines if words[:1] == ["picchio"]]


def test_the_log_is_counted(blocks, tmp_path, capsys) -> None:
    (tmp_path / "log.py").write_text(blocks["python"][0])
    runpy.run_path(str(tmp_path / "log.py"))
    (tmp_path / "logs" / "mapping.toml").write_text(blocks["toml"][0])
    (count,) = (c for text in blocks["sh"] for c in commands(text) if c[0] == "count")
    assert run(count) == 0
    assert "1440 blows" in capsys.readouterr().out
    assert (tmp_path / "life.html").is_file()


@pytest.mark.slow
def test_the_softer_joint_is_identified(blocks, tmp_path) -> None:
    (tmp_path / "plan.toml").write_text(blocks["toml"][1])
    for command in commands(blocks["sh"][-1]):
        assert run(command) == 0, command
    robot = picchio.load_robot("fanuc_like_3dof", flex=tmp_path / "flex.toml")
    assert robot.stiffness[1] == pytest.approx(7e4, rel=0.02)
