"""Where an identification from records of blows begins, if stiffness is far from what is stated."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from picchio.campaign.campaign import Campaign
from picchio.core import spoken
from picchio.diagnosis.percussion.conclude.holdout import holdout_gain
from picchio.diagnosis.percussion.data.problem import Problem, held_out
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.search.far import Rough, far_from_stated
from picchio.diagnosis.stiffness.mixed import with_stiffness
from picchio.diagnosis.stiffness.prior import UNKNOWN
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.spread import Spread
from picchio.robot.varied import robot_with

# Logarithms: how far what is found from nothing may be off, at least.
_STIFFNESS, _DAMPING = 0.05, 0.3
_APART = 2.0  # times that, beyond which a fit in time is in another basin
_SURER = 3.0  # times the deviation that the lines' noise alone has


@dataclass(frozen=True, eq=False)
class Begun:
    """A robot with stiffness and damping found from nothing.

    Attributes:
        robot: with these values and how far they may be off.
        found: the same over the stated.
        nrmse: what the stated values leave of the records that a diagnosis holds out.
    """

    robot: FlexibleRobot
    found: Rough
    nrmse: float

    def contradicts(self, joint: str, stiffness: float) -> bool:
        """Whether a stiffness is farther from what was found than that may be off.

        Args:
            joint: its name.
            stiffness: N m/rad or N/m.
        """
        known = self.robot.spreads[f"stiffness.{joint}"]
        off = math.log(max(stiffness, 1e-300) / float(known.value))  # type: ignore[arg-type]
        return abs(off) > _APART * known.size

    def to_dict(self, stated: FlexibleRobot) -> dict[str, Any]:
        """What was found over the stated values, for JSON.

        Args:
            stated: the robot as its files have it.
        """
        names, found = stated.flexible_names, self.found
        return {
            "stiffness_over_stated": dict(zip(names, found.stiffness.tolist(), strict=True)),
            "damping_over_stated": found.damping,
            "left": {"before": found.before, "after": found.left},
        }

    def said(self, stated: FlexibleRobot) -> str:
        """What was far from stated, in a sentence.

        Args:
            stated: the robot as its files have it.
        """
        factors = ", ".join(
            f"{name} {factor:.3g}"
            for name, factor in zip(stated.flexible_names, self.found.stiffness, strict=True)
        )
        return (
            "The stated stiffness is far off. So the springs were first found from the blows "
            "alone, and the records were then fitted from there. Roughly, as a factor of what was "
            f"stated: {factors}; damping {self.found.damping:.2g}. The stated values leave "
            f"{spoken.per_cent(self.found.before)} % of the response unexplained, these "
            f"{spoken.per_cent(self.found.left, 2)} %."
        )


def begin(robot: FlexibleRobot, campaign: Campaign) -> Begun | None:
    """The robot with stiffness and damping as the records have them.

    Args:
        robot: as its files have it.
        campaign: with records of blows.

    Returns:
        None where its stated stiffness will do.

    Raises:
        InputError: records that can't be predicted for this robot.
    """
    problem = Problem(robot, campaign)
    found = far_from_stated(problem, problem.records)
    if found is None:
        return None
    factor = {joint.name: found.damping for joint in robot.flexible_joints}
    ratios = [
        Spread("joint", joint.name, ("damping_ratio",), joint.damping_ratio * factor[joint.name],
               _DAMPING, True)
        for joint in robot.flexible_joints
    ]  # fmt: skip
    damped = replace(
        robot_with(robot, [(one, one.value) for one in ratios]),
        spreads=dict(robot.spreads) | {one.name: one for one in ratios},
    )
    size = np.clip(_SURER * found.stiffness_std, _STIFFNESS, UNKNOWN)
    stated = Hypothesis.nominal(problem)
    nrmse = holdout_gain(problem, stated, stated, *held_out(problem)[0]).baseline_nrmse
    return Begun(with_stiffness(damped, np.log(found.stiffness), np.diag(size**2)), found, nrmse)
