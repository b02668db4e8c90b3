"""Arms that no part of the project was made for run the whole way."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

import picchio
from picchio.robot.loading.find import example_robots
from picchio.robot.masses.check import general_pose
from picchio.studies.maps.places import joint_grid

G = 79.3e9  # Pa, steel
# Of example-robot-data, none of them in robots/: name, and the tool's frame where it must be named.
FOUND = {
    "ur3_robot": None,
    "ur3_gripper": "ee_link",
    "so100": None,
    "so101": "gripper_frame_link",
    "hextilt_flying_arm_5": None,
    "anymal-kinova": None,
    "baxter": "left_gripper",
    "pr2": "r_gripper_tool_frame",
}
# Generated: of each joint its kind and axis.
MADE = {
    "scara": [("revolute", "0 0 1"), ("revolute", "0 0 1"), ("prismatic", "0 0 1"),
              ("revolute", "0 0 1")],
    "gantry": [("prismatic", "1 0 0"), ("prismatic", "0 1 0"), ("prismatic", "0 0 1")],
    "one": [("continuous", "0 1 0")],
    "eight": [("revolute", axis) for axis in ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0",
                                              "1 0 0", "0 1 0", "1 0 0")],
}  # fmt: skip
JOINT = """<joint name="j{k}" type="{kind}"><parent link="l{k}"/><child link="l{next}"/>
<origin xyz="0.3 0 0.1" rpy="0.1 0 0"/><axis xyz="{axis}"/>
<limit lower="-1.5" upper="1.5" effort="500" velocity="2"/></joint><link name="l{next}"><inertial>
<origin xyz="0.15 0.01 0.02"/><mass value="{mass}"/><inertia ixx="{a}" ixy="0" ixz="0" iyy="{b}"
iyz="0" izz="{b}"/></inertial></link>"""


def made(name: str, folder: Path) -> Path:
    parts = []
    for k, (kind, axis) in enumerate(MADE[name]):
        mass = 24.0 / (k + 2) ** 1.1
        parts.append(JOINT.format(k=k, next=k + 1, kind=kind, axis=axis, mass=mass,
                                  a=0.004 * mass, b=0.011 * mass))  # fmt: skip
    parts.append(f'<link name="tip"/><joint name="end" type="fixed"><parent link="l{len(parts)}"/>'
                 '<child link="tip"/><origin xyz="0.3 0 0.05"/></joint>')  # fmt: skip
    urdf = folder / f"{name}.urdf"
    urdf.write_text(f'<robot name="{name}"><link name="l0"/>{"".join(parts)}</robot>')
    return urdf


def springs(urdf: Path, tool: str | None) -> dict[str, dict[str, object]]:
    """Each joint on the way to the tool: a spring of 8 Hz and more, and a shaft that is it."""
    bare = picchio.load_robot(urdf, tool=tool, allow_rigid=True)
    pose = general_pose(bare)
    inertia = np.diag(bare.rigid.mass_matrix(pose))
    on_the_way = [joint.name for joint in bare.tree.chain(bare.tool.frame)]
    found: dict[str, dict[str, object]] = {}
    names = [name for name in bare.joint_names if name in on_the_way]
    for k, name in enumerate(names):
        row = bare.joint_names.index(name)
        stiffness = inertia[row] * (2.0 * math.pi * (8.0 + 6.0 * k)) ** 2
        found[name] = {"stiffness": stiffness, "damping_ratio": 0.03}
        if bare.tree.joints[name].type != "prismatic":
            radius = (2.0 * stiffness * 0.05 / (math.pi * G)) ** 0.25
            found[name]["shaft"] = {"radius": radius, "length": 0.05, "shear_modulus": G,
                                    "sn_curve": "42CrMo4-QT-shaft"}  # fmt: skip
    return found


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")
@pytest.mark.parametrize("name", [*FOUND, *MADE])
def test_the_whole_way(name, tmp_path):
    urdf, tool = (example_robots()[name], FOUND[name]) if name in FOUND else (
        made(name, tmp_path), None)  # fmt: skip
    robot = picchio.load_robot(urdf, tool=tool, values=springs(urdf, tool))
    pose = general_pose(robot)
    # The tool pushes with a tenth of what moves.
    force = 0.1 * 9.81 * sum(
        body.mass for link in robot.tree.beyond(robot.flexible_names[0])
        if (body := robot.tree.links[link]) is not None
    )  # fmt: skip
    blows = {"kind": "pulse_train", "force": force, "period": 0.04, "width": 0.004}
    task = picchio.task_from_dict(
        {
            "format": "picchio-task/1",
            "excitation": blows,
            "hits_per_rivet": 4,
            "operation": [
                {"name": "push", "direction": [1.0, 0.3, -1.0],
                 "poses": [pose.tolist(), (0.9 * pose).tolist()]},
            ],
        },
        robot,
    )  # fmt: skip
    found = picchio.assess(robot, task)
    assert found.verdict.status in ("safe", "limited", "fails", "cannot-be-told")
    peaks = np.array([joint.peak_deflection for joint in found.joints])
    assert np.isfinite(peaks).all()
    assert (peaks > 0).any()
    json.dumps(found.to_dict(), allow_nan=False)

    turning = [joint for joint in found.joints if joint.sn_curve]
    if turning:
        allowed = picchio.allowable(robot, task, 1e6, survival=0.99)
        json.dumps(allowed.to_dict(), allow_nan=False)
        spread = picchio.uncertain_life(robot, task, samples=24)
        json.dumps(spread.to_dict(), allow_nan=False)

    excitation = task.operations[0].excitation
    counts = [2 if joint in robot.flexible_names else 1 for joint in robot.joint_names]
    with picchio.workspace_map(
        robot, joint_grid(robot, counts), excitation, tmp_path / "map.nc", workers=0
    ) as mapped:
        summary = mapped.to_dict()
    assert summary["poses"] == 2 ** len(robot.flexible_names)
    assert all(joint["peak_deflection"] > 0 for joint in summary["joints"])

    moved = picchio.place(robot, task, move=(0.02, 0.02, 0.02, 0.1), placements=20,
                          self_collision=False)  # fmt: skip
    json.dumps(moved.to_dict(), allow_nan=False)
    page = picchio.report(found, robot=robot, task=task).html()
    assert robot.flexible_names[0] in page
