"""A coverage-guided fuzzer for the loader: `python fuzz_loader.py SECONDS [SEED]`.

Spoils URDFs and sidecars and keeps those that reach new lines of picchio.robot, to spoil them
further. Anything but a robot or an `InputError` of one short line is printed and ends the run
with 1; a crash of the interpreter ends it by itself. What was found is left in the folder that
is printed first.
"""

from __future__ import annotations

import random
import re
import sys
import tempfile
import time
import traceback
import warnings
from pathlib import Path
from types import FrameType
from typing import Any

from picchio.core.errors import InputError
from picchio.robot.loading.load import load_robot

SEED_URDF = b"""<?xml version="1.0"?>
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
SEED_FLEX = b"""format = "picchio-sidecar/1"
[joint.k]
stiffness_curve = { k1 = 1e4, k2 = 2e4, k3 = 3e4, t1 = 1.0, t2 = 2.0 }
source = "fuzz"
[tool]
frame = "d"
axis = [0.0, 1.0, 0.0]
inertia = [1, 0, 0, 1, 0, 1]
[base]
gravity = [0, 0, -9.81]
"""
NASTY = [b"", b"0", b"-1", b"nan", b"inf", b"1e308", b"1e-308", b"9" * 400, b"\x00", b"\xff",
         b"&lt;", b"&#0;", b"a", b"j", b"fixed", b"floating", b"planar", b"continuous", b"mimic",
         b"urn:picchio:2", b"0 0 0", b"1 2", b"\xc3\xa9", b"<!DOCTYPE x>", b"true", b"[[", b"{",
         b"picchio:", b"1_0", b"0x10", b"-0.0", b"1e12", b"0 0 0 0"]  # fmt: skip
TOKEN = re.compile(rb'"[^"]*"|<[^>]*>|[A-Za-z_:]+|[-+.\de]+|\s+|.', re.DOTALL)


def spoil(content: bytes, chance: random.Random) -> bytes:
    """Change a few tokens or bytes."""
    for _ in range(chance.choice((1, 1, 1, 2, 3, 8))):
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
            quoted = [n for n, token in enumerate(tokens) if token[:1] == b'"']
            if quoted:
                tokens[chance.choice(quoted)] = b'"' + chance.choice(NASTY) + b'"'
        elif kind == 5:
            tokens[i] = chance.choice(NASTY)
        elif kind == 6 and tokens[i]:
            place = chance.randrange(len(tokens[i]))
            tokens[i] = tokens[i][:place] + bytes([chance.randrange(256)]) + tokens[i][place + 1 :]
        else:
            inside = re.sub(rb'"[^"]*"', lambda _: b'"' + chance.choice(NASTY) + b'"', tokens[i])
            tokens[i] = inside
        content = b"".join(tokens)[:20_000]
    return content


class Coverage:
    """Lines of picchio.robot that were reached."""

    def __init__(self) -> None:
        self.lines: set[tuple[str, int]] = set()

    def trace(self, frame: FrameType, event: str, _: Any) -> Any:
        if "picchio/robot" not in frame.f_code.co_filename:
            return None
        self.lines.add((frame.f_code.co_filename, frame.f_lineno))
        return self.trace


def try_one(folder: Path, urdf: bytes, flex: bytes | None) -> None:
    """Load and use it.

    Raises:
        AssertionError: the error is no short single line.
    """
    (folder / "robot.urdf").write_bytes(urdf)
    sidecar = folder / "flex.toml"
    if flex is not None:
        sidecar.write_bytes(flex)
    try:
        robot = load_robot(folder / "robot.urdf", flex=sidecar if flex is not None else None)
        robot.state([0.1] * len(robot.joint_names))
        robot.gravity_stiffness([0.1] * len(robot.joint_names))
    except InputError as error:
        if "\n" in str(error) or len(str(error)) > 2000:
            raise AssertionError("no short single line") from error


def main(seconds: float, seed: int) -> int:
    """Fuzz for a while; 0 if nothing was found."""
    warnings.simplefilter("ignore")
    chance = random.Random(seed)
    folder = Path(tempfile.mkdtemp(prefix="picchio-fuzz-"))
    print(folder, flush=True)
    corpus: list[tuple[bytes, bytes | None]] = [(SEED_URDF, None), (SEED_URDF, SEED_FLEX)]
    coverage = Coverage()
    tries, end = 0, time.monotonic() + seconds
    while time.monotonic() < end:
        urdf, flex = chance.choice(corpus)
        if flex is None or chance.random() < 0.6:
            urdf = spoil(urdf, chance)
        else:
            flex = spoil(flex, chance)
        before = len(coverage.lines)
        sys.settrace(coverage.trace)
        try:
            try_one(folder, urdf, flex)
        except BaseException:
            sys.settrace(None)
            traceback.print_exc()
            return 1
        finally:
            sys.settrace(None)
        if len(coverage.lines) > before:
            corpus.append((urdf, flex))
        tries += 1
    print(f"{tries} tries, {len(corpus)} kept, {len(coverage.lines)} lines reached")
    return 0


if __name__ == "__main__":
    sys.exit(main(float(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0))
