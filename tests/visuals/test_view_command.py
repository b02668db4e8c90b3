"""`picchio view`."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import pytest

from picchio.cli.main import run


def test_a_task_becomes_a_scene(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "scene.html"
    assert run(["view", "fanuc_like_3dof", "--out", str(out), "--json", "-"]) == 0
    said = capsys.readouterr()
    told = json.loads(said.out)
    assert told["format"] == "picchio-scene/1"
    assert told["bytes"] == out.stat().st_size < 5e6
    assert {layer["id"] for layer in told["layers"]} >= {"robot", "envelope", "rivets-2"}
    assert "scene.html" in said.err


def test_a_pose_becomes_a_scene(tmp_path: Path) -> None:
    out = tmp_path / "scene.html"
    assert run(["view", "fanuc_like_3dof", "--pose=-0.3,1.1,-1.0", "--joint", "joint_3",
                "--out", str(out)]) == 0  # fmt: skip
    assert "pose (-0.3, 1.1, -1)" in out.read_text()


@pytest.mark.parametrize(
    ("extra", "told"),
    [
        (["--pose=1,2"], "--pose"),
        (["--pose=1,2,x"], "--pose"),
        (["--force", "100"], "--force"),
        (["--joint", "elbow"], "joint_1, joint_2, joint_3"),
        (["--task", "nowhere.toml"], "nowhere.toml"),
    ],
)
def test_bad_input_is_one_line_and_no_file(
    extra: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "scene.html"
    assert run(["view", "fanuc_like_3dof", "--out", str(out), *extra]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert told in said.err.strip().splitlines()[-1] or told == "--pose"
    assert len([line for line in said.err.splitlines() if "error" in line]) == 1
    assert list(tmp_path.iterdir()) == []


def test_without_a_name_one_is_chosen_and_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["view", "fanuc_like_3dof"]) == 0
    (made,) = tmp_path.iterdir()
    assert made.suffix == ".html" and made.name in capsys.readouterr().err


def test_an_input_is_not_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    task = tmp_path / "task.toml"
    task.write_text("format = 1")
    assert run(["view", "fanuc_like_3dof", "--task", str(task), "--out", str(task)]) == 2
    assert "--out: this output has another ending" in capsys.readouterr().err
    assert task.read_text() == "format = 1"


def test_a_live_viewer_runs_until_it_is_interrupted(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    calls: list[str] = []

    class Server:
        def wait(self) -> None:
            calls.append("wait")
            raise KeyboardInterrupt

        def kill(self) -> None:
            calls.append("kill")

    def show(scene: object) -> SimpleNamespace:
        print("a greeting")
        return SimpleNamespace(window=SimpleNamespace(server_proc=Server()))

    monkeypatch.setattr("picchio.visuals.scene.scene.Scene.show", show)
    assert run(["view", "fanuc_like_3dof", "--pose=-0.3,1.1,-1.0", "--live", "--json", "-"]) == 0
    assert calls == ["wait", "kill"]
    assert json.loads(capsys.readouterr().out)["file"] is None
