"""Quantities of robots' joints as signs of one size, a robot's and a joint's, with gaps.

The logarithm y of quantity i of a joint is

    y_i = V_i + C_i x + b_i d + e_i,        e_i ~ N(0, w_i), d ~ N(0, 1)      (a joint)
    V_i = m_i + a_i D + u_i,                u_i ~ N(0, v_i), D ~ N(0, 1)      (its robot)

with x the joint's place in the chain; V of what is asked for (the first quantities) has g added,
the shift of the robot's class of drives. So each quantity tells of the sizes D and d as well as its
scatter lets it, on each level; together they predict what is asked for, and errors of one robot
correlated through D and u. It is factor analysis on two levels. A quantity that is not known is
not there: nothing is filled in. A class that is not known is drawn, too, with probabilities that
the robots teach. What is predicted is a mixture over draws of the posterior, so its tails are as
wide as few robots make them; `benchmarks/drive_fit.py` makes the draws.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Group:
    """A robot's table.

    Attributes:
        values: (n, p) logarithms, NaN where not known.
        place: (n, q) covariates of its joints.
        asked: (n,) which quantity is asked for of each joint, one of the first.
        kind: which class of drives; None if not known.
    """

    values: Array
    place: Array
    asked: NDArray[np.intp]
    kind: int | None = None


@dataclass(frozen=True, eq=False)
class Draws:
    """d draws from the posterior, named as in the module's text.

    Attributes:
        targets: how many quantities can be asked for.
        mean: (d, p) m.
        shift: (d, c) g, of each class.
        size: (d, p) a.
        scatter: (d, p) v, variances.
        contrast: (d, p, q) C.
        joint_size: (d, p) b.
        joint_scatter: (d, p) w, variances.
        share: (d, c) of robots of each class.
    """

    targets: int
    mean: Array
    shift: Array
    size: Array
    scatter: Array
    contrast: Array
    joint_size: Array
    joint_scatter: Array
    share: Array


def predict(draws: Draws, group: Group, *, given: bool = False) -> tuple[Array, Array, Array]:
    """What is asked for of a robot's joints, given what is known of the rest, as a mixture.

    Args:
        draws: of the posterior.
        group: the robot.
        given: read also the quantities that can be asked for: those of a joint that are known
            stand as they are, and tell of the others. Else they are not read.

    Returns:
        weights (k,), means (k, n) and covariances (k, n, n) of the parts.
    """
    n = len(group.values)
    joint, asked = np.arange(n), group.asked
    there = ~np.isnan(group.values)
    there[:, : draws.targets] &= given
    rows, columns = np.nonzero(there)
    data = group.values[rows, columns]
    same, own_row = rows[:, None] == rows, joint[:, None] == rows

    def cov(ones: NDArray[np.intp], others: NDArray[np.intp], alike: Array) -> Array:
        """(d, len(ones), len(others)) of quantities, of one joint where `alike`."""
        equal = ones[:, None] == others
        a, b = draws.size, draws.joint_size
        between = a[:, ones, None] * a[:, None, others] + equal * draws.scatter[:, None, others]
        within = b[:, ones, None] * b[:, None, others]
        return between + alike * (within + equal * draws.joint_scatter[:, None, others])

    centre = draws.mean[:, None] + np.einsum("nq,dpq->dnp", group.place, draws.contrast)
    cross = cov(asked, columns, own_row)
    gain = np.linalg.solve(cov(columns, columns, same), cross.swapaxes(1, 2)).swapaxes(1, 2)
    means = centre[:, joint, asked] + np.einsum("dnr,dr->dn", gain, data - centre[:, rows, columns])
    covs = cov(asked, asked, np.eye(n)) - gain @ cross.swapaxes(1, 2)
    kinds = range(draws.share.shape[1]) if group.kind is None else [group.kind]
    weight = draws.share[:, kinds] / draws.share[:, kinds].sum(axis=1, keepdims=True)
    moved = means[:, None] + draws.shift[:, kinds, None]
    return (
        (weight / len(weight)).ravel(),
        moved.reshape(-1, n),
        np.repeat(covs, len(kinds), axis=0),
    )
