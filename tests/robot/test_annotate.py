"""Annotating a URDF: loadable everywhere, and byte for byte the same beside it."""

from __future__ import annotations

import difflib
import re
import warnings

import mujoco
import numpy as np
import pytest
import yourdfpy

from picchio.core.errors import InputError, PicchioWarning
from picchio.robot.annotations.annotate import annotate
from picchio.robot.annotations.sidecar import JointEntry, Sidecar, read_sidecar
from picchio.robot.loading.find import example_robots
from picchio.robot.loading.load import load_robot

from .trees import load_tree

FULL = """format = "picchio-sidecar/1"
[joint.a]
stiffness_curve = { k1 = 1e4, k2 = 2e4, k3 = 3e4, t1 = 5.0, t2 = 20.0 }
damping_ratio = 0.02
reducer = "RV-80E-121"
source = "a <test> with \\"quotes\\" & an ü"
estimated = true
rotor_inertia = 1e-4
gear_ratio = -121.0
shaft = { radius = 0.01, length = 0.1, shear_modulus = 79.3e9, sn_curve = "curve" }
balancer = { parent_point = [-0.2, 0, 0.1], child_point = [0.1, 0, 0], stiffness = 900.0 }
[joint.b]
stiffness = 12345.678901234567
[tool]
frame = "tip"
xyz = [0.0, 0.0, 0.05]
axis = [1.0, 0.0, 0.0]
mass = 1.5
com = [0.01, 0.0, 0.0]
inertia = [0.01, 0, 0, 0.01, 0, 0.01]
[gun]
mass = 2.0
recoil_stiffness = 4e4
[base]
rpy = [0.0, 1.0, 0.0]
"""


def only_added(before: bytes, after: bytes, marker: bytes = b"picchio") -> bool:
    """Take what carries the marker out again: what remains is the file as it was."""
    text, new = before.decode("latin-1"), after.decode("latin-1")
    matcher = difflib.SequenceMatcher(None, text, new, autojunk=False)
    for kind, i1, i2, j1, j2 in matcher.get_opcodes():
        if kind in ("replace", "delete") and i1 != i2:
            return False
        if kind == "insert" and not new[j1:j2].strip():
            return False
    return marker in after


def taken_out(content: bytes) -> bytes:
    """The file without the annotations, the white space before each, and their prefix."""
    kept = re.sub(rb"\s*<picchio:[^>]*/>", b"", content)
    return kept.replace(b' xmlns:picchio="urn:picchio:1"', b"", 1)


def test_annotated_equals_sidecar(arm, write):
    flex = write("full.toml", FULL)
    out = write("annotated.urdf", "")
    out.write_bytes(annotate(arm, read_sidecar(flex)))
    assert only_added(arm.read_bytes(), out.read_bytes())
    one, other = load_robot(arm, flex=flex), load_robot(out)
    assert one.flexible_joints == other.flexible_joints
    assert (one.tool, one.gun, one.mounting) == (other.tool, other.gun, other.mounting)
    assert 'a <test> with "quotes" & an ü' in other.origins["a.damping_ratio"]
    state, again = one.state([0.3, 0.2, 0.1]), other.state([0.3, 0.2, 0.1])
    np.testing.assert_array_equal(state.mass_matrix, again.mass_matrix)


def test_other_readers_see_the_same_robot(arm, write):
    out = write("annotated.urdf", "")
    out.write_bytes(annotate(arm, read_sidecar(write("full.toml", FULL))))
    models = [mujoco.MjModel.from_xml_path(str(path)) for path in (arm, out)]
    assert models[0].nv == models[1].nv == 3
    np.testing.assert_array_equal(models[0].body_mass, models[1].body_mass)
    robots = [yourdfpy.URDF.load(str(path), load_meshes=False) for path in (arm, out)]
    for robot in robots:
        robot.update_cfg([0.3, 0.2, 0.1])
    np.testing.assert_array_equal(*(robot.get_transform("tip") for robot in robots))


def test_annotating_twice_changes_only_what_is_new(arm, write):
    flex = read_sidecar(write("full.toml", FULL))
    once = annotate(arm, flex)
    path = write("once.urdf", "")
    path.write_bytes(once)
    assert annotate(path, flex) == once
    # A later sidecar wins where it speaks; the rest stays.
    path.write_bytes(annotate(path, Sidecar(joint={"a": JointEntry(stiffness=7e3)})))
    joint = load_robot(path).flexible_joints[0]
    assert (joint.stiffness, joint.damping_ratio, joint.stiffness_curve) == (7e3, 0.02, None)


@pytest.mark.parametrize("name", sorted(set(example_robots()) - {"ur3", "iris_simple",
                                                                 "quadrotor_base"}))  # fmt: skip
def test_every_example_robot_can_be_annotated(name, tmp_path):
    urdf = example_robots()[name]
    tree = load_tree(urdf)
    joints = {j: JointEntry(stiffness=1e4) for j in tree.movable()[:6]}
    content = annotate(urdf, Sidecar(joint=joints))
    out = tmp_path / "out.urdf"
    out.write_bytes(content)
    assert taken_out(content) == urdf.read_bytes()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PicchioWarning)
        if name == "romeo_laas_small":
            with pytest.raises(InputError, match="carries no mass"):
                load_robot(out, tool=tree.leaves()[0])
            return
        robot = load_robot(
            out,
            tool=tree.leaves()[0],
        )
    assert set(robot.flexible_names) == set(joints)


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_odd_spacing_comments_and_other_tools_tags_stay(tmp_path, newline):
    text = (
        '<?xml version="1.0" encoding="iso-8859-1"?>\n<!-- caf\xe9 <joint name="a"> -->\n'
        "<robot\n\tname='r' xmlns:drake='urn:d'>\n<link name='x'/><link name='y'>"
        "<inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/>"
        "</inertial></link>\n\t<joint   type='revolute' name='a &gt; b' ><parent link='x'/>"
        "<child\nlink='y'/>\n\t\t<limit effort='1' velocity='1' lower='-1' upper='1' >\n"
        "<!-- inside --></limit> <drake:any thing='>'/>  \n<!-- last -->\t</joint  >\n"
        "<gazebo><springStiffness>3</springStiffness></gazebo></robot>\n<!-- end -->"
    ).replace("\n", newline)
    path = tmp_path / "odd.urdf"
    path.write_bytes(text.encode("latin-1"))
    content = annotate(path, Sidecar(joint={"a > b": JointEntry(stiffness=100.0)}))
    added = (b' xmlns:picchio="urn:picchio:1"', b'<picchio:flexibility stiffness="100.0"/>')
    rest = content
    for piece in added:
        assert content.count(piece) == 1
        rest = rest.replace(piece, b"")
    assert rest.replace(b"\r", b"").split() == text.encode("latin-1").replace(b"\r", b"").split()
    path.write_bytes(content)
    assert load_robot(path).stiffness.tolist() == [100.0]


@pytest.mark.parametrize(
    ("sidecar", "says"),
    [
        (Sidecar(joint={"z": JointEntry(stiffness=1.0)}), "no joint of this name"),
        (Sidecar(joint={"end": JointEntry(stiffness=1.0)}), "a fixed joint cannot be flexible"),
    ],
)
def test_refuses_what_does_not_fit(arm, sidecar, says):
    with pytest.raises(InputError, match=says):
        annotate(arm, sidecar)


def test_utf_16_is_refused(arm, arm_text, write):
    arm.write_bytes(arm_text.replace("?>", ' encoding="utf-16"?>').encode("utf-16"))
    with pytest.raises(InputError, match="superset of ASCII"):
        annotate(arm, Sidecar(joint={"a": JointEntry(stiffness=1.0)}))
