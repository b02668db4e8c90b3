"""Modes of a linear system, real or complex, as poles and residues."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from picchio.core.arrays import ComplexArray, FloatArray
from picchio.core.errors import InputError
from picchio.core.shown import Shown
from picchio.model.linear_system import LinearSystem, undamped_modes
from picchio.model.model import Model, ModelLike

if TYPE_CHECKING:
    import pandas

# Largest off-diagonal term of S^T C S, relative to its diagonal, that counts as rounding.
_DECOUPLED = 1e-10
# Two equal poles make the residues infinite though the response is smooth in the damping:
# damping this close to critical is moved by this much, which moves the response as little.
_CRITICAL = 1e-10
_DEFECTIVE = 1e7
_NUDGE = 1e-9


@dataclass(frozen=True, eq=False)
class Modes(Shown):
    """The system in modal form.

    The response of output j to a force F(t) n is the sum over poles of
    Re(residue[j, p] . n z_p(t)) with z_p' = pole_p z_p + F. Poles below the real axis are
    left out, their share is in the residues of their conjugates.

    Attributes:
        natural_frequencies: (n,) Hz, undamped, ascending.
        damping_ratios: (n,) of the undamped modes: the diagonal of S^T C S over 2 omega.
        mode_shapes: (n, n), mass-normalised undamped modes, one a column.
        poles: (p,) complex, 1/s.
        residues: (m, p, 3) complex, output per newton along x, y, z.
        decoupled: whether the damping leaves the undamped modes uncoupled.
        output_names: m names.
    """

    PLOTS: ClassVar = {
        "shapes": "visuals.plots.frequency:plot_mode_shapes",
        "response": "visuals.plots.frequency:plot_frequency_response",
    }
    LACKS: ClassVar = {"show": "show the robot's envelope: the scene plays its modes"}

    natural_frequencies: FloatArray
    damping_ratios: FloatArray
    mode_shapes: FloatArray
    poles: ComplexArray
    residues: ComplexArray
    decoupled: bool
    output_names: tuple[str, ...]

    def __repr__(self) -> str:
        return f"Modes(natural_frequencies={self.natural_frequencies.round(3).tolist()} Hz)"

    def _repr_html_(self) -> str:
        from picchio.core.html import sheet

        rows = zip(range(1, 1 + len(self.natural_frequencies)), self.natural_frequencies,
                   100 * self.damping_ratios, strict=True)  # fmt: skip
        columns = ("mode", "natural frequency [Hz]", "damping ratio [%]")
        head = f"{', '.join(f'{f:.4g}' for f in self.natural_frequencies)} Hz"
        return sheet(f"Modes of {', '.join(self.output_names)}", None, columns, rows, head=head)

    def to_frame(self) -> pandas.DataFrame:
        """A row a mode: frequency (Hz), damping ratio, and the deflections of its shape."""
        import pandas

        shapes = dict(zip(self.output_names, self.mode_shapes, strict=False))
        return pandas.DataFrame(
            {
                "natural_frequency": self.natural_frequencies,
                "damping_ratio": self.damping_ratios,
                **shapes,
            }
        ).rename_axis("mode")

    def frequency_response(self, angular_frequency: FloatArray) -> ComplexArray:
        """The deflection per newton (m, 3, k), complex, rad/N.

        Args:
            angular_frequency: (k,) rad/s.
        """
        s = 1j * np.asarray(angular_frequency, dtype=float)
        poles = np.append(self.poles, self.poles.conj())
        residues = 0.5 * np.concatenate([self.residues, self.residues.conj()], axis=1)
        return np.einsum("mpd,pk->mdk", residues, 1.0 / (s - poles[:, None]))


def modal_analysis(system: LinearSystem | ModelLike, pose: ArrayLike | None = None) -> Modes:
    """Poles and residues of a linear system, or of a robot at a pose.

    Where the damping is proportional to the modes (paper eq. 11) the poles are those of single
    oscillators, under-, over- or undamped. Other damping couples them: the complex modes of the
    state-space form are taken, exact all the same.

    Args:
        system: M, C, K, and where force goes in; or a robot as `load_robot` takes it, or its
            model.
        pose: (nv,) rad or m, of a robot.

    Returns:
        the modes.

    Raises:
        InputError: M or K is not positive definite; a robot without a pose.

    Source: Ewins, Modal Testing (2000), ch. 2; Golla and Hughes state-space form.
    """
    if not isinstance(system, LinearSystem):
        model = Model.of(system)
        if pose is None:
            raise InputError("is needed: modes are those of a robot at a pose", key="pose")
        system = model.linear_system(model.robot.pose(pose))
    omega, shapes = undamped_modes(system.mass_matrix, system.stiffness_matrix)
    damping = shapes.T @ system.damping_matrix @ shapes
    scale = np.sqrt(np.abs(np.outer(damping.diagonal(), damping.diagonal())))
    off_diagonal = damping - np.diag(damping.diagonal())
    decoupled = bool((np.abs(off_diagonal) <= _DECOUPLED * (scale + scale.max())).all())

    ratio = damping.diagonal() / (2.0 * omega)
    participation = shapes.T @ system.input_matrix
    output = system.output_matrix @ shapes
    if decoupled:
        poles, left, right = _oscillators(omega, ratio)
    else:
        poles, left, right = _complex_modes(omega, damping)
    residues = (output @ left)[:, :, None] * (right @ participation)
    return Modes(
        natural_frequencies=omega / (2.0 * np.pi),
        damping_ratios=ratio,
        mode_shapes=shapes,
        poles=poles,
        residues=np.where((poles.imag > 0.0)[None, :, None], 2.0 * residues, residues),
        decoupled=decoupled,
        output_names=system.output_names,
    )


def _oscillators(
    omega: FloatArray, ratio: FloatArray
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Poles of uncoupled oscillators: 1/((s - a)(s - b)) = (1/(s - a) - 1/(s - b))/(a - b)."""
    poles, modes, weights = [], [], []
    for i, (w, zeta) in enumerate(zip(omega, ratio, strict=True)):
        if abs(zeta * zeta - 1.0) < _CRITICAL:
            zeta = np.sqrt(1.0 + _CRITICAL)
        if zeta < 1.0:
            damped = w * np.sqrt(1.0 - zeta * zeta)
            poles.append(-zeta * w + 1j * damped)
            modes.append(i)
            weights.append(1.0 / (2j * damped))
        else:
            # The slow pole from the product of both, so that strong damping loses no digits.
            root = np.sqrt(zeta * zeta - 1.0)
            fast = -w * (zeta + root)
            poles += [w * w / fast, fast]
            modes += [i, i]
            weights += [1.0 / (2.0 * w * root), -1.0 / (2.0 * w * root)]
    count = len(poles)
    left = np.zeros((omega.size, count), dtype=complex)
    right = np.zeros((count, omega.size), dtype=complex)
    for p, (i, weight) in enumerate(zip(modes, weights, strict=True)):
        left[i, p] = weight
        right[p, i] = 1.0
    return np.array(poles, dtype=complex), left, right


def _complex_modes(
    omega: FloatArray, damping: FloatArray
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Complex modes of eta'' + damping eta' + omega^2 eta = f, state (omega eta, eta')."""
    n = omega.size

    def solve(damping: FloatArray) -> tuple[FloatArray, FloatArray]:
        state = np.block([[np.zeros((n, n)), np.diag(omega)], [-np.diag(omega), -damping]])
        return np.linalg.eig(state)

    poles, vectors = solve(damping)
    if np.linalg.cond(vectors) > _DEFECTIVE:
        # Equal poles share one vector; a hair more damping parts them (see _CRITICAL).
        step = np.diag(damping.diagonal() * _NUDGE * np.arange(1, n + 1))
        poles, vectors = solve(damping + step)
    inverse = np.linalg.inv(vectors)
    keep = poles.imag >= 0.0
    left = vectors[:n] / omega[:, None]
    return poles[keep], left[:, keep], inverse[keep, n:]
