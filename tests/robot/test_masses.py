"""Masses that a sidecar gives: link by link, or a total over the links' shapes."""

from __future__ import annotations

import numpy as np
import pytest

from picchio.core.errors import InputError, PicchioWarning
from picchio.robot.annotations.annotate import annotate
from picchio.robot.annotations.sidecar import read_sidecar
from picchio.robot.loading.load import load_robot

LOWER = """[link.lower]
mass = 7.5
com = [0.1, 0.0, 0.0]
inertia = [0.04, 0.0, 0.0, 0.1, 0.0, 0.1]
source = "weighed"
"""


def test_a_link_given_equals_a_link_written(arm_text, write, sidecar_text):
    old = arm_text[arm_text.index('<inertial><origin xyz="0.15') :]
    old = old[: old.index("</inertial>")]
    new = (
        '<inertial><origin xyz="0.1 0 0"/><mass value="7.5"/>'
        '<inertia ixx="0.04" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/>'
    )
    flex = write("masses.toml", sidecar_text + LOWER)
    arm = write("arm.urdf", arm_text)
    given = load_robot(arm, flex=flex)
    annotated = write("annotated.urdf", "")
    annotated.write_bytes(annotate(arm, read_sidecar(flex)))
    written = load_robot(
        write("written.urdf", arm_text.replace(old, new)), flex=write("flex.toml", sidecar_text)
    )
    pose = [0.3, 0.4, 0.1]
    for robot in (given, load_robot(annotated)):
        np.testing.assert_allclose(
            robot.state(pose).mass_matrix, written.state(pose).mass_matrix, rtol=1e-13
        )
        assert robot.tree.links == written.tree.links
    assert given.origins["link.lower.mass"] == "masses.toml: weighed"


def test_a_mass_alone_scales_the_inertia(arm, write, sidecar_text):
    robot = load_robot(arm, flex=write("m.toml", sidecar_text + "[link.lower]\nmass = 10.0\n"))
    lower = robot.tree.links["lower"]
    assert lower is not None
    assert (lower.mass, lower.inertia) == (10.0, (0.1, 0, 0.02, 0.3, 0, 0.24))


# Half a box under each link's frame, a cylinder and a ball.
SHAPES = {
    "base": '<collision><geometry><box size="0.2 0.2 0.1"/></geometry></collision>',
    "upper": '<collision><origin xyz="0.25 0 0" rpy="0 1.5707963267948966 0"/>'
    '<geometry><cylinder radius="0.05" length="0.5"/></geometry></collision>',
    "lower": '<collision><origin xyz="0.2 0 0"/><geometry><box size="0.4 0.08 0.06"/></geometry>'
    "</collision>",
}


@pytest.fixture
def shaped(arm_text, write):
    for name, shape in SHAPES.items():
        whole = f'<link name="{name}">'
        arm_text = arm_text.replace(f'<link name="{name}"/>', whole + "</link>")
        arm_text = arm_text.replace(whole, whole + shape)
    return write("shaped.urdf", arm_text)


def test_a_total_is_spread_by_volume(shaped, write, sidecar_text):
    text = sidecar_text + "[links]\ntotal_mass = 30.0\n[link.slide]\nmass = 2.0\n"
    robot = load_robot(shaped, flex=write("m.toml", text))
    links = {name: body for name, body in robot.tree.links.items() if body is not None}
    assert sum(body.mass for body in links.values()) == pytest.approx(30.0)
    assert links["slide"].mass == 2.0
    box, rod = links["lower"], links["upper"]
    volumes = [0.2 * 0.2 * 0.1, np.pi * 0.05**2 * 0.5, 0.4 * 0.08 * 0.06]
    assert box.mass == pytest.approx(28.0 * volumes[2] / sum(volumes), rel=2e-3)
    assert box.xyz == pytest.approx((0.2, 0.0, 0.0), abs=1e-12)
    sides = np.array([0.4, 0.08, 0.06]) ** 2
    expected = box.mass / 12.0 * (sides.sum() - sides)
    np.testing.assert_allclose([box.inertia[k] for k in (0, 3, 5)], expected, rtol=1e-9)
    # A rod along x: 48 sides are a little less than a circle.
    assert rod.inertia[0] == pytest.approx(0.5 * rod.mass * 0.05**2, rel=5e-3)
    assert robot.origins["link.upper.mass"] == "m.toml, 30 kg over the collision shapes by volume"
    assert robot.origins["link.slide.mass"] == "m.toml"


def test_a_total_over_real_meshes(write):
    """A UR10's moving links get their published masses within a factor of 2.5, by volume alone."""
    own = load_robot("ur10")
    stated = {name: body.mass for name, body in own.tree.links.items() if body and body.mass}
    text = f'format = "picchio-sidecar/1"\n[links]\ntotal_mass = {sum(stated.values())}\n'
    flex = write("m.toml", text + "[joint.elbow_joint]\nstiffness = 1e4\n")
    robot = load_robot(own.source, flex=flex)
    moving = robot.tree.beyond("shoulder_pan_joint")
    for name in (name for name in stated if name in moving):
        body = robot.tree.links[name]
        assert body is not None
        assert 0.4 < body.mass / stated[name] < 2.5, name


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[link.uper]\nmass = 1.0\n", "did you mean 'upper'"),
        ("[link.tip]\nmass = 1.0\n", "link.tip: the URDF gives this link no mass: com must be"),
        ("[link.tip]\ncom = [0, 0, 0]\n", "mass must be given"),
        ("[link.lower]\nsource = 'x'\n", "give mass, com or inertia"),
        ("[link.lower]\ninertia = [1, 0, 0, -1, 0, 1]\n", "not positive semidefinite"),
        ("[link.lower]\nmass = 0.0\ninertia = [1, 0, 0, 1, 0, 1]\n", "an inertia needs a mass"),
        ("[links]\ntotal_mass = 10.0\n", "links.total_mass: no link has a collision shape"),
        ("[links]\ntotal_mass = 1.0\nshapes = 'hull'\n", "links.shapes: "),
    ],
)
def test_bad_masses(arm, write, sidecar_text, text, says):
    with pytest.raises(InputError) as caught:
        load_robot(arm, flex=write("bad.toml", sidecar_text + text))
    assert says in str(caught.value)


def test_a_total_below_the_given_masses(shaped, write, sidecar_text):
    text = sidecar_text + "[links]\ntotal_mass = 2.5\n[link.lower]\nmass = 1.0\n"
    with pytest.raises(InputError, match=r"must be above 4 kg"):
        load_robot(shaped, flex=write("bad.toml", text))


def serial(*bodies: tuple[float, float, str], length: float = 0.4) -> str:
    """An arm of boxes: of each link its mass, its moment about each axis, and more of it."""
    parts = ['<robot name="arm"><link name="base"/>']
    parent = "base"
    for k, (mass, moment, more) in enumerate(bodies, 1):
        inertial = (
            f'<inertial><origin xyz="0 0 {length / 2}"/><mass value="{mass}"/><inertia '
            f'ixx="{moment}" ixy="0" ixz="0" iyy="{moment}" iyz="0" izz="{moment}"/></inertial>'
        )
        parts.append(
            f'<joint name="j{k}" type="revolute"><parent link="{parent}"/><child link="l{k}"/>'
            f'<origin xyz="0 0 {length}"/><axis xyz="{k % 2} {(k + 1) % 2} 0"/>'
            f'<limit lower="-2" upper="2" effort="{200 - 10 * k}" velocity="1"/></joint>'
            f'<link name="l{k}">{inertial if mass else ""}'
            f'<collision><origin xyz="0 0 {length / 2}"/><geometry><box size="0.1 0.1 {length}"/>'
            f"</geometry></collision>{more}</link>"
        )
        parent = f"l{k}"
    return "".join(parts) + "</robot>"


REAL = [(9.0, 0.13, ""), (6.0, 0.09, ""), (4.0, 0.06, "")]


@pytest.mark.parametrize(
    ("bodies", "stiffness", "told"),
    [
        (REAL, 1e4, []),
        ([(2.0, 0.01 * k, "") for k in (1.2, 2.1, 3.3)], 1e4,
         ["links 'l1', 'l2', 'l3': the same mass of 2 kg; placeholders?"]),
        ([(k, 0.021, "") for k in (1.0, 1.5, 1.8)], 1e4,
         ["links 'l1', 'l2', 'l3': the same inertia; placeholders?"]),
        ([(9.0, 0.1, ""), (6.0, 0.01, "")], 1e4,
         ["links 'l1', 'l2': inertias of a round number, alike about every axis; placeholders?"]),
        ([*REAL[:2], (0.5, 0.22, "")], 1e4,
         ["link 'l3': an inertia of 0.22 kg m^2 for 0.5 kg is more than any body of its size"]),
        ([*REAL[:2], (3.0, 2e-5, "")], 1e4, ["link 'l3': an inertia of 2e-05 kg m^2 for 3 kg is as "
         "little as a point's; as a solid of its shape it would have 0.0425"]),
        ([REAL[0], (0.0, 0.0, ""), REAL[2]], 1e4,
         ["link 'l2': no mass is given, nor for what is fixed to it"]),
        (REAL, 1e10, [f"joint '{j}': would vibrate at" for j in ("j1", "j2", "j3")]),
        (REAL, 1e-1, [f"joint '{j}': would vibrate at" for j in ("j1", "j2", "j3")]),
    ],
)  # fmt: skip
def test_masses_that_can_hardly_be_are_told(write, recwarn, bodies, stiffness, told):
    urdf = write("arm.urdf", serial(*bodies))
    load_robot(urdf, values={f"j{k}": {"stiffness": stiffness} for k in range(1, len(bodies) + 1)})
    said = sorted(str(w.message) for w in recwarn.list if w.category is PicchioWarning)
    assert len(said) == len(told), said
    for line, start in zip(said, sorted(told), strict=True):
        assert line.startswith(f"arm.urdf: {start}")


def test_what_a_sidecar_states_is_not_doubted(write, recwarn):
    urdf = write("arm.urdf", serial(*REAL[:2], (0.5, 0.22, "")))
    text = "".join(f"[joint.j{k}]\nstiffness = 1e4\n" for k in (1, 2, 3))
    stated = "[link.l3]\ninertia = [0.22, 0, 0, 0.22, 0, 0.22]\nsource = 'a swing test'\n"
    load_robot(urdf, flex=write("f.toml", f'format = "picchio-sidecar/1"\n{text}{stated}'))
    assert not recwarn.list


def test_a_robot_of_no_mass_but_its_tools(write):
    urdf = write("arm.urdf", serial((0.0, 0.0, ""), (0.0, 0.0, ""), (0.0, 0.0, "")))
    text = 'format = "picchio-sidecar/1"\n[tool]\nmass = 5.0\n[joint.j2]\nstiffness = 1e4\n'
    with pytest.raises(
        InputError, match="no link that moves has a mass, only the tool has: l2, l3"
    ):
        load_robot(urdf, flex=write("f.toml", text))
    # The message's way out works.
    load_robot(urdf, flex=write("g.toml", text + "[links]\ntotal_mass = 20.0\n"))


def test_a_pose_at_which_nothing_resists_names_its_joint(write):
    """Two point masses on a line through both joints: stretched, the second turns for free."""
    point = '<inertial><origin xyz="{x} 0 0"/><mass value="3"/>' + (
        '<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'
    )
    limit = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
    urdf = write("arm.urdf", (
        '<robot name="r"><link name="base"/><link name="a"/><link name="b">' + point.format(x=0.5)
        + '</link><joint name="j1" type="revolute"><parent link="base"/><child link="a"/>'
        f'<axis xyz="0 0 1"/>{limit}</joint><joint name="j2" type="revolute"><parent link="a"/>'
        f'<child link="b"/><origin xyz="0.4 0 0"/><axis xyz="0 0 1"/>{limit}</joint></robot>'
    ))  # fmt: skip
    robot = load_robot(urdf, values={f"j{k}": {"stiffness": 1e4} for k in (1, 2)})
    with pytest.raises(InputError) as caught:
        robot.state([0.2, 0.0])
    said = str(caught.value)
    assert "can move no mass at the pose (0.2, 0): the mass matrix is not positive" in said
    assert "or leave the joint rigid" in said
