"""Spreads of values: every number may have one, files carry them, bad ones are named."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

import picchio
from picchio.core.errors import InputError
from picchio.robot.annotations.sidecar import JointEntry
from picchio.robot.joint import Shaft
from picchio.robot.link import LinkEntry
from picchio.robot.spread import Posterior, numbers_of, root_of
from picchio.robot.tool import Gun, Tool
from picchio.robot.varied import robot_with

SIDECAR = """\
format = "picchio-sidecar/1"
[joint.joint_1]
stiffness = 2.4e5
stiffness_spread = 2.0
damping_ratio = 0.03
damping_ratio_std = 0.006
shaft = { radius = 0.01765, length = 0.0504, shear_modulus = 79.3e9, radius_std = 1e-4 }
[joint.joint_2]
stiffness = 1e5
stiffness_std = 1e4
damping_ratio = 0.03
[joint.joint_3]
stiffness = 1e5
damping_ratio = 0.03
estimated = true
[tool]
frame = "tool"
axis = [1.0, 0.0, 0.0]
mass = 2.0
mass_spread = 1.1
com = [0.0, 0.0, 0.1]
com_std = 0.01
[link.link2]
mass_spread = 1.05
[posterior]
names = ["stiffness.joint_1", "stiffness.joint_2", "mass.tool"]
correlation = [[1.0, -0.5, 0.0], [-0.5, 1.0, 0.2], [0.0, 0.2, 1.0]]
"""


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("spreads") / "flex.toml"
    link = sorted(picchio.load_robot("fanuc_like_3dof").tree.links)[-2]
    path.write_text(SIDECAR.replace("link2", link))
    return path


def test_every_number_of_every_table_may_have_one() -> None:
    assert numbers_of(JointEntry) == ("stiffness", "damping_ratio", "rotor_inertia", "gear_ratio")
    assert numbers_of(Shaft) == ("radius", "length", "shear_modulus")
    assert {"mass", "com", "inertia"} <= set(numbers_of(Tool)) & set(numbers_of(LinkEntry))
    assert "recoil_stiffness" in numbers_of(Gun)


def test_a_robot_knows_its_spreads(file: Path) -> None:
    robot = picchio.load_robot("fanuc_like_3dof", flex=file)
    found = robot.spreads
    assert found["stiffness.joint_1"].size == pytest.approx(math.log(2.0))
    assert found["stiffness.joint_2"].size == pytest.approx(math.sqrt(math.log(1.01)))
    assert found["shaft.radius.joint_1"].at(1.0) == pytest.approx(0.01775, rel=1e-4)
    guess = found["stiffness.joint_3"]
    assert guess.estimated and guess.size == pytest.approx(math.log(2.0))
    assert found["damping_ratio.joint_3"].estimated
    assert not found["stiffness.joint_1"].estimated
    assert found["com.tool[2]"].at(-1.0) == pytest.approx((0.0, 0.0, 0.09))
    assert any(name.startswith("mass.link.") for name in found)
    assert "flex.toml" in found["mass.tool"].source
    # A value that wins over the file is known: neither its spread nor its correlation is left.
    sure = picchio.load_robot("fanuc_like_3dof", flex=file, values={"joint_1": {"stiffness": 2e5}})
    assert "stiffness.joint_1" not in sure.spreads
    assert sure.posterior.names == ("stiffness.joint_2", "mass.tool")


def test_annotations_carry_them(file: Path, tmp_path: Path) -> None:
    urdf = picchio.annotate("fanuc_like_3dof", flex=file).save(tmp_path / "robot.urdf")
    ours, theirs = picchio.load_robot("fanuc_like_3dof", flex=file), picchio.load_robot(urdf)
    assert {n: s.at(1.0) for n, s in ours.spreads.items()} == {
        n: s.at(1.0) for n, s in theirs.spreads.items()
    }
    assert ours.posterior == theirs.posterior


FLEXIBILITY = '<picchio:flexibility stiffness="2e5" {}/>'
DAMPED = 'stiffness_std="1e4" damping_ratio="0.05"'


@pytest.mark.parametrize(
    ("before", "sidecar"),
    [
        # An estimate is one of its own source's values, and a spread of the value beside it.
        (DAMPED, "stiffness = 3e5\nestimated = true"),
        (DAMPED, "stiffness = 3e5"),
        ('damping_ratio="0.05" estimated="true"', "stiffness = 3e5"),
        ('damping_ratio="0.05" estimated="true"', "damping_ratio = 0.02"),
        (DAMPED, "stiffness_curve = { k1 = 1e5, k2 = 2e5, k3 = 3e5, t1 = 10.0, t2 = 20.0 }"),
    ],
)
def test_an_annotated_robot_is_the_one_with_the_sidecar(
    tmp_path: Path, before: str, sidecar: str
) -> None:
    text = picchio.load_robot("fanuc_like_3dof").source.read_text()
    urdf = tmp_path / "robot.urdf"
    urdf.write_text(re.sub("<picchio:flexibility[^>]*>", FLEXIBILITY.format(before), text, count=1))
    flex = tmp_path / "flex.toml"
    flex.write_text(f'format = "picchio-sidecar/1"\n[joint.joint_1]\n{sidecar}\n')
    apart = picchio.load_robot(urdf, flex=flex)
    merged = picchio.load_robot(picchio.annotate(urdf, flex=flex).save(tmp_path / "one.urdf"))
    told = [
        {n: (s.value, s.size, s.estimated) for n, s in r.spreads.items()} for r in (apart, merged)
    ]
    assert told[0] == told[1]
    assert apart.stiffness.tolist() == merged.stiffness.tolist()


def test_a_name_with_a_blank_hangs_together(file: Path, tmp_path: Path) -> None:
    urdf, flex = tmp_path / "robot.urdf", tmp_path / "flex.toml"
    source = picchio.load_robot("fanuc_like_3dof").source
    urdf.write_text(source.read_text().replace("joint_1", "joint 1's"))
    text = file.read_text().replace("joint.joint_1]", 'joint."joint 1\'s"]')
    flex.write_text(text.replace("stiffness.joint_1", "stiffness.joint 1's"))
    saved = picchio.annotate(urdf, flex=flex).save(tmp_path / "one.urdf")
    posterior = picchio.load_robot(saved).posterior
    assert posterior == picchio.load_robot(urdf, flex=flex).posterior
    assert posterior.names[0] == "stiffness.joint 1's"
    saved.write_text(saved.read_text().replace("mass.tool", "mass.tool'"))
    with pytest.raises(InputError, match="picchio:posterior names"):
        picchio.load_robot(saved)


def test_a_drawn_robot_is_the_one_with_these_values(file: Path, tmp_path: Path) -> None:
    robot = picchio.load_robot("fanuc_like_3dof", flex=file)
    names = ["stiffness.joint_1", "shaft.radius.joint_1", "mass.tool", "com.tool[2]"]
    drawn = robot_with(robot, [(robot.spreads[n], robot.spreads[n].at(1.0)) for n in names])
    text = file.read_text().replace("stiffness = 2.4e5", "stiffness = 4.8e5")
    text = text.replace("mass = 2.0", "mass = 2.2").replace("0.0, 0.1]", "0.0, 0.11]")
    other = tmp_path / "other.toml"
    other.write_text(
        text.replace("radius = 0.01765", f"radius = {drawn.flexible_joints[0].shaft.radius!r}")
    )
    expected = picchio.load_robot("fanuc_like_3dof", flex=other)
    pose = [0.3, 0.5, -0.8]
    np.testing.assert_allclose(
        drawn.state(pose).mass_matrix, expected.state(pose).mass_matrix, rtol=1e-12
    )
    np.testing.assert_allclose(drawn.stiffness, expected.stiffness, rtol=1e-12)
    assert not drawn.spreads


def test_the_root_of_a_correlation_gives_it_back() -> None:
    posterior = Posterior(names=("a", "b"), correlation=((1.0, -1.0), (-1.0, 1.0)))
    root = root_of(["c", "b", "a"], posterior)
    np.testing.assert_allclose(root @ root.T, [[1, 0, 0], [0, 1, -1], [0, -1, 1]], atol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("stiffness_spread = 2.0", "stiffness_spread = 0.5", "joint.joint_1.stiffness_spread"),
        ("stiffness_spread = 2.0", "stiffness_spread = 2.0\nstiffness_std = 1.0", "not both"),
        ("stiffness_std = 1e4", "stiffness_std = -1e4", "joint.joint_2.stiffness_std"),
        ("stiffness_std = 1e4", "stifness_std = 1e4", "stifness_std"),
        ("damping_ratio_std = 0.006", "gear_ratio_std = 1.0", "gear_ratio_std"),
        ('"mass.tool"]', '"mass.gun"]', "mass.gun"),
        ("-0.5, 1.0, 0.2", "-0.4, 1.0, 0.2", "symmetric"),
        ("[[1.0, -0.5", "[[0.9, -0.5", "ones on its diagonal"),
        ("0.2, 1.0]]", "0.2]]", "rows of 3"),
        ("[[1.0, -0.5, 0.0], [-0.5,", "[[1.0, -9.0, 0.0], [-9.0,", "semidefinite"),
    ],
)  # fmt: skip
def test_a_spread_that_cannot_be_is_named(
    file: Path, tmp_path: Path, old: str, new: str, said: str
) -> None:
    bad = tmp_path / "bad.toml"
    text = file.read_text()
    assert old in text
    bad.write_text(text.replace(old, new))
    with pytest.raises(InputError, match=r"bad\.toml") as error:
        picchio.load_robot("fanuc_like_3dof", flex=bad)
    assert said in str(error.value)
