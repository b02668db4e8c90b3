"""Systems to shake, and solvers that are not picchio's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import eigh, expm

from picchio.model.linear_system import LinearSystem


def modal_damping(mass, stiffness, ratio):
    """C from the modes, written here from the definition."""
    squared, shapes = eigh(stiffness, mass)
    weighted = mass @ shapes
    return weighted @ np.diag(2 * np.asarray(ratio) * np.sqrt(squared)) @ weighted.T


def make_system(seed=0, ratio=0.03, n=3, damping=None, stiffness=None):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(n, n))
    mass = root @ root.T + n * np.eye(n)
    spring = np.diag(rng.uniform(1e4, 5e4, n)) if stiffness is None else stiffness
    c = modal_damping(mass, spring, ratio) if damping is None else damping
    names = tuple(f"joint_{i + 1}" for i in range(n))
    return LinearSystem(mass, c, spring, rng.normal(size=(n, 3)), np.eye(n), names)


def integrate(system, force, direction, times, state=None):
    """Runge-Kutta of order 8 from jump to jump of the force."""
    n = len(system.mass_matrix)
    inverse = np.linalg.inv(system.mass_matrix)
    push = system.input_matrix @ np.asarray(direction, float)
    y = np.zeros(2 * n) if state is None else np.asarray(state, float)
    out = np.empty((n, times.size))
    edges = [*force.start, min(force.end, times[-1] + 1e-3)]
    for i, (a, b) in enumerate(zip(edges[:-1], edges[1:], strict=True)):

        def rate(t, y, i=i, a=a):
            f = float(force.in_piece(i, t - a))
            x, v = y[:n], y[n:]
            accel = push * f - system.damping_matrix @ v - system.stiffness_matrix @ x
            return np.concatenate([v, inverse @ accel])

        here = (times >= a) & (times < b)
        ends = np.append(times[here], b)
        solved = solve_ivp(rate, (a, b), y, method="DOP853", rtol=1e-12, atol=1e-16, t_eval=ends)
        assert solved.success
        out[:, here] = solved.y[:n, :-1]
        y = solved.y[:, -1]
    return out, y


def propagate_by_expm(system, pulse, period, width, hits, direction, times):
    """A pulse train from rest, exactly, by the matrix exponential of the augmented state."""
    n = len(system.mass_matrix)
    inverse = np.linalg.inv(system.mass_matrix)
    a = np.zeros((2 * n + 1, 2 * n + 1))
    a[:n, n : 2 * n] = np.eye(n)
    a[n : 2 * n, :n] = -inverse @ system.stiffness_matrix
    a[n : 2 * n, n : 2 * n] = -inverse @ system.damping_matrix
    quiet = a.copy()
    a[n : 2 * n, -1] = inverse @ system.input_matrix @ np.asarray(direction, float) * pulse
    on, off = expm(a * width), expm(quiet * (period - width))
    starts = [np.append(np.zeros(2 * n), 1.0)]
    for _ in range(hits):
        starts.append(off @ on @ starts[-1])
    out = np.empty((n, times.size))
    for k, t in enumerate(times):
        hit = min(int(t // period), hits)
        u = t - hit * period
        y = starts[hit]
        if hit < hits:
            y = expm(a * min(u, width)) @ y
            u = max(u - width, 0.0)
        out[:, k] = (expm(quiet * u) @ y)[:n]
    return out


@pytest.fixture(scope="session")
def tools():
    class Tools:
        system = staticmethod(make_system)
        integrate = staticmethod(integrate)
        by_expm = staticmethod(propagate_by_expm)
        modal_damping = staticmethod(modal_damping)

    return Tools
