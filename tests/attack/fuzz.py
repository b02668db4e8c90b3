"""Spoils the files of every reader: each must be read, or refused in one line, in bounded effort.

    python tests/attack/fuzz.py [--reader mcap] [--seconds 600] [--seed 1]

Bytes and tokens are changed, cut out, doubled, swapped and taken from elsewhere, numbers replaced;
what reaches new lines of picchio is kept and spoiled further. A reader works in a process of its
own, so that a crash is seen, too. Anything but a result or a `PicchioError` of one short line that
names a file is a finding, as are more than 10 s of processor time or 2 GiB for one small file. Each
is printed and left, with the files that led to it, in a folder that is printed; the exit status is
then 1.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.util
import json
import multiprocessing
import os
import random
import re
import resource
import shutil
import signal
import struct
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

import picchio
from picchio.core import processes
from picchio.core.errors import PicchioError

SECONDS, MEMORY, LONGEST, LEAST = 10.0, 2 << 30, 2000, 10
ARM, POSE = "fanuc_like_3dof", [0.3, 0.5, -0.8]
BLOWS = '{ kind = "pulse_train", force = 300.0, period = 0.04, width = 0.004, hits = 2 }'

URDF = """<?xml version="1.0"?>
<robot name="r" xmlns:picchio="urn:picchio:1" xmlns:drake="urn:drake">
<link name="a"/><link name="b"><inertial><origin xyz="0.1 0 0" rpy="0 0 1"/><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial><visual/></link>
<link name="c"><inertial><mass value="2"/><inertia ixx="1" ixy="0.1" ixz="0" iyy="1" iyz="0"
izz="1"/></inertial></link><link name="d"/>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0 0 1"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/>
<picchio:flexibility stiffness="1e4" damping_ratio="0.03"/>
<picchio:shaft radius="0.01" length="0.1" shear_modulus="79e9" sn_curve="x"/>
<picchio:balancer parent_point="0 0 1" child_point="1 0 0" stiffness="5"/></joint>
<joint name="k" type="prismatic"><parent link="b"/><child link="c"/><axis xyz="1 0 0"/>
<limit lower="0" upper="1" effort="1" velocity="1"/></joint>
<joint name="m" type="continuous"><parent link="c"/><child link="d"/><mimic joint="j"/></joint>
<transmission name="t"><joint name="j"/><actuator name="x"><drake:rotor_inertia value="1e-4"/>
</actuator></transmission><picchio:tool frame="d" mass="1"/>
<picchio:gun mass="1" recoil_stiffness="1e4"/></robot>"""
FLEX = """format = "picchio-sidecar/1"
[joint.k]
stiffness_curve = { k1 = 1e4, k2 = 2e4, k3 = 3e4, t1 = 1.0, t2 = 2.0 }
source = "fuzz"
[tool]
frame = "d"
mass = 1.0
axis = [0.0, 1.0, 0.0]
inertia = [1, 0, 0, 1, 0, 1]
[base]
gravity = [0, 0, -9.81]
"""
TASK = """format = "picchio-task/1"
hits_per_rivet = 2
[excitation]
kind = "pulse_train"
force = 300.0
period = 0.040
width = 0.004
[[operation]]
name = "forward"
direction = [1.0, 0.0, 0.0]
poses = [[0.0, 0.5, -0.8], { joint_2 = 0.5 }]
rivets = 2
[[operation]]
name = "up"
direction = [0.0, 0.0, 2.0]
points = [[1.35, 0.25, 0.65]]
branch = "elbow-up"
excitation = { kind = "half_sine_train", width = 0.006 }
"""
MEASURED = """format = "picchio-task/1"
hits_per_rivet = 2
excitation = { kind = "measured", file = "force.csv", period = 0.04 }
operation = [{ name = "a", direction = [0, 1, 0], poses = [[0.0, 0.5, -0.8]] }]
"""
PLAN = f"""format = "picchio-plan/1"
poses = [[0.3, 0.5, -0.8]]
directions = [[0.6, 0.0, 0.8]]
levels = [300.0]
sample_rate = 200.0
quiet = 0.02
length = 0.1
excitation = {BLOWS}
[[sensor]]
channels = "accelerometer.tool"
noise = 0.1
[[effect]]
effect = "joint_stiffness"
target = "joint_2"
parameters = {{ scale = 0.7 }}
"""
MODEL = f"""format = "picchio-model/1"
robot = "{ARM}"
[[effect]]
effect = "joint_stiffness"
target = "joint_2"
parameters = {{ scale = 0.7 }}
[[effect]]
effect = "payload"
target = "tool"
parameters = {{ mass = 1.5 }}
"""
CAMPAIGN = f"""format = "picchio-campaign/1"
robot = "{ARM}"
tool = "tool"
excitation = {BLOWS}
[tolerance]
stiffness = 0.05
[[record]]
file = "r01.csv"
kind = "percussion"
pose = {{ joint_1 = 0.3, joint_2 = 0.5, joint_3 = -0.8 }}
direction = [1.0, 0.0, 0.0]
time = 2026-03-01T08:00:00Z
temperature = 22.0
[[record]]
file = "r02.parquet"
kind = "motion"
"""
CURVE = """format = "picchio-sn-curve/1"
name = "my-steel"
kind = "shear"
strength = 230e6
cycles = 2e6
slopes = [5.0, 7.0]
knees = [2e6, 1e8]
survival = 0.975
scatter = 0.04
source = "tests"
"""
REDUCERS = """format = "picchio-reducers/1"
manufacturer = "Example Gears"
kind = "cycloidal"
rated_speed_rpm = 15.0
rated_life_hours = 6000.0
source = "catalogue"
[[reducer]]
name = "EX-40"
rated_torque = 412.0
repeated_peak_torque = 1029.0
momentary_peak_torque = 2058.0
"""
MAPPING = """format = "picchio-mapping/1"
[source]
delimiter = ";"
[time]
series = "t"
unit = "ms"
rate = 1000.0
resample = "linear"
[[channel]]
from = "F"
to = "force"
unit = "kN"
scale = 2.0
remove = "mean"
[record]
kind = "percussion"
pose = { joint_1 = 0.3 }
direction = [0.0, 0.0, 1.0]
"""
DIAGNOSIS = {
    "format": "picchio-diagnosis/1", "verdict": "named",
    "causes": [{"effect": "payload", "target": "tool", "confidence": 0.99,
                "parameters": {"mass": {"value": 2.1, "std": 0.02, "unit": "kg"}}}],
    "alternatives": [[{"effect": "joint_stiffness", "target": "joint_2"}]],
    "leads": [{"effect": "backlash", "target": "joint_1"}],
}  # fmt: skip


@dataclass(frozen=True)
class Reader:
    """What reads a kind of file.

    Attributes:
        write: makes good files in a folder.
        read: takes the folder, and uses what it has read as a command would.
        spoiled: the files in it that are spoiled; all of them, in folders, too, where empty.
    """

    write: Callable[[Path], Any]
    read: Callable[[Path], Any]
    spoiled: tuple[str, ...] = ()


# The good files, and what reads them.


def texts(**named: str) -> Callable[[Path], None]:
    """Writes these; `__` stands for the point before a file's ending."""

    def write(folder: Path) -> None:
        for name, text in named.items():
            (folder / name.replace("__", ".")).write_text(text)

    return write


def load(folder: Path, **options: Any) -> None:
    robot = picchio.load_robot(folder / "robot.urdf", **options)
    robot.state([0.1] * len(robot.joint_names))
    robot.gravity_stiffness([0.1] * len(robot.joint_names))


def assess(folder: Path) -> None:
    robot = picchio.load_robot(ARM)
    picchio.assess(robot, picchio.load_task(folder / "task.toml", robot)).to_dict()


def envelope(folder: Path) -> None:
    model = picchio.Model.of(picchio.load_robot(folder / "model.toml"))
    picchio.envelope(model, POSE, picchio.PulseTrain(300.0, 0.04, 0.004)).to_dict()


def samples(folder: Path) -> None:
    for record in picchio.load_campaign(folder):
        record.check_samples()
        for values in record.read().values():
            assert values.size == record.clock.samples and np.isfinite(values).all()


def write_campaign(folder: Path) -> None:
    from picchio.campaign.campaign import Campaign
    from picchio.campaign.record import Record

    clock = np.arange(-10, 40) / 1024.0
    noise = np.random.default_rng(7).normal(size=(2, clock.size))
    motion = {"position.joint_1": noise[0], "torque.joint_1": 900.0 * noise[1]}
    record = Record.from_arrays("r02.parquet", clock, motion, kind="motion")
    made = Campaign.from_records([record]).save(folder / "c").folder
    os.replace(made / "r02.parquet", folder / "r02.parquet")
    shutil.rmtree(made)
    table = zip(clock.tolist(), *noise.tolist(), strict=True)
    rows = "".join(f"{t!r},{f!r},{q!r}\n" for t, f, q in table)
    texts(
        r01__csv="time [s],force [N],deflection.joint_1 [rad]\n" + rows,
        campaign__toml=CAMPAIGN,
    )(folder)


def write_foreign(folder: Path) -> None:
    (folder / "raw.csv").write_text("t;F;n\n" + "".join(f"{i};{i * 0.25};x\n" for i in range(40)))
    (folder / "mapping.toml").write_text(MAPPING)


def mapped(folder: Path) -> None:
    from picchio.campaign.importing.importer import read_mapped
    from picchio.campaign.importing.mapping import read_mapping

    file = folder / "mapping.toml"
    campaign = read_mapped(folder / "raw.csv", read_mapping(file), mapping_file=file)
    campaign.check_samples()


def raw(name: str) -> Callable[[Path], None]:
    """Reads a foreign file, and writes the mapping for it."""

    def read(folder: Path) -> None:
        from picchio.campaign.importing.importer import read_raw
        from picchio.campaign.importing.template import mapping_template

        mapping_template(read_raw(folder / name))

    return read


def write_uff(folder: Path) -> None:
    import pyuff

    clock = np.arange(40) / 1024.0
    for binary in (0, 1):
        told = pyuff.prepare_58(
            binary=binary, func_type=1, rsp_node=7, rsp_dir=1, ref_dir=1, ref_node=1,
            data=np.sin(clock), x=clock, id1="acc", ord_data_type=4, abscissa_spacing=1,
            abscissa_spec_data_type=17, ordinate_spec_data_type=12, orddenom_spec_data_type=13,
            ordinate_axis_units_lab="g", abscissa_axis_units_lab="s",
        )  # fmt: skip
        pyuff.UFF(str(folder / "raw.uff")).write_sets([told], mode="add")


def write_bag(folder: Path) -> None:
    logs = imported(Path(__file__).parents[1] / "campaign" / "test_logs_as_they_come.py")
    logs.bag(folder / "raw.bag", np.ones(6), "bag")


def write_mcap(folder: Path) -> None:
    """Without checksums, which would tell of every change at once."""
    import mcap_ros2.writer
    from mcap.writer import CompressionType

    log = imported(Path(__file__).parents[1] / "campaign" / "test_import_mcap.py")
    plain = mcap_ros2.writer.Writer
    mcap_ros2.writer.Writer = lambda stream: plain(
        stream, compression=CompressionType.NONE, enable_crcs=False
    )
    try:
        log.write_log(folder / "raw.mcap", np.arange(4) * 1_000_000, np.ones((5, 4)))
    finally:
        mcap_ros2.writer.Writer = plain


def imported(file: Path) -> Any:
    found = importlib.util.spec_from_file_location(file.stem, file)
    assert found is not None and found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


def write_mat(folder: Path) -> None:
    from scipy.io import savemat

    clock = np.arange(40) / 1024.0
    fields = {"force": np.sin(clock), "position": np.ones((2, 40)), "name": "x"}
    savemat(folder / "raw.mat", {"t": clock, "rec": fields, "cell": [[1.0], ["a"]]})


def map_to(ending: str) -> Callable[[Path], None]:
    """Writes a small map."""

    def write(folder: Path) -> None:
        from picchio.studies.maps import places

        robot = picchio.load_robot(ARM)
        grid = places.joint_grid(robot, [2, 2, 2])
        blows = picchio.PulseTrain(300.0, 0.04, 0.004)
        picchio.workspace_map(robot, grid, blows, folder / f"map{ending}")

    return write


def mapped_values(folder: Path) -> None:
    from picchio.studies.maps.stored import open_map
    from picchio.visuals.plots.workspace import best_branch

    (file,) = folder.glob("map.*")
    with contextlib.closing(open_map(file)) as found:
        best_branch(found, "joint_1")


def scene(folder: Path) -> None:
    blows = picchio.PulseTrain(300.0, 0.04, 0.004)
    picchio.view(ARM, pose=POSE, excitation=blows, diagnosis=folder / "diagnosis.json")


def mesh_to(ending: str) -> Callable[[Path], None]:
    """Writes a box."""

    def write(folder: Path) -> None:
        import trimesh

        trimesh.creation.box((1.0, 2.0, 3.0)).export(folder / f"part{ending}")

    return write


def mesh(ending: str) -> Callable[[Path], None]:
    """Reads a mesh to be drawn, and as a surface whose points are mapped."""

    def read(folder: Path) -> None:
        from picchio.studies.maps.places import surface
        from picchio.visuals.scene.robot.visuals import load_mesh

        drawn = load_mesh(folder / f"part{ending}")
        assert np.isfinite(drawn.vertices[drawn.faces]).all()
        surface(folder / f"part{ending}", spacing=0.5)

    return read


def points(folder: Path) -> None:
    from picchio.studies.maps.places import points_from_csv

    points_from_csv(folder / "points.csv")


def reducers(folder: Path) -> None:
    from picchio.robot.drives.reducer import read_reducers

    read_reducers(folder / "reducers.toml")


def simulate(folder: Path) -> None:
    picchio.simulate(ARM, folder / "plan.toml").campaign.check_samples()


TESTS = "shear_amplitude [MPa],cycles,failed\n" + "".join(
    f"{500 * n**-0.08:.2f},{n:.0f},1\n" for n in (2e4, 5e4, 1e5, 3e5, 1e6, 2e6)
) + "180,1e7,0\n170,1e7,0\n"  # fmt: skip
MESHES = (".stl", ".dae", ".obj", ".ply", ".glb", ".off", ".3mf")
READERS = {
    "urdf": Reader(texts(robot__urdf=URDF), load),
    "sidecar": Reader(
        texts(robot__urdf=URDF, flex__toml=FLEX),
        lambda folder: load(folder, flex=folder / "flex.toml"),
        ("flex.toml",),
    ),
    "task": Reader(texts(task__toml=TASK), assess),
    "force": Reader(
        texts(task__toml=MEASURED, force__csv="time [s],force [N]\n0,0\n0.002,400\n0.004,0\n"),
        assess,
    ),
    "model": Reader(texts(model__toml=MODEL), envelope),
    "plan": Reader(texts(plan__toml=PLAN), simulate),
    "campaign": Reader(write_campaign, samples, ("campaign.toml",)),
    "record-csv": Reader(write_campaign, samples, ("r01.csv",)),
    "record-parquet": Reader(write_campaign, samples, ("r02.parquet",)),
    "sn-curve": Reader(
        texts(curve__toml=CURVE), lambda folder: picchio.load_sn_curve(folder / "curve.toml")
    ),
    "sn-tests": Reader(
        texts(tests__csv=TESTS), lambda folder: picchio.fit_sn(folder / "tests.csv")
    ),
    "reducers": Reader(texts(reducers__toml=REDUCERS), reducers),
    "mapping": Reader(write_foreign, mapped, ("mapping.toml",)),
    "csv": Reader(write_foreign, mapped, ("raw.csv",)),
    "uff": Reader(write_uff, raw("raw.uff")),
    "mcap": Reader(write_mcap, raw("raw.mcap")),
    "bag": Reader(write_bag, raw("raw.bag")),
    "matlab": Reader(write_mat, raw("raw.mat")),
    "map-nc": Reader(map_to(".nc"), mapped_values),
    "map-zarr": Reader(map_to(".zarr"), mapped_values),
    "points": Reader(texts(points__csv="x [m],y [m],z [m],nx,ny,nz\n1,0,0.5,0,0,1\n"), points),
    "diagnosis": Reader(texts(diagnosis__json=json.dumps(DIAGNOSIS)), scene),
    **{ending[1:]: Reader(mesh_to(ending), mesh(ending)) for ending in MESHES},
}

# How files are spoiled.

NASTY = [b"", b"0", b"-1", b"nan", b"inf", b"1e308", b"1e-308", b"9" * 400, b"\x00", b"\xff",
         b"&lt;", b"&#0;", b"a", b"j", b"fixed", b"floating", b"planar", b"continuous", b"mimic",
         b"urn:picchio:2", b"0 0 0", b"1 2", b"\xc3\xa9", b"<!DOCTYPE x>", b"true", b"[[", b"{",
         b"picchio:", b"1_0", b"0x10", b"-0.0", b"1e12", b"0 0 0 0", b"\r", b"\n\n", b"2.0e9",
         b"9223372036854775807", b"[]", b"{}", b'""', b"..", b"x" * 140_000]  # fmt: skip
TOKEN = re.compile(rb'"[^"]*"|<[^>]*>|[A-Za-z_:]+|[-+.\de]+|\s+|.', re.DOTALL)
NUMBERS = [struct.pack(kind, value) for kind, values in {
    "<I": (0, 1, 1 << 16, 0x7FFFFFFF, 0xFFFFFFFF), ">I": (1, 0x7FFFFFFF), "<H": (0xFFFF,),
    "<Q": (1 << 32, 1 << 62, (1 << 64) - 1), "<d": (float("nan"), float("inf"), 1e308),
}.items() for value in values]  # fmt: skip
MOST = 200_000


def spoil(content: bytes, other: bytes, chance: random.Random) -> bytes:
    """Change a few tokens or bytes; `other` is what pieces are taken from."""
    text = b"\x00" not in content[:1000]
    for _ in range(chance.choice((1, 1, 1, 2, 3, 8))):
        change = token_changed if text and chance.random() < 0.8 else byte_changed
        content = change(content, other, chance)[:MOST]
    return content


def token_changed(content: bytes, other: bytes, chance: random.Random) -> bytes:
    tokens = TOKEN.findall(content) or [b""]
    i, j = chance.randrange(len(tokens)), chance.randrange(len(tokens))
    kind = chance.randrange(8)
    if kind == 0:
        del tokens[i]
    elif kind == 1:
        tokens[i] = tokens[j]
    elif kind == 2:
        tokens[i], tokens[j] = tokens[j], tokens[i]
    elif kind == 3:
        tokens[i:i] = tokens[min(i, j) : min(min(i, j) + 20, max(i, j))]
    elif kind == 4:
        numbers = [n for n, token in enumerate(tokens) if token[:1].isdigit()]
        if numbers:
            tokens[chance.choice(numbers)] = chance.choice(NASTY)
    elif kind == 5:
        tokens[i] = chance.choice(NASTY)
    elif kind == 6:
        quoted = [n for n, token in enumerate(tokens) if token[:1] == b'"']
        if quoted:
            tokens[chance.choice(quoted)] = b'"' + chance.choice(NASTY) + b'"'
    else:
        nasty = chance.choice(NASTY)
        tokens[i] = re.sub(rb'"[^"]*"', lambda _: b'"' + nasty + b'"', tokens[i])
    return b"".join(tokens)


def byte_changed(content: bytes, other: bytes, chance: random.Random) -> bytes:
    at = chance.randrange(len(content) + 1)
    length = min(chance.choice((1, 4, 16, 256)), len(content) - at)
    kind = chance.randrange(7)
    put = b""  # cut out, or cut off
    if kind == 0:
        return content[:at]
    if kind in (1, 2) and length:
        put, length = bytes([content[at] ^ (1 << chance.randrange(8))]), 1
    elif kind == 3:
        put = chance.choice(NUMBERS)
        length = len(put)
    elif kind == 4:
        source = chance.choice((content, other))
        begin = chance.randrange(len(source) + 1)
        put = source[begin : begin + chance.choice((1, 8, 64, 1024))]
    elif kind == 5:
        put, length = content[at : at + length], 0  # doubled
    return content[:at] + put + content[at + length :]


# One reader for a while, in a process of its own.


class TooLong(BaseException):
    """A reader has used its processor time."""


class Coverage:
    """Lines of picchio that were reached."""

    def __init__(self) -> None:
        self.lines: set[tuple[str, int]] = set()
        self.folder = str(Path(picchio.__file__).parent)

    def trace(self, frame: FrameType, event: str, _: Any) -> Any:
        if not frame.f_code.co_filename.startswith(self.folder):
            return None
        self.lines.add((frame.f_code.co_filename, frame.f_lineno))
        return self.trace


class Forked:
    """As `start_python`, but forked: a thousand times a minute. Its limits are ours."""

    def __init__(self, code: str, arguments: list[str], *, memory: int) -> None:
        ours, theirs = os.pipe()
        self.child = os.fork()
        if self.child == 0:
            status = 70
            try:
                sys.settrace(None)
                os.close(ours)
                os.dup2(theirs, 1)
                os.close(theirs)
                sys.argv = ["-c", *arguments]
                exec(code, {"sys": sys})
                status = 0
            except SystemExit as ended:
                status = int(ended.code or 0)
            finally:
                os._exit(status)
        os.close(theirs)
        self.stdout = os.fdopen(ours, "rb", buffering=0)

    def kill(self) -> None:
        """It may have ended."""
        os.kill(self.child, signal.SIGKILL)

    def wait(self) -> None:
        """Until it has ended."""
        os.waitpid(self.child, 0)


@contextlib.contextmanager
def limited() -> Iterator[None]:
    """Within the block, more than `SECONDS` of processor time is `TooLong`."""

    def ended(*_: object) -> None:
        raise TooLong

    signal.signal(signal.SIGPROF, ended)
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def wrong_with(read: Callable[[Path], Any], folder: Path) -> str | None:
    """A traceback, or what is wrong with an error's line; None if it is as it should be."""
    try:
        with limited():
            read(folder)
    except PicchioError as error:
        line = str(error)
        if "\n" in line or len(line) > LONGEST:
            return f"no short single line: {line!r}"
        if str(folder) not in line:
            return f"names no file: {line}"
    except BaseException:
        return traceback.format_exc()
    return None


def work(name: str, folder: Path, seconds: float, seed: int) -> None:
    """Spoil and read for a while; tries, kept, lines and findings go to `folder`/done.json."""
    import dask

    dask.config.set(scheduler="synchronous")  # its threads did not come along
    reader, now = READERS[name], folder / "now"
    chance = random.Random(seed)
    warnings.simplefilter("ignore")
    real = processes.start_python
    for module in list(sys.modules.values()):
        if getattr(module, "start_python", None) is real:
            module.start_python = Forked  # type: ignore[attr-defined]
    own = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (own + MEMORY, own + MEMORY))
    files = sorted(path for path in now.rglob("*") if path.is_file())
    if reader.spoiled:
        files = [now / file for file in reader.spoiled]
    good = {file: file.read_bytes() for file in files}
    corpus = list(good.items())
    reader.read(now)  # good files are read within the limits
    coverage, found, tries = Coverage(), {}, 0
    end = time.monotonic() + seconds
    while time.monotonic() < end or tries < LEAST:
        file, content = chance.choice(corpus)
        file.write_bytes(spoiled := spoil(content, chance.choice(corpus)[1], chance))
        before = len(coverage.lines)
        sys.settrace(coverage.trace)
        try:
            wrong = wrong_with(reader.read, now)
        finally:
            sys.settrace(None)
        if wrong is not None:
            place = re.sub(r"\d+", "#", "".join(wrong.splitlines()[-3:]))[:200]
            if place not in found:
                kept = folder / f"found-{len(found)}"
                shutil.copytree(now, kept)
                found[place] = f"{kept}\n{wrong}"
        elif len(coverage.lines) > before:
            corpus.append((file, spoiled))
        file.write_bytes(good[file])
        tries += 1
    told = {"tries": tries, "kept": len(corpus), "lines": len(coverage.lines)}
    (folder / "done.json").write_text(json.dumps({**told, "found": list(found.values())}))


def fuzz(name: str, folder: Path, seconds: float, seed: int = 0) -> dict[str, Any]:
    """Spoil a reader's files for a while.

    Args:
        name: of the reader.
        folder: an empty one, for the files and what is found.
        seconds: how long.
        seed: of the changes.

    Returns:
        tries, files kept for new lines, lines reached, and what was found: its folder, and why.
    """
    now = folder / "now"
    now.mkdir()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        READERS[name].write(now)
        READERS[name].read(now)
    process = multiprocessing.get_context("fork").Process(
        target=work, args=(name, folder, seconds, seed)
    )
    process.start()
    process.join(seconds + 6 * SECONDS)
    if process.is_alive():
        process.kill()
        process.join()
        return {
            "tries": 0,
            "kept": 0,
            "lines": 0,
            "found": [f"{now}\nhangs where no signal ends it"],
        }
    done = folder / "done.json"
    if not done.exists():
        return {"tries": 0, "kept": 0, "lines": 0, "found": [f"{now}\ndied: {process.exitcode}"]}
    return json.loads(done.read_text())


def main() -> int:
    """Fuzz one reader or all in turn; 0 if nothing was found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--reader", choices=READERS, help="one; all in turn if not given")
    parser.add_argument("--seconds", type=float, default=10.0, help="of each reader")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    failed = False
    print(f"{'reader':16} {'tries':>7} {'kept':>5} {'lines':>6} {'found':>6}")
    for name in [given.reader] if given.reader else READERS:
        folder = Path(tempfile.mkdtemp(prefix=f"picchio-fuzz-{name}-"))
        told = fuzz(name, folder, given.seconds, given.seed)
        counts = f"{told['tries']:7} {told['kept']:5} {told['lines']:6} {len(told['found']):6}"
        print(f"{name:16} {counts}", flush=True)
        for wrong in told["found"]:
            failed = True
            print(wrong, flush=True)
        if not told["found"]:
            shutil.rmtree(folder)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
