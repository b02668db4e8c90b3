"""What the tests of this folder share: an import, and what they hold of processes."""

from __future__ import annotations

from pathlib import Path

MAPPING = """format = "picchio-mapping/1"
[time]
series = "t"
unit = "ms"
[[channel]]
from = "F"
to = "force"
unit = "kN"
[record]
kind = "percussion"
pose = { joint_1 = 0.3 }
direction = [0.0, 0.0, 1.0]
[campaign]
robot = "fanuc_like_3dof"
tool = "tool"
"""


def one_line(done, status, *words):
    """Held: this exit status, one line on stderr with these words, nothing on stdout."""
    assert done.returncode == status, done.stderr
    assert len(done.stderr.splitlines()) == 1, done.stderr
    for word in words:
        assert word in done.stderr, done.stderr


def children(pid: int) -> set[int]:
    """Process numbers of all that descend from a process (Linux)."""
    found, todo = set(), [pid]
    while todo:
        number = todo.pop()
        for task in Path(f"/proc/{number}/task").glob("*/children"):
            for child in task.read_text().split():
                found.add(int(child))
                todo.append(int(child))
    return found


def alive(pid: int) -> bool:
    """Whether a process runs; one that ended and was not waited for does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False
