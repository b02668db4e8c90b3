"""Joint stiffness and damping from frequency response functions."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from picchio.campaign.campaign import Campaign
from picchio.core.arrays import FloatArray
from picchio.core.provenance import provenance
from picchio.diagnosis.identified import FORMAT, Identification, Identified, IdentifiedJoint, Method
from picchio.diagnosis.stiffness.fit import Fit, climb
from picchio.diagnosis.stiffness.joints import MOST_HALF, Told, stiffness_of
from picchio.diagnosis.stiffness.modes import starts
from picchio.diagnosis.stiffness.prior import prior_of
from picchio.diagnosis.stiffness.responses import FrfProblem, make_problem
from picchio.diagnosis.stiffness.written import sidecar
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.joint import is_drive

_TAILS = 6.0  # degrees of freedom of the lines' errors
_FAR = 0.3  # residual over the functions beyond which the answer is doubted
_DECISIVE = 5.0  # in log evidence, for a convention of the damping
_WORDS = {
    "modal": "one ratio for each mode, the joints' weighted by strain energy",
    "joint": "a dashpot in each joint",
}


class ByResponses(Method):
    """Springs and damping fitted to frequency response functions, from nothing."""

    name = "frf"
    kinds = frozenset({"frf"})
    needs_springs = frozenset({"frf"})

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
        left: residual over the functions, each line over its scale.
        before: the same of the stated values.
        convention: of the damping that the functions follow: "modal" or "joint".
        decided: log evidence for it over the other.
    """

    campaign: Campaign
    fit: Fit
    half: float
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
            f"{100 * self.left:.2g} % of the functions are left unexplained: a joint-spring model "
            "does not follow them, and the intervals do not know that"
        )

    @property
    def remarks(self) -> tuple[str, ...]:
        """What is left, and which convention the damping follows."""
        sure = "" if self.decided > _DECISIVE else ", though the other one does about as well"
        return (
            f"{len(list(self.campaign))} functions, {self.fit.problem.rows} lines. With the stated "
            f"values {100 * self.before:.3g} % of them is left, with those found "
            f"{100 * self.left:.3g} %; nothing was held out.",
            f"Damping: {_WORDS[self.convention]}{sure} (log evidence {self.decided:+.1f}).",
        )

    def sidecar_text(self) -> str:
        """See `Identification`; a joint that is not told has a wide spread."""
        n = self.fit.problem.joints
        return sidecar(
            self.robot, self.joints, self.source, self.campaign.files, self.remarks,
            self.fit.covariance[: 2 * n, : 2 * n], damping=True,
        )  # fmt: skip

    def _content(self) -> Mapping[str, Any]:
        return {
            "format": FORMAT,
            "robot": self.robot.name,
            "method": ByResponses.name,
            "joints": [asdict(joint) for joint in self.joints],
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
        campaign: records of the kind "frf".
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
    best: Fit | None = None
    for at in begin:
        say("frequency responses: springs and damping")
        if best is not None and np.abs(at[: problem.joints] - _springs(best)).max() < 0.02:
            continue
        found = climb(problem, at, _TAILS)
        if best is None or found.evidence > best.evidence:
            best = found
    assert best is not None  # there is always the stated robot to begin at
    say("frequency responses: the other damping")
    other_problem = replace(problem, convention="joint")
    at = best.mean[: len(other_problem.precision)].copy()
    other = climb(other_problem, at, _TAILS)
    gain = best.evidence - other.evidence
    convention = "modal" if gain >= 0.0 else "joint"
    fit = best if gain >= 0.0 else other
    stated = np.zeros(len(problem.precision))
    joints = _joints(robot, fit, best)
    source = "memory" if campaign.folder is None else campaign.folder.resolve().name
    return FrfIdentification(
        robot, source, joints, campaign, fit, fit.half(), _left(fit.problem, fit.mean),
        _left(problem, stated), convention, abs(gain),
    )  # fmt: skip


def _springs(fit: Fit) -> FloatArray:
    return np.asarray(fit.mean[: fit.problem.joints])


def _left(problem: FrfProblem, at: FloatArray) -> float:
    """The residual of all functions over themselves, each function alike."""
    shares = []
    for part, table in zip(problem.predict(at), problem.tables, strict=True):
        left = np.linalg.norm(part.residual * table.scale[:, None])
        shares.append(float(left / np.linalg.norm(table.measured)))
    return math.sqrt(float(np.mean(np.square(shares))))


def _joints(robot: FlexibleRobot, fit: Fit, modal: Fit) -> tuple[IdentifiedJoint, ...]:
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
        fit.mean[:n], fit.covariance[:n, :n], problem.prior.std, 1.0 / np.sqrt(known), fit.half(),
        names, fit.covariance, tuple(_moved(fit, k) for k in range(n)), ("",) * n, np.zeros(n),
    )  # fmt: skip
    found = stiffness_of(robot.flexible_joints, told)
    half, joints = modal.half(), []
    for k, joint in enumerate(robot.flexible_joints):
        if not is_drive(joint.name):
            continue
        size = float(modal.std[n + k])
        value = float(problem.damping_ratio[k] * math.exp(modal.mean[n + k]))
        reach = math.exp(half * size)
        sure = 0.5 * (reach - 1.0 / reach) <= MOST_HALF and size < 0.5 * problem.damping_std[k]
        why = "as the modes show it" if sure else f"within a factor of {reach:.2g}"
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
