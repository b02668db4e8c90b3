"""One burst on the 3-DoF arm to second order: picchio's step against whole nonlinear simulators.

    python benchmarks/forward.py [--repeat 5] [--json FILE]

The data a diagnosis fits, thousands of times: 12 blows from rest, 1.2 s, deflections at 600 times.
Side by side, in turns, processor time of this thread, the median of the ratios: picchio's
exponential steps, as the diagnosis takes them, equations of motion included; Pinocchio's ABA under
SciPy's DOP853 at two tolerances; MuJoCo's Runge-Kutta at two steps (undamped, as its joints have no
modal damping: held against an undamped answer). Beside each its error: RMS of all deflections
against DOP853 at 1e-10, over their own RMS.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import numpy as np

import picchio
from picchio.core.files import atomic_write
from picchio.model.blows import Blows
from picchio.model.geometry import Geometry
from picchio.model.model import Model
from picchio.vibration.integration.integrate import Samples, integrate

ROOT = Path(__file__).resolve().parent.parent
sys.path[0] = str(ROOT / "tests" / "worlds")  # not this folder, which has a rainflow.py of its own
import nonlinear_arm  # noqa: E402

POSE = [0.3, 1.1, -1.0]
DIRECTION = np.array([0.48, -0.6, 0.64])
FORCE, PERIOD, WIDTH, HITS = 300.0, 0.040, 0.004, 12
SAMPLES = Samples(0.0, 0.002, 600)
URDF = ROOT / "robots" / "fanuc_like_3dof" / "robot.urdf"


def ours(geometry: Geometry, model: Model) -> np.ndarray:
    train = picchio.PulseTrain(FORCE, PERIOD, WIDTH)
    force = Blows.of(train, HITS, DIRECTION).force()
    motion = integrate(model.plant(geometry).build(DIRECTION), force, SAMPLES)
    return motion.position.T


def aba(springs: np.ndarray, ratio: float, rtol: float) -> np.ndarray:
    blows = (FORCE, PERIOD, WIDTH, HITS, SAMPLES.times)
    return nonlinear_arm.integrate_aba(URDF, springs, ratio, POSE, DIRECTION, *blows, rtol=rtol)


def mujoco(springs: np.ndarray, step: float) -> np.ndarray:
    blows = (FORCE, PERIOD, WIDTH, HITS, step, SAMPLES.times[-1])
    found = nonlinear_arm.integrate_mujoco(URDF, springs, POSE, DIRECTION, *blows)[1]
    return found[:, :: round(SAMPLES.step / step)]


def seconds(call: Callable[[], object]) -> float:
    begun = time.thread_time()
    call()
    return time.thread_time() - begun


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    robot = picchio.load_robot("fanuc_like_3dof")
    springs = Geometry.of(robot, POSE).stiffness
    ratio = float(robot.damping_ratio[0])
    geometry = Geometry.of(robot, POSE)
    model = Model(robot, gravity_stiffness=True)
    truth, undamped = aba(springs, ratio, 1e-10), aba(springs, 0.0, 1e-10)
    ways: dict[str, tuple[Callable[[], np.ndarray], np.ndarray]] = {
        "picchio": (lambda: ours(geometry, model), truth),
        "ABA, DOP853 at 1e-6": (lambda: aba(springs, ratio, 1e-6), truth),
        "ABA, DOP853 at 1e-3": (lambda: aba(springs, ratio, 1e-3), truth),
        "MuJoCo, RK4 at 1e-4 s": (lambda: mujoco(springs, 1e-4), undamped),
        "MuJoCo, RK4 at 1e-3 s": (lambda: mujoco(springs, 1e-3), undamped),
    }
    errors = {}
    for name, (call, right) in ways.items():
        found = call()  # compiles, too
        errors[name] = float(np.sqrt(((found - right) ** 2).sum() / (right**2).sum()))
    times: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(options.repeat):
        for name, (call, _right) in ways.items():
            times[name].append(seconds(call))
    print(f"{'':<22} {'ms':>9} {'times ours':>11} {'error':>9}")
    rows = {}
    for name, own in times.items():
        times_ours = median(a / b for a, b in zip(own, times["picchio"], strict=True))
        rows[name] = {"seconds": median(own), "times_ours": times_ours, "error": errors[name]}
        print(f"{name:<22} {1e3 * median(own):>9.2f} {times_ours:>11.1f} {errors[name]:>9.1e}")
    if options.json:
        with atomic_write(options.json) as stream:
            stream.write(json.dumps(rows, indent=2) + "\n")


if __name__ == "__main__":
    main()
