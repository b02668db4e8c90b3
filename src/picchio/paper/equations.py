"""Eqs. 1 to 22: those that are printed alone (12, 13, 18-21), and a number that checks each."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from picchio.core.arrays import ComplexArray, FloatArray
from picchio.excitation.pulse_train import PulseTrain
from picchio.fatigue.shaft_stress import shear_stress, shear_stress_from_deflection
from picchio.model.linear_system import undamped_modes
from picchio.paper.printed import Printed, trials
from picchio.paper.world import World, places_of

if TYPE_CHECKING:
    from picchio.paper.study import Study

_HARMONICS = 4000  # of eq. 13: the largest left out is below 1e-7 of the peak


def printed_series(blows: PulseTrain, harmonics: int) -> ComplexArray:
    """Eq. 12: a0, then a_j - i b_j, (harmonics + 1,) N."""
    j = np.arange(1, harmonics + 1)
    share = blows.width / blows.period
    a = blows.force / (j * np.pi) * np.sin(2.0 * np.pi * j * share)
    b = blows.force / (j * np.pi) - blows.force / (j * np.pi) * np.cos(2.0 * np.pi * j * share)
    return np.concatenate([[blows.force * share], a - 1j * b])


def printed_force(blows: PulseTrain, harmonics: int, time: FloatArray) -> FloatArray:
    """Fig. 4 by eq. 12: the truncated series at times (k,) s, N."""
    terms = printed_series(blows, harmonics)
    wave = np.exp(2j * np.pi / blows.period * np.outer(np.arange(harmonics + 1), time))
    return np.asarray((terms @ wave).real)


def printed_response(
    omega: FloatArray, ratio: float, blows: PulseTrain, time: FloatArray, *, plain: bool
) -> FloatArray:
    """Eq. 13 for modes (m,) rad/s of unit mass and unit n_d at times (k,) s: (m, k).

    The phase is by a plain arctangent, as written, or else by one of the full circle.
    """
    terms, j = printed_series(blows, _HARMONICS), np.arange(1, _HARMONICS + 1)
    a, b, wave = terms[1:].real, -terms[1:].imag, j * (2.0 * np.pi / blows.period)
    r = wave / omega[:, None]
    damped, stiffness = 2.0 * ratio * r, omega**2
    size = np.hypot(a, b) / stiffness[:, None] / np.sqrt((1.0 - r**2) ** 2 + damped**2)
    phase = np.arctan2(damped, 1.0 - r**2) + np.arctan2(b, a)
    if plain:
        with np.errstate(divide="ignore", invalid="ignore"):
            phase = np.nan_to_num(np.arctan(damped / (1.0 - r**2)) + np.arctan(b / a))
    angle = np.outer(wave, time)
    each = zip(stiffness, size, phase, strict=True)
    return np.array([terms[0].real / k + s @ np.cos(angle - p[:, None]) for k, s, p in each])


def check_phase(world: World) -> dict[str, Any]:
    """Eq. 13's phase as written and as meant, on the most stressed rivet of a world.

    Over one period `time` (k,) s: `exact`, `plain`, `right`, (k,) mrad; the relative errors of
    both peaks, and of the plain history.
    """
    at, n, joint = world.at_worst
    modes, time = at.modes, np.linspace(0.0, world.blows.period, 400, endpoint=False)
    push = modes.mode_shapes[joint] * (modes.mode_shapes.T @ (at.linear.input_matrix @ n))
    own = (2.0 * np.pi * modes.natural_frequencies, world.given.damping_ratio, world.blows, time)
    found = {"exact": 1e3 * at.response(world.blows, None).deflection(time, n)[joint]}
    for name in ("plain", "right"):
        found[name] = 1e3 * (push @ printed_response(*own, plain=name == "plain"))
    peaks = {name: np.abs(values).max() for name, values in found.items()}
    errors = {
        f"{name}_error": abs(float(peak / peaks["exact"]) - 1.0) for name, peak in peaks.items()
    }
    history = float(np.abs(found["plain"] - found["exact"]).max() / peaks["exact"])
    return {"time": time, **found, "joint": joint + 1, "plain_history": history, **errors}


def miner_gap(printed: Printed) -> float:
    """Eqs. 20 and 21 against eq. 18, relative, on Table 2's joint 2."""
    n = printed.cycles[:, 1]
    hits, rivets = float(printed.task.hits_per_rivet), float(printed.task.rivets)
    a = b = np.ones(len(n))  # the same rivet and as many in each direction
    first = 1.0 / float((a * b * hits / n).sum())
    total = float(b.sum()) * first
    # Eq. 18 with those rivets must come to 1.
    spent = float((hits * (first / rivets) * rivets / n).sum())
    return max(abs(spent - 1.0), abs(total - len(n) * first) / total)


def printed_total(printed: Printed) -> tuple[float, int]:
    """Rivets to failure and joint (from 1) by eqs. 18-21 with Table 2's N as hits."""
    spent = [float((printed.task.hits_per_rivet / n).sum()) for n in printed.cycles.T]
    rivets = [len(printed.table2) / each for each in spent]
    return float(min(rivets)), int(np.argmin(rivets)) + 1


def _energy(study: Study) -> float:
    """Eq. 1: the tool's kinetic energy by links and by M, for random rates."""
    robot, arm, step = study.base.robot, study.printed.arm, 1e-5
    rng, worst = np.random.default_rng(0), 0.0
    for _ in range(5):
        pose, rate = rng.uniform(-1.0, 1.0, 3), rng.normal(size=3)
        near, total = [pose + s * step * rate for s in (-1.0, 0.0, 1.0)], 0.0
        for i, (mass, centre) in enumerate(zip(arm.masses, arm.centres_of_gravity, strict=True)):
            places = [robot.frame_placement(each, f"link_{i + 1}") for each in near]
            (p0, r0), (_, frame), (p1, r1) = places
            speed = ((p1 + r1 @ centre) - (p0 + r0 @ centre)) / (2.0 * step)
            turn = (r1 - r0) / (2.0 * step) @ (0.5 * (r0 + r1)).T
            spin = frame.T @ np.array([turn[2, 1], turn[0, 2], turn[1, 0]])
            inertia = arm.inertia(i, study.given.inertia_about)
            total += float(0.5 * mass * speed @ speed + 0.5 * inertia @ spin**2)
        exact = float(0.5 * rate @ robot.state(pose).mass_matrix @ rate)
        worst = max(worst, abs(total / exact - 1.0))
    return worst


def _jacobian(study: Study) -> float:
    """Eq. 3: J against differences of the tool's place."""
    pose, step = np.array([0.3, 0.5, -0.8]), 1e-6
    ends = [places_of(pose + s * step * np.eye(3)) for s in (1.0, -1.0)]
    differences = (ends[0] - ends[1]).T / (2.0 * step)
    return float(np.abs(study.base.robot.state(pose).jacobian - differences).max())


def _motion(study: Study) -> float:
    """Eqs. 2, 4, 5, 9, 11: the exact response put into M x'' + C x' + K x = J' n F."""
    at, n, _ = study.base.at_worst
    rest, system, blows = at.response(study.base.blows, 12), at.linear, study.base.blows
    time = np.linspace(0.1, 0.9, 7) * blows.width
    left = (
        system.mass_matrix @ rest.acceleration(time, n)
        + system.damping_matrix @ rest.velocity(time, n)
        + system.stiffness_matrix @ rest.deflection(time, n)
    )
    right = (system.input_matrix @ n)[:, None] * blows.force
    return float(np.abs(left - right).max() / np.abs(right).max())


def _split(study: Study) -> float:
    """Eq. 6: from rest less the steady state is a free vibration; it repeats the modes' decay."""
    (at, n, _), blows = study.base.at_worst, study.base.blows
    time = np.linspace(0.0, 0.99, 9) * blows.period
    late = at.response(blows, 400).deflection(399.0 * blows.period + time, n)
    steady = at.response(blows, None).deflection(time, n)
    return float(np.abs(late - steady).max() / np.abs(steady).max())


def _modes(study: Study) -> float:
    """Eqs. 7, 8, 10: K S = M S D with S'MS = 1."""
    system = study.base.model.linear_system(study.base.rivet_poses[0])
    omega, shapes = undamped_modes(system.mass_matrix, system.stiffness_matrix)
    left = system.stiffness_matrix @ shapes
    right = system.mass_matrix @ shapes * omega**2
    return float(np.abs(left - right).max() / np.abs(left).max())


def decoupling(study: Study) -> float:
    """Off-diagonal over diagonal of S'MS, S'KS and S'CS, the largest at the rivets."""
    systems = [study.base.model.linear_system(pose) for pose in study.base.rivet_poses]
    matrices = np.array([(s.mass_matrix, s.stiffness_matrix, s.damping_matrix) for s in systems])
    shapes = np.array([undamped_modes(mass, stiff)[1] for mass, stiff, _ in matrices])[:, None]
    modal = np.abs(shapes.swapaxes(-1, -2) @ matrices @ shapes)
    off = np.where(np.eye(modal.shape[-1]), 0.0, modal).max(axis=(-1, -2))
    return float((off / modal.diagonal(axis1=-2, axis2=-1).max(axis=-1)).max())


def series_gap(study: Study) -> float:
    """The largest difference of eq. 12's coefficients from the exact pulse's, over F0."""
    blows, count = study.base.blows, study.given.harmonics
    exact = blows.one_period().fourier_coefficients(count)
    ours = np.concatenate([[exact[0]], 2.0 * exact[1:]])
    return float(np.abs(printed_series(blows, count) - ours).max() / blows.force)


def _stress(study: Study) -> float:
    """Eqs. 14-17: G r x / l against k x r / Jp."""
    joints = [(j.stiffness, j.shaft) for j in study.base.robot.flexible_joints if j.shaft]
    by_twist = [float(shear_stress_from_deflection(1e-3, shaft)) for _, shaft in joints]
    by_torque = [float(shear_stress(1e-3 * k, shaft)) for k, shaft in joints]
    return max(abs(a / b - 1.0) for a, b in zip(by_torque, by_twist, strict=True))


GAPS: dict[str, Callable[[Study], float]] = {
    "energy": _energy,
    "jacobian": _jacobian,
    "motion": _motion,
    "split": _split,
    "modes": _modes,
    "series": series_gap,
    "phase": lambda study: study.phase["right_error"],
    "stress": _stress,
    "miner": lambda study: miner_gap(study.printed),
}
"""How far two ways of computing an equation are apart, relative, in the base world."""


def equations(study: Study) -> list[dict[str, Any]]:
    """Every equation: what it says, the function that does it, and how far two ways differ."""
    nothing = {"function": "", "check": "not in the text", "gap": ""}
    gaps = {name: gap(study) for name, gap in GAPS.items()}
    found = []
    for number, remark in study.printed.equations.items():
        done = trials().equations.get(number, nothing)
        said = {"number": number, "page": remark.page, "says": remark.says}
        found.append({**said, **done, "gap": gaps.get(done["gap"])})
    return found
