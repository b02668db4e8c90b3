"""What a URDF says is read or told: rotations, unknown attributes, mesh addresses, shapes."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from lxml import etree
from scipy.spatial.transform import Rotation

from picchio.core.errors import InputError, PicchioWarning
from picchio.robot.loading.load import load_robot
from picchio.robot.masses.by_volume import bodies
from picchio.robot.urdf.addresses import resolve_mesh
from picchio.robot.urdf.shapes import origin
from picchio.robot.urdf.tree import without_quaternions

HALF = math.sqrt(0.5)


@pytest.mark.parametrize(
    "four",
    [
        (0, 0, 0, 1), (0, HALF, 0, HALF), (0, -HALF, 0, HALF), (1, 0, 0, 0), (0, 0, HALF, HALF),
        (0.5, 0.5, 0.5, 0.5), (0.1, -0.2, 0.3, 0.9273618495495703),
        (-0.1, 0.2, -0.3, -0.92736), (0.2706, 0.6533, 0.2706, 0.6533),
    ],
)  # fmt: skip
def test_a_quaternion_turns_as_scipys_does(four):
    element = etree.fromstring(f'<joint><origin quat_xyzw="{" ".join(map(str, four))}"/></joint>')
    np.testing.assert_allclose(
        origin(element)[:3, :3], Rotation.from_quat(four).as_matrix(), atol=1e-9
    )


def test_pinocchio_is_given_what_it_reads(arm_text):
    root = etree.fromstring(arm_text.replace('rpy="0 0 0.4"', 'quat_xyzw="0 0.6 0 0.8"').encode())
    read = pin.buildModelFromXML(without_quaternions(root)).jointPlacements[2].rotation
    np.testing.assert_allclose(read, Rotation.from_quat([0, 0.6, 0, 0.8]).as_matrix(), atol=1e-12)


def test_an_arm_written_with_quaternions_is_the_same_arm(arm_text, write, flex):
    text = arm_text
    for rpy in ("0.1 0 0", "0 0.2 0", "0 0 0.4"):
        four = Rotation.from_euler("xyz", [float(part) for part in rpy.split()]).as_quat()
        text = text.replace(f'rpy="{rpy}"', f'quat_xyzw="{" ".join(map(repr, four.tolist()))}"')
    assert text.count("quat_xyzw") == 3
    assert "rpy" not in text
    pose = [0.3, 0.4, 0.1]
    one = load_robot(write("rpy.urdf", arm_text), flex=flex)
    other = load_robot(write("quat.urdf", text), flex=flex)
    mass = other.state(pose).mass_matrix
    np.testing.assert_allclose(mass, one.state(pose).mass_matrix, rtol=1e-12)
    np.testing.assert_allclose(
        other.state(pose).tool_position, one.state(pose).tool_position, atol=1e-12
    )


@pytest.mark.parametrize(
    ("attributes", "says"),
    [
        ('rpy="0 0 1" quat_xyzw="0 0 0 1"', "both rpy and quat_xyzw"),
        ('quat_xyzw="0 0 0 0"', "its length is 0, not 1"),
        ('quat_xyzw="0 0 90 1"', "its length is 90.01, not 1"),
        ('quat_xyzw="0 0 1"', "<origin quat_xyzw> needs four numbers"),
        ('quat_xyzw="0 0 nan 1"', "is not a finite number"),
    ],
)
def test_what_is_no_rotation_is_refused(arm_text, write, attributes, says):
    text = arm_text.replace('rpy="0.1 0 0"', attributes)
    with pytest.raises(InputError, match="joint a: ") as caught:
        load_robot(write("bad.urdf", text))
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('rpy="0.1 0 0"', 'rpyy="0.1 0 0"',
         "<origin> has no attribute 'rpyy', so it is not read (in joint a); did you mean 'rpy'?"),
        ('<axis xyz="0 1 0"/>', '<axis xyz="0 1 0" frame="base"/>', "'frame'"),
        ('upper="0.3"', 'upper="0.3" stiffness="7"', "<limit> has no attribute 'stiffness'"),
        ('iyz="0" izz="0.12"', 'iyz="0" izz="0.12" unit="g"', "'unit', so it is not read (in link "
         "lower)"),
        ('value="5"', 'value="5" units="lb"', "<mass> has no attribute 'units'"),
        ("<axis xyz=\"0 0.6 0.8\"/>", '<axis xyz="0 0.6 0.8"/><mimic joint="a" factor="2"/>',
         "<mimic> has no attribute 'factor'"),
        ('upper="0.3"', 'upper="0.3" jerk="7" acceleration="2"', None),
        ('<link name="tip"/>', '<link name="tip"><x><y><origin turn="1"/></y></x></link>', None),
        ('upper="0.3"', 'upper="0.3" xmlns:d="urn:d" d:stiffness="7"', None),
    ],
)  # fmt: skip
def test_unknown_attributes_are_told(arm_text, write, flex, recwarn, old, new, told):
    assert old in arm_text
    load_robot(write("a.urdf", arm_text.replace(old, new)), tool="tip", allow_rigid=True)
    said = [str(w.message) for w in recwarn.list if w.category is PicchioWarning]
    assert [told in line for line in said] == [True] * (told is not None), said


@pytest.mark.parametrize(
    ("variable", "place", "address"),
    [
        ("ROS_PACKAGE_PATH", "my arm/m/a.stl", "package://my arm/m/a.stl"),
        ("AMENT_PREFIX_PATH", "share/arm/m/a.stl", "package://arm/m/a.stl"),
        ("GAZEBO_MODEL_PATH", "arm/m/a.stl", "model://arm/m/a.stl"),
        ("GZ_SIM_RESOURCE_PATH", "arm/m/a.stl", "model://arm/m/a.stl"),
        ("AMENT_PREFIX_PATH", "share/my arm/m/a.stl", "package://my%20arm/m/a.stl"),
        ("ROS_PACKAGE_PATH", "arm/m/a b.stl", "package://arm\\m\\a%20b.stl"),
        (None, "arm/m/a.stl", "model://arm/m/a.stl"),
        (None, "arm/urdf/m/a b.stl", "m/a%20b.stl"),
        (None, "arm/urdf/m/a.stl", "m\\a.stl"),
        (None, "arm/urdf/m/a.stl", ".\\m\\a.stl"),
        (None, "arm/urdf/a%20b.stl", "a%20b.stl"),
    ],
)
def test_meshes_are_found(tmp_path: Path, monkeypatch, variable, place, address):
    root = tmp_path / "root" if variable else tmp_path
    for name in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH", "GAZEBO_MODEL_PATH"):
        monkeypatch.delenv(name, raising=False)
    if variable:
        monkeypatch.setenv(variable, f"{tmp_path / 'nothing'}:{root}")
    (root / place).parent.mkdir(parents=True)
    (root / place).write_bytes(b"x")
    folder = tmp_path / "arm" / "urdf"
    folder.mkdir(parents=True, exist_ok=True)
    assert resolve_mesh(address, folder).resolve() == (root / place).resolve()


@pytest.mark.parametrize("address", ["model://none/a.stl", "package://none/a.stl"])
def test_a_package_that_is_not_there(tmp_path: Path, address):
    with pytest.raises(InputError, match="set ROS_PACKAGE_PATH or AMENT_PREFIX_PATH"):
        resolve_mesh(address, tmp_path)


@pytest.mark.parametrize(("radius", "length"), [(0.06, 0.3), (0.2, 0.05), (0.01, 1.0)])
def test_a_capsule_weighs_as_its_formula_says(tmp_path, radius, length):
    root = etree.fromstring(
        f'<robot name="r"><link name="a"><collision><geometry><capsule radius="{radius}" '
        f'length="{length}"/></geometry></collision></link></robot>'
    )
    body = bodies(root, "collision", tmp_path)["a"]
    rod, ball = math.pi * radius**2 * length, 4 / 3 * math.pi * radius**3
    assert body.volume == pytest.approx(rod + ball, rel=0.01)
    # The rod's, and two half balls', each about its own centre of mass and then moved.
    off = length / 2 + 3 / 8 * radius
    across = rod * (3 * radius**2 + length**2) / 12
    across += ball * (83 / 320 * radius**2 + off**2)
    assert body.moments[0] == pytest.approx(across, rel=0.015)
    assert body.moments[5] == pytest.approx(radius**2 * (rod / 2 + 2 / 5 * ball), rel=0.015)


def test_a_total_mass_over_capsules(arm_text, write, sidecar_text):
    shape = '<collision><geometry><capsule radius="0.05" length="{}"/></geometry></collision>'
    for name, length in (("upper", 0.4), ("lower", 0.2)):
        head = f'<link name="{name}">'
        arm_text = arm_text.replace(head, head + shape.format(length))
    text = sidecar_text + "[links]\ntotal_mass = 13.0\n"
    links = load_robot(write("a.urdf", arm_text), flex=write("f.toml", text)).tree.links
    ends = 4 / 3 * 0.05
    share = (0.4 + ends) / (0.6 + 2 * ends)  # the slide has no shape and keeps its 3 kg
    assert links["upper"].mass == pytest.approx(10.0 * share, rel=2e-3)
    assert links["lower"].mass == pytest.approx(10.0 * (1.0 - share), rel=2e-3)
