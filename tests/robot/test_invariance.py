"""Turning, mirroring, renaming, reordering, splitting: what must not change the answer."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree

from picchio.robot.joint import Balancer
from picchio.robot.loading.load import load_robot

KIN = ("revolute", "continuous", "prismatic")


def random_arm(seed: int, count: int) -> dict:
    """An arm as numbers: joints with placements, axes, kinds; bodies with full inertias."""
    rng = np.random.default_rng(seed)
    joints, bodies = [], []
    for _ in range(count):
        kind = KIN[rng.integers(3)]
        joints.append({"xyz": rng.uniform(-0.5, 0.5, 3), "rpy": rng.uniform(-3, 3, 3),
                       "axis": rng.normal(size=3), "kind": kind})  # fmt: skip
        points = rng.normal(size=(5, 3)) * 0.1
        tensor = np.trace(points.T @ points) * np.eye(3) - points.T @ points
        bodies.append({"mass": rng.uniform(0.5, 10), "com": rng.uniform(-0.3, 0.3, 3),
                       "rpy": rng.uniform(-3, 3, 3), "inertia": tensor})  # fmt: skip
    return {"joints": joints, "bodies": bodies, "tool": rng.uniform(-0.2, 0.2, 3)}


def text(values) -> str:
    return " ".join(repr(float(v)) for v in values)


def link(name: str, body: dict | None) -> str:
    if body is None:
        return f'<link name="{name}"/>'
    i = body["inertia"]
    return (
        f'<link name="{name}"><inertial><origin xyz="{text(body["com"])}" '
        f'rpy="{text(body["rpy"])}"/><mass value="{body["mass"]:.17g}"/><inertia '
        f'ixx="{i[0, 0]:.17g}" ixy="{i[0, 1]:.17g}" ixz="{i[0, 2]:.17g}" iyy="{i[1, 1]:.17g}" '
        f'iyz="{i[1, 2]:.17g}" izz="{i[2, 2]:.17g}"/></inertial></link>'
    )


def joint(name: str, parent: str, child: str, data: dict) -> str:
    extra = ""
    if data["kind"] != "fixed":
        extra = f'<axis xyz="{text(data["axis"])}"/>'
        extra += '<limit lower="-9" upper="9" effort="1" velocity="1"/>'
    return (
        f'<joint name="{name}" type="{data["kind"]}"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin xyz="{text(data["xyz"])}" rpy="{text(data["rpy"])}"/>'
        f"{extra}</joint>"
    )


def write_urdf(arm: dict, path, *, names=None, order=None, split: bool = False):
    """The arm as a URDF; `split` puts every body on a link of its own behind a fixed joint."""
    count = len(arm["joints"])
    names = names or [f"joint{i}" for i in range(count)]
    parts = [link("base", None)]
    parent = "base"
    for i, (j, b) in enumerate(zip(arm["joints"], arm["bodies"], strict=True)):
        child = f"{names[i]}_link"
        parts.append(joint(names[i], parent, child, j))
        if split:
            near, far = dict(b), dict(b)
            turned = pin.rpy.rpyToMatrix(0.3, -0.2, 0.5)
            shift = np.array([0.1, 0.2, -0.3])
            # Half the body stays, half sits on a link at another place, seen from there.
            near["mass"] = far["mass"] = 0.5 * b["mass"]
            near["inertia"] = far["inertia"] = 0.5 * b["inertia"]
            far["com"] = turned.T @ (b["com"] - shift)
            body = pin.rpy.rpyToMatrix(*b["rpy"])
            far["rpy"] = pin.rpy.matrixToRpy(turned.T @ body)
            parts += [link(child, near), link(f"{child}_half", far)]
            place = {"kind": "fixed", "xyz": shift, "rpy": (0.3, -0.2, 0.5)}
            parts.append(joint(f"{names[i]}_split", child, f"{child}_half", place))
        else:
            parts.append(link(child, b))
        parent = child
    tool = {"kind": "fixed", "xyz": arm["tool"], "rpy": (0.1, 0.2, 0.3)}
    parts += [joint("mount", parent, "tool", tool), link("tool", None)]
    if order is not None:
        np.random.default_rng(order).shuffle(parts)
    path.write_text(f'<robot name="r">{"".join(parts)}</robot>')
    stiffness = {name: {"stiffness": 1e4 * (i + 1)} for i, name in enumerate(names)}
    return stiffness


def load(arm: dict, path, **options):
    flex = options.pop("flex", None)
    return load_robot(path, values=write_urdf(arm, path, **options), flex=flex)


def arrays(robot, pose) -> list[np.ndarray]:
    state = robot.state(pose)
    return [state.mass_matrix, state.jacobian, state.gravity_torque, state.stiffness,
            state.tool_position, state.tool_rotation, robot.gravity_stiffness(pose)]  # fmt: skip


def assert_same(one: list[np.ndarray], other: list[np.ndarray]) -> None:
    for a, b in zip(one, other, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9 * max(1.0, np.abs(b).max()))


arms = st.tuples(st.integers(0, 10**6), st.integers(1, 7))
many = settings(max_examples=40, deadline=None)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return tmp_path_factory.mktemp("arms") / "arm.urdf"


@many
@given(arms)
def test_mass_matrix_and_gravity_are_those_of_the_bodies_one_by_one(path, which):
    """M and g from each body's own kinetic and potential energy, by differences of its place."""
    arm = random_arm(*which)
    robot = load(arm, path)
    count = which[1]
    pose = np.random.default_rng(which[0]).uniform(-1, 1, count)

    def places(q: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        turned, origin, found = np.eye(3), np.zeros(3), []
        for j, b, angle in zip(arm["joints"], arm["bodies"], q, strict=True):
            origin = origin + turned @ j["xyz"]
            turned = turned @ pin.rpy.rpyToMatrix(*j["rpy"])
            axis = j["axis"] / np.linalg.norm(j["axis"])
            if j["kind"] == "prismatic":
                origin = origin + turned @ axis * angle
            else:
                turned = turned @ pin.AngleAxis(angle, axis).matrix()
            found.append((origin + turned @ b["com"], turned @ pin.rpy.rpyToMatrix(*b["rpy"])))
        return found

    h = 1e-5
    mass, gravity = np.zeros((count, count)), np.zeros(count)
    moved = [[places(pose + s * h * np.eye(count)[i]) for s in (1, -1)] for i in range(count)]
    for k, (body, (_, here)) in enumerate(zip(arm["bodies"], places(pose), strict=True)):
        linear = np.array([(up[k][0] - down[k][0]) / (2 * h) for up, down in moved])
        spin = np.array([
            pin.log3(up[k][1] @ down[k][1].T) / (2 * h) for up, down in moved])  # fmt: skip
        world = here @ body["inertia"] @ here.T
        mass += body["mass"] * linear @ linear.T + spin @ world @ spin.T
        gravity += body["mass"] * 9.81 * linear[:, 2]
    state = robot.state(pose)
    np.testing.assert_allclose(state.mass_matrix, mass, atol=1e-7 * np.abs(mass).max())
    np.testing.assert_allclose(
        state.gravity_torque, gravity, atol=1e-6 * max(1.0, np.abs(gravity).max())
    )


@many
@given(arms, st.tuples(*[st.floats(-3, 3)] * 3), st.tuples(*[st.floats(-5, 5)] * 3))
def test_turning_base_and_gravity_turns_the_answer(path, which, rpy, xyz):
    arm = random_arm(*which)
    pose = np.random.default_rng(which[0]).uniform(-1, 1, which[1])
    turned = pin.rpy.rpyToMatrix(*rpy)
    flex = path.with_suffix(".toml")
    gravity = turned @ [0, 0, -9.81]
    flex.write_text(
        f'format = "picchio-sidecar/1"\n[base]\nrpy = {[float(v) for v in rpy]}\n'
        f"xyz = {[float(v) for v in xyz]}\ngravity = {[float(v) for v in gravity]}\n"
    )
    plain = arrays(load(arm, path), pose)
    other = arrays(load(arm, path, flex=flex), pose)
    plain[1] = turned @ plain[1]
    plain[4] = turned @ plain[4] + xyz
    plain[5] = turned @ plain[5]
    assert_same(other, plain)


@many
@given(arms)
def test_mirroring_mirrors_the_answer(path, which):
    """Through the x-z plane: vectors lose their y, axes of rotation keep it."""
    arm = random_arm(*which)
    flip = np.diag([1.0, -1.0, 1.0])
    mirrored = {"joints": [], "bodies": [], "tool": flip @ arm["tool"]}

    def turn(rpy):
        return pin.rpy.matrixToRpy(flip @ pin.rpy.rpyToMatrix(*rpy) @ flip)

    for j in arm["joints"]:
        axis = flip @ j["axis"] * (1 if j["kind"] == "prismatic" else -1)
        mirrored["joints"].append({**j, "xyz": flip @ j["xyz"], "rpy": turn(j["rpy"]),
                                   "axis": axis})  # fmt: skip
    for b in arm["bodies"]:
        mirrored["bodies"].append({**b, "com": flip @ b["com"], "rpy": turn(b["rpy"]),
                                   "inertia": flip @ b["inertia"] @ flip})  # fmt: skip
    pose = np.random.default_rng(which[0]).uniform(-1, 1, which[1])
    one, other = load(arm, path).state(pose), load(mirrored, path).state(pose)
    np.testing.assert_allclose(one.mass_matrix, other.mass_matrix, atol=1e-9)
    np.testing.assert_allclose(flip @ one.jacobian, other.jacobian, atol=1e-9)
    np.testing.assert_allclose(one.gravity_torque, other.gravity_torque, atol=1e-8)


@many
@given(arms, st.integers(0, 1000))
def test_renaming_and_reordering_change_nothing(path, which, order):
    arm = random_arm(*which)
    pose = np.random.default_rng(which[0]).uniform(-1, 1, which[1])
    names = [f"{'zyxwvut'[i]} <joint> & é{i}" for i in range(which[1])]
    plain = load(arm, path)
    escaped = [name.replace("&", "&amp;").replace("<", "&lt;") for name in names]
    write_urdf(arm, path, names=escaped, order=order)
    stiffness = {name: {"stiffness": 1e4 * (i + 1)} for i, name in enumerate(names)}
    other = load_robot(path, values=stiffness)
    assert other.joint_names == tuple(names)
    assert_same(arrays(plain, pose), arrays(other, dict(zip(names, pose, strict=True))))


@many
@given(arms)
def test_splitting_bodies_by_fixed_joints_changes_nothing(path, which):
    arm = random_arm(*which)
    pose = np.random.default_rng(which[0]).uniform(-1, 1, which[1])
    plain = load(arm, path)
    write = write_urdf(arm, path, split=True)
    assert_same(arrays(plain, pose), arrays(load_robot(path, values=write, tool="tool"), pose))


@many
@given(arms)
def test_continuous_is_revolute_without_limits(path, which):
    arm = random_arm(*which)
    pose = np.random.default_rng(which[0]).uniform(-7, 7, which[1])
    robots = []
    for kind in ("continuous", "revolute"):
        for j in arm["joints"]:
            j["kind"] = kind if j["kind"] != "prismatic" else "prismatic"
        robots.append(load(arm, path))
    assert_same(*(arrays(robot, pose) for robot in robots))


@many
@given(arms)
def test_rigid_joints_are_as_good_as_fixed(path, which):
    """A joint without stiffness stands still: fixing it at its angle gives the same."""
    arm = random_arm(which[0], 5)
    pose = np.random.default_rng(which[0]).uniform(-1, 1, 5)
    stiffness = write_urdf(arm, path)
    stiffness.pop("joint2")
    robot = load_robot(path, values=stiffness)
    assert robot.flexible_names == ("joint0", "joint1", "joint3", "joint4")
    j = arm["joints"][2]
    turned = pin.rpy.rpyToMatrix(*j["rpy"])
    axis = j["axis"] / np.linalg.norm(j["axis"])
    if j["kind"] == "prismatic":
        j["xyz"] = j["xyz"] + turned @ axis * pose[2]
    else:
        j["rpy"] = pin.rpy.matrixToRpy(turned @ pin.AngleAxis(pose[2], axis).matrix())
    j["kind"] = "fixed"
    write_urdf(arm, path)
    other = load_robot(path, values=stiffness)
    assert_same(arrays(robot, pose), arrays(other, np.delete(pose, 2)))


def test_numbers_survive_the_way_to_pinocchio(path):
    """The URDF written for Pinocchio has every digit, and lxml sees the same names."""
    arm = random_arm(3, 4)
    robot = load(arm, path)
    root = etree.fromstring(robot.rigid._text)
    masses = [float(m.get("value")) for m in root.iter("mass")]
    assert masses == [b["mass"] for b in arm["bodies"]]


def test_balancers_points_may_meet():
    balancer = Balancer(parent_point=(1.0, 0.0, 0.0), child_point=(1.0, 0.0, 0.0), stiffness=100.0)
    assert balancer.torque_and_stiffness((0, 0, 1), 0.0) == (0.0, 100)
