"""Eqs. 1 to 22: the function that does each, and a number that shows it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from picchio.excitation.piecewise import PiecewiseForce
from picchio.excitation.pulse_train import PulseTrain
from picchio.fatigue.miner import damage, peak_damage
from picchio.fatigue.shaft_stress import shear_stress, shear_stress_from_deflection
from picchio.model.linear_system import LinearSystem, modal_damping_matrix, undamped_modes
from picchio.model.model import Model
from picchio.paper.arm import places_of
from picchio.paper.fourier import (
    amplitude_and_phase,
    printed_series,
    worst_of,
    worst_responses,
)
from picchio.paper.printed import Printed
from picchio.paper.study import Study
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.studies.assessment.run import assess
from picchio.vibration.closed_form.modes import modal_analysis
from picchio.vibration.closed_form.response import (
    Response,
    response_from_rest,
    truncated_fourier_response,
)


@dataclass(frozen=True)
class Equation:
    """An equation and where it is done.

    Attributes:
        number: as printed; page and says: of the data file.
        function: dotted path of what does it; empty where there is nothing to do.
        check: what was computed both ways.
        gap: how far the two are apart, relative; None where there is nothing to compute.
    """

    number: str
    page: int
    says: str
    function: str
    check: str
    gap: float | None


Row = tuple[Callable[..., Any], str, Callable[[Study], float]]


def equations(study: Study) -> tuple[Equation, ...]:
    """All of them, checked in the base world."""
    found = []
    for number, remark in study.printed.equations.items():
        path, check, gap = "", "not in the text", None
        if number in DONE_BY:
            function, check, apart = DONE_BY[number]
            path, gap = f"{function.__module__}.{function.__qualname__}", apart(study)
        found.append(Equation(number, remark.page, remark.says, path, check, gap))
    return tuple(found)


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
    rivets = [
        len(column) / float((printed.task.hits_per_rivet / column).sum())
        for column in printed.cycles.T
    ]
    return float(min(rivets)), int(np.argmin(rivets)) + 1


def _energy(study: Study) -> float:
    """Eq. 1: the tool's kinetic energy by links and by M, for random rates."""
    world = study.base
    rng = np.random.default_rng(0)
    worst = 0.0
    arm = study.printed.arm
    for _ in range(5):
        pose, rate = rng.uniform(-1.0, 1.0, 3), rng.normal(size=3)
        step = 1e-5
        total: float = 0.0
        for i, mass in enumerate(arm.masses):
            ends = [
                world.robot.frame_placement(pose + s * step * rate, f"link_{i + 1}")
                for s in (-1.0, 1.0)
            ]
            centre = np.array(arm.centres_of_gravity[i])
            speed = ((ends[1][0] + ends[1][1] @ centre) - (ends[0][0] + ends[0][1] @ centre)) / (
                2.0 * step
            )
            turn = (ends[1][1] - ends[0][1]) / (2.0 * step) @ (0.5 * (ends[0][1] + ends[1][1])).T
            spin = np.array([turn[2, 1], turn[0, 2], turn[1, 0]])
            frame = world.robot.frame_placement(pose, f"link_{i + 1}")[1]
            inertia = arm.inertia(i, study.given.inertia_about)
            total += float(0.5 * mass * speed @ speed + 0.5 * inertia @ (frame.T @ spin) ** 2)
        exact = float(0.5 * rate @ world.robot.state(pose).mass_matrix @ rate)
        worst = max(worst, abs(total / exact - 1.0))
    return worst


def _jacobian(study: Study) -> float:
    """Eq. 3: J against differences of the tool's place."""
    pose, step = np.array([0.3, 0.5, -0.8]), 1e-6
    found = study.base.robot.state(pose).jacobian
    by_steps = [
        (places_of(pose + step * e) - places_of(pose - step * e)) / (2.0 * step) for e in np.eye(3)
    ]
    return float(np.abs(found - np.array(by_steps).T).max())


def _motion(study: Study) -> float:
    """Eqs. 2, 4, 5, 9, 11: the exact response put into M x'' + C x' + K x = J' n F."""
    rest, _, n, _ = worst_responses(study.base, 12)
    pose = study.base.rivet_poses[worst_of(study.base)[1]]
    system = study.base.model.linear_system(pose)
    blows = study.base.blows
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
    rest, steady, n, _ = worst_responses(study.base, 400)
    late = 399.0 * study.base.blows.period
    time = np.linspace(0.0, 0.99, 9) * study.base.blows.period
    a, b = rest.deflection(late + time, n), steady.deflection(time, n)
    return float(np.abs(a - b).max() / np.abs(b).max())


def _modes(study: Study) -> float:
    """Eqs. 7, 8, 10: K S = M S D with S'MS = 1."""
    system = study.base.model.linear_system(study.base.rivet_poses[0])
    omega, shapes = undamped_modes(system.mass_matrix, system.stiffness_matrix)
    left = system.stiffness_matrix @ shapes
    right = system.mass_matrix @ shapes * omega**2
    return float(np.abs(left - right).max() / np.abs(left).max())


def series_gap(study: Study) -> float:
    """The largest difference of eq. 12's coefficients from those of the exact pulse, over F0.

    Args:
        study: its base world's blows, and as many harmonics as it assumes.
    """
    count = study.given.harmonics
    printed = printed_series(study.base.blows, count)
    exact = study.base.blows.one_period().fourier_coefficients(count)
    ours = np.concatenate([[exact[0]], 2.0 * exact[1:]])
    return float(np.abs(printed - ours).max() / study.base.blows.force)


def _stress(study: Study) -> float:
    """Eqs. 14-17: G r x / l against k x r / Jp."""
    gaps = []
    for joint in study.base.robot.flexible_joints:
        assert joint.shaft is not None
        by_twist = float(shear_stress_from_deflection(1e-3, joint.shaft))
        gaps.append(abs(float(shear_stress(1e-3 * joint.stiffness, joint.shaft)) / by_twist - 1.0))
    return max(gaps)


_EOM = "residual of the exact response in the equation of motion"
_MODES = "residual of K S = M S D"
_SHAFT = "G r Δq / l against k Δq r / Jp"
_MINER = "eqs. 20 and 21 put back into eq. 18"
_STRESS: Row = (shear_stress_from_deflection, _SHAFT, _stress)
_RIVETS: Row = (assess, _MINER, lambda study: miner_gap(study.printed))

DONE_BY: dict[str, Row] = {
    "1": (FlexibleRobot.state, "kinetic energy link by link against M", _energy),
    "2": (Model.linear_system, _EOM, _motion),
    "3": (FlexibleRobot.frame_jacobian, "J against differences", _jacobian),
    "4": (PulseTrain, _EOM, _motion),
    "5": (LinearSystem, _EOM, _motion),
    "6": (response_from_rest, "from rest, after 400 blows, against the steady state", _split),
    "7": (Response.deflection, _EOM, _motion),
    "8": (undamped_modes, _MODES, _modes),
    "9": (modal_analysis, _EOM, _motion),
    "10": (undamped_modes, _MODES, _modes),
    "11": (modal_damping_matrix, _EOM, _motion),
    "12": (PiecewiseForce.fourier_coefficients, "eq. 12 against the exact pulse", series_gap),
    "13": (truncated_fourier_response, "eq. 13 with atan2 against the exact steady state",
           lambda study: amplitude_and_phase(study.base).right_error),
    "14": _STRESS,
    "15": _STRESS,
    "16": _STRESS,
    "17": _STRESS,
    "18": (damage, _MINER, lambda study: miner_gap(study.printed)),
    "19": (peak_damage, _MINER, lambda study: miner_gap(study.printed)),
    "20": _RIVETS,
    "21": _RIVETS,
}  # fmt: skip
"""By number: the function that does it, what was computed two ways, and how far they differ."""
