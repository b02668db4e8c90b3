"""Joint stiffness and damping from frequency response functions."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from picchio.campaign.campaign import Campaign
from picchio.campaign.channels import FREQUENCY
from picchio.core import spoken
from picchio.core.arrays import FloatArray
from picchio.core.provenance import provenance
from picchio.diagnosis.identified import (
    FORMAT,
    Compared,
    Identification,
    Identified,
    IdentifiedJoint,
    Method,
    ModeSeen,
    PoseLeft,
)
from picchio.diagnosis.stiffness.fit import Fit, climb
from picchio.diagnosis.stiffness.joints import MOST_HALF, Told, stiffness_of
from picchio.diagnosis.stiffness.modes import TAILS, paired, settled_elsewhere, starts
from picchio.diagnosis.stiffness.prior import prior_of
from picchio.diagnosis.stiffness.responses import Damping, FrfProblem, left_over, make_problem
from picchio.diagnosis.stiffness.written import sidecar
from picchio.prediction.percussion import pose_of
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.joint import is_drive

_FAR = 0.3  # residual over the functions beyond which the answer is doubted
_STRAY, _INCREDIBLE = 1.5, 3.0  # standard deviations before the tests
_DECISIVE = 5.0  # in log evidence, for a convention of the damping
_READ = ("m/N", "m/s/N", "m/s²/N")
_WORDS = {
    "modal": "one ratio for each mode, the joints' weighted by strain energy",
    "joint": "a dashpot in each joint",
}


class ByResponses(Method):
    """Springs and damping fitted to frequency response functions, from nothing."""

    name = "frf"
    kinds = frozenset({"frf", "tap"})
    needs_springs = frozenset({"frf", "tap"})

    def identify(
        self,
        robot: FlexibleRobot,
        campaign: Campaign,
        *,
        workers: int | None = None,
        progress: Callable[[str], None] | None = None,
    ) -> Identification:
        """As `identify_frf`."""
        return identify_frf(robot, campaign, progress=progress)


@dataclass(frozen=True, eq=False, repr=False)
class FrfIdentification(Identification):
    """What frequency response functions say of the joints.

    Attributes:
        campaign: the functions.
        fit: the most probable numbers.
        half: standard deviations to either end of a 90 % interval.
        covariance: (2 n, 2 n) of the logarithms of stiffness and damping ratios.
        left: residual over the functions, each line over its scale.
        before: the same of the stated values.
        convention: of the damping that the functions follow: "modal" or "joint".
        decided: log evidence for it over the other.
    """

    campaign: Campaign
    fit: Fit
    half: float
    covariance: FloatArray
    left: float
    before: float
    convention: str
    decided: float

    @property
    def doubt(self) -> str:
        """That the model does not follow the functions."""
        if self.left < _FAR:
            return ""
        return (
            f"{spoken.per_cent(self.left, 2)} % of the functions are left unexplained: a "
            "joint-spring model does not follow them, and the intervals do not know that"
        )

    @property
    def remarks(self) -> tuple[str, ...]:
        """What is left, and which convention the damping follows."""
        sure = "" if self.decided > _DECISIVE else ", though the other one does about as well"
        return (
            f"{len(list(self.campaign))} functions, {self.fit.problem.rows} lines. With the stated "
            f"values {spoken.per_cent(self.before)} % of them is left, with those found "
            f"{spoken.per_cent(self.left)} %; nothing was held out.",
            f"Damping: {_WORDS[self.convention]}{sure} (log evidence {self.decided:+.1f}).",
        )

    def compared(self) -> list[Compared]:
        """Every function, by its magnitude; the spread is what its coherence leaves."""
        problem, found = self.fit.problem, []
        known = {record.file: record for record in self.campaign if record.kind == "frf"}
        for part, table in zip(problem.predict(self.fit.mean), problem.tables, strict=True):
            record, coherence = known.get(table.file), None
            if record is not None and "coherence" in record.channels:
                columns = record.read(["coherence"])
                lines = 2.0 * np.pi * columns[FREQUENCY]
                coherence = np.interp(table.omega, lines, columns["coherence"])
            fitted = (table.values - part.residual) @ np.array([1.0, 1j]) * table.scale
            left = np.linalg.norm(table.measured - fitted) / np.linalg.norm(table.measured)
            found.append(Compared(
                table.file, "frequency [Hz]", f"magnitude [{_READ[table.power]}]",
                table.omega / (2.0 * np.pi), np.abs(table.measured), np.abs(fitted),
                table.scale * self.fit.noise["frf"], float(left), True,
                True, coherence,
            ))  # fmt: skip
        return found

    def modes(self) -> list[ModeSeen]:
        """Every peak of every pose that a mode of the fit explains."""
        problem: FrfProblem = self.fit.problem
        n = problem.joints
        held = problem.bare(self.fit.mean, problem.convention)
        parts = iter(held.predict(self.fit.mean[: 2 * n]))
        poses = dict.fromkeys(tuple(pose_of(self.robot, r).tolist()) for r in self.campaign)
        springs, found = np.exp(self.fit.mean[:n]), []
        for stand, (standing, pose) in enumerate(zip(held.standings, poses, strict=True), start=1):
            fitted = [
                (one.values - next(parts).residual) @ np.array([1.0, 1j]) * one.scale
                for one in standing.responses
            ]
            for pair in paired(held, standing, standing.spring * springs, fitted):
                whole = np.zeros(len(pose))
                whole[self.robot.flexible_index] = pair.shape
                found.append(ModeSeen(stand, np.array(pose), *pair[:2],
                                      held.ratio_of(self.fit.mean[: 2 * n], standing, pair.number),
                                      pair.mac, whole / np.abs(whole).max()))  # fmt: skip
        return found

    def by_pose(self) -> list[PoseLeft]:
        """Pose by pose, its functions together, each alike."""
        problem, found = self.fit.problem, []
        parts = iter(problem.predict(self.fit.mean))
        for stand, standing in enumerate(problem.standings, start=1):
            shares = [
                np.linalg.norm(next(parts).residual * one.scale[:, None])
                / np.linalg.norm(one.measured)
                for one in standing.responses
            ]
            files = list(dict.fromkeys(one.file for one in standing.responses))
            found.append(PoseLeft(
                f"pose {stand}: {files[0]}" + (f" to {files[-1]}" if len(files) > 1 else ""),
                len(shares), math.sqrt(float(np.mean(np.square(shares)))),
            ))  # fmt: skip
        return found

    def sidecar_text(self) -> str:
        """See `Identification`; a joint that is not told has a wide spread."""
        return sidecar(
            self.robot, self.joints, self.source, self.campaign.files, self.remarks,
            self.covariance, damping=True,
        )  # fmt: skip

    def _content(self) -> Mapping[str, Any]:
        return {
            "format": FORMAT,
            "robot": self.robot.name,
            "method": ByResponses.name,
            "joints": self.joints,
            "also": [],
            "residual": {"before": self.before, "after": self.left, "held_out": []},
            "damping": {"convention": self.convention, "evidence": self.decided},
            "noise": {"frf": {"std": self.fit.noise["frf"], "unit": "1"}},
            "provenance": provenance([*self.robot.files, *self.campaign.files]),
        }

    def _headline(self) -> str:
        return f"{self._told()} told by {self.fit.problem.rows} lines"


def identify_frf(
    robot: FlexibleRobot,
    campaign: Campaign,
    *,
    progress: Callable[[str], None] | None = None,
) -> FrfIdentification:
    """Stiffness and damping of every joint from frequency response functions, from nothing.

    Modes are matched by frequency and shape first; from the best of these starts the functions
    themselves are fitted, each line by its coherence, with masses, poses, places, directions and
    gains as numbers of their own within `[tolerance]`.

    Args:
        robot: flexible, its stiffness stated or estimated.
        campaign: records of the kind "frf", and taps in time.
        progress: told what is being done.

    Returns:
        values, intervals and reasons.

    Raises:
        InputError: a function that cannot be read, or that names a frame that is not there.
    """
    say = progress or (lambda text: None)
    say("frequency responses: modes")
    problem = make_problem(robot, list(campaign), campaign.tolerance, prior_of(robot))
    begin = starts(problem)
    say("frequency responses: springs and damping")
    plain = problem.bare()
    bare = max(
        (climb(plain, at[: problem.springs], TAILS) for at in begin),
        key=lambda found: found.evidence,
    )  # fmt: skip
    bare = settled_elsewhere(plain, bare)
    other = climb(problem.bare(convention="joint"), bare.mean, TAILS)
    say("frequency responses: with all that is never exact")
    # Which convention holds shows only where modes may differ from it, as they always do a little.
    modal = _whole(problem, bare.mean)
    joint = _whole(replace(problem, convention="joint"), other.mean)
    gain = modal.evidence - joint.evidence
    convention: Damping = "modal" if gain >= -_DECISIVE else "joint"
    fit = settled_elsewhere(
        *((modal.problem, modal) if convention == "modal" else (joint.problem, joint))
    )
    if convention == "modal":
        modal = fit
    covariance = fit.covariance[: problem.springs, : problem.springs]
    joints = _joints(robot, fit, covariance, modal, _by_modes(modal))
    stated = np.zeros(len(problem.precision))
    source = "memory" if campaign.folder is None else campaign.folder.resolve().name
    return FrfIdentification(
        robot, source, joints, campaign, fit, fit.half(), covariance,
        left_over(fit.problem, fit.mean),
        left_over(problem, stated), convention,
        gain if convention == "modal" else -gain,
    )  # fmt: skip


def _whole(problem: FrfProblem, begin: FloatArray) -> Fit:
    """The fit of everything, begun at springs and damping (2 n,) fitted alone."""
    at = np.zeros(len(problem.precision))
    at[: problem.springs] = begin
    fit = climb(problem, at, TAILS)
    # Without nuisances a joint hardly seen makes up for what masses and places are off by.
    known = np.concatenate([problem.prior.std, problem.damping_std])
    strays = np.abs(begin) > _STRAY * known
    if strays.any():
        at[: problem.springs][strays] = 0.0
        fit = max(fit, climb(problem, at, TAILS), key=lambda found: found.evidence)
    return fit


def _by_modes(fit: Fit) -> FloatArray:
    """The covariance (2 n, 2 n) of springs and damping, wider where modes differ more than told.

    Under dashpots in the joints no ratio of the modes holds at all poses: what the modes are then
    off by is more than their tolerance.
    """
    problem: FrfProblem = fit.problem
    found = fit.covariance[: problem.springs, : problem.springs].copy()
    count = problem.modal * len(problem.standings)
    if not count:
        return found
    own = fit.mean[-count:] ** 2 + np.diag(fit.covariance)[-count:]
    found[problem.joints :, problem.joints :] *= max(1.0, float(own.mean()))
    return found


def _joints(
    robot: FlexibleRobot,
    fit: Fit,
    covariance: FloatArray,
    modal: Fit,
    of_modes: FloatArray,
) -> tuple[IdentifiedJoint, ...]:
    problem: FrfProblem = fit.problem
    n = problem.joints
    names = (
        *(f"the stiffness of {name}" for name in robot.flexible_names),
        *(f"the damping of {name}" for name in robot.flexible_names),
        *problem.steps,
        *("a mode's damping" for _ in range(problem.modal * len(problem.standings))),
    )
    known = np.diag(fit.data_information)[:n] + np.diag(np.linalg.inv(problem.prior.covariance))
    told = Told(
        fit.mean[:n], covariance[:n, :n], problem.prior.std, 1.0 / np.sqrt(known), fit.half(),
        names, fit.covariance, tuple(_moved(fit, k) for k in range(n)), ("",) * n, np.zeros(n),
    )  # fmt: skip
    found = stiffness_of(robot.flexible_joints, told)
    for k, away in enumerate(np.abs(fit.mean[:n]) / problem.prior.std):
        if away > _INCREDIBLE:
            why = "far from all that was thought possible before: it makes up for something else"
            found[k] = replace(found[k], told=False, why=why)
    half, joints = modal.half(), []
    for k, joint in enumerate(robot.flexible_joints):
        if not is_drive(joint.name):
            continue
        size = float(math.sqrt(of_modes[n + k, n + k]))
        value = float(problem.damping_ratio[k] * math.exp(modal.mean[n + k]))
        reach = math.exp(half * size)
        sure = 0.5 * (reach - 1.0 / reach) <= MOST_HALF and size < 0.5 * problem.damping_std[k]
        why = "as the modes show it" if sure else f"within a factor of {spoken.number(reach, 2)}"
        ratio = Identified(value, value / reach, value * reach, bool(sure), why)
        joints.append(IdentifiedJoint(joint.name, found[k], ratio))
    return tuple(joints)


def _moved(fit: Fit, k: int) -> str:
    """Which function tells a joint most, in words."""
    total = float(fit.information[:, k].sum())
    if not total > 1.0:
        return ""
    ends = np.cumsum([len(table) for table in fit.problem.tables])[:-1]
    shares = [float(part.sum()) for part in np.split(fit.information[:, k], ends)]
    best = int(np.argmax(shares))
    return f"told most by {fit.problem.tables[best].file} ({100 * shares[best] / total:.2g} %)"
