"""Effects with a mechanics of their own, against pinocchio's ABA under scipy's integrators."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import eigh

from worlds import campaign, equations, robots
from worlds import plan as plans
from worlds.bench import nominal_chain, rest

NAME = "fanuc_like_3dof"
SPRINGS = np.array([2.4e5, 1e5, 1e5])
END = 0.16


@pytest.fixture(scope="module")
def plan():
    return plans.make(NAME, np.random.default_rng(11), 3, hits=3, force=600.0)


@pytest.fixture(scope="module")
def model():
    return robots.load(NAME).model


class Reference:
    """The arm of pinocchio under springs, with room for an effect's own terms."""

    def __init__(self, model, shot):
        self.model, self.data = model, model.createData()
        self.pose, self.direction, self.force = shot.pose, shot.direction, shot.force
        self.tool = model.getFrameId("tool")
        self.gravity = pin.computeGeneralizedGravity(model, self.data, self.pose).copy()
        self.mass = pin.crba(model, self.data, self.pose).copy()
        squared, shapes = eigh(np.diag(SPRINGS), self.mass)
        weighted = self.mass @ shapes
        self.damping = weighted @ np.diag(0.06 * np.sqrt(squared)) @ weighted.T
        self.rest = self.place(np.zeros(3))[0]

    def place(self, x, frame=None):
        """(position, Jacobian) of a frame's origin."""
        q = self.pose + x
        frame = self.tool if frame is None else frame
        local = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        jacobian = pin.computeFrameJacobian(self.model, self.data, q, frame, local)[:3].copy()
        pin.framesForwardKinematics(self.model, self.data, q)
        return self.data.oMf[frame].translation.copy(), jacobian

    def run(self, springs=None, extra=None, states=0, method="DOP853", tolerance=1e-9):
        """(times, deflections): `extra(x, v, z, other, other_speed)` -> (torque, rates)."""
        springs = SPRINGS if springs is None else springs

        def rate(_, y, force):
            x, v, z = y[:3], y[3:6], y[6:]
            torque, dz = np.zeros(3), np.zeros(states)
            if extra is not None:
                torque, dz = extra(x, v, z)
            torque = torque + self.gravity - springs * x - self.damping @ v
            if force:
                torque = torque + self.place(x)[1].T @ self.direction * force
            return np.concatenate([v, pin.aba(self.model, self.data, self.pose + x, v, torque), dz])

        y, out, times = np.zeros(6 + states), [], []
        for h in range(4):
            for a, b, force in (
                (0.04 * h, 0.04 * h + 0.004, self.force if h < 3 else 0.0),
                (0.04 * h + 0.004, 0.04 * h + 0.04, 0.0),
            ):
                at = np.linspace(a, b, round((b - a) / 0.001) + 1)
                done = solve_ivp(rate, (a, b), y, method, at, args=(force,), rtol=tolerance,
                                 atol=1e-13, max_step=1e-3)  # fmt: skip
                assert done.success
                y = done.y[:, -1]
                times.append(at[:-1])
                out.append(done.y[:3, :-1])
        return np.concatenate(times), np.concatenate(out, axis=1)


def of_world(plan, effect, target, parameters, times, index=1):
    world = campaign.World(plan, campaign.Nuisances.none(3), ((effect, target, parameters),))
    stops, out = world.motion(world.bench(index), times)
    at = np.searchsorted(stops, times - 1e-9)
    return out[at, 0, equations.OUTPUTS :].T


def agree(known, found, bound):
    error = np.abs(known - found).max() / np.abs(known).max()
    print(f"{error:.1e}")
    assert error < bound


def matters(plan, effect, target, parameters, known, times, index=1):
    healthy = of_world(plan, "joint_damping", "joint_1", {"damping": 0.0}, times, index)
    assert np.abs(known - healthy).max() > 0.01 * np.abs(known).max()


@pytest.mark.parametrize(("joint", "gap"), [("joint_1", 2e-4), ("joint_2", 2e-4)])
def test_backlash_with_gravity(plan, model, joint, gap):
    """Joint 1 carries nothing and starts in the middle; joint 2 leans on an edge."""
    ref, j = Reference(model, plan.shots[1]), int(joint[-1]) - 1
    carried = -ref.gravity[j] if abs(ref.gravity[j]) > 1e-9 else 0.0
    lean = carried / SPRINGS[j] + np.sign(carried) * gap / 2

    def extra(x, v, z):
        u = x[j] + lean
        dead = u - np.clip(u, -gap / 2, gap / 2)
        torque = np.zeros(3)
        torque[j] = SPRINGS[j] * x[j] - (SPRINGS[j] * dead - carried)
        return torque, np.zeros(0)

    times, known = ref.run(extra=extra)
    agree(known, of_world(plan, "backlash", joint, {"gap": gap}, times), 1e-5)
    if joint == "joint_1":
        matters(plan, "backlash", joint, {"gap": gap}, known, times)


def test_hardening_and_hysteresis(plan, model):
    ref = Reference(model, plan.shots[1])
    cases = {
        "hardening": {"cubic": 5e10},
        "hysteresis": {"torque": 8.0, "deflection": 1e-4},
    }

    def law(effect, p):
        def extra(x, v, z):
            torque, rates = np.zeros(3), np.zeros(len(z))
            if effect == "hardening":
                torque[1] = -p["cubic"] * x[1] ** 3
            else:
                torque[1] = -p["torque"] * z[0]
                d, n = v[1], z[0]
                rates[0] = (d - 0.5 * (abs(d) * n + d * abs(n))) / p["deflection"]
            return torque, rates

        return extra

    for effect, p in cases.items():
        states = 1 if effect == "hysteresis" else 0
        times, known = ref.run(extra=law(effect, p), states=states)
        found = of_world(plan, effect, "joint_2", p, times)
        matters(plan, effect, "joint_2", p, known, times)
        agree(known, found, 1e-5)


def test_friction_slides_and_sticks(plan, model):
    """The ideal law, against one that is smoothed below 10 urad/s."""
    ref = Reference(model, plan.shots[1])
    p = {"torque": 110.0}

    def extra(x, v, z):
        return np.array([0.0, -p["torque"] * np.tanh(v[1] / 1e-5), 0.0]), np.zeros(0)

    times, known = ref.run(extra=extra, method="LSODA", tolerance=1e-7)
    found = of_world(plan, "coulomb_friction", "joint_2", p, times)
    still = np.abs(np.diff(found[1])) < 1e-12
    assert 0.02 < still[5:].mean() < 0.9  # it sticks now and then
    matters(plan, "coulomb_friction", "joint_2", p, known, times)
    agree(known, found, 1e-3)


@pytest.mark.parametrize("torque", [4.0, 60.0])
def test_friction_that_is_smoothed(plan, model, torque):
    ref = Reference(model, plan.shots[1])
    p = {"torque": torque, "smoothing": 5e-4}

    def extra(x, v, z):
        return np.array([0.0, -torque * np.tanh(v[1] / 5e-4), 0.0]), np.zeros(0)

    times, known = ref.run(extra=extra, method="LSODA", tolerance=1e-9)
    agree(known, of_world(plan, "coulomb_friction", "joint_2", p, times), 1e-5)


def test_a_link_that_bends_half_way(plan):
    """Against pinocchio's model of the two halves, hinge and all."""

    shot = plan.shots[1]
    p = {"stiffness": 2e5, "damping": 60.0, "angle": 0.8}
    chain = nominal_chain(NAME).split(1, "bend", 0.5, 0.8)
    model = pin.Model()
    for i, name in enumerate(chain.names):
        kind = pin.JointModelRevoluteUnaligned(chain.axis[i])
        place = pin.SE3(chain.rotation[i], chain.offset[i])
        new = model.addJoint(int(chain.parent[i]), kind, place, name)
        own = pin.Inertia(chain.mass[i], chain.com[i], chain.inertia[i])
        model.appendBodyToJoint(new, own, pin.SE3.Identity())
    tool = pin.Frame("tool", new, pin.SE3(chain.tool_rotation, chain.tool_offset),
                     pin.FrameType.OP_FRAME)  # fmt: skip
    tool = model.addFrame(tool)
    data = model.createData()
    pose = np.insert(shot.pose, 2, 0.0)
    gravity = pin.computeGeneralizedGravity(model, data, pose).copy()
    springs = np.insert(SPRINGS, 2, p["stiffness"])
    joints = [0, 1, 3]
    mass = rest(nominal_chain(NAME), shot.pose)[0]
    squared, shapes = eigh(np.diag(SPRINGS), mass)
    damping = np.zeros((4, 4))
    damping[np.ix_(joints, joints)] = (
        mass @ shapes @ np.diag(0.06 * np.sqrt(squared)) @ shapes.T @ mass
    )
    damping[2, 2] = p["damping"]
    local = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED

    def rate(_, y, force):
        x, v = y[:4], y[4:]
        torque = gravity - springs * x - damping @ v
        jacobian = pin.computeFrameJacobian(model, data, pose + x, tool, local)[:3]
        torque = torque + jacobian.T @ shot.direction * force
        return np.concatenate([v, pin.aba(model, data, pose + x, v, torque)])

    y, out, times = np.zeros(8), [], []
    for a, b, force in ((0.0, 0.004, shot.force), (0.004, 0.04, 0.0)):
        at = np.linspace(a, b, round((b - a) / 0.001) + 1)
        done = solve_ivp(rate, (a, b), y, "DOP853", at, args=(force,), rtol=1e-9, atol=1e-13)
        y = done.y[:, -1]
        times.append(at[:-1])
        out.append(done.y[joints, :-1])
    times, known = np.concatenate(times), np.concatenate(out, axis=1)
    found = of_world(plan, "mid_link_bending", "link_2", p, times)
    matters(plan, "mid_link_bending", "link_2", p, known, times)
    agree(known, found, 1e-5)


def test_workpiece_contact_lets_go(plan, model):
    shot = plan.shots[2]
    ref = Reference(model, shot)
    p = {"stiffness": 8e4, "damping": 300.0, "preload": 30.0}
    free = []

    def extra(x, v, z):
        place, jacobian = ref.place(x)
        u, du = ref.direction @ (place - ref.rest), ref.direction @ jacobian @ v
        normal = max(0.0, p["preload"] - p["stiffness"] * u - p["damping"] * du)
        free.append(normal == 0.0)
        return jacobian.T @ ref.direction * (normal - p["preload"]), np.zeros(0)

    times, known = ref.run(extra=extra)
    assert 0.05 < np.mean(free) < 0.95
    matters(plan, "workpiece_contact", "tool", p, known, times, 2)
    agree(known, of_world(plan, "workpiece_contact", "tool", p, times, 2), 1e-5)


def test_cable_holds_the_elbow(plan, model):
    ref = Reference(model, plan.shots[1])
    frame = model.getFrameId("link_3")
    anchor = ref.place(np.zeros(3), frame)[0]
    p = {"stiffness": 4e4, "damping": 200.0}

    def extra(x, v, z):
        place, jacobian = ref.place(x, frame)
        pull = -p["stiffness"] * (place - anchor) - p["damping"] * jacobian @ v
        return jacobian.T @ pull, np.zeros(0)

    times, known = ref.run(extra=extra)
    matters(plan, "cable", "link_3", p, known, times)
    agree(known, of_world(plan, "cable", "link_3", p, times), 1e-6)


def test_servo_and_damper(plan, model):
    """The motor side is a coordinate of its own; its share of C reacts on it."""
    ref, j = Reference(model, plan.shots[1]), 2
    p = {"rotor_inertia": 3.0, "stiffness": 5e5, "damping": 250.0}
    modal, ref.damping = ref.damping, np.zeros((3, 3))

    def extra(x, v, z):
        d, dd = x.copy(), v.copy()
        d[j] -= z[0]
        dd[j] -= z[1]
        torque = SPRINGS * d + modal @ dd
        motor = (torque[j] - p["stiffness"] * z[0] - p["damping"] * z[1]) / p["rotor_inertia"]
        return -torque, np.array([z[1], motor])

    times, x = ref.run(springs=np.zeros(3), extra=extra, states=2)
    found = of_world(plan, "servo_compliance", "joint_3", p, times)
    # the channel is link less motor: where the motor does not move, the link's own
    agree(x[:2], found[:2], 1e-6)
    matters(plan, "servo_compliance", "joint_3", p, x, times)
    ref.damping = modal + np.diag([0.0, 80.0, 0.0])
    times, known = ref.run()
    agree(known, of_world(plan, "joint_damping", "joint_2", {"damping": 80.0}, times), 1e-6)


def test_tool_offset_and_force_direction(plan, model):
    shot = plan.shots[1]
    moved = model.copy()
    frame = moved.frames[moved.getFrameId("tool")]
    frame.placement = frame.placement * pin.SE3(np.eye(3), np.array([0.01, -0.02, 0.03]))
    times, known = Reference(moved, shot).run()
    p = {"x": 0.01, "y": -0.02, "z": 0.03}
    agree(known, of_world(plan, "tool_offset", "tool", p, times), 1e-6)
    ref = Reference(model, shot)
    pin.framesForwardKinematics(model, ref.data, ref.pose)
    turn = ref.data.oMf[ref.tool].rotation
    r = np.array([0.1, -0.05, 0.08])
    ref.direction = turn @ pin.exp3(r) @ turn.T @ shot.direction
    times, known = ref.run()
    p = dict(zip(("rx", "ry", "rz"), r, strict=True))
    agree(known, of_world(plan, "force_direction", "tool", p, times), 1e-6)
