"""What the robot's files state of the spread of its stiffness and damping, for a diagnosis.

A robot that was identified has a sidecar with a spread of each value and their correlations. These
take the place of `[tolerance]`, where the campaign does not state it itself; an estimate's do not:
how far a guess is off is for the diagnosis to say.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from picchio.campaign.tables import Tolerance
from picchio.core.arrays import FloatArray
from picchio.model.effects.effect import Effect
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.spread import Spread


@dataclass(frozen=True)
class Known:
    """Logarithms of scales that are known together, each about zero.

    Attributes:
        labels: of the nuisances.
        covariance: a row each.
    """

    labels: tuple[str, ...] = ()
    covariance: tuple[tuple[float, ...], ...] = ()

    def sigma(self, label: str) -> float | None:
        """The standard deviation of one; None where nothing is stated.

        Args:
            label: of the nuisance.
        """
        if label not in self.labels:
            return None
        k = self.labels.index(label)
        return float(np.sqrt(self.covariance[k][k]))

    def precision(self, labels: Collection[str]) -> tuple[list[str], FloatArray]:
        """Which of some nuisances are among these, and their precision, the others integrated out.

        Args:
            labels: of the nuisances.
        """
        kept = [k for k, label in enumerate(self.labels) if label in labels]
        among = np.array(self.covariance).reshape([len(self.labels)] * 2)[np.ix_(kept, kept)]
        return [self.labels[k] for k in kept], np.linalg.inv(among)


NOTHING = Known()


def known_of(robot: FlexibleRobot, nuisances: Sequence[Effect], tolerance: Tolerance) -> Known:
    """What the robot's files state.

    Args:
        robot: flexible.
        nuisances: of the campaign.
        tolerance: what the campaign states itself counts in place of it.

    Returns:
        the stiffnesses as they hang together; of the damping, which has one factor for all joints,
        the root mean square of the joints'.
    """
    labels, sizes, names = [], [], []
    for effect in nuisances:
        key = effect.tolerance
        if key in tolerance.model_fields_set:
            continue
        if key == "stiffness":
            size = _size(robot.spreads.get(f"stiffness.{effect.target}"))
        elif key == "damping_ratio":
            every = [_size(robot.spreads.get(f"{key}.{joint}")) for joint in robot.flexible_names]
            size = float(np.sqrt(np.mean(np.square(every)))) if all(every) else 0.0
        else:
            continue
        if size > 0.0:
            labels.append(effect.label)
            sizes.append(size)
            names.append(f"{key}.{effect.target}")
    matrix = np.eye(len(names))
    together = robot.posterior.among(names) if robot.posterior is not None else None
    if together is not None:
        at = [names.index(name) for name in together.names]
        matrix[np.ix_(at, at)] = np.array(together.correlation)
    # Rounded correlations may lie a hair beyond what can be.
    matrix = (matrix + 1e-6 * np.eye(len(names))) / (1.0 + 1e-6)
    covariance = np.outer(sizes, sizes) * matrix
    return Known(tuple(labels), tuple(map(tuple, covariance.tolist())))


def _size(spread: Spread | None) -> float:
    """Of the logarithm; 0 where nothing is stated, or only estimated."""
    if spread is None or spread.estimated or isinstance(spread.value, tuple):
        return 0.0
    return spread.size if spread.log else spread.size / abs(spread.value)
