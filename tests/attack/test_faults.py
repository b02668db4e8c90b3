"""Every output on a full and on a read-only disk: one line, the old file whole, no litter."""

from __future__ import annotations

import contextlib
import os
import resource
from dataclasses import dataclass

import numpy as np
import pytest
from held import MAPPING, one_line

from picchio.prediction.plan import Plan, plan_toml
from picchio.prediction.simulation import simulate

ARM = "fanuc_like_3dof"
PLAN = Plan(
    poses=[[0.3, 0.5, -0.8]], directions=[[0.6, 0.0, 0.8]], sample_rate=1000.0, quiet=0.3,
    length=0.3, sensor=[{"channels": "accelerometer.tool", "noise": 0.1}],
    excitation={"kind": "pulse_train", "force": 300.0, "period": 0.04, "width": 0.004, "hits": 2},
    effect=[{"effect": "joint_stiffness", "target": "joint_2", "parameters": {"scale": 0.7}}],
)  # fmt: skip


@dataclass(frozen=True)
class Output:
    """A file or folder that a command writes: what is typed, with OUT for its name."""

    name: str
    typed: str
    slow: bool = False


OUTPUTS = [
    Output("a.json", f"assess {ARM} --json OUT"),
    Output("a.html", f"assess {ARM} --report OUT", slow=True),
    Output("e.json", f"envelope {ARM} --pose 0,0.5,-0.8 --json OUT"),
    Output("m.nc", f"map {ARM} --joint-grid 3 --out OUT"),
    Output("m.zarr", f"map {ARM} --joint-grid 3 --out OUT"),
    Output("p.toml", f"place {ARM} --placements 2 --move 0.01,0,0,0 --out OUT", slow=True),
    Output("r.urdf", f"annotate {ARM} --out OUT"),
    Output("mapping.toml", "import raw.csv --write-mapping OUT"),
    Output("imported", "import raw.csv --mapping made.toml --to OUT"),
    Output("simulated", f"simulate {ARM} --plan plan.toml --overwrite --to OUT"),
    Output("parquet", f"simulate {ARM} --plan plan.toml --parquet --overwrite --to OUT"),
    Output("steel.toml", "fit-sn tests.csv --out OUT"),
    Output("steel.png", "fit-sn tests.csv --plot OUT"),
    Output("c.json", "check campaign --json OUT"),
    Output("c.html", f"check campaign --robot {ARM} --report OUT", slow=True),
    Output("v.html", f"view {ARM} --out OUT"),
    Output("d.json", f"diagnose {ARM} --data campaign --json OUT", slow=True),
    Output("d.toml", f"diagnose {ARM} --data campaign --model OUT", slow=True),
    Output("d.html", f"diagnose {ARM} --data campaign --report OUT", slow=True),
    Output("rep.html", "reproduce --report OUT", slow=True),
]


@contextlib.contextmanager
def full_disk():
    """No file grows beyond 64 bytes: the same error path as a disk without room."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (64, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def inputs(folder):
    """What the commands read."""
    simulate(ARM, PLAN, folder / "campaign")
    (folder / "plan.toml").write_text(plan_toml(PLAN))
    (folder / "made.toml").write_text(MAPPING)
    (folder / "raw.csv").write_text("t,F\n" + "".join(f"{i},{i * 0.25}\n" for i in range(50)))
    cycles = [2e4, 5e4, 1e5, 3e5, 1e6, 2e6]
    (folder / "tests.csv").write_text(
        "shear_amplitude [MPa],cycles,failed\n"
        + "".join(f"{500 * n**-0.08:.2f},{n:.0f},1\n" for n in cycles)
        + "180,1e7,0\n170,1e7,0\n"
    )


def content(path):
    """Bytes of a file, or of all in a folder."""
    if path.is_dir():
        return {p.relative_to(path): p.read_bytes() for p in path.rglob("*") if p.is_file()}
    return path.read_bytes() if path.exists() else None


def marked(outputs):
    for output in outputs:
        marks = [pytest.mark.slow] if output.slow else []
        yield pytest.param(output, marks=marks, id=f"{output.typed.split()[0]}-{output.name}")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("faults")
    inputs(made)
    return made


@pytest.mark.parametrize("output", marked(OUTPUTS))
def test_a_full_disk_leaves_the_old_output(output, folder, in_process):
    target = folder / output.name
    typed = output.typed.replace("OUT", output.name).split()
    first = in_process(*typed, cwd=folder)  # everything that is kept for later runs, too
    assert first.returncode == 0, first.stderr
    old = content(target)
    assert old
    if output.name == "imported":
        typed.append("--append")
        (folder / "raw2.csv").write_bytes((folder / "raw.csv").read_bytes())
        typed[1] = "raw2.csv"
    if output.name == "mapping.toml":  # it is never replaced
        target.unlink()
        old = None
    before = {p.name for p in folder.iterdir()}
    with full_disk():
        done = in_process(*typed, cwd=folder)
    errors = [line for line in done.stderr.splitlines() if "warning:" not in line]
    assert done.returncode == 1, done.stderr
    assert len(errors) == 1 and output.name in errors[0] and "File too large" in errors[0], errors
    assert content(target) == old
    # The finished chunks of a map stay, for it to be resumed.
    assert {p.name for p in folder.iterdir()} - before <= {f".{output.name}.chunks"}


@pytest.mark.parametrize("output", marked(o for o in OUTPUTS if not o.slow))
def test_a_read_only_place_is_one_line(output, folder, in_process):
    """/sys takes no files, whoever asks."""
    target = f"/sys/{output.name}"
    done = in_process(*output.typed.replace("OUT", target).split(), cwd=folder)
    one_line(done, 1, target)
    assert not os.path.exists(target)


def test_the_limit_is_felt(tmp_path):
    with full_disk(), pytest.raises(OSError, match="File too large"):
        (tmp_path / "x").write_bytes(np.zeros(100).tobytes())
