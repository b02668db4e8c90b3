"""The arm's own recursion against pinocchio, on the URDFs and with further joints in them."""

import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin
import pytest

from worlds import arm, campaign, equations, robots
from worlds import chain as chain_module
from worlds import plan as plans
from worlds.bench import nominal_chain, rest

NAMES = ("fanuc_like_3dof", "ur10", "kinova_gen3", "kuka_iiwa14")


def to_pin(model, values):
    """Pinocchio's configuration of joint angles; a continuous joint has two numbers."""
    out = pin.neutral(model)
    for joint, value in zip(list(model.joints)[1:], values, strict=True):
        wide = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
        out[joint.idx_q : joint.idx_q + joint.nq] = wide
    return out


def mass_and_bias(chain, q, v):
    work = arm.workspace(len(q))
    arm.kinematics(chain.arrays(), q, v, work)
    arm.dynamics(chain.arrays(), arm.GRAVITY, work)
    return work[12].copy(), work[13].copy(), work


def pinned(model, q, v):
    data, where = model.createData(), to_pin(model, q)
    return pin.crba(model, data, where).copy(), pin.nonLinearEffects(model, data, where, v).copy()


@pytest.mark.parametrize("name", NAMES)
def test_mass_matrix_and_bias_are_pinocchios(name):
    robot, rng = robots.load(name), np.random.default_rng(1)
    chain = nominal_chain(name)
    for _ in range(10):
        q, v = rng.uniform(-2, 2, (2, len(robot.joints)))
        mass, bias, _ = mass_and_bias(chain, q, 5.0 * v)
        known_mass, known_bias = pinned(robot.model, q, 5.0 * v)
        assert np.abs(mass - known_mass).max() < 1e-12 * np.abs(known_mass).max()
        assert np.abs(bias - known_bias).max() < 1e-12 * np.abs(known_bias).max()


@pytest.mark.parametrize("name", NAMES)
def test_accelerations_under_a_blow_are_those_of_aba(name):
    """Joints and tool, springs and dampers and gravity in it: to 1e-9."""
    rng = np.random.default_rng(2)
    plan = plans.make(name, rng, 3)
    world = campaign.World(plan, campaign.Nuisances.draw(len(plan.shots[0].pose), rng))
    bench = world.bench(1)
    system = bench.system()[0]
    model, n = bench.robot.model, len(bench.pose)
    data, work = model.createData(), arm.workspace(n)
    tool = model.getFrameId(bench.robot.tool)
    local = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    hold = pin.computeGeneralizedGravity(model, data, to_pin(model, bench.pose)).copy()
    for _ in range(5):
        x, v = 1e-2 * rng.normal(size=n), rng.normal(size=n)
        acc, out, none = np.empty(n), np.empty(equations.OUTPUTS + n), np.zeros(0)
        on = np.zeros(12, bool)
        on[3] = True
        past = (none, none, np.zeros(1, int))
        equations.rates(
            0.121, x, v, none, on, none, system, work, past, acc, none.copy(), none, out, True
        )
        q = to_pin(model, bench.pose + x)
        push = bench.blows.force * bench.direction
        jacobian = pin.computeFrameJacobian(model, data, q, tool, local)[:3]
        torque = hold - bench.springs * x - bench.damping_matrix() @ v + jacobian.T @ push
        known = pin.aba(model, data, q, v, torque).copy()
        assert np.abs(acc - known).max() < 1e-9 * np.abs(known).max()
        pin.forwardKinematics(model, data, q, v, known)
        moved = pin.getFrameClassicalAcceleration(model, data, tool, local).linear
        turn = pin.updateFramePlacement(model, data, tool).rotation
        assert np.abs(out[3:6] - moved).max() < 1e-9 * np.abs(moved).max()
        felt = turn.T @ (moved - arm.GRAVITY)
        assert np.abs(out[:3] - felt).max() < 1e-9 * np.abs(felt).max()
        speed = pin.getFrameVelocity(model, data, tool, local).linear
        assert np.abs(out[6:9] - speed).max() < 1e-9 * np.abs(speed).max()


def with_joint(robot, child_joint, xyz, kind, tmp_path):
    """The URDF with a further joint, axis `xyz`, between `child_joint` and its parent."""
    tree = ET.parse(robot.urdf)
    root = tree.getroot()
    for link in root.findall("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    if child_joint is None:
        child = next(link.get("name") for link in root.findall("link"))
        parent, origin = "floor", None
        ET.SubElement(root, "link", name="floor")
    else:
        joint = next(j for j in root.findall("joint") if j.get("name") == child_joint)
        parent, origin = joint.find("parent").get("link"), joint.find("origin")
        child = "between"
        ET.SubElement(root, "link", name=child)
        joint.find("parent").set("link", child)
        joint.remove(origin)
    new = ET.SubElement(root, "joint", name="new", type=kind)
    ET.SubElement(new, "parent", link=parent)
    ET.SubElement(new, "child", link=child)
    if origin is not None:
        new.append(origin)
    ET.SubElement(new, "axis", xyz=" ".join(map(str, xyz)))
    ET.SubElement(new, "limit", lower="-9", upper="9", effort="9", velocity="9")
    path = tmp_path / "more.urdf"
    tree.write(path)
    return pin.buildModelFromUrdf(str(path))


@pytest.mark.parametrize("name", ["fanuc_like_3dof", "kinova_gen3"])
@pytest.mark.parametrize(("kind", "axis"), [("revolute", "ry"), ("prismatic", "x")])
def test_a_base_that_moves_is_a_joint_below_the_urdfs_root(name, kind, axis, tmp_path):
    robot = robots.load(name)
    xyz = np.eye(3)["xyz".index(axis[-1])]
    model = with_joint(robot, None, xyz, kind, tmp_path)
    chain = nominal_chain(name).on_moving_base("base", xyz, kind == "prismatic")
    compare(model, chain)


@pytest.mark.parametrize("joint", ["joint_1", "joint_3"])
def test_a_hinge_is_a_joint_in_the_chain(joint, tmp_path):
    robot = robots.load("kinova_gen3")
    model = with_joint(robot, joint, [1, 0, 0], "revolute", tmp_path)
    chain = nominal_chain("kinova_gen3").insert(joint, "new", [1.0, 0.0, 0.0])
    compare(model, chain)


@pytest.mark.parametrize(("name", "body"), [("fanuc_like_3dof", 2), ("fanuc_r2000ic", 1)])
def test_a_body_that_bends_is_two_with_a_hinge(name, body):
    """Held straight it is the old one; bent it is pinocchio's model with two bodies."""
    robot, whole = robots.load(name), nominal_chain(name)
    chain = whole.split(body, "bend", 0.5, 0.7)
    q = np.random.default_rng(4).uniform(-1, 1, len(whole.names))
    straight = np.insert(q, body + 1, 0.0)
    rows = np.delete(np.arange(len(straight)), body + 1)
    mass, gravity, work = rest(chain, straight)
    old_mass, old_gravity, old_work = rest(whole, q)
    assert np.allclose(mass[np.ix_(rows, rows)], old_mass, rtol=1e-10, atol=1e-10)
    assert np.allclose(gravity[rows], old_gravity, rtol=1e-10, atol=1e-10)
    tools = [
        w[1][c.tool + 1] + w[0][c.tool + 1] @ c.tool_offset
        for w, c in ((work, chain), (old_work, whole))
    ]
    assert np.allclose(tools[0], tools[1], atol=1e-12)
    for i in (body, body + 1):
        moments = np.linalg.eigvalsh(chain.inertia[i])
        assert moments.min() > 0.0 and 2.0 * moments.max() < moments.sum() * (1.0 + 1e-9)
    model = pin.Model()
    for i, joint in enumerate(chain.names):
        place = pin.SE3(chain.rotation[i], chain.offset[i])
        kind = pin.JointModelRevoluteUnaligned(chain.axis[i])
        new = model.addJoint(int(chain.parent[i]), kind, place, joint)
        own = pin.Inertia(chain.mass[i], chain.com[i], chain.inertia[i])
        model.appendBodyToJoint(new, own, pin.SE3.Identity())
    compare(model, chain)
    assert robot.joints == tuple(n for n in chain.names if n != "bend")


def compare(model, chain):
    rng, n = np.random.default_rng(3), len(chain.names)
    order = [chain.names.index(name) if name in chain.names else chain.names.index("base")
             for name in list(model.names)[1:]]  # fmt: skip
    for _ in range(5):
        q, v = rng.uniform(-1, 1, (2, n))
        mass, bias, _ = mass_and_bias(chain, q, v)
        known_mass, known_bias = pinned(model, q[order], v[order])
        assert np.abs(mass[np.ix_(order, order)] - known_mass).max() < 1e-11 * known_mass.max()
        assert np.abs(bias[order] - known_bias).max() < 1e-11 * np.abs(known_bias).max()


def test_a_branch_with_a_point_mass_is_pinocchios():
    robot = robots.load("kinova_gen3")
    model = robot.model.copy()
    frame = model.frames[model.getFrameId(robot.tool)]
    place = pin.SE3(frame.placement.rotation, frame.placement.translation)
    new = model.addJoint(frame.parentJoint, pin.JointModelPZ(), place, "mass")
    model.appendBodyToJoint(
        new, pin.Inertia(0.7, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity()
    )
    chain = nominal_chain(robot.name)
    chain = chain.hang("mass", chain.tool, chain.tool_rotation, chain.tool_offset,
                       [0.0, 0.0, 1.0], True, 0.7)  # fmt: skip
    compare(model, chain)


def test_joints_that_stand_still_are_merged():
    robot, rng = robots.load("kinova_gen3"), np.random.default_rng(5)
    whole = nominal_chain(robot.name)
    moving = tuple(n for n in robot.joints if n not in ("joint_3", "joint_6"))
    q = rng.uniform(-1, 1, 7)
    pose = dict(zip(robot.joints, q, strict=True))
    part = chain_module.from_pinocchio(robot.model, moving, robot.tool, pose)
    at = [robot.joints.index(name) for name in moving]
    mass, gravity, _ = rest(whole, q)
    part_mass, part_gravity, _ = rest(part, q[at])
    assert np.allclose(part_mass, mass[np.ix_(at, at)], atol=1e-12)
    assert np.allclose(part_gravity, gravity[at], atol=1e-12)


@pytest.mark.parametrize("spin", [False, True])
def test_energy_is_kept_once_the_blows_are_over(spin):
    """Without damping; a rotor's gyroscopic torque does no work."""
    causes = (("gyroscopic_spindle", "tool", {"x": 30.0, "y": -50.0, "z": 80.0}),) if spin else ()
    plan = plans.make("fanuc_like_3dof", np.random.default_rng(6), 3, hits=3, force=900.0)
    still = campaign.Nuisances(np.ones(3), 0.0, 1.0)
    world = campaign.World(plan, still, causes, step=1e-4)
    bench = world.bench(1)
    step = 2e-4
    times = np.arange(0.0, 0.6, step)
    stops, out = world.motion(bench, times)
    at = np.searchsorted(stops, times[times > 0.14] - 1e-9)
    x = out[at, 0, equations.OUTPUTS :]
    v = (x[:-4] - 8.0 * x[1:-3] + 8.0 * x[3:-1] - x[4:]) / (12.0 * step)
    x = x[2:-2]
    model, data = bench.robot.model, bench.robot.model.createData()
    hold = pin.computeGeneralizedGravity(model, data, bench.pose).copy()
    energy = np.array([
        pin.computeKineticEnergy(model, data, bench.pose + a, b)
        + pin.computePotentialEnergy(model, data, bench.pose + a)
        + 0.5 * bench.springs @ a**2
        - hold @ a
        for a, b in zip(x, v, strict=True)
    ])  # fmt: skip
    start = pin.computePotentialEnergy(model, data, bench.pose)
    kept = energy - start
    print(f"{kept.mean():.4f} J, spread {np.ptp(kept) / kept.mean():.1e}")
    assert kept.mean() > 0.01
    assert np.ptp(kept) < 1e-6 * kept.mean()
