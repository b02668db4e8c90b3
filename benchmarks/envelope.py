"""What the exact direction envelope of a pose costs, against the alternatives, in one run.

    python benchmarks/envelope.py [--json FILE] [--long]

Steady-state deflection of all joints, worst of all directions, on one core. Side by side:
Pinocchio's mass matrix and Jacobian alone (the floor); picchio, with them; the paper's procedure
done plainly in NumPy (200 harmonics, 512 samples, 642 directions); MuJoCo's time integration of the
3-DoF arm to its steady state, for one direction. Each is timed in turns, and the median of the
ratios is taken. Damage by rainflow, of a rivet from rest in one direction, is dearer: its ratio is
printed, too. --long adds how the cost and the memory go with up to 1e7 poses and with the cores.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import resource
import time
import warnings
from collections.abc import Callable
from statistics import median

import numba
import numpy as np
import pinocchio as pin

import picchio
from picchio.core.files import atomic_write
from picchio.robot import Shaft
from picchio.studies.batch_damage import batch_damage
from picchio.studies.envelope import icosphere
from picchio.vibration.batch import batch_peaks

BLOWS = picchio.PulseTrain(force=300.0, period=0.040, width=0.004)
ROBOTS = {3: "fanuc_like_3dof", 6: "ur10", 7: "panda"}
POSES = 4000
ROUNDS = 7


def clock(work: Callable[[], object]) -> float:
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def random_poses(robot: picchio.FlexibleRobot, count: int) -> np.ndarray:
    lower = np.where(np.isfinite(robot.lower), robot.lower, -np.pi)
    upper = np.where(np.isfinite(robot.upper), robot.upper, np.pi)
    return np.random.default_rng(0).uniform(lower, upper, (count, len(lower)))


def floor(robot: picchio.FlexibleRobot, poses: np.ndarray) -> None:
    """The two calls that no pose can do without, and nothing else."""
    model, data = robot.rigid._model, robot.rigid._data()
    frame = robot.rigid.frame(robot.tool_point)
    every = poses if robot.rigid._plain else poses @ robot.rigid._follow.T
    for q in every:
        pin.crba(model, data, q)
        pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)


def ours(robot: picchio.FlexibleRobot, poses: np.ndarray) -> np.ndarray:
    mass, jacobian = robot.mass_and_jacobian(poses)
    found = batch_peaks(mass, jacobian, robot.stiffness, robot.damping_ratio, BLOWS)
    return found.peak_deflection


def damaged(robot: picchio.FlexibleRobot, poses: np.ndarray, curve: picchio.SNCurve) -> None:
    """A rivet of 12 hits from rest in one direction, ring-down, cycles counted, in every joint."""
    curves = [curve] * len(robot.flexible_joints)
    batch_damage(robot, poses, [1.0, 0.0, 0.0], BLOWS, 12, curves)


def shafted(robot: picchio.FlexibleRobot) -> picchio.FlexibleRobot:
    """The robot with some shaft in every joint, so that there is a stress to count."""
    shaft = Shaft(0.015, 0.05, 79.3e9)
    joints = tuple(dataclasses.replace(j, shaft=shaft) for j in robot.flexible_joints)
    return dataclasses.replace(robot, flexible_joints=joints)


def go_long() -> None:
    """Cost a pose and memory against the number of poses, the chunk and the cores (3 DoF)."""
    robot = picchio.load_robot(ROBOTS[3])
    ours(robot, random_poses(robot, 200))
    print("     poses   chunk  cores   us a pose   memory, MB")
    runs = [(count, 4096, 1) for count in (10**4, 10**5, 10**6, 10**7)]
    runs += [(10**5, chunk, 1) for chunk in (64, 512, 32768)]
    runs += [(10**5, 4096, numba.config.NUMBA_NUM_THREADS)]
    for count, chunk, cores in runs:
        numba.set_num_threads(cores)
        block = random_poses(robot, chunk)

        def run(count: int = count, chunk: int = chunk, block: np.ndarray = block) -> None:
            for first in range(0, count, chunk):
                ours(robot, block[: count - first])

        taken = clock(run) / count * 1e6
        most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024  # so far, in all
        print(f"{count:10d}  {chunk:6d}  {cores:5d}   {taken:9.2f}   {most:10.0f}", flush=True)
    numba.set_num_threads(1)


def plain(robot: picchio.FlexibleRobot, pose: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Paper eqs. 7-13, direction by direction."""
    from scipy.linalg import eigh

    state = robot.state(pose)
    squared, shapes = eigh(np.diag(state.stiffness), state.mass_matrix)
    omega, stiff = np.sqrt(squared), squared
    base = 2 * np.pi / BLOWS.period
    j = np.arange(1, 201)
    duty = BLOWS.width / BLOWS.period
    a = BLOWS.force / (j * np.pi) * np.sin(2 * j * np.pi * duty)
    b = BLOWS.force / (j * np.pi) * (1 - np.cos(2 * j * np.pi * duty))
    r = j[:, None] * base / omega
    zeta = robot.damping_ratio[0]
    size = np.hypot(a, b)[:, None] / stiff / np.sqrt((1 - r**2) ** 2 + (2 * zeta * r) ** 2)
    phase = np.arctan2(2 * zeta * r, 1 - r**2) + np.arctan2(b, a)[:, None]
    t = np.arange(512) / 512 * BLOWS.period
    peaks = np.zeros(len(omega))
    for n in directions:
        eta = np.empty((len(omega), t.size))
        share = shapes.T @ state.jacobian.T @ n
        for i in range(len(omega)):
            waves = np.cos(np.outer(j * base, t) - phase[:, i, None])
            eta[i] = share[i] * (BLOWS.force * duty / stiff[i] + size[:, i] @ waves)
        peaks = np.maximum(peaks, np.abs(shapes @ eta).max(axis=1))
    return peaks


def mujoco_seconds(robot: picchio.FlexibleRobot) -> float | None:
    """One pose, one direction: five time constants, then one period, at 0.1 ms."""
    try:
        import mujoco
    except ImportError:
        return None
    spec = mujoco.MjSpec.from_file(str(robot.source))
    spec.option.timestep = 1e-4
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.gravity = [0.0, 0.0, 0.0]
    model = spec.compile()
    model.jnt_stiffness[:] = robot.stiffness
    model.dof_damping[:] = 2 * 0.03 * robot.stiffness / (2 * np.pi * 6.0)
    data = mujoco.MjData(model)
    data.qpos[:] = model.qpos_spring[:] = [0.3, 1.1, -1.0]
    tool = model.body(model.nbody - 1).id
    steps = round(5 / (0.03 * 2 * np.pi * 5.57) / 1e-4) + 400
    per_period, per_width = 400, 40

    def run() -> None:
        for k in range(steps):
            data.xfrc_applied[tool, 2] = 300.0 if k % per_period < per_width else 0.0
            mujoco.mj_step(model, data)

    return clock(run)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", metavar="FILE")
    parser.add_argument("--long", action="store_true")
    options = parser.parse_args()
    target = options.json
    numba.set_num_threads(1)
    ratios, costs, counted = {}, {}, {}
    # No endurance limit: the whole ring-down is counted. (Its name is warned of; it is only cost.)
    warnings.simplefilter("ignore", picchio.PicchioWarning)
    curve = picchio.load_sn_curve("nie-2016")
    print("DoF  robot             two calls, us   picchio, us   ratio   ratio with rainflow")
    for dof, name in ROBOTS.items():
        robot = picchio.load_robot(name)
        poses = random_poses(robot, POSES)
        ours(robot, poses[:200])  # compiled, or read from the cache
        rounds = [
            (clock(lambda: floor(robot, poses)), clock(lambda: ours(robot, poses)))  # noqa: B023
            for _ in range(ROUNDS)
        ]
        least = median(f for f, _ in rounds) / POSES * 1e6
        costs[dof] = median(o for _, o in rounds) / POSES * 1e6
        ratios[str(dof)] = round(median(o / f for f, o in rounds), 2)
        arm, few = shafted(robot), poses[: POSES // 20]
        damaged(arm, few, curve)
        rainflow = [
            (clock(lambda: floor(arm, few)), clock(lambda: damaged(arm, few, curve)))  # noqa: B023
            for _ in range(ROUNDS)
        ]
        counted[str(dof)] = round(median(o / f for f, o in rainflow), 1)
        print(
            f"{dof:3d}  {name:16s}  {least:13.2f}   {costs[dof]:11.2f}   {ratios[str(dof)]:5.2f}"
            f"   {counted[str(dof)]:19.1f}"
        )
    arm = picchio.load_robot(ROBOTS[3])
    directions = icosphere(3)[0]
    pose = np.array([0.3, 1.1, -1.0])
    seconds = clock(lambda: plain(arm, pose, directions))
    exact = ours(arm, pose[None])[0]
    off = np.abs(plain(arm, pose, directions) / exact - 1).max()
    speedup_numpy = seconds / (costs[3] * 1e-6)
    print(
        f"plain NumPy, {len(directions)} directions: {seconds:.3f} s a pose, {speedup_numpy:,.0f} "
        f"times ours; its peaks are {100 * off:.2f} % low"
    )
    taken = mujoco_seconds(arm)
    speedup_mujoco = None if taken is None else taken / (costs[3] * 1e-6)
    if speedup_mujoco is not None:
        print(
            f"MuJoCo, one direction: {taken:.3f} s a pose, {speedup_mujoco:,.0f} times ours for "
            "all directions"
        )
    print(
        f"largest memory of this run: "
        f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB"
    )
    if options.long:
        go_long()
    if target:
        content = {
            "format": "picchio-benchmark/1",
            "ratio_to_floor": ratios,
            "ratio_to_floor_with_rainflow": counted,
            "speedup_numpy": round(speedup_numpy),
            "speedup_mujoco": None if speedup_mujoco is None else round(speedup_mujoco),
            "cores": 1,
        }
        with atomic_write(target) as stream:
            stream.write(json.dumps(content, indent=2) + "\n")


if __name__ == "__main__":
    main()
