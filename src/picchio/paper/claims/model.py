"""Claims about the arm and the equations."""

from __future__ import annotations

import numpy as np

from picchio.model.linear_system import undamped_modes
from picchio.paper.equations import series_gap
from picchio.paper.fourier import amplitude_and_phase
from picchio.paper.study import Study
from picchio.paper.verdict import PANEL, Finding, claim, claim_of_worlds, decided
from picchio.paper.world import World


@claim("gravity")
def mimics(study: Study) -> Finding:
    """Whether the actuators could hold the arm up."""
    largest = study.base.sweep[1].max(axis=0)
    limits = study.printed.arm.actuator_torques
    return decided(
        bool(largest[1] <= limits[1] and largest[2] <= limits[2]),
        "torque to hold the unloaded arm against gravity, at full horizontal reach, against the "
        "stated actuators",
        f"joint 2: {largest[1]:.0f} N m against {limits[1]:.0f} N m, joint 3: "
        f"{largest[2]:.0f} N m against {limits[2]:.0f} N m; joint 2 can hold the arm in "
        f"{100 * study.base.share_held:.0f} % of its range with joint 3 straight",
        float(largest[1]),
    )


@claim_of_worlds(
    "",
    "sum of the joints' largest deflections in a rivet of 12 hits: the most the gun can turn",
    "{base}° in the base world, {most}° at most over {worlds} worlds; up to 1°, which "
    "turns 1.7 % of the force aside, may be ignored",
    PANEL,
)
def fixed_direction(world: World) -> tuple[bool, float]:
    """How far the gun turns while it hits."""
    degrees = float(np.degrees(world.rivet_peaks(hits=12).sum(axis=-1).max()))
    return degrees < 1.0, degrees


@claim_of_worlds(
    "steady-state",
    "a joint's largest peak over the task, 12 hits from rest, over that of the steady state; "
    "below 1.1 the steady state may replace it",
    "{base} in the base world, {least} to {most} over {worlds} worlds",
    PANEL,
)
def transient(world: World) -> tuple[bool, float]:
    """Whether the steady state is there when it matters."""
    peaks = world.stress(world.rivet_peaks(hits=12).max(axis=(0, 1)))
    ratio = float((peaks / world.rivet_stress.max(axis=(0, 1))).max())
    return ratio < 1.1, ratio


@claim()
def decoupled(study: Study) -> Finding:
    """S^T M S and S^T K S are diagonal."""
    worst = 0.0
    for pose in study.base.rivet_poses:
        system = study.base.model.linear_system(pose)
        _, shapes = undamped_modes(system.mass_matrix, system.stiffness_matrix)
        for matrix in (system.mass_matrix, system.stiffness_matrix, system.damping_matrix):
            modal = shapes.T @ matrix @ shapes
            off = np.abs(modal - np.diag(modal.diagonal())).max()
            worst = max(worst, float(off / np.abs(modal.diagonal()).max()))
    return decided(
        worst < 1e-9,
        "off-diagonal over diagonal of SᵀMS, SᵀKS and SᵀCS at the 15 rivets",
        f"{worst:.1g} at most; for the damping that is what a damping ratio of each mode means",
        worst,
    )


@claim("fig-4")
def fourier(study: Study) -> Finding:
    """Eq. 12's coefficients against those of the exact pulse."""
    count, gap = study.given.harmonics, series_gap(study)
    return decided(
        gap < 1e-9,
        f"eq. 12's a0, a_j, b_j against the exact pulse's, {count} harmonics",
        f"largest difference {gap:.1g} of F0",
        gap,
    )


@claim("phase")
def phase(study: Study) -> Finding:
    """Eq. 13 with the arctangent as it is written."""
    found = amplitude_and_phase(study.base)
    return decided(
        found.right_error < 1e-6,
        "eq. 13 summed with a plain tan⁻¹ and with a full-circle one, against the exact steady "
        "state, where the base world's stress is largest",
        f"plain, the peak is off by {100 * found.plain_error:.3g} % and the history by "
        f"{100 * found.plain_history:.3g} % of its peak; with atan2, by "
        f"{100 * found.right_error:.2g} %",
        found.plain_error,
        "tan⁻¹ is read as atan2: above resonance the plain one takes the wrong quadrant",
    )


@claim("shaft")
def shaft_strain(study: Study) -> Finding:
    """Eqs. 14-17 take the whole of a joint's spring to be one shaft."""
    radii = [1e3 * j.shaft.radius for j in study.base.robot.flexible_joints if j.shaft]
    lengths = [1e3 * j.shaft.length for j in study.base.robot.flexible_joints if j.shaft]
    return decided(
        True,
        "the shaft that is the joint's whole spring (k = G Jp / l) and has the stress per twist "
        "that is assumed",
        f"{2 * radii[1]:.3g} mm thick and {lengths[1]:.3g} mm long in joints 2 and 3, "
        f"{2 * radii[0]:.3g} by {lengths[0]:.3g} mm in joint 1; the paper gives neither",
        radii[1],
        "nothing but that shaft yields in the joint; a gear or bearing that yields too makes "
        "G r Δq / l too large by as much",
    )
