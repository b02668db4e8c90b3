"""A second world: MuJoCo's dynamics and Runge-Kutta, for what it can do.

It shares with the first one the plan, the drawing and the sensors, and none of the mechanics: the
model is MuJoCo's reading of the URDF, and each fault is put into that.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass

import mujoco
import numpy as np

from . import equations
from .bench import nominal_chain
from .world import World, columns

EFFECTS = (
    "joint_stiffness", "modal_damping", "joint_damping", "payload", "link_mass", "joint_inertia",
    "tool_offset", "force_amplitude", "force_drift", "force_direction", "missed_hits",
    "stiffness_drift", "thermal_stiffness", "hardening",
    "sensor_gain", "sensor_axes", "sensor_misalignment", "sensor_delay", "clock_drift",
    "sensor_highpass", "sensor_lowpass", "sensor_clipping", "mount_resonance", "mains_hum",
    "nonlinear_sensor", "uneven_blows", "swinging_direction", "quadratic_damping",
)  # fmt: skip
_NONLINEAR = {equations.CUBIC, equations.QUADRATIC_DAMPER}


@dataclass(frozen=True, eq=False)
class MujocoWorld(World):
    """As `World`, with MuJoCo's mechanics; the blows' edges must fall on its steps."""

    def record(self, index, groups, shot=None):
        for name, _, _ in self.causes:
            if name not in EFFECTS:
                raise ValueError(f"{name}: MuJoCo's world cannot; it can {', '.join(EFFECTS)}")
        if self.plan.hits is None:
            raise ValueError("MuJoCo's world makes bursts only")
        off = self.errors.sigma if self.errors is not None else {}
        if off.get("rise_time") or off.get("blow_time"):
            raise ValueError("MuJoCo's world needs blows that begin and end on a step")
        bench = self.bench(index, shot)
        times = self.plan.times()
        stops, out = self._simulate(bench, times[-1] + 2.0 / self.plan.sampling)
        read = {}
        phases = np.random.default_rng([self.seed, index, 78]).uniform(
            0.0, 2.0 * np.pi, len(groups)
        )
        for group, phase in zip(groups, phases, strict=True):
            signal = np.ascontiguousarray(out[:, :, columns(group)])
            read[group] = self.sensor(bench, group).read(stops, signal, times, phase)
        return read, bench

    def _simulate(self, bench, end):
        """(stops, outputs) as `World.motion` gives them."""
        model, tool, seat, joints, degrees = self._model(bench)
        data = mujoco.MjData(model)
        step = 0.25 / self.plan.sampling
        while step > (self.step or 2.6e-4):
            step *= 0.5
        model.opt.timestep = step
        rest = np.zeros(model.nq)
        rest[joints] = bench.pose
        data.qpos[:] = rest
        mujoco.mj_forward(model, data)
        held = data.qfrc_bias.copy()
        mass = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, mass)
        mass = mass[np.ix_(degrees, degrees)]
        damping = _modal(mass, bench.springs, bench.ratios(len(joints)))
        if bench.dampers is not None:
            damping = damping + np.diag(bench.dampers)
        turn = data.site_xmat[tool].reshape(3, 3).copy()
        place, still = data.site_xpos[seat].copy(), turn.T @ -model.opt.gravity
        weight = bench.gravity_stiffness * _gravity_change(model, rest, joints, degrees)
        mujoco.mj_forward(model, data)
        blows = bench.blows.table(bench.direction, turn)
        first = np.rint(blows[:, 0] / step).astype(int)
        last = np.rint((blows[:, 0] + blows[:, 1]) / step).astype(int)
        if np.abs(first * step - blows[:, 0]).max() > 1e-9:
            raise ValueError("MuJoCo's world needs blows that begin on a step")
        elements = [
            (kind, degrees[bench.joint(name)], joints[bench.joint(name)], p0)
            for kind, name, p0, _ in bench.elements
        ]
        if any(kind not in _NONLINEAR for kind, *_ in elements):
            raise ValueError("MuJoCo's world cannot do this element")
        body = model.site_bodyid[tool]
        linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        force = np.zeros(3)

        def passive(model, data):
            x, v = data.qpos[joints] - bench.pose, data.qvel[degrees]
            torque = held.copy()
            torque[degrees] -= bench.springs * x + weight @ x + damping @ v
            for kind, at, joint, p0 in elements:
                u, du = data.qpos[joint] - rest[joint], data.qvel[at]
                torque[at] -= p0 * u**3 if kind == equations.CUBIC else p0 * abs(du) * du
            if force.any():
                here = data.site_xmat[tool].reshape(3, 3)
                point = data.site_xpos[tool] + here @ bench.force_offset
                mujoco.mj_jac(model, data, linear, angular, point, body)
                torque += linear.T @ force
            data.qfrc_passive[:] += torque

        count = 2 * int(np.ceil(0.5 * end / step))
        out = np.empty((count // 2, 3, equations.OUTPUTS + len(joints)))

        def write(row):
            mujoco.mj_forward(model, data)
            mujoco.mj_rnePostConstraint(model, data)
            motion = np.zeros(6)
            mujoco.mj_objectAcceleration(model, data, mujoco.mjtObj.mjOBJ_SITE, seat, motion, 1)
            row[0:3] = motion[3:] - still
            row[3:6] = data.site_xmat[seat].reshape(3, 3) @ motion[3:] + model.opt.gravity
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_SITE, seat, motion, 0)
            row[6:9] = motion[3:]
            row[9:12] = data.site_xpos[seat] - place
            row[13:] = data.qpos[joints] - bench.pose

        mujoco.set_mjcb_passive(passive)
        try:
            for k in range(count):
                on = (first <= k) & (k < last)
                changed = force.copy()
                total = blows[on, 2].sum()
                force[:] = blows[on, 2] @ blows[on, 4:7]
                changed = (changed != force).any()
                if k % 2 and changed:
                    raise ValueError("MuJoCo's world needs blows that end on a sample's half-step")
                write(out[k // 2, k % 2])
                out[k // 2, k % 2, 12] = total
                mujoco.mj_step(model, data)
                if k % 2:
                    write(out[k // 2, 2])
                    out[k // 2, 2, 12] = total
        finally:
            mujoco.set_mjcb_passive(None)
        return step * np.arange(0, count + 1, 2), out

    def _model(self, bench):
        """(model, tool's and sensors' site, qpos of the flexible joints, degrees of freedom)."""
        robot = bench.robot
        tree = ET.parse(robot.urdf)
        for link in tree.getroot().iter("link"):
            for shape in [*link.findall("visual"), *link.findall("collision")]:
                link.remove(shape)
        spec = mujoco.MjSpec.from_string(ET.tostring(tree.getroot(), encoding="unicode"))
        spec.compiler.fusestatic = False
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
        for flag in (mujoco.mjtDisableBit.mjDSBL_CONTACT, mujoco.mjtDisableBit.mjDSBL_LIMIT):
            spec.option.disableflags |= flag
        frame = spec.body(robot.tool)
        frame.add_site(name="picked")
        frame.add_site(name="seat", pos=bench.sensor_offset)
        if self.errors is not None:
            _weigh(spec, robot, self.errors.chain(nominal_chain(robot.name)))
        for name, target, p in self.causes:
            if name == "payload":
                child = frame.add_body(name="payload")
                child.mass, child.inertia = p["mass"], [1e-12] * 3
                child.explicitinertial = True
            elif name == "link_mass":
                link = spec.body(target)
                link.mass *= p["scale"]
                link.inertia = np.array(link.inertia) * p["scale"]
                link.fullinertia = np.array(link.fullinertia) * p["scale"]
            elif name == "joint_inertia":
                spec.joint(target).armature = p["inertia"]
        model = spec.compile()
        ids = [model.joint(name).id for name in robot.joints]
        joints, degrees = model.jnt_qposadr[ids], model.jnt_dofadr[ids]
        if model.nv != len(ids):
            raise ValueError(f"{robot.name}: MuJoCo's world wants every joint flexible")
        model.dof_damping[:] = 0.0
        model.dof_frictionloss[:] = 0.0
        return model, model.site("picked").id, model.site("seat").id, joints, degrees


def _modal(mass, springs, ratio):
    """As the contract defines it, by the symmetric square root: M^1/2 2 zeta sqrt(A) M^1/2."""
    values, vectors = np.linalg.eigh(mass)
    root, inverse = (vectors * values**0.5) @ vectors.T, (vectors * values**-0.5) @ vectors.T
    squared, shapes = np.linalg.eigh(inverse @ np.diag(springs) @ inverse)
    return root @ (shapes * (2.0 * ratio * np.sqrt(squared))) @ shapes.T @ root


def _weigh(spec, robot, chain):
    """Each link, and what is fixed to it, as one body with the mass that it really has."""
    moving = set(robot.links())
    for i, name in enumerate(robot.links()):
        waiting = [spec.body(name)]
        for body in waiting:
            body.mass, body.inertia, body.fullinertia = 0.0, [0.0] * 3, [np.nan] + [0.0] * 5
            waiting += [child for child in body.bodies if child.name not in moving]
        size, axes = np.linalg.eigh(chain.inertia[i])
        axes = axes * np.sign(np.linalg.det(axes))
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, axes.ravel())
        body = waiting[0]
        body.mass, body.ipos, body.iquat, body.inertia = (
            chain.mass[i],
            chain.com[i],
            quaternion,
            size,
        )
        body.explicitinertial = True


def _gravity_change(model, rest, joints, degrees):
    """(n, n) N m/rad of gravity's torque by the joints, by MuJoCo's own."""
    data, step, columns = mujoco.MjData(model), 1e-5, []
    for at in joints:
        torque = []
        for aside in (step, -step):
            data.qpos[:] = rest
            data.qpos[at] += aside
            mujoco.mj_forward(model, data)
            torque.append(data.qfrc_bias[degrees].copy())
        columns.append((torque[0] - torque[1]) / (2.0 * step))
    return np.array(columns).T
