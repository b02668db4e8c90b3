"""A link that bends: against the same arm whose URDF has joints in the middle of its link."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.linalg

import picchio
from picchio.core.errors import InputError
from picchio.model.effects.structure.springs.link_bending import LinkBending
from picchio.model.geometry import Geometry
from picchio.model.model import Model

LENGTH, MASS, TIP = 0.8, 6.0, 4.0  # m, kg, kg: a uniform rod along x, and what it carries
STIFF, RATIO, DAMPING = 9e4, 0.4, 20.0
SPRINGS = {"joint_1": 4e4, "joint_2": 2e4}


def _link(name: str, mass: float, centre: float, length: float, thick: float) -> str:
    across = mass * length**2 / 12.0 + thick
    return (
        f'<link name="{name}"><inertial><origin xyz="{centre} 0 0"/><mass value="{mass}"/>'
        f'<inertia ixx="{2 * thick}" ixy="0" ixz="0" iyy="{across}" iyz="0" izz="{across}"/>'
        "</inertial></link>"
    )


def _joint(name: str, parent: str, child: str, x: float, axis: str) -> str:
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{x} 0 0"/><axis xyz="{axis}"/>'
        '<limit lower="-3" upper="3" effort="1e3" velocity="3"/></joint>'
    )


def _arm(folder, angle: float | None = None):
    """The arm, its rod in one piece, or in two halves with two hinges between them.

    Args:
        folder: for its files.
        angle: rad, of the first hinge's axis from z towards -y.
    """
    bends = angle is not None
    cos, sin = math.cos(angle or 0.0), math.sin(angle or 0.0)
    half = [
        _link("rod", 0.5 * MASS, 0.25 * LENGTH, 0.5 * LENGTH, 0.5e-3),
        '<link name="between"/>',
        _link("far", 0.5 * MASS, 0.25 * LENGTH, 0.5 * LENGTH, 0.5e-3),
        _joint("bend_1", "rod", "between", 0.5 * LENGTH, f"0 {-sin} {cos}"),
        _joint("bend_2", "between", "far", 0.0, f"0 {-cos} {-sin}"),
        _joint("joint_2", "far", "tip", 0.5 * LENGTH, "0 1 0"),
    ]
    whole = [_link("rod", MASS, 0.5 * LENGTH, LENGTH, 1e-3),
             _joint("joint_2", "rod", "tip", LENGTH, "0 1 0")]  # fmt: skip
    body = [
        '<link name="base"/>', _joint("joint_1", "base", "rod", 0.0, "0 1 0"),
        *(half if bends else whole), _link("tip", TIP, 0.2, 0.3, 1e-2), '<link name="tool"/>',
        '<joint name="fixed" type="fixed"><parent link="tip"/><child link="tool"/>'
        '<origin xyz="0.3 0.05 0"/></joint>',
    ]  # fmt: skip
    urdf, flex = folder / f"arm{bends}.urdf", folder / f"arm{bends}.toml"
    urdf.write_text(f'<robot name="arm{bends}">{"".join(body)}</robot>')
    springs = dict(SPRINGS)
    if bends:
        springs |= {"bend_1": STIFF, "bend_2": STIFF / RATIO}
    flex.write_text(
        'format = "picchio-sidecar/1"\n[tool]\nframe = "tool"\naxis = [1, 0, 0]\n'
        + "".join(
            f"[joint.{name}]\nstiffness = {value}\ndamping_ratio = 0.02\n"
            for name, value in springs.items()
        )
    )
    return picchio.load_robot(urdf, flex=flex, tool="tool")


def _system(robot, effects=()):
    pose = robot.pose({"joint_1": 0.4, "joint_2": -0.9} | dict.fromkeys(
        set(robot.flexible_names) - set(SPRINGS), 0.0))  # fmt: skip
    return Model(robot).with_effects(effects).plant(Geometry.of(robot, pose)).build(np.eye(3)[2])


def _modes(system):
    """Frequencies, Hz, and the tool's compliance through each mode: the same in any coordinates."""
    values, shapes = scipy.linalg.eigh(system.stiffness, system.mass)
    moved = system.force_jacobian @ shapes
    return np.sqrt(values) / (2.0 * np.pi), [np.outer(m, m) for m in moved.T]


@pytest.mark.parametrize("angle", [0.0, 0.5 * np.pi, 2.0])
def test_its_modes_are_those_of_two_halves_with_hinges(tmp_path, angle):
    effect = LinkBending("joint_1", stiffness=STIFF, damping=DAMPING, ratio=RATIO, angle=angle)
    found = _modes(_system(_arm(tmp_path), [effect]))
    true = _modes(_system(_arm(tmp_path, angle)))
    assert len(found[0]) == 4
    assert found[0] == pytest.approx(true[0], rel=1e-9)
    assert np.allclose(found[1], true[1], rtol=1e-7, atol=1e-9)


def test_the_last_link_bends_half_way_to_the_tool(tmp_path):
    """Statics: what is beyond its middle turns about it, so the tool moves by half its length."""
    robot = _arm(tmp_path)
    effect = LinkBending("joint_2", stiffness=STIFF, damping=DAMPING, ratio=1.0)
    stiff, soft = _system(robot), _system(robot, [effect])

    def compliance(system):
        return system.force_jacobian @ np.linalg.solve(system.stiffness, system.force_jacobian.T)

    more = np.trace(compliance(soft) - compliance(stiff))
    half = 0.5 * np.linalg.norm([0.3, 0.05])
    assert more == pytest.approx(2.0 * half**2 / STIFF, rel=1e-9)


def test_a_link_without_length_cannot_bend(tmp_path):
    _arm(tmp_path)
    file = tmp_path / "armFalse.urdf"
    file.write_text(file.read_text().replace("0.3 0.05 0", "0 0 0"))
    robot = picchio.load_robot(file, flex=tmp_path / "armFalse.toml", tool="tool")
    effect = LinkBending("joint_2", stiffness=STIFF, damping=DAMPING)
    with pytest.raises(InputError, match="no link that could bend"):
        _system(robot, [effect])
