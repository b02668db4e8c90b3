"""Loadings and functions in one campaign: what the loads tell is known before the functions.

Both posteriors are normal in the logarithms of the stiffness, so the order changes nothing: the
one's is the other's prior. Zeros, places and gravity's stiffness are numbers of their own in
either, which counts a little less than both together could tell.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from picchio.campaign.campaign import Campaign
from picchio.core.arrays import FloatArray
from picchio.core.provenance import provenance
from picchio.diagnosis.identified import (
    FORMAT,
    Compared,
    Identification,
    IdentifiedJoint,
    Method,
    ModeSeen,
    PoseLeft,
)
from picchio.diagnosis.stiffness.frf import FrfIdentification, identify_frf
from picchio.diagnosis.stiffness.joints import MOST_HALF
from picchio.diagnosis.stiffness.prior import prior_of
from picchio.diagnosis.stiffness.static import StaticIdentification, identify_static
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.spread import Posterior, Spread
from picchio.robot.varied import robot_with

_APART = 3.3  # deviations between the two kinds, beyond which they disagree: 1 of 1,000 joints


class ByBoth(Method):
    """Springs and damping from static loadings and frequency response functions together."""

    name = "static and frf"
    kinds = frozenset({"static", "clamped", "frf", "tap"})
    needs_springs = kinds

    def identify(
        self,
        robot: FlexibleRobot,
        campaign: Campaign,
        *,
        workers: int | None = None,
        progress: Callable[[str], None] | None = None,
    ) -> Identification:
        """The loadings first."""

        def of(static: bool) -> Campaign:
            kept = tuple(r for r in campaign if (r.kind in ("static", "clamped")) == static)
            return replace(campaign, records=kept)

        loads = identify_static(robot, of(True), progress=progress)
        known = with_stiffness(robot, loads.answer.mean, loads.answer.covariance)
        functions = identify_frf(known, of(False), progress=progress)
        joints = tuple(_joint(robot, k, loads, functions) for k in range(len(functions.joints)))
        return BothIdentification(robot, functions.source, joints, campaign, loads, functions)


@dataclass(frozen=True, eq=False, repr=False)
class BothIdentification(Identification):
    """What loadings and functions say together.

    Attributes:
        campaign: all records.
        loads: what the loadings say alone.
        functions: what the functions say, the loadings known.
    """

    campaign: Campaign
    loads: StaticIdentification
    functions: FrfIdentification

    @property
    def apart(self) -> FloatArray:
        """(n,) how far the functions move each joint from what the loads say, deviations."""
        n = len(self.robot.flexible_joints)
        before = np.diag(self.loads.answer.covariance)
        after = np.diag(self.functions.covariance)[:n]
        # What is left of the loads' own spread moves with them.
        moved = np.maximum(before - after, 0.01 * before)
        return np.asarray(self.functions.fit.mean[:n] / np.sqrt(moved))

    @property
    def doubt(self) -> str:
        """That the two kinds of test contradict each other, or the functions' own doubt."""
        far = np.flatnonzero(np.abs(self.apart) > _APART)
        if not len(far):
            return self.functions.doubt
        names = ", ".join(
            f"{self.robot.flexible_names[k]} by {abs(self.apart[k]):.1f} deviations" for k in far
        )
        return f"loads and functions disagree: {names}; something else yields in one of them"

    @property
    def remarks(self) -> tuple[str, ...]:
        """Those of both."""
        return (*self.loads.remarks, *self.functions.remarks)

    def compared(self) -> list[Compared]:
        """Those of both."""
        return [*self.loads.compared(), *self.functions.compared()]

    def modes(self) -> list[ModeSeen]:
        """Those of the functions."""
        return self.functions.modes()

    def by_pose(self) -> list[PoseLeft]:
        """Those of both."""
        return [*self.loads.by_pose(), *self.functions.by_pose()]

    def sidecar_text(self) -> str:
        """See `Identification`: spreads and correlations after both."""
        return replace(self.functions, joints=self.joints, campaign=self.campaign).sidecar_text()

    def _content(self) -> Mapping[str, Any]:
        loads, functions = self.loads._content(), self.functions._content()
        left = functions["residual"]
        return {
            **loads,
            **functions,
            "residual": {
                **loads["residual"],
                "functions": {"before": left["before"], "after": left["after"]},
            },
            "noise": {**loads["noise"], **functions["noise"]},
            "format": FORMAT,
            "robot": self.robot.name,
            "method": ByBoth.name,
            "joints": self.joints,
            "also": self.loads.causes,
            "provenance": provenance([*self.robot.files, *self.campaign.files]),
        }

    def _headline(self) -> str:
        return (
            f"{self._told()} told by {self.loads.read} and {self.functions.fit.problem.rows} lines"
        )


def with_stiffness(robot: FlexibleRobot, mean: FloatArray, covariance: FloatArray) -> FlexibleRobot:
    """The robot with what tests told of its springs, for further ones.

    Args:
        robot: as it was before.
        mean: (n,) logarithms of the stiffness over the stated ones.
        covariance: (n, n) of them.

    Returns:
        with these medians, spreads and correlations.
    """
    size = np.sqrt(np.diag(covariance))
    springs = [
        Spread("joint", joint.name, ("stiffness",), joint.stiffness * math.exp(off), float(s), True)
        for joint, off, s in zip(robot.flexible_joints, mean, size, strict=True)
    ]
    names = tuple(one.name for one in springs)
    others = {name: one for name, one in robot.spreads.items() if name not in names}
    matrix = covariance / np.outer(size, size)
    matrix = 0.5 * (matrix + matrix.T)
    np.fill_diagonal(matrix, 1.0)
    moved = robot_with(robot, [(one, one.value) for one in springs])
    return replace(
        moved, spreads=others | {one.name: one for one in springs},
        posterior=Posterior(names=names, correlation=matrix.tolist()),
    )  # fmt: skip


def _joint(
    robot: FlexibleRobot, k: int, loads: StaticIdentification, functions: FrfIdentification
) -> IdentifiedJoint:
    """A drive's numbers after both, told by what was known before either."""
    joint, alone = functions.joints[k], loads.joints[k]
    one = joint.stiffness
    n = robot.flexible_names.index(joint.name)
    before, size = prior_of(robot).std[n], math.sqrt(functions.covariance[n, n])
    told = 0.5 * (one.high - one.low) <= MOST_HALF * one.value and size < 0.5 * before
    why = f"by loads: {alone.stiffness.why}; by functions, the loads known: {one.why}"
    return replace(joint, stiffness=replace(one, told=bool(told), why=why))
