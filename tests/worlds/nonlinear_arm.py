"""The full nonlinear arm under blows: Pinocchio's ABA, or MuJoCo, under springs at the joints.

Nothing here comes from picchio's model, vibration or prediction. The springs' rest angles are such
that the pose is in equilibrium under gravity; the vibration is what comes on top.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp
from scipy.linalg import eigh


def modal_damping(mass, springs, ratio):
    """C = M S diag(2 zeta omega) S^T M, the contract's definition."""
    squared, shapes = eigh(np.diag(springs), mass)
    weighted = mass @ shapes
    return weighted @ np.diag(2.0 * ratio * np.sqrt(squared)) @ weighted.T


def integrate_aba(
    urdf, springs, ratio, pose, direction, pulse, period, width, hits, times, rtol=1e-10
):
    """Deflections (n, k) of the nonlinear arm at `times`, from rest, by Runge-Kutta of order 8."""
    model = pin.buildModelFromUrdf(str(urdf))
    data = model.createData()
    tool = model.getFrameId("tool")
    pose = np.asarray(pose, float)
    n = model.nv
    gravity = pin.computeGeneralizedGravity(model, data, pose).copy()
    damping = modal_damping(pin.crba(model, data, pose).copy(), springs, ratio)
    push = np.asarray(direction, float)

    def rate(_, y, force):
        q, v = pose + y[:n], y[n:]
        torque = gravity - springs * y[:n] - damping @ v
        if force:
            jacobian = pin.computeFrameJacobian(
                model, data, q, tool, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
            )[:3]
            torque = torque + jacobian.T @ push * force
        return np.concatenate([v, pin.aba(model, data, q, v, torque)])

    edges = [h * period + s for h in range(hits) for s in (0.0, width)] + [hits * period]
    forces = [pulse, 0.0] * hits
    if times[-1] > edges[-1]:
        edges.append(times[-1] + 1e-6)
        forces.append(0.0)
    out, y = np.empty((n, times.size)), np.zeros(2 * n)
    for a, b, force in zip(edges[:-1], edges[1:], forces, strict=True):
        here = (times >= a) & (times < b)
        solved = solve_ivp(
            rate,
            (a, b),
            y,
            method="DOP853",
            rtol=rtol,
            atol=1e-4 * rtol,
            t_eval=np.append(times[here], b),
            args=(force,),
        )
        assert solved.success
        out[:, here] = solved.y[:n, :-1]
        y = solved.y[:, -1]
    return out


def integrate_mujoco(urdf, springs, pose, direction, pulse, period, width, hits, step, end):
    """Undamped deflections (n, k) by MuJoCo's Runge-Kutta at every step: (times, deflections)."""
    import mujoco

    spec = mujoco.MjSpec.from_file(str(urdf))
    spec.compiler.fusestatic = False
    spec.option.timestep = step
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_LIMIT
    model = spec.compile()
    data = mujoco.MjData(model)
    pose = np.asarray(pose, float)
    data.qpos[:] = pose
    mujoco.mj_forward(model, data)
    held = data.qfrc_bias.copy()  # gravity, at rest
    model.jnt_stiffness[:] = springs
    model.qpos_spring[:] = pose + held / springs
    tool = model.body("tool").id
    push = np.asarray(direction, float) * pulse
    steps = round(end / step)
    per_period, per_width = round(period / step), round(width / step)
    out = np.empty((model.nv, steps + 1))
    out[:, 0] = 0.0
    zero = np.zeros(3)
    for k in range(steps):
        data.qfrc_applied[:] = 0.0
        if k // per_period < hits and k % per_period < per_width:
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_applyFT(model, data, push, zero, data.xpos[tool], tool, data.qfrc_applied)
        mujoco.mj_step(model, data)
        out[:, k + 1] = data.qpos - pose
    return step * np.arange(steps + 1), out
