"""What a robot, a joint or an operation is called is text, wherever it is printed."""

from pathlib import Path

import pytest

import picchio

NAMES = {"markup": "[/x]", "bold": "[bold]j[/]", "emoji": ":smile:", "escape": "a\x1b[31mb"}


@pytest.fixture(params=NAMES)
def named(request, tmp_path):
    """The shipped arm whose first joint and first operation have a strange name."""
    name = NAMES[request.param]
    robot = picchio.load_robot("fanuc_like_3dof")
    if name.isprintable():  # XML holds no escape
        urdf = Path(robot.source).read_text().replace("joint_1", name)
    else:
        urdf = Path(robot.source).read_text()
    (tmp_path / "robot.urdf").write_text(urdf)
    task = Path(robot.task_path).read_text().replace('name = "forward"', f"name = {toml(name)}")
    (tmp_path / "task.toml").write_text(task)
    return tmp_path, name


def toml(text):
    return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in text) + '"'


@pytest.mark.parametrize(
    "command",
    [
        "assess robot.urdf --task task.toml",
        "envelope robot.urdf --pose 0,0.5,-0.8",
        "map robot.urdf --joint-grid 3 --out m.nc",
    ],
)
def test_it_is_printed_as_it_is(named, command, in_process):
    folder, name = named
    done = in_process(*command.split(), cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "\x1b" not in done.stdout + done.stderr
    if name.isprintable() or "task" in command:
        shown = name.encode("unicode_escape").decode()
        assert shown in done.stdout


@pytest.mark.parametrize("name", ["\x1b[31mred", "a\x00b", "\u202eabc", "\udcff"])
def test_a_name_that_is_wrong_is_spelled_out(name, in_process):
    done = in_process("assess", name)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert not any(c in done.stderr for c in "\x1b\x00\u202e\udcff")
