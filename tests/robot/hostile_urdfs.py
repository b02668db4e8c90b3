"""Files that no robot loader should trust, each with a word that its refusal must contain.

`FILES` maps a name to (URDF bytes, sidecar text or None, word). A word of None means that the
file must load. Run as a script with a name and two paths it loads one and prints the error.
"""

from __future__ import annotations

import sys
from pathlib import Path

HEAD = '<robot name="r">'
AB = '<link name="a"/><link name="b"><inertial><mass value="1"/>{inertia}</inertial></link>'
INERTIA = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
JOINT = (
    '<joint name="j" type="{type}"><parent link="a"/><child link="b"/>{axis}{limit}{more}</joint>'
)
FLEX = 'format = "picchio-sidecar/1"\n[joint.j]\nstiffness = 1.0\n'


def urdf(
    *, links: str | None = None, inertia: str = INERTIA, type: str = "revolute",
    axis: str = '<axis xyz="0 1 0"/>', limit: str = LIMIT, more: str = "",
    joints: str | None = None, head: str = HEAD, tail: str = "</robot>",
) -> bytes:  # fmt: skip
    body = (links if links is not None else AB).format(inertia=inertia)
    joint = JOINT.format(type=type, axis=axis, limit=limit, more=more)
    return (head + body + (joints if joints is not None else joint) + tail).encode()


def joint(name: str, parent: str, child: str, kind: str = "fixed", more: str = "") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f"{more}</joint>"
    )


def entity_bomb(depth: int = 9) -> bytes:
    rows = ['<!ENTITY e0 "boom">']
    rows += [f'<!ENTITY e{i} "{f"&e{i - 1};" * 10}">' for i in range(1, depth)]
    return f'<!DOCTYPE robot [{"".join(rows)}]><robot name="&e{depth - 1};"/>'.encode()


def chain(count: int, kind: str = "fixed") -> bytes:
    links = "".join(f'<link name="l{i}"/>' for i in range(count))
    joints = "".join(
        joint(f"j{i}", f"l{i}", f"l{i + 1}", kind, LIMIT if kind == "revolute" else "")
        for i in range(count - 1)
    )
    return f"{HEAD}{links}{joints}</robot>".encode()


PARSER = {
    "empty": (b"", "is empty"),
    "blank": (b" \n\t ", "is empty"),
    "no xml": (b"hello", "not valid XML"),
    "cut off": (urdf()[:-30], "not valid XML"),
    "mismatched tags": (b'<robot name="r"><link name="a"></robot>', "not valid XML"),
    "two roots elements": (urdf() + urdf(), "not valid XML"),
    "nul bytes": (b'<robot name="r">\0</robot>', "not valid XML"),
    "control character": (b'<robot name="r\x01"/>', "not valid XML"),
    "random bytes": (bytes((i * 37 + 11) % 256 for i in range(4096)), "not valid XML"),
    "a zip": (b"PK\x03\x04" + bytes(200), "not valid XML"),
    "a mujoco model": (b"<mujoco><worldbody/></mujoco>", "first element must be <robot>"),
    "an sdf": (b'<sdf version="1.7"><model name="m"/></sdf>', "first element must be <robot>"),
    "html": (b"<html><body>404</body></html>", "first element must be <robot>"),
    "wrong encoding": ('<?xml version="1.0" encoding="utf-8"?><robot name="é"/>'.encode("latin-1"),
                       "not valid XML"),
    "unknown encoding": (b'<?xml version="1.0" encoding="klingon"?><robot name="r"/>', "not valid"),
    "entity bomb": (entity_bomb(), "document type declaration"),
    "utf-16 entity bomb": (entity_bomb().decode().encode("utf-16"), "document type declaration"),
    "external entity": (b'<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]>'
                        b'<robot name="&x;"/>', "document type declaration"),
    "network dtd": (b'<!DOCTYPE robot SYSTEM "http://192.0.2.1/robot.dtd"><robot name="r"/>',
                    "document type declaration"),
    "parameter entity": (b'<!DOCTYPE r [<!ENTITY % p SYSTEM "http://192.0.2.1/x"> %p;]>'
                         b'<robot name="r"/>', "document type declaration"),
    "deep nesting": (b'<robot name="r">' + b"<x>" * 100_000 + b"</x>" * 100_000 + b"</robot>",
                     "not valid XML"),
    "undeclared prefix": (urdf(more='<picchio:flexibility stiffness="1"/>'), "not declared"),
    "prefix of another tool": (urdf(more='<drake:x value="1"/>'), "not declared"),
    "a hundred thousand attributes": (
        b"<robot " + b" ".join(b'a%d="1"' % i for i in range(100_000)) + b"/>", "has no name"),
    "one attribute of 20 MB": (b'<robot name="' + b"x" * 20_000_000 + b'"/>', "not valid XML"),
}  # fmt: skip

STRUCTURE = {
    "no name": (b'<robot><link name="a"/></robot>', "has no name"),
    "empty name": (b'<robot name=""><link name="a"/></robot>', "has no name"),
    "no links": (b'<robot name="r"/>', "no links"),
    "nameless link": (b'<robot name="r"><link/></robot>', "a <link> has no name"),
    "nameless joint": (urdf(joints="<joint/>"), "a <joint> has no name"),
    "duplicate links": (b'<robot name="r"><link name="a"/><link name="a"/></robot>', "same name"),
    "duplicate joints": (urdf(joints=joint("j", "a", "b") + joint("j", "a", "b")), "same name"),
    "cycle": (urdf(joints=joint("j", "a", "b") + joint("k", "b", "a")), "closed loop"),
    "self loop": (urdf(joints=joint("j", "a", "b") + joint("k", "a", "a")), "closed loop"),
    "a loop beside the tree": (
        urdf(links='<link name="x"/><link name="a"/><link name="b"/>',
             joints=joint("j", "a", "b") + joint("k", "b", "a")), "closed loop"),
    "two roots": (urdf(joints=""), "more than one root link: 'a', 'b'"),
    "two parents": (
        urdf(links='<link name="a"/><link name="b"/><link name="c"/>',
             joints=joint("j", "a", "c") + joint("k", "b", "c")), "two joints carry link 'c'"),
    "unknown parent": (urdf(joints=joint("j", "z", "b")), "no link of this name, got 'z'"),
    "unknown child": (urdf(joints=joint("j", "a", "z")), "no link of this name, got 'z'"),
    "no parent": (urdf(joints='<joint name="j" type="fixed"><child link="b"/></joint>'),
                  "needs one <parent"),
    "two children": (urdf(more='<child link="a"/>'), "needs one <child"),
    "unknown joint type": (urdf(type="screw"), "unknown joint type, got 'screw'"),
    "no joint type": (urdf(joints=joint("j", "a", "b").replace(' type="fixed"', "")),
                      "unknown joint type"),
    "3000 links": (chain(3000), "at most 2000"),
    "a chain of 400 moving joints": (chain(401, "revolute"), "at most 300"),
    "mimic circle": (
        urdf(links='<link name="a"/><link name="b"/><link name="c"/>', joints=
             joint("j", "a", "b", "revolute", LIMIT + '<mimic joint="k"/>')
             + joint("k", "b", "c", "revolute", LIMIT + '<mimic joint="j"/>')), "in a circle"),
    "mimics itself": (urdf(more='<mimic joint="j"/>'), "in a circle"),
    "mimic NaN": (urdf(more='<mimic joint="k" multiplier="nan"/>'), "not a finite number"),
}  # fmt: skip

NUMBERS = {
    "zero axis": (urdf(axis='<axis xyz="0 0 0"/>'), "axis has length zero"),
    "tiny axis": (urdf(axis='<axis xyz="1e-200 0 0"/>'), "axis has length zero"),
    "NaN axis": (urdf(axis='<axis xyz="nan 0 1"/>'), "not a finite number"),
    "axis of two": (urdf(axis='<axis xyz="0 1"/>'), "needs three numbers"),
    "axis of words": (urdf(axis='<axis xyz="x y z"/>'), "not a finite number"),
    "no limit": (urdf(limit=""), "needs <limit"),
    "limit without effort": (urdf(limit='<limit lower="0" upper="1" velocity="1"/>'),
                             "<limit> has no effort"),
    "limit without velocity": (urdf(limit='<limit lower="0" upper="1" effort="1"/>'),
                               "<limit> has no velocity"),
    "limits crossed": (urdf(limit=LIMIT.replace('"-1"', '"2"')), "lower limit is above"),
    "limit NaN": (urdf(limit=LIMIT.replace('"-1"', '"nan"')), "not a finite number"),
    "negative effort": (urdf(limit=LIMIT.replace('effort="1"', 'effort="-1"')), "is negative"),
    "negative mass": (urdf(links=AB.replace('value="1"', 'value="-1"')), "the mass is negative"),
    "NaN mass": (urdf(links=AB.replace('value="1"', 'value="NaN"')), "not a finite number"),
    "mass 1e400": (urdf(links=AB.replace('value="1"', 'value="1e400"')), "larger than 1e+12"),
    "mass 1e300": (urdf(links=AB.replace('value="1"', 'value="1e300"')), "larger than 1e+12"),
    "mass with unit": (urdf(links=AB.replace('value="1"', 'value="1 kg"')), "not a finite number"),
    "mass with decimal comma": (urdf(links=AB.replace('value="1"', 'value="1,5"')),
                                "not a finite number"),
    "no mass": (urdf(links=AB.replace('<mass value="1"/>', "")), "needs one <mass>"),
    "no inertia": (urdf(inertia=""), "needs one <inertia>"),
    "inertia without izz": (urdf(inertia=INERTIA.replace(' izz="1"', "")), "<inertia> has no izz"),
    "two inertials": (urdf(links=AB.replace("</inertial>", "</inertial><inertial/>")),
                      "more than one <inertial>"),
    "negative inertia": (urdf(inertia=INERTIA.replace('izz="1"', 'izz="-1"')),
                         "link b: cannot vibrate: its inertia is not positive semidefinite"),
    "indefinite inertia": (urdf(inertia=INERTIA.replace('ixy="0"', 'ixy="5"')),
                           "not positive semidefinite"),
    "origin infinite": (urdf(more='<origin xyz="0 0 inf"/>'), "not a finite number"),
    "origin of 1e20 m": (urdf(more='<origin xyz="0 0 1e20"/>'), "larger than 1e+12"),
    "rpy of four": (urdf(more='<origin rpy="0 0 0 1"/>'), "needs three numbers"),
    "python numbers": (urdf(axis='<axis xyz="1_0 0 0x1"/>'), "not a finite number"),
    "arabic digits": (urdf(axis='<axis xyz="٠ ١ ٠"/>'), "not a finite number"),
    "massless": (urdf(links='<link name="a"/><link name="b"/>'), "carries no mass"),
    "xacro left in": (urdf(axis='<axis xyz="${x} 0 0"/>'), "; expand it first: xacro"),
    "xacro macros": (
        urdf(head='<robot name="r" xmlns:xacro="http://ros.org/wiki/xacro"><xacro:arm p="a"/>'),
        "expand it first: xacro FILE > robot.urdf",
    ),
    "xacro undeclared": (urdf(tail="<xacro:arm/></robot>"), "expand it first: xacro FILE"),
}  # fmt: skip

SIDECARS = {
    "sidecar: no toml": ("[[[", "is not valid TOML"),
    "sidecar: deep": ('format = "picchio-sidecar/1"\nx = ' + "[" * 100_000, ""),
    "sidecar: nul": ("\0", "is not valid TOML"),
    "sidecar: unknown joint": (FLEX.replace("joint.j", "joint.k"), "valid: j"),
    "sidecar: huge integer": (FLEX.replace("1.0", "1" + "0" * 5000), ""),
    "sidecar: minus infinity": (FLEX.replace("1.0", "-inf"), "joint.j.stiffness"),
    "sidecar: a list": (FLEX.replace("1.0", "[1, 2]"), "joint.j.stiffness"),
    "sidecar: a date": (FLEX.replace("1.0", "1979-05-27"), "joint.j.stiffness"),
    "sidecar: a version to come": (FLEX.replace("/1", "/9"), "unknown format"),
    "sidecar: a table for a value": (FLEX + "[joint.j.stiffness]\nx = 1\n", "is not valid TOML"),
}

# Odd, but robots all the same.
FINE = {
    "plain": urdf(),
    "utf-16": urdf().decode().encode("utf-16"),
    "byte order mark": b"\xef\xbb\xbf" + urdf(),
    "missing meshes": urdf(
        links=AB.replace("</inertial>", "</inertial><visual><geometry>"
                         '<mesh filename="package://none/of/this.dae"/></geometry></visual>')),
    "a mesh on the network": urdf(
        links=AB.replace("</inertial>", "</inertial><visual><geometry>"
                         '<mesh filename="http://192.0.2.1/x.stl"/></geometry></visual>')),
    "a broken visual": urdf(links=AB.replace("</inertial>", "</inertial><visual/>")),
    "dynamics with odd attributes": urdf(more='<dynamics spring_stiffness="1"/>'),
    "names with spaces and quotes": urdf(
        links='<link name="a &quot;&lt;&amp;"/><link name="b">' + AB.split('<link name="b">')[1],
        joints=joint("j", "a &quot;&lt;&amp;", "b", "revolute", LIMIT)),
    "a chain of 1500 fixed links": chain(1500).replace(
        b'<link name="l1499"/>', AB.split('<link name="a"/>')[1].format(inertia=INERTIA).replace(
            '"b"', '"l1499"').encode()).replace(
                b'<joint name="j1498" type="fixed">',
                b'<joint name="j" type="revolute">' + LIMIT.encode()),
    "continuous without limit": urdf(type="continuous", limit=""),
    "floating base": urdf(
        links='<link name="w"/>' + AB,
        joints=joint("f", "w", "a", "floating") + JOINT.format(
            type="revolute", axis="", limit=LIMIT, more="")),
    "reserved names": urdf(
        links='<link name="picchio_world"/><link name="b">' + AB.split('<link name="b">')[1],
        joints=joint("j", "picchio_world", "b", "revolute", LIMIT)),
    "infinite limits": urdf(limit=LIMIT.replace('"-1"', '"-inf"').replace('"1"', '"inf"')),
}  # fmt: skip

FILES: dict[str, tuple[bytes, str, str | None]] = {
    **{name: (content, FLEX, word) for group in (PARSER, STRUCTURE, NUMBERS)
       for name, (content, word) in group.items()},
    **{name: (urdf(), text, word) for name, (text, word) in SIDECARS.items()},
    **{name: (content, FLEX, None) for name, content in FINE.items()},
}  # fmt: skip


def peak_memory(unit: int) -> int:
    """MB that this process has taken at most."""
    import re
    import resource

    status = Path("/proc/self/status")
    # ru_maxrss survives exec on Linux: it would tell of the parent.
    if status.exists() and (found := re.search(r"VmHWM:\s*(\d+)", status.read_text())):
        return int(found[1]) >> 10
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // unit


def main(names: list[str], folder: Path) -> None:
    """Load each, one line of outcome each; the parent watches for a crash in between."""
    import socket
    import time
    import warnings

    def no_network(*_: object) -> None:
        raise AssertionError("the network was asked for")

    socket.socket.connect = no_network  # type: ignore[method-assign, assignment]
    from picchio.core.errors import InputError
    from picchio.robot.loading.load import load_robot

    warnings.simplefilter("ignore")
    for name in names:
        content, sidecar, _ = FILES[name]
        (folder / "robot.urdf").write_bytes(content)
        (folder / "flex.toml").write_text(sidecar, encoding="utf-8")
        print("BEGIN", name, flush=True)
        start = time.monotonic()
        try:
            robot = load_robot(folder / "robot.urdf", flex=folder / "flex.toml")
            robot.state([0.0] * len(robot.joint_names))
            outcome = "LOADED"
        except InputError as error:
            outcome = f"INPUT {error}"
        unit = 1 << 20 if sys.platform == "darwin" else 1 << 10
        peak = peak_memory(unit)
        print(f"END {time.monotonic() - start:.2f} {peak} {outcome}", flush=True)


if __name__ == "__main__":
    main(sys.argv[2:], Path(sys.argv[1]))
