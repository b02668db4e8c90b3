"""Which value wins, and where each says it is from."""

from __future__ import annotations

import pytest

from picchio.core.errors import InputError, PicchioWarning
from picchio.robot.loading.catalogue import describe_robot
from picchio.robot.loading.find import FoundRobot
from picchio.robot.loading.load import load_robot

ANNOTATION = '<picchio:flexibility stiffness="111" damping_ratio="0.11" rotor_inertia="0.111"/>'
DRAKE = (
    '<transmission name="t"><joint name="a"/><actuator name="m">'
    '<drake:rotor_inertia value="0.222"/><drake:gear_ratio value="222"/></actuator></transmission>'
)
SRDF = (
    '<robot name="arm"><group_state name="home" group="g"><joint name="a" value="0.5"/>'
    '<joint name="b" value="0 1"/><joint name="nowhere" value="1"/></group_state>'
    '<rotor_params><joint name="a" mass="0.333" gear_ratio="333"/>'
    '<joint name="b" mass="0.334"/><joint name="z" mass="1"/></rotor_params>'
    '<end_effector name="e" parent_link="slide"/></robot>'
)


@pytest.fixture
def full(arm_text, write):
    text = arm_text.replace(
        '<robot name="arm">',
        '<robot name="arm" xmlns:picchio="urn:picchio:1" xmlns:drake="http://drake.mit.edu">',
    )
    text = text.replace('<limit lower="-2"', ANNOTATION + '<limit lower="-2"')
    write("arm.srdf", SRDF)
    return write("arm.urdf", text.replace("</robot>", DRAKE + "</robot>"))


def test_precedence_value_by_value(full, write):
    robot = load_robot(full)
    (joint,) = robot.flexible_joints
    assert (joint.stiffness, joint.damping_ratio) == (111, 0.11)
    assert (joint.rotor_inertia, joint.gear_ratio) == (0.111, 222)
    assert robot.origins["a.rotor_inertia"] == "arm.urdf, picchio annotation"
    assert robot.origins["a.gear_ratio"] == "arm.urdf, drake tags"

    flex = write(
        "my.toml",
        'format = "picchio-sidecar/1"\n[joint.a]\nstiffness = 44\nsource = "Smith"\n'
        "[joint.b]\nstiffness = 45\n",
    )
    robot = load_robot(full, flex=flex)
    joint, other = robot.flexible_joints
    assert (joint.stiffness, joint.damping_ratio, joint.gear_ratio) == (44, 0.11, 222)
    assert robot.origins["a.stiffness"] == "my.toml: Smith"
    assert other.rotor_inertia == 0.334
    assert robot.origins["b.rotor_inertia"] == "arm.srdf, rotor_params"
    assert robot.origins["b.damping_ratio"] == "picchio's default, not measured"
    assert [path.name for path in robot.files] == ["arm.urdf", "my.toml", "arm.srdf"]

    robot = load_robot(full, flex=flex, values={"a": {"stiffness": 5.0}})
    assert robot.stiffness.tolist() == [5.0, 45.0]
    assert robot.origins["a.stiffness"] == "argument"


def test_srdf_poses_and_end_effector(full, flex):
    robot = load_robot(full, flex=flex)
    # "0 1" is the cosine and sine of a quarter turn.
    assert robot.pose("home").tolist() == pytest.approx([0.5, 1.5707963267948966, 0.0])
    assert robot.tool_frame == "slide"
    with pytest.raises(InputError, match="did you mean 'home'"):
        robot.pose("hme")


def test_tool_frame_argument_beats_sidecar(arm, write):
    flex = write("f.toml", 'format = "picchio-sidecar/1"\n[joint.a]\nstiffness = 1e4\n'
                 '[tool]\nframe = "lower"\n')  # fmt: skip
    assert load_robot(arm, flex=flex).tool_frame == "lower"
    robot = load_robot(arm, flex=flex, tool="end")  # a joint's name: the link it carries
    assert (robot.tool_frame, robot.origins["tool.frame"]) == ("tip", "argument")


def test_a_folders_own_sidecar(arm_text, sidecar_text, write):
    urdf = write("myarm/robot.urdf", arm_text)
    write("myarm/flex.toml", sidecar_text)
    for asked in (urdf, urdf.parent):
        assert load_robot(asked).flexible_names == ("a", "b", "c")
    # Another name: a sidecar beside it is not taken unasked, so its drives are estimated.
    lone = write("myarm/other.urdf", arm_text)
    with pytest.warns(PicchioWarning, match="Estimated: nobody measured the stiffness"):
        alone = load_robot(lone)
    assert {alone.origins[f"{name}.stiffness"].partition(":")[0] for name in ("a", "b")} == {
        "picchio's estimate"
    }
    assert load_robot(lone, allow_rigid=True).flexible_joints == ()
    saved = lone.with_name("saved.toml")
    saved.write_text(f'format = "picchio-model/1"\nrobot = "{lone}"\n')
    assert load_robot(saved, allow_rigid=True).flexible_joints == ()
    # An annotation in the URDF keeps the folder's sidecar out.
    urdf.write_text(
        arm_text.replace("<robot ", '<robot xmlns:picchio="urn:picchio:1" ').replace(
            '<limit lower="-2"', '<picchio:flexibility stiffness="1"/><limit lower="-2"'
        )
    )
    with pytest.warns(PicchioWarning, match=r"flex.toml: is not read, since robot.urdf has annot"):
        assert load_robot(urdf).flexible_names == ("a",)


def test_springs_beside_the_drive_are_never_read(arm_text, write):
    tags = (
        '<gazebo reference="a"><springStiffness>1e5</springStiffness></gazebo>'
        '<gazebo reference="b"><spring_stiffness>1e5</spring_stiffness></gazebo>'
    )
    text = arm_text.replace("</robot>", tags + "</robot>")
    text = text.replace('<limit lower="0"', '<dynamics damping="3" stiffness="9"/><limit lower="0"')
    robot = load_robot(write("gazebo.urdf", text), allow_rigid=True)
    assert robot.flexible_joints == ()
    assert robot.origins.keys() == {"tool.frame"}


def test_catalogue_entry(full, flex):
    entry = describe_robot(FoundRobot("x", full))
    assert (entry.dof, entry.flexible, entry.with_stiffness) == (3, ("a", "b", "c"), ("a",))
    entry = describe_robot(FoundRobot("x", flex))
    assert entry.problem is not None
    assert "is a TOML file, not a URDF" in entry.problem


@pytest.mark.parametrize(
    ("joint", "says"),
    [
        ("stiffness = -1.0", "joint.a.stiffness: input should be greater than 0, got -1.0"),
        ("stiffness = 0", "greater than 0"),
        ("stiffness = nan", "joint.a.stiffness: "),
        ("stiffness = inf", "joint.a.stiffness: "),
        ('stiffness = "stiff"', "joint.a.stiffness: "),
        ("stifness = 1.0", "did you mean 'stiffness'"),
        ("stiffness = 1.0\ndamping_ratio = -0.1", "joint.a.damping_ratio"),
        ("stiffness = 1.0\nshaft = { radius = 0.1 }", "joint.a.shaft.length: the key is missing"),
        ("stiffness = 1.0\nshaft = { radius = 0.1, length = 0, shear_modulus = 1 }", "length"),
        ("stiffness_curve = { k1 = 1, k2 = 2, k3 = 3, t1 = 2, t2 = 1 }", "t2 must be above t1"),
        ("stiffness = 1\nstiffness_curve = { k1 = 1, k2 = 2, k3 = 3, t1 = 1, t2 = 2 }", "not both"),
        ("stiffness = 1\ngear_ratio = 0", "gear_ratio must not be zero"),
        ("balancer = { parent_point = [1,0,0], child_point = [0,1,0] }", "on a rigid joint"),
    ],
)
def test_bad_joint_entries(arm, write, joint, says):
    flex = write("bad.toml", f'format = "picchio-sidecar/1"\n[joint.a]\n{joint}\n')
    with pytest.raises(InputError) as caught:
        load_robot(arm, flex=flex)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('format = "picchio-sidecar/2"', "unknown format, got 'picchio-sidecar/2'"),
        ("[joint.a]\nstiffness = 1", "format: the key is missing"),
        ('format = "picchio-sidecar/1"\n[joint.d]\nstiffness = 1', "valid: a, b, c"),
        ('format = "picchio-sidecar/1"\n[joint.end]\nstiffness = 1', "fixed joint cannot be flex"),
        ('format = "picchio-sidecar/1"\n[joint.c]\nstiffness = 1\n'
         "shaft = { radius = 1, length = 1, shear_modulus = 1 }", "prismatic joint has no torsion"),
        ('format = "picchio-sidecar/1"\n[joints.a]\nstiffness = 1', "did you mean 'joint'"),
        ('format = "picchio-sidecar/1"\n[joint.a]\nstiffness = 1\n[tool]\nframe = "tipp"',
         "did you mean 'tip'"),
        ('format = "picchio-sidecar/1"\n[joint.a]\nstiffness = 1\n[tool]\naxis = [0,0,0]',
         "length zero"),
        ('format = "picchio-sidecar/1"\n[joint.a]\nstiffness = 1\n[tool]\nmass = -1', "tool.mass"),
        ('format = "picchio-sidecar/1"\n[joint.a]\nstiffness = 1\n[tool]\ninertia=[1,0,0,1,0,1]',
         "an inertia needs a mass"),
        ('format = "picchio-sidecar/1"\n[joint.a]\nstiffness = 1\n[tool]\nmass = 1\n'
         "inertia=[1,0,0,-1,0,1]", "not positive semidefinite"),
        ('format = "picchio-sidecar/1"\n[joint.a]\nstiffness = 1\n[gun]\nmass = 0\n'
         "recoil_stiffness = 1", "needs the gun's mass"),
        ("format = ", "is not valid TOML"),
    ],
)  # fmt: skip
def test_bad_sidecars(arm, write, text, says):
    with pytest.raises(InputError) as caught:
        load_robot(arm, flex=write("bad.toml", text))
    assert says in str(caught.value)


SHAFT = "shaft = { radius = 0.01, length = 0.1, shear_modulus = 79e9 }"


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        (f"[joint.b]\n{SHAFT}", "joint 'b': shaft is not used: the joint has no stiffness"),
        (
            "[joint.b]\ndamping_ratio = 0.1\ngear_ratio = 3.0",
            "damping_ratio and gear_ratio are not",
        ),
        ("[joint.b]\nsource = 'x'", "joint 'b': says nothing that is used"),
    ],
)
def test_what_a_rigid_joint_cannot_use_is_told(arm, write, recwarn, entry, told):
    flex = write("f.toml", f'format = "picchio-sidecar/1"\n[joint.a]\nstiffness = 1e4\n{entry}\n')
    load_robot(arm, flex=flex)
    (warning,) = recwarn.list
    assert str(warning.message).startswith("f.toml: ")
    assert told in str(warning.message)


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        (f"[joint.end]\n{SHAFT}", "a fixed joint cannot be flexible and has no drive"),
        ("[gun]\nmass = 1.0\ndamping_ratio = 0.1", "a damping ratio needs recoil_stiffness"),
        ("[tool]\ncom = [0, 0, 0.1]", "a centre of mass needs a mass"),
    ],
)
def test_what_can_have_no_effect_is_refused(arm, write, entry, says):
    flex = write("f.toml", f'format = "picchio-sidecar/1"\n[joint.a]\nstiffness = 1e4\n{entry}\n')
    with pytest.raises(InputError) as caught:
        load_robot(arm, flex=flex)
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("element", "says"),
    [
        ('<picchio:flexibility stiffness="-5"/>', "joint.a.stiffness"),
        ('<picchio:flexibility stiffness="nan"/>', "is not a finite number, got 'nan'"),
        ('<picchio:flexibility stiffness="1 2"/>', "is not a finite number"),
        ('<picchio:flexibility stifness="1"/>', "did you mean 'stiffness'"),
        ('<picchio:flexibilty stiffness="1"/>', "did you mean 'flexibility'"),
        ('<picchio:flexibility stiffness="1"/><picchio:flexibility stiffness="2"/>', "twice"),
        ('<picchio:flexibility stiffness="1" estimated="yes"/>', "neither true nor false"),
        ('<picchio:tool frame="tip"/>', "belongs directly in <robot>"),
        ('<limit2><picchio:shaft radius="1"/></limit2>', "belongs directly in a <joint>"),
        ('<picchio:balancer parent_point="1 2" child_point="0 0 0"/>', "parent_point"),
    ],
)
def test_bad_annotations(arm_text, write, element, says):
    text = arm_text.replace("<robot ", '<robot xmlns:picchio="urn:picchio:1" ', 1)
    text = text.replace('<limit lower="-2"', element + '<limit lower="-2"')
    with pytest.raises(InputError) as caught:
        load_robot(write("bad.urdf", text))
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("address", "says"),
    [
        ("urn:picchio:2", "unknown namespace, got 'urn:picchio:2'; did you mean 'urn:picchio:1'"),
        ("http://picchio", "unknown namespace"),
        (None, 'write <robot name="..." xmlns:picchio="urn:picchio:1">'),
    ],
)
def test_the_prefix_must_be_bound(arm_text, write, address, says):
    bound = f'<robot xmlns:picchio="{address}" ' if address else "<robot "
    text = arm_text.replace("<robot ", bound, 1)
    text = text.replace("<limit", '<picchio:flexibility stiffness="1"/><limit', 1)
    with pytest.raises(InputError) as caught:
        load_robot(write("bad.urdf", text))
    assert says in str(caught.value)
