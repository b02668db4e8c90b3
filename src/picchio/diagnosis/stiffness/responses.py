"""Frequency response functions of an arm on its joint springs, and how they change with everything.

About a pose, with the motor sides held, Z(w) = K + dg/dq - w^2 M + i w C, and a force along d at a
point that moves with J_f gives a reading H = (J_s^T e)^T Z^-1 (J_f^T d) along e at the sensor,
times (i w)^2 of an accelerometer, i w of a velocity (Ewins, Modal Testing (2000), ch. 2). An
accelerometer also turns in gravity. The slope by any number of Z is -u^T (dZ/dp) v, with
v = Z^-1 J_f^T d and u likewise of the sensor.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import itemgetter
from typing import Literal, NamedTuple

import numpy as np

from picchio.campaign.channels import FREQUENCY
from picchio.campaign.record import Record
from picchio.campaign.tables import Tolerance
from picchio.core.arrays import ComplexArray, FloatArray, IndexArray
from picchio.core.errors import InputError
from picchio.diagnosis.stiffness.fit import Predicted
from picchio.diagnosis.stiffness.prior import Prior, damping_std, remainder_of
from picchio.diagnosis.stiffness.statics import moved
from picchio.diagnosis.stiffness.taps import SAMPLING, UNKNOWN_BLOW, Seen, spectra
from picchio.prediction.percussion import pose_of
from picchio.robot.flexible_robot import FlexibleRobot

Damping = Literal["modal", "joint"]
_TURN = 1e-4  # rad or m, of the differences by the pose
_ARM = 0.05  # m, at which masses are put to shift a centre or to change an inertia
_MOST_LINES = 240  # of a function; more are thinned out
_WITHOUT = 0.02  # relative deviation of a line without coherence, to begin with
_FLOOR = 1e-3  # of the largest line: nothing is measured better than that
_POWER = {"receptance": 0, "mobility": 1, "accelerance": 2}


@dataclass(frozen=True, eq=False)
class Response:
    """One measured function.

    Attributes:
        file: the record's name.
        omega: (m,) rad/s.
        measured: (m,) SI.
        scale: (m,) what a line's standard deviation is in units of the fitted noise, SI.
        power: of i w.
        push: (n,) m, J_f^T d.
        sight: (n,) m, J_s^T e.
        tilt: (n,) m/s^2, what the sensor reads of gravity for a unit turn of each joint.
        pushes, sights: (k, n) by how much a standard deviation of each of its pose's k numbers
            changes these.
        tilts: (k, n) likewise.
        gains: (k,) likewise, of the whole function's logarithm.
        delays: (k,) likewise, s, by which it comes later.
        widths: (k,) likewise, s^2, the variance in time of a blow that is not known.
        bends: (k, m) by how much of what it answers at once to a force, less what it answers, a
            standard deviation of each number changes it; see `picchio.diagnosis.stiffness.taps`.
        bent: (m,) of that, what is held.
        shift: 1/s, of the lines to the right of the imaginary axis; 0 of a frequency response.
    """

    file: str
    omega: FloatArray
    measured: ComplexArray
    scale: FloatArray
    power: int
    push: FloatArray
    sight: FloatArray
    tilt: FloatArray
    pushes: FloatArray
    sights: FloatArray
    tilts: FloatArray
    gains: FloatArray
    delays: FloatArray
    widths: FloatArray
    bends: ComplexArray
    bent: ComplexArray | float = 0.0
    shift: float = 0.0

    @property
    def s(self) -> ComplexArray:
        """(m,) rad/s, where the lines lie in the Laplace plane."""
        return self.shift + 1j * self.omega

    def factor(self, off: FloatArray) -> ComplexArray:
        """(m,) by which numbers that are never exact multiply the function.

        Args:
            off: (k,) of them, in standard deviations.
        """
        return _factor(self, self.s, off)

    @property
    def values(self) -> FloatArray:
        """(m, 2) real and imaginary part over the lines' scale."""
        return np.stack([self.measured.real, self.measured.imag], axis=1) / self.scale[:, None]

    @cached_property
    def remainder(self) -> FloatArray:
        """(m,) variance, over the lines' scale, of what a model never follows.

        See `remainder_of`.
        """
        return np.asarray(remainder_of(self.measured) / self.scale**2)

    groups: tuple[str, ...] = ("frf", "frf")

    def __len__(self) -> int:
        return len(self.omega)


@dataclass(frozen=True, eq=False)
class Standing:
    """The arm at one pose, and the functions measured there.

    Attributes:
        mass: (n, n) kg m^2.
        gravity: (n, n) N m/rad, dg/dq.
        masses: (k, n, n) what a standard deviation of each number that is never exact adds to it.
        products: (q, n, n) likewise, with the product of two numbers: a centre of mass that is off
            to either side makes a light wrist turn more slowly.
        pairs: (q, 2) which two.
        spring: (n,) N m/rad, as stated.
        responses: measured here.
        factors: (n,) on the modes' damping ratios, by ascending frequency.
    """

    mass: FloatArray
    gravity: FloatArray
    masses: FloatArray
    products: FloatArray
    pairs: IndexArray
    spring: FloatArray
    responses: tuple[Response, ...]
    factors: FloatArray

    @cached_property
    def driven(self) -> tuple[_Alike, ...]:
        """The responses, those together that are pushed alike at the same lines."""
        alike: dict[tuple[bytes, ...], list[int]] = {}
        for k, one in enumerate(self.responses):
            key = one.s.tobytes(), one.push.tobytes(), one.pushes.tobytes()
            alike.setdefault(key, []).append(k)
        return tuple(_Alike.of(self.responses, index) for index in alike.values())

    def mass_at(self, off: FloatArray) -> FloatArray:
        """The mass matrix (n, n).

        Args:
            off: (k,) numbers that are never exact, in standard deviations.
        """
        both = off[self.pairs].prod(axis=1)
        added = np.tensordot(off, self.masses, 1) + np.tensordot(both, self.products, 1)
        return np.asarray(self.mass + added)

    def mass_slopes(self, off: FloatArray) -> FloatArray:
        """(k, n, n) its derivatives by the numbers.

        Args:
            off: as above.
        """
        found = self.masses.copy()
        for own, other in ((0, 1), (1, 0)):
            part = off[self.pairs[:, other], None, None] * self.products
            np.add.at(found, self.pairs[:, own], part)
        return found


@dataclass(frozen=True, eq=False)
class _Driven:
    """How the arm answers to a force, whatever reads it.

    Attributes:
        motion: (m, n) of the joints, at every line.
        slopes: (m, p, n) its derivatives by the numbers; (m, 0, n) where none was asked for.
        at_once: (n,) acceleration where nothing but the masses resists.
    """

    motion: ComplexArray
    slopes: ComplexArray
    at_once: FloatArray

    @classmethod
    def of(
        cls,
        response: Response,
        off: FloatArray,
        system: tuple[FloatArray, FloatArray, FloatArray],
        slopes: tuple[FloatArray, FloatArray, FloatArray] | None,
    ) -> _Driven:
        """The answer to what a response is the answer to.

        `system` is stiffness, damping and mass, (n, n), and `slopes` their derivatives (p, n, n).
        """
        w = response.s[:, None, None]
        powers = np.ones_like(w), w, w**2
        push = response.push + off @ response.pushes
        at_once = np.linalg.solve(system[2], push)
        matrix = sum(a * part for a, part in zip(powers, system, strict=True))
        if slopes is None:
            motion = np.linalg.solve(matrix, push[:, None])[..., 0]
            return cls(motion, np.zeros((len(motion), 0, len(push)), complex), at_once)
        inverse = np.linalg.inv(matrix)
        motion = inverse @ push
        m, n = motion.shape
        both = np.concatenate([motion.real, motion.imag])
        by: ComplexArray = np.zeros((m, len(slopes[0]), n), complex)
        for a, part in zip(powers, slopes, strict=True):
            real = (both @ part.reshape(-1, n).T).reshape(2, m, -1, n)
            by -= a * (real[0] + 1j * real[1])
        by[:, 2 * n : 2 * n + len(off)] += response.pushes
        return cls(motion, by @ inverse, at_once)


@dataclass(frozen=True, eq=False)
class _Alike:
    """The r responses of a pose that one force drives at the same lines; see `Response`.

    Attributes:
        first: the first of them.
        index: which of the pose's they are.
        lead: (r, m) by which a motion is multiplied to be what is read.
        sight, tilt: (r, n).
        sights, tilts: (r, k, n).
        gains, delays, widths: (r, 1, k).
        bends: (r, m, k).
        bent, measured: (r, m).
        scale, remainder: (r, m).
        straight: (r, 1) 1 of those that read what answers at once to a force, else 0.
    """

    first: Response
    index: Sequence[int]
    lead: ComplexArray
    sight: FloatArray
    tilt: FloatArray
    sights: FloatArray
    tilts: FloatArray
    gains: FloatArray
    delays: FloatArray
    widths: FloatArray
    bends: ComplexArray
    bent: ComplexArray
    measured: ComplexArray
    scale: FloatArray
    remainder: FloatArray
    straight: FloatArray

    @classmethod
    def of(cls, responses: Sequence[Response], index: Sequence[int]) -> _Alike:
        """Those of the numbers in `index`."""
        own = [responses[k] for k in index]
        s = own[0].s

        def every(name: str) -> FloatArray:
            return np.array([getattr(one, name) for one in own])

        power = every("power")[:, None]
        numbers = {name: every(name)[:, None] for name in ("gains", "delays", "widths")}
        return cls(
            own[0], index, s**power, every("sight"), every("tilt"), every("sights"),
            every("tilts"), **numbers, bends=every("bends").swapaxes(1, 2),
            bent=np.array([one.bent * np.ones(len(s)) for one in own]), measured=every("measured"),
            scale=every("scale"), remainder=every("remainder"),
            straight=(power == 2).astype(float),
        )  # fmt: skip

    def read(self, driven: _Driven, off: FloatArray) -> Iterator[tuple[int, Predicted]]:
        """Each response's number, and what is left of it."""
        motion, s = driven.motion, self.first.s
        sight, tilt = self.sight + off @ self.sights, self.tilt + off @ self.tilts
        seen = self.lead[..., None] * sight[:, None] + tilt[:, None]
        gain = _factor(self, s, off)
        bent = self.bent + self.bends @ off
        plain = (seen * motion).sum(axis=-1)
        other = self.straight * (sight @ driven.at_once)[:, None] - plain
        value = gain * (plain + bent * other)
        left = (self.measured - value) / self.scale
        follows = gain * (1.0 - bent)
        slope = (driven.slopes @ seen.transpose(1, 2, 0)).transpose(2, 0, 1) * follows[..., None]
        if slope.shape[-1] and len(off):
            own = slice(2 * motion.shape[1], 2 * motion.shape[1] + len(off))
            line = s[:, None]
            sights = self.lead[..., None] * (motion @ self.sights.swapaxes(1, 2))
            direct = sights + motion @ self.tilts.swapaxes(1, 2)
            slope[..., own] += follows[..., None] * direct
            slope[..., own] += value[..., None] * (
                self.gains - line * self.delays + 0.5 * line**2 * self.widths
            )
            slope[..., own] += (gain * other)[..., None] * self.bends
        slope /= self.scale[..., None]
        both = np.stack([slope.real, slope.imag], axis=2)
        residual = np.stack([left.real, left.imag], axis=2)
        remainder = np.stack([self.remainder] * 2, axis=2)
        for k, number in enumerate(self.index):
            yield number, Predicted(residual[k], both[k], remainder[k])


def _factor(of: Response | _Alike, s: ComplexArray, off: FloatArray) -> ComplexArray:
    """By which numbers that are never exact multiply one function, or several (r, m)."""
    late, wide = s * (of.delays @ off), s**2 * (of.widths @ off)
    return np.asarray(np.exp(of.gains @ off - late + 0.5 * wide))


@dataclass(frozen=True, eq=False)
class FrfProblem:
    """The functions of all poses, and what is known before.

    The numbers: the logarithms of the n stiffnesses and of the n damping ratios over the stated
    ones; then what is never exact, in standard deviations; then, for each pose, what its modes'
    damping ratios are off by.

    Attributes:
        standings: a pose each.
        prior: of the stiffness.
        damping_ratio: (n,) as stated.
        damping_std: (n,) of the logarithm.
        steps: names of what is never exact.
        by_mode: relative deviation of each mode's damping ratio, drawn once a pose.
        gravity_std: relative deviation of gravity's stiffness.
        convention: of the damping: "modal", or dashpots in the joints, "joint".
    """

    standings: tuple[Standing, ...]
    prior: Prior
    damping_ratio: FloatArray
    damping_std: FloatArray
    steps: tuple[str, ...]
    by_mode: float
    gravity_std: float
    convention: Damping = "modal"
    noise: Mapping[str, float] = field(default_factory=lambda: {"frf": 1.0})
    groups = ("frf",)
    zeros = ()
    causes = ()

    @property
    def joints(self) -> int:
        """How many yield."""
        return len(self.damping_ratio)

    @property
    def springs(self) -> int:
        """Logarithms that no step may change by much."""
        return 2 * self.joints

    @cached_property
    def tables(self) -> tuple[Response, ...]:
        """Every function, pose by pose."""
        return tuple(one for standing in self.standings for one in standing.responses)

    @cached_property
    def rows(self) -> int:
        """Lines in all."""
        return sum(len(one) for one in self.tables)

    @cached_property
    def modal(self) -> int:
        """How many numbers the modes of one pose have."""
        return self.joints if self.by_mode > 0.0 else 0

    @cached_property
    def precision(self) -> FloatArray:
        """(p, p) of all numbers before the tests."""
        n = self.joints
        found = np.eye(2 * n + len(self.steps) + self.modal * len(self.standings))
        found[:n, :n] = np.linalg.inv(self.prior.covariance)
        found[n : 2 * n, n : 2 * n] = np.diag(self.damping_std**-2)
        return found

    def bare(self, at: FloatArray | None = None, convention: Damping = "modal") -> FrfProblem:
        """The same with everything but springs and damping held: many times faster.

        Args:
            at: (p,) the numbers at which it is held; as told if None.
            convention: of the damping.

        Returns:
            the problem of 2 n numbers.
        """
        n = self.joints
        first = 2 * n + len(self.steps)
        off = np.zeros(len(self.steps)) if at is None else at[2 * n : first]
        pull = 0.0
        if self.gravity_std > 0.0:
            pull = self.gravity_std * float(off[self.steps.index("gravity_stiffness")])

        def plain(one: Response) -> Response:
            none, nothing, gain = np.zeros((0, n)), np.zeros(0), one.factor(off)
            return replace(
                one, measured=one.measured / gain, scale=one.scale / np.abs(gain),
                push=one.push + off @ one.pushes, sight=one.sight + off @ one.sights,
                tilt=one.tilt + off @ one.tilts, pushes=none, sights=none, tilts=none,
                gains=nothing, delays=nothing, widths=nothing,
                bends=np.zeros((0, len(one))), bent=one.bent + off @ one.bends,
            )  # fmt: skip

        standings = []
        for k, standing in enumerate(self.standings):
            own = np.zeros(self.modal)
            if at is not None:
                own = at[first + self.modal * k : first + self.modal * (k + 1)]
            factors = np.exp(self.by_mode * own) if self.modal else np.ones(n)
            standings.append(replace(
                standing, mass=standing.mass_at(off),
                gravity=(1.0 + pull) * standing.gravity, masses=np.zeros((0, n, n)),
                products=np.zeros((0, n, n)), pairs=np.zeros((0, 2), dtype=np.intp),
                responses=tuple(map(plain, standing.responses)),
                factors=standing.factors * factors,
            ))  # fmt: skip
        return replace(self, standings=tuple(standings), steps=(), by_mode=0.0, gravity_std=0.0,
                       convention=convention)  # fmt: skip

    def damping(
        self,
        mass: FloatArray,
        springs: FloatArray,
        ratio: FloatArray,
        factors: FloatArray,
    ) -> FloatArray:
        """The damping matrices (..., n, n), N m s/rad.

        Args:
            mass: (..., n, n) kg m^2.
            springs: (..., n) N m/rad.
            ratio: (..., n) damping ratios of the joints.
            factors: (..., n) on the modes' ratios.
        """
        inverse = np.linalg.inv(np.linalg.cholesky(mass))
        back = inverse.swapaxes(-1, -2)
        squared, vectors = np.linalg.eigh((inverse * springs[..., None, :]) @ back)
        shapes = back @ vectors
        weighted = mass @ shapes
        if self.convention == "joint":
            # As if each joint swung alone: c = 2 zeta k / w. How modes differ, between them, too.
            each = 2.0 * ratio * np.sqrt(springs * np.diagonal(mass, axis1=-2, axis2=-1))
            root = np.sqrt(factors)
            within = (shapes.swapaxes(-1, -2) * each[..., None, :]) @ shapes
            between = weighted * root[..., None, :]
            return np.asarray(between @ within @ between.swapaxes(-1, -2))
        energy = springs[..., :, None] * shapes**2
        own = (ratio[..., None, :] @ energy)[..., 0, :] / energy.sum(axis=-2) * factors
        between = weighted * (2.0 * own * np.sqrt(squared))[..., None, :]
        return np.asarray(between @ weighted.swapaxes(-1, -2))

    def ratio_of(self, at: FloatArray, standing: Standing, mode: int) -> float:
        """The damping ratio of a mode of a pose.

        Args:
            at: (2 n,) the numbers; all others held.
            standing: the pose.
            mode: its number, by ascending frequency.
        """
        n = self.joints
        springs = standing.spring * np.exp(at[:n])
        ratio = self.damping_ratio * np.exp(at[n : 2 * n])
        damp = self.damping(standing.mass, springs, ratio, standing.factors)
        squared, shapes = natural(self, standing, springs)
        own = shapes[:, mode]
        return float(own @ damp @ own / (2.0 * np.sqrt(squared[mode])))

    def predict(
        self, at: FloatArray, known: Sequence[Predicted] | None = None, slopes: bool = True
    ) -> list[Predicted]:
        """The real and imaginary parts over the lines' scale, measured less predicted.

        Args:
            at: (p,) the numbers.
            known: not used: everything is computed anew.
            slopes: False where none is needed, which is many times faster.
        """
        n, found = self.joints, []
        scale = np.exp(np.clip(at[: 2 * n], -12.0, 12.0))
        ratio = self.damping_ratio * scale[n:]
        off = at[2 * n : 2 * n + len(self.steps)]
        pull = self.steps.index("gravity_stiffness") if self.gravity_std > 0.0 else None
        for k, standing in enumerate(self.standings):
            springs = standing.spring * scale[:n]
            first = 2 * n + len(self.steps) + self.modal * k
            factors = standing.factors
            if self.modal:
                factors = factors * np.exp(self.by_mode * at[first : first + self.modal])
            mass = standing.mass_at(off)
            stiff = np.diag(springs) + standing.gravity
            if pull is not None:
                stiff = stiff + off[pull] * self.gravity_std * standing.gravity
            system, by = (stiff, self.damping(mass, springs, ratio, factors), mass), None
            if slopes:
                by = self._slopes(standing, off, (springs, ratio, factors), system, first)
                if pull is not None:
                    by[0][2 * n + pull] = self.gravity_std * standing.gravity
            own: list[tuple[int, Predicted]] = []
            for alike in standing.driven:
                own += alike.read(_Driven.of(alike.first, off, system, by), off)
            found += [part for _, part in sorted(own, key=itemgetter(0))]
        return found

    def _slopes(
        self,
        standing: Standing,
        off: FloatArray,
        numbers: tuple[FloatArray, FloatArray, FloatArray],
        system: tuple[FloatArray, FloatArray, FloatArray],
        first: int,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Derivatives (p, n, n) of a pose's stiffness, damping and mass, gravity's own left out.

        The damping's by differences, all at once: springs, ratios, modes, masses. `numbers` are
        springs, damping ratios and the modes' factors, `first` where the pose's own begin.
        """
        (springs, ratio, factors), (_, damp, mass), n = numbers, system, self.joints
        by_mass = standing.mass_slopes(off)
        moved = np.flatnonzero(np.abs(by_mass).max(axis=(1, 2), initial=0.0))
        step, once = 1e-5, np.eye(n)
        ones, still = np.ones((n, n)), np.ones((len(moved), n))
        modes = np.ones((self.modal, n)) + step * once[: self.modal]
        same = np.ones_like(modes)
        change = [(1.0 + step * once, ones, ones), (ones, 1.0 + step * once, ones),
                  (same, same, modes), (still, still, still)]  # fmt: skip
        k_of, z_of, f_of = (np.concatenate(part) for part in zip(*change, strict=True))
        masses = np.repeat(mass[None], len(k_of), axis=0)
        masses[len(k_of) - len(moved) :] += step * by_mass[moved]
        more = (self.damping(masses, springs * k_of, ratio * z_of, factors * f_of) - damp) / step
        d_stiff, d_damp, d_mass = np.zeros((3, len(self.precision), n, n))
        d_stiff[np.arange(n), np.arange(n), np.arange(n)] = springs
        d_damp[: 2 * n] = more[: 2 * n]
        d_damp[first : first + self.modal] = self.by_mode * more[2 * n : 2 * n + self.modal]
        d_damp[2 * n + moved] = more[2 * n + self.modal :]
        d_mass[2 * n : 2 * n + len(self.steps)] = by_mass
        return d_stiff, d_damp, d_mass


def make_problem(
    robot: FlexibleRobot, records: Sequence[Record], tolerance: Tolerance, prior: Prior
) -> FrfProblem:
    """What was measured, with all that a prediction needs.

    Args:
        robot: flexible.
        records: of the kind "frf", or taps.
        tolerance: how exact masses, poses and places are.
        prior: of the stiffness.

    Raises:
        InputError: a frame that is not there; a function that cannot be one.
    """
    names = never_exact(robot, tolerance, [record.file for record in records])
    for record in records:
        if record.test == "tap":
            names += [f"{name}.{record.file}" for name in SAMPLING]
            if "force" not in record.channels:
                names += [f"{name}.{record.file}" for name, _ in UNKNOWN_BLOW]
    index = {name: k for k, name in enumerate(names)}
    poses: dict[tuple[float, ...], list[Response]] = {}
    for record in records:
        pose = pose_of(robot, record)
        own = _responses_of(robot, record, pose, tolerance, index)
        poses.setdefault(tuple(pose.tolist()), []).extend(own)
    stands = [(np.array(pose), tuple(own)) for pose, own in poses.items()]
    return assembled(robot, stands, tolerance, prior, index)


def never_exact(robot: FlexibleRobot, tolerance: Tolerance, files: Sequence[str]) -> list[str]:
    """The names of the numbers that are never exact of any function.

    Args:
        robot: flexible.
        tolerance: how exact masses, poses and places are.
        files: names of the records, each with a direction of its own.
    """
    names = [name for name, _ in _bodies(robot, tolerance).single]
    names += [f"pose.{name}" for name in robot.joint_names if tolerance.pose > 0.0]
    names += [f"tool_point.{axis}" for axis in "xyz" if tolerance.tool_point > 0.0]
    names += [f"sensor_position.{axis}" for axis in "xyz" if tolerance.sensor_position > 0.0]
    names += [f"sensor_angle.{axis}" for axis in "xyz" if tolerance.sensor_angle > 0.0]
    names += ["sensor_gain"] if tolerance.sensor_gain > 0.0 else []
    names += ["gravity_stiffness"] if tolerance.gravity_stiffness > 0.0 else []
    if tolerance.direction > 0.0:
        names += [f"direction.{file}.{axis}" for file in files for axis in "xyz"]
    return names


def assembled(
    robot: FlexibleRobot,
    stands: Sequence[tuple[FloatArray, tuple[Response, ...]]],
    tolerance: Tolerance,
    prior: Prior,
    index: Mapping[str, int],
) -> FrfProblem:
    """Functions by pose, and what masses and poses that are off do to the arm there.

    Args:
        robot: flexible.
        stands: (nv,) rad or m each, and what was measured there.
        tolerance: how exact masses and poses are.
        prior: of the stiffness.
        index: number of each name that is never exact.

    Returns:
        the problem, its damping from the robot's files.
    """
    bodies, flex = _bodies(robot, tolerance), robot.flexible_index
    square, standings = np.ix_(flex, flex), []
    for pose, responses in stands:
        mass = robot.rigid.mass_matrix(pose)[square]
        masses, products = np.zeros((len(index), *mass.shape)), []
        for name, added in bodies.single:
            masses[index[name]] = robot.rigid.with_masses(added).mass_matrix(pose)[square] - mass
        for *_, added in bodies.double:
            products.append(robot.rigid.with_masses(added).mass_matrix(pose)[square] - mass)
        for k, joint in enumerate(robot.joint_names):
            if tolerance.pose > 0.0:
                other = pose + _TURN * np.eye(len(pose))[k]
                change = robot.rigid.mass_matrix(other)[square] - mass
                masses[index[f"pose.{joint}"]] = tolerance.pose / _TURN * change
        standings.append(Standing(
            mass, robot.gravity_stiffness(pose), masses,
            np.array(products).reshape(-1, *mass.shape),
            np.array([(index[a], index[b]) for a, b, _ in bodies.double], np.intp).reshape(-1, 2),
            robot.state(pose).stiffness, responses, np.ones(len(flex)),
        ))  # fmt: skip
    return FrfProblem(
        tuple(standings), prior, np.maximum(robot.damping_ratio, 1e-3), damping_std(robot),
        tuple(index), tolerance.damping_by_mode, tolerance.gravity_stiffness,
    )  # fmt: skip


Added = list[tuple[float, str, tuple[float, float, float] | None]]


class _Bodies(NamedTuple):
    """What a standard deviation of what is never exact of a link is, as masses added to it.

    Attributes:
        single: by name, with the number itself.
        double: by two names, with the product of both numbers.
    """

    single: list[tuple[str, Added]]
    double: list[tuple[str, str, Added]]


def _bodies(robot: FlexibleRobot, tolerance: Tolerance) -> _Bodies:
    """Mass, centre and inertia of each moving link."""
    found = _Bodies([], [])
    moving = {link for joint in robot.flexible_names for link in robot.tree.beyond(joint)}
    for link in sorted(moving):
        body = robot.tree.links.get(link)
        if body is None or not body.mass > 0.0:
            continue
        centre = np.array(body.xyz)

        def at(size: float, *arms: float, link: str = link, centre: FloatArray = centre) -> Added:
            place = centre + _ARM * np.array(arms)
            return [(size, link, (float(place[0]), float(place[1]), float(place[2])))]

        def about_others(inertia: float, k: int, at: Callable[..., Added] = at) -> Added:
            """Masses that turn about the two other axes only, kg m^2."""
            size, way = inertia / (2.0 * _ARM**2), np.eye(3)[k]
            return at(size, *way) + at(size, *-way) + at(-2.0 * size, 0.0, 0.0, 0.0)

        if tolerance.link_mass > 0.0:
            found.single.append((f"link_mass.{link}", [(tolerance.link_mass, link, None)]))
        for k, axis in enumerate("xyz"):
            if tolerance.link_com > 0.0:
                size, way = body.mass * tolerance.link_com / (2.0 * _ARM), np.eye(3)[k]
                name = f"link_com.{link}.{axis}"
                found.single.append((name, at(size, *way) + at(-size, *-way)))
                square = about_others(body.mass * tolerance.link_com**2, k)
                found.double.append((name, name, square))
            if tolerance.link_inertia > 0.0:
                # Three such make any change of the diagonal.
                own = tolerance.link_inertia * body.inertia[(0, 3, 5)[k]]
                found.single.append((f"link_inertia.{link}.{axis}", about_others(own, k)))
        if tolerance.link_com > 0.0:
            size = body.mass * tolerance.link_com**2 / (4.0 * _ARM**2)
            for a, b in ((0, 1), (0, 2), (1, 2)):
                one, other = np.eye(3)[a], np.eye(3)[b]
                crossed = at(size, *(one + other)) + at(size, *(-one - other))
                crossed += at(-size, *(one - other)) + at(-size, *(other - one))
                names = [f"link_com.{link}.{'xyz'[i]}" for i in (a, b)]
                found.double.append((names[0], names[1], crossed))
    return found


def _responses_of(
    robot: FlexibleRobot, record: Record, pose: FloatArray, tolerance: Tolerance,
    index: dict[str, int],
) -> list[Response]:  # fmt: skip
    """The functions of one record."""
    if record.kind == "frf":
        return [_response_of(robot, record, pose, tolerance, index)]
    found = []
    for one in spectra(robot, record, pose):
        gains, delays, widths = np.zeros((3, len(index)))
        if not one.known:
            for numbers, (name, size) in zip((gains, delays, widths), UNKNOWN_BLOW, strict=True):
                numbers[index[f"{name}.{record.file}"]] = size
        made = response_to(robot, record.file, one.seen, pose, tolerance, index)
        bends = np.zeros((len(index), len(one.omega)), dtype=complex)
        bends[[index[f"{name}.{record.file}"] for name in SAMPLING]] = one.bends
        found.append(replace(
            made, omega=one.omega, measured=one.measured, scale=one.scale, shift=one.shift,
            gains=made.gains + gains, delays=delays, widths=widths, bends=bends,
        ))  # fmt: skip
    return found


def _response_of(
    robot: FlexibleRobot, record: Record, pose: FloatArray, tolerance: Tolerance,
    index: dict[str, int],
) -> Response:  # fmt: skip
    table, columns = record.table, record.read()
    frequency = columns[FREQUENCY]
    if not (np.diff(frequency) > 0.0).all() or frequency[0] < 0.0 or len(frequency) < 8:
        raise record.source.error("needs eight frequencies or more, ascending", channel=FREQUENCY)
    measured = columns["real"] + 1j * columns["imag"]
    if not np.abs(measured).max() > 0.0:
        raise record.source.error("is zero throughout", channel="real")
    coherence = columns.get("coherence")
    if coherence is not None and not ((coherence >= -1e-6) & (coherence <= 1.0 + 1e-6)).all():
        bad = int(np.argmax((coherence < -1e-6) | (coherence > 1.0 + 1e-6)))
        raise record.source.error("is not within 0 and 1", channel="coherence", sample=bad)
    share = np.full(len(measured), _WITHOUT)
    if coherence is not None:
        # Bendat and Piersol, Random Data (2010), ch. 9, but for the number of averages.
        known = np.clip(coherence, 1e-3, 1.0 - 1e-6)
        share = np.sqrt((1.0 - known) / (2.0 * known))
    scale = share * np.abs(measured) + _FLOOR * float(np.abs(measured).max()) * _WITHOUT
    kept = frequency > 0.0
    thin = np.flatnonzero(kept)[:: max(1, int(np.ceil(kept.sum() / _MOST_LINES)))]
    way = np.array(table.force_direction, dtype=float)
    along = np.array(table.response_direction, dtype=float)
    quantity = table.quantity or "accelerance"
    seen = Seen(
        way / np.linalg.norm(way), along / np.linalg.norm(along), _POWER[quantity],
        quantity == "accelerance", table.force_frame, table.force_point, table.response_frame,
        table.response_point,
    )  # fmt: skip
    made = response_to(robot, record.file, seen, pose, tolerance, index)
    return replace(made, omega=2.0 * np.pi * frequency[thin], measured=measured[thin],
                   scale=scale[thin], bends=np.zeros((len(index), len(thin))))  # fmt: skip


def response_to(
    robot: FlexibleRobot, file: str, seen: Seen, pose: FloatArray, tolerance: Tolerance,
    index: dict[str, int],
) -> Response:  # fmt: skip
    """A function without its lines.

    Args:
        robot: flexible.
        file: the record's name.
        seen: how the function is taken.
        pose: (nv,) rad or m.
        tolerance: how exact poses and places are.
        index: number of each name that is never exact.
    """
    way, along = seen.way, seen.along
    down = np.array(robot.mounting.gravity, dtype=float)

    def stand(at: FloatArray, push: FloatArray, see: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(6, n) of the force's point and of the sensor's, shifted by (3,) m in their frames."""
        return (
            _point(robot, at, seen.force_frame, seen.force_point, push, True),
            _point(robot, at, seen.response_frame, seen.response_point, see, False),
        )

    def sides(
        both: tuple[FloatArray, FloatArray], d: FloatArray, e: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """J_f^T d, J_s^T e and what turning in gravity reads: (w x g) . e."""
        n = both[0].shape[1]
        turned = both[1][3:].T @ np.cross(down, e) if seen.tilts else 0.0
        sight = both[1][:3].T @ e if seen.joint is None else np.eye(n)[seen.joint]
        return both[0][:3].T @ d, sight, turned * np.ones(n)

    nothing = np.zeros(3)
    here = stand(pose, nothing, nothing)
    own = sides(here, way, along)
    changes = np.zeros((3, len(index), len(own[0])))

    def put(name: str, other: tuple[FloatArray, ...], factor: float = 1.0) -> None:
        if name in index:
            for k in range(3):
                changes[k, index[name]] = factor * (other[k] - own[k])

    for k, joint in enumerate(robot.joint_names):
        if f"pose.{joint}" in index:
            at = pose + _TURN * np.eye(len(pose))[k]
            put(f"pose.{joint}", sides(stand(at, nothing, nothing), way, along),
                tolerance.pose / _TURN)  # fmt: skip
    for k, axis in enumerate("xyz"):
        unit = np.eye(3)[k]
        put(f"tool_point.{axis}",
            sides(stand(pose, tolerance.tool_point * unit, nothing), way, along))  # fmt: skip
        put(f"sensor_position.{axis}",
            sides(stand(pose, nothing, tolerance.sensor_position * unit), way, along))  # fmt: skip
        put(f"sensor_angle.{axis}",
            sides(here, way, along + tolerance.sensor_angle * np.cross(unit, along)))  # fmt: skip
        put(f"direction.{file}.{axis}",
            sides(here, way + tolerance.direction * np.cross(unit, way), along))  # fmt: skip
    gains = np.zeros(len(index))
    if "sensor_gain" in index:
        gains[index["sensor_gain"]] = tolerance.sensor_gain
    none, nothing = np.zeros(0), np.zeros(len(index))
    return Response(
        file, none, none.astype(complex), none, seen.power, own[0], own[1], own[2], changes[0],
        changes[1], changes[2], gains, nothing, nothing, np.zeros((len(index), 0)),
    )  # fmt: skip


def _point(robot: FlexibleRobot, pose: FloatArray, frame: str | None,
           point: tuple[float, float, float] | None, shift: FloatArray,
           force: bool) -> FloatArray:  # fmt: skip
    """The Jacobian (6, n) of a point in a frame, shifted (3,) m; of the tool's if none is named."""
    if frame is None and point is None and force:
        link = robot.tool_point
        at = robot.rigid.frame(link)
    else:
        link = robot.link_of(frame or robot.tool_frame)
        at = robot.rigid.frame(link)
    jacobian = robot.rigid.jacobian(pose, at)[:, robot.flexible_index]
    turn = robot.rigid.placement(pose, at)[1]
    return moved(jacobian, turn @ (np.array(point or (0.0, 0.0, 0.0)) + shift))


def left_over(problem: FrfProblem, at: FloatArray) -> float:
    """The residual of all functions over themselves, each function alike.

    Args:
        problem: the functions.
        at: (p,) the numbers.
    """
    shares = []
    for part, table in zip(problem.predict(at, slopes=False), problem.tables, strict=True):
        left = np.linalg.norm(part.residual * table.scale[:, None])
        shares.append(float(left / np.linalg.norm(table.measured)))
    return float(np.sqrt(np.mean(np.square(shares))))


def natural(
    problem: FrfProblem, standing: Standing, springs: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Squared frequencies (..., n), rad/s, and shapes (..., n, n) of one pose.

    Args:
        problem: whose pose it is.
        standing: the pose.
        springs: (..., n) N m/rad.

    Returns:
        ascending; a mode a column, of unit modal mass.

    Raises:
        InputError: the mass matrix is not positive definite.
    """
    try:
        inverse = np.linalg.inv(np.linalg.cholesky(standing.mass))
    except np.linalg.LinAlgError:
        raise InputError("the mass matrix is not positive definite at a pose") from None
    stiff = springs[..., None] * np.eye(problem.joints) + standing.gravity
    squared, vectors = np.linalg.eigh(inverse @ stiff @ inverse.T)
    return squared, inverse.T @ vectors
