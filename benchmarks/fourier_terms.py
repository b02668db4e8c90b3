"""How many Fourier terms buy what: the paper's truncated solution against the exact one.

    python benchmarks/fourier_terms.py

For the 3-DoF arm at one pose and a force along z: relative error of the steady deflection, of the
peak, and of the acceleration away from the jumps, by number of harmonics.
"""

from __future__ import annotations

import time

import numpy as np

import picchio
from picchio.vibration.closed_form.response import truncated_fourier_response


def main() -> None:
    robot = picchio.load_robot("fanuc_like_3dof")
    modes = picchio.modal_analysis(picchio.Model(robot).linear_system(robot.pose([0.3, 1.1, -1.0])))
    blows = picchio.PulseTrain(force=300.0, period=0.040, width=0.004)
    direction = np.array([0.0, 0.0, 1.0])
    exact = picchio.steady_state(modes, blows)
    t = np.linspace(0.0, blows.period, 4001)
    x = exact.deflection(t, direction)[1:]
    largest = np.abs(x).max(axis=1)  # on the same samples
    began = time.perf_counter()
    for _ in range(20):
        exact.deflection(t, direction)
    closed = (time.perf_counter() - began) / 20
    print("terms   error of x(t)   error of the peak   time, ratio to the closed form")
    for terms in (5, 10, 20, 50, 100, 200, 500, 1000, 5000, 20000):
        began = time.perf_counter()
        y = truncated_fourier_response(modes, blows, direction, t, terms)[1:]
        took = time.perf_counter() - began
        error = np.abs(y - x).max() / np.abs(x).max()
        peak = np.abs(np.abs(y).max(axis=1) / largest - 1.0).max()
        print(f"{terms:6d}  {error:13.1e}   {peak:17.1e}   {took / closed:10.1f}")


if __name__ == "__main__":
    main()
