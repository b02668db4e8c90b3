"""What every output makes of a fault: a row an output, a column a fault.

    python tests/attack/faults.py [--fast] [NAME ...]

Each is written once, then again under the fault: the old one must be whole afterwards, or the new
one, and what is said is one line that names it. `test_faults.py` runs the same functions.
"""

from __future__ import annotations

import argparse
import contextlib
import errno
import os
import resource
import shutil
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from subprocess import CompletedProcess

from held import MAPPING

from picchio.campaign.tables import Tolerance
from picchio.cli.main import main as command
from picchio.cli.main import run
from picchio.prediction.plan import Plan, plan_toml
from picchio.prediction.simulation import simulate

ARM = "fanuc_like_3dof"
PLAN = Plan(
    poses=[[0.3, 0.5, -0.8]], directions=[[0.6, 0.0, 0.8]], sample_rate=1000.0, quiet=0.3,
    length=0.3, sensor=[{"channels": "accelerometer.tool", "noise": 0.1}],
    excitation={"kind": "pulse_train", "force": 300.0, "period": 0.04, "width": 0.004, "hits": 2},
    effect=[{"effect": "joint_stiffness", "target": "joint_2", "parameters": {"scale": 0.7}}],
    tolerance=Tolerance.zero(),  # one pose tells a cause only where the files are exact
)  # fmt: skip
DIED = 77
Waiter = Callable[[], CompletedProcess]
MOST_RENAMES = 40


@dataclass(frozen=True)
class Output:
    """A file or folder that a command writes.

    Attributes:
        name: of the output.
        typed: the command, with OUT for the name.
        slow: it takes seconds.
        again: the command that replaces it, where that is another.
        kept: whether it is never replaced: the second command finds none.
        threads: it computes in threads, which a fork does not survive.
    """

    name: str
    typed: str
    slow: bool = False
    again: str = ""
    kept: bool = False
    threads: bool = False

    @property
    def title(self) -> str:
        return f"{self.typed.split()[0]}-{self.name}"

    def words(self, target: object, again: bool = False) -> list[str]:
        return ((again and self.again) or self.typed).replace("OUT", str(target)).split()


OUTPUTS = [
    Output("a.json", f"assess {ARM} --json OUT"),
    Output("a.html", f"assess {ARM} --report OUT", slow=True),
    Output("e.json", f"envelope {ARM} --pose 0,0.5,-0.8 --json OUT"),
    Output("m.nc", f"map {ARM} --joint-grid 3 --out OUT", threads=True),
    Output("m.zarr", f"map {ARM} --joint-grid 3 --out OUT", threads=True),
    Output("p.toml", f"place {ARM} --placements 2 --move 0.01,0,0,0 --out OUT", slow=True,
           threads=True),
    Output("r.urdf", f"annotate {ARM} --out OUT"),
    Output("mapping.toml", "import raw.csv --write-mapping OUT", kept=True),
    Output("imported", "import raw.csv --mapping made.toml --to OUT",
           again="import raw2.csv --mapping made.toml --to OUT --append"),
    Output("simulated", f"simulate {ARM} --plan plan.toml --overwrite --to OUT"),
    Output("parquet", f"simulate {ARM} --plan plan.toml --parquet --overwrite --to OUT"),
    Output("sheet.html", f"plan {ARM} --budget 3min --report OUT", slow=True, threads=True),
    Output("steel.toml", "fit-sn tests.csv --out OUT"),
    Output("steel.png", "fit-sn tests.csv --plot OUT"),
    Output("c.json", "check campaign --json OUT"),
    Output("c.html", f"check campaign --robot {ARM} --report OUT", slow=True),
    Output("v.html", f"view {ARM} --out OUT", slow=True),
    Output("d.json", f"diagnose {ARM} --data campaign --json OUT", slow=True),
    Output("d.toml", f"diagnose {ARM} --data campaign --model OUT", slow=True),
    Output("d.html", f"diagnose {ARM} --data campaign --report OUT", slow=True),
    Output("i.toml", f"identify {ARM} --data campaign --out OUT", slow=True),
    Output("rep.html", "reproduce --worlds 8 --report OUT", slow=True, threads=True),
]  # fmt: skip


def inputs(folder: Path) -> None:
    """What the commands read."""
    simulate(ARM, PLAN, folder / "campaign")
    (folder / "plan.toml").write_text(plan_toml(PLAN))
    (folder / "made.toml").write_text(MAPPING)
    for name in ("raw.csv", "raw2.csv"):
        (folder / name).write_text("t,F\n" + "".join(f"{i},{i * 0.25}\n" for i in range(50)))
    cycles = [2e4, 5e4, 1e5, 3e5, 1e6, 2e6]
    (folder / "tests.csv").write_text(
        "shear_amplitude [MPa],cycles,failed\n"
        + "".join(f"{500 * n**-0.08:.2f},{n:.0f},1\n" for n in cycles)
        + "180,1e7,0\n170,1e7,0\n"
    )


def content(path: Path) -> dict[str, bytes] | None:
    """Bytes of a file, or of all in a folder."""
    if path.is_dir():
        return {str(p.relative_to(path)): p.read_bytes() for p in path.rglob("*") if p.is_file()}
    return {"": path.read_bytes()} if path.exists() else None


def put_back(path: Path, files: dict[str, bytes] | None) -> None:
    """Make it what `content` saw."""
    if path.is_dir():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)
    for name, data in (files or {}).items():
        file = path / name if name else path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(data)


def begin(output: Output, words: list[str], folder: Path, hook: str = "") -> Waiter:
    """Start a command as a process of its own; what is returned waits for it.

    A fork of this one is many times faster, where the threads of a map are not in the way.
    """
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        os.dup2(write, 2)
        if output.threads:
            os.chdir(folder)
            os.execv(sys.executable, [sys.executable, __file__, "--child", hook, *words])
        sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w")
        os.chdir(folder)
        child_main(hook, words)
    os.close(write)

    def wait() -> CompletedProcess:
        with open(read) as said:
            lines = [line for line in said if ": error: " in line or "Traceback" in line]
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        return CompletedProcess(words, status, "", "".join(lines))

    return wait


def child_main(hook: str, words: list[str]) -> None:
    """Run a command with a fault, and end."""
    status = 70
    try:
        if hook == "limited":
            limited()
        elif hook:
            dies_at(int(hook))
        command(words)
    except SystemExit as ended:
        status = int(ended.code or 0)
    except BaseException:
        traceback.print_exc()
    finally:
        with contextlib.suppress(OSError):
            sys.stderr.flush()
        os._exit(status)


def first(output: Output, folder: Path) -> dict[str, bytes] | None:
    """Write it once; its content, or None where it is never replaced."""
    target = folder / output.name
    put_back(target, None)
    if output.threads:
        assert begin(output, output.words(output.name), folder)().returncode == 0
    else:  # in this process: what it loads, every fork has
        with (
            contextlib.chdir(folder),
            open(os.devnull, "w") as away,
            warnings.catch_warnings(),
            contextlib.redirect_stdout(away),
            contextlib.redirect_stderr(away),
        ):
            assert run(output.words(output.name)) == 0
    old = content(target)
    assert old
    if output.kept:
        put_back(target, None)
        return None
    return old


def refused(done: CompletedProcess, output: object, reason: str) -> None:
    """One line that names the output, or a temporary file that came before it."""
    lines = done.stderr.splitlines()
    assert done.returncode == 1, (done.returncode, lines)
    assert len(lines) == 1 and reason in lines[0], lines
    assert str(output) in lines[0] or tempfile.gettempdir() in lines[0], lines


def left(output: Output, folder: Path, old: dict[str, bytes] | None, before: set[str]) -> None:
    assert content(folder / output.name) == old
    # The finished chunks of a map stay, for it to be resumed.
    assert {p.name for p in folder.iterdir()} - before <= {f".{output.name}.chunks"}


def limited() -> None:
    """No file grows beyond 64 bytes."""
    hard = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
    resource.setrlimit(resource.RLIMIT_FSIZE, (64, hard))


def size_limit(output: Output, folder: Path) -> str:
    """Beyond `ulimit -f`."""
    old = first(output, folder)
    before = {p.name for p in folder.iterdir()}
    done = begin(output, output.words(output.name, True), folder, "limited")()
    refused(done, output.name, "File too large")
    left(output, folder, old, before)
    return "old"


def full_disk(output: Output, folder: Path) -> str:
    """On a disk of its own without room."""
    disk = folder / "disk"
    disk.mkdir(exist_ok=True)
    with mounted(disk, "size=4k,nr_inodes=64") as small:
        if not small:
            return "no tmpfs"
        (disk / "filler").write_bytes(bytes(4096))
        words = output.words(Path("disk") / output.name)
        done = begin(output, words, folder)()
        refused(done, output.name, os.strerror(errno.ENOSPC))
        assert content(disk / output.name) is None
    return "none"


@contextlib.contextmanager
def mounted(folder: Path, options: str) -> Iterator[bool]:
    """A small disk; False where this user may mount none."""
    did = os.system(f"mount -t tmpfs -o {options} tmpfs '{folder}' 2>/dev/null") == 0
    try:
        yield did
    finally:
        if did:
            os.system(f"umount -l '{folder}'")


def read_only(output: Output, folder: Path) -> str:
    """/sys takes no files, whoever asks."""
    target = Path("/sys") / output.name
    done = begin(output, output.words(target), folder)()
    refused(done, target, "")
    assert not target.exists()
    return "none"


def killed(output: Output, folder: Path) -> str:
    """Gone at the first rename, at the second, and so on until none is left."""
    old = first(output, folder)
    target = folder / output.name
    seen = []
    for call in range(1, MOST_RENAMES):
        put_back(target, old)
        done = begin(output, output.words(output.name, True), folder, str(call))()
        if done.returncode == 0:
            new = content(target)
            assert all(found in (old, new) for found in seen), "neither old nor new"
            return f"{len(seen)} kills"
        assert done.returncode == DIED, (done.returncode, done.stderr)
        seen.append(content(target))
    raise AssertionError("no end of renames")


def dies_at(call: int) -> None:
    """This process ends at its `call`-th rename, before it is done."""
    count, renames = 0, {name: getattr(os, name) for name in ("replace", "rename")}

    def counted(name: str) -> Callable[..., None]:
        def rename(*names: object, **options: object) -> None:
            nonlocal count
            # zarr's own, inside a folder that is not yet in its place, are no replacement.
            count += "picchio" in sys._getframe(1).f_globals["__name__"]
            if count == call:
                os._exit(DIED)
            renames[name](*names, **options)

        return rename

    for name in renames:
        setattr(os, name, counted(name))


def two_at_once(output: Output, folder: Path) -> str:
    """Two write it at the same time: each does, or is told in one line."""
    old = first(output, folder)
    target = folder / output.name
    put_back(target, old)
    words = output.words(output.name, True)
    alone = begin(output, words, folder)()
    assert alone.returncode == 0, alone.stderr
    new = content(target)
    put_back(target, old)
    both = [begin(output, words, folder) for _ in range(2)]
    ended = [wait() for wait in both]
    for done in ended:
        lines = done.stderr.splitlines()
        told = len(lines) == 1 and output.name in lines[0]
        assert done.returncode == 0 or (done.returncode in (1, 2) and told), (done, lines)
    assert any(done.returncode == 0 for done in ended), ended
    assert content(target) == new
    return "both" if all(done.returncode == 0 for done in ended) else "one told"


FAULTS = {
    "full disk": full_disk,
    "read-only": read_only,
    "ulimit -f": size_limit,
    "killed": killed,
    "two at once": two_at_once,
}


def main() -> int:
    """Print the table: what is left, or what is wrong. 1 if anything is."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="of outputs; all if not given")
    parser.add_argument("--fast", action="store_true", help="without those that take seconds")
    given = parser.parse_args()
    chosen = [
        output for output in OUTPUTS
        if (not given.names or output.name in given.names) and not (given.fast and output.slow)
    ]  # fmt: skip
    wrong = []
    print(f"{'output':24}" + "".join(f"{name:>12}" for name in FAULTS))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        inputs(folder)
        for output in chosen:
            cells = []
            for fault, tried in FAULTS.items():
                try:
                    cells.append(tried(output, folder))
                except AssertionError as error:
                    cells.append("WRONG")
                    wrong.append(f"{output.title}, {fault}: {error}")
            print(f"{output.title:24}" + "".join(f"{cell:>12}" for cell in cells), flush=True)
    print(*wrong, sep="\n")
    return int(bool(wrong))


if __name__ == "__main__":
    if sys.argv[1:2] == ["--child"]:
        child_main(sys.argv[2], sys.argv[3:])
    sys.exit(main())
