"""Annotating URDFs laid out in every way: one line, minified, CRLF, comments, namesakes."""

from __future__ import annotations

import re

import pytest
from lxml import etree

from picchio.core.errors import InputError
from picchio.robot.annotations.annotate import annotate
from picchio.robot.annotations.sidecar import JointEntry, Sidecar, read_sidecar
from picchio.robot.loading.load import load_robot

FULL = """format = "picchio-sidecar/1"
[joint.a]
stiffness = 2.5e4
damping_ratio = 0.02
source = "a </joint> in a text"
shaft = { radius = 0.01, length = 0.1, shear_modulus = 79.3e9, sn_curve = "curve" }
balancer = { parent_point = [-0.2, 0, 0.1], child_point = [0.1, 0, 0], stiffness = 900.0 }
[joint.b]
stiffness_curve = { k1 = 1e4, k2 = 2e4, k3 = 3e4, t1 = 5.0, t2 = 20.0 }
[joint.c]
stiffness = 5e5
[tool]
frame = "tip"
mass = 1.5
[gun]
mass = 2.0
[base]
rpy = [0.0, 1.0, 0.0]
"""
TRANSMISSION = (
    '<transmission name="t"><type>x</type><joint name="a"/><joint name="b"><hw>y</hw></joint>'
    '<actuator name="m"/></transmission><gazebo reference="a"><joint name="a"/></gazebo>'
)


def minified(text: str) -> str:
    return re.sub(r">\s+<", "><", text).strip()


def joints_on_one_line(text: str) -> str:
    return re.sub(r"<joint.*?</joint>", lambda match: minified(match[0]), text, flags=re.DOTALL)


def with_comments(text: str) -> str:
    text = text.replace("</joint>", "<!-- </joint> <joint name='a'> --></joint> <!-- </joint> -->")
    return text.replace("</robot>", "<!-- </robot> --></robot>")


def with_namesakes(text: str) -> str:
    text = text.replace('<link name="base"/>', '<link name="base"/>' + TRANSMISSION)
    nested = '<safety_controller k="1>2"><any/><any></any></safety_controller></joint>'
    return text.replace("</joint>", nested).replace("</robot>", TRANSMISSION + "</robot>")


LAYOUTS = {
    "as it is": lambda text: text,
    "one line": joints_on_one_line,
    "minified": minified,
    "minified, spaced": lambda text: minified(text).replace("><", "> <"),
    "tabs": lambda text: text.replace("  ", "\t"),
    "comments": with_comments,
    "comments, minified": lambda text: with_comments(minified(text)),
    "namesakes": with_namesakes,
    "namesakes, minified": lambda text: with_namesakes(minified(text)),
    "elements long": lambda text: re.sub(
        r"<((?:limit|axis|child)\b[^>]*)/>", lambda m: f"<{m[1]}></{m[1].split()[0]}>", text
    ),
    "closing tag wide": lambda text: text.replace("</joint>", "</joint\n >"),
    "text in the joint": lambda text: text.replace("</joint>", "<![CDATA[</joint>]]></joint>"),
}


def taken_out(content: bytes) -> bytes:
    kept = re.sub(rb"\s*<picchio:[^>]*?/>", b"", content)
    return kept.replace(b' xmlns:picchio="urn:picchio:1"', b"", 1)


@pytest.mark.parametrize("newline", ["\n", "\r\n"], ids=["LF", "CRLF"])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_reads_back_in_every_layout(arm_text, tmp_path, write, layout, newline):
    before = LAYOUTS[layout](arm_text).replace("\n", newline).encode()
    urdf, out = tmp_path / "two.urdf", tmp_path / "out.urdf"
    urdf.write_bytes(before)
    flex = write("two.toml", FULL)
    after = annotate(urdf, read_sidecar(flex))
    out.write_bytes(after)

    one, other = load_robot(urdf, flex=flex), load_robot(out)
    assert one.flexible_joints == other.flexible_joints
    assert (one.tool, one.gun, one.mounting) == (other.tool, other.gun, other.mounting)
    assert taken_out(after) == before
    assert re.search(rb"(?<!\r)\n" if newline == "\r\n" else rb"\r", after) is None
    # Independent of picchio: each joint holds its own, last among its children.
    root = etree.fromstring(after)
    for joint in root.findall("joint"):
        tags = [str(child.tag) for child in joint.iterchildren("*")]
        mine = [tag.startswith("{urn:picchio:1}") for tag in tags]
        assert mine == sorted(mine)
        assert sum(mine) == {"a": 3, "b": 1, "c": 1, "end": 0}[str(joint.get("name"))]
    # Doing it again finds and replaces what is there.
    assert annotate(out, read_sidecar(flex)) == after


def test_one_line_stays_one_line(arm_text, tmp_path):
    urdf = tmp_path / "r.urdf"
    sidecar = Sidecar(joint={"a": JointEntry(stiffness=7.0)})
    urdf.write_text(minified(arm_text))
    assert b"\n" not in annotate(urdf, sidecar)
    urdf.write_text(joints_on_one_line(arm_text))
    assert b'<picchio:flexibility stiffness="7.0"/></joint>\n' in annotate(urdf, sidecar)
    urdf.write_text(arm_text)
    assert b'\n    <picchio:flexibility stiffness="7.0"/>\n  </joint>' in annotate(urdf, sidecar)


def test_annotations_as_the_only_neighbours_of_the_closing_tag(arm_text, tmp_path):
    """What is taken out for a new value ends before `</joint>` and `</robot>`."""
    text = minified(arm_text).replace("<robot ", '<robot xmlns:p="urn:picchio:1" ')
    text = text.replace("</joint>", '<p:flexibility stiffness="3"></p:flexibility></joint>', 1)
    urdf = tmp_path / "r.urdf"
    urdf.write_text(text.replace("</robot>", '<p:tool mass="1"/></robot>'))
    sidecar = Sidecar.model_validate({"joint": {"a": {"stiffness": 4.0}}, "tool": {"mass": 2.0}})
    after = annotate(urdf, sidecar)
    assert after.count(b'<p:flexibility stiffness="4.0"/></joint>') == 1
    assert after.endswith(b'<p:tool mass="2.0"/></robot>')
    assert after.count(b"<p:") == 2


def test_a_self_closing_joint_is_no_joint(arm_text, tmp_path):
    urdf = tmp_path / "r.urdf"
    urdf.write_text(arm_text.replace("</robot>", '<joint name="z" type="revolute"/></robot>'))
    with pytest.raises(InputError, match="z"):
        annotate(urdf, Sidecar(joint={"a": JointEntry(stiffness=7.0)}))


def test_an_annotation_in_a_transmissions_joint_is_refused(arm_text, tmp_path):
    text = arm_text.replace("<robot ", '<robot xmlns:picchio="urn:picchio:1" ')
    element = '<joint name="a"><picchio:flexibility stiffness="1"/></joint>'
    urdf = tmp_path / "r.urdf"
    urdf.write_text(text.replace("</robot>", f"<transmission>{element}</transmission></robot>"))
    with pytest.raises(InputError, match="belongs directly in a <joint> of <robot>"):
        load_robot(urdf)


@pytest.mark.parametrize(
    ("bend", "source"),
    [
        (lambda text: text, "a control character \x01"),
        # Here the root's prefix means something else inside the joint.
        (
            lambda text: text.replace("<robot ", '<robot xmlns:p="urn:picchio:1" ').replace(
                '<joint name="a"', '<joint xmlns:p="urn:other" name="a"'
            ),
            None,
        ),
    ],
)
def test_what_would_not_read_back_is_not_handed_over(arm_text, tmp_path, bend, source):
    urdf = tmp_path / "r.urdf"
    urdf.write_text(bend(arm_text))
    with pytest.raises(InputError, match="would not read back"):
        annotate(urdf, Sidecar(joint={"a": JointEntry(stiffness=7.0, source=source)}))


def test_an_encoding_of_several_bytes_is_refused(arm_text, tmp_path):
    urdf = tmp_path / "r.urdf"
    urdf.write_text(arm_text.replace("?>", ' encoding="gb2312"?>'), encoding="gb2312")
    with pytest.raises(InputError, match="in this encoding"):
        annotate(urdf, Sidecar(joint={"a": JointEntry(stiffness=7.0)}))
