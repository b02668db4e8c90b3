"""A body's ten inertial numbers, and the form in which they stay physically possible.

Mass m, first moments m c and inertia about the frame's origin are linear in a robot's torques. A
body that can exist has a pseudo-inertia, the (4, 4) second moments of its mass over (x, y, z, 1),
that is positive definite: then its mass, its inertia and their triangle inequalities are right.

Source: Wensing, Kim, Slotine, IEEE Robotics and Automation Letters 3(1), 2018.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from picchio.core.arrays import FloatArray

_INERTIA = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))
_THIN = 1e-6  # of the largest second moment: what a body is given that a file has as a point


def pseudo_inertia(ten: FloatArray) -> FloatArray:
    """The pseudo-inertia (4, 4) of ten inertial numbers.

    Args:
        ten: (10,) mass, kg, first moments x, y, z, kg m, and inertia xx, xy, yy, xz, yz, zz about
            the frame's origin, kg m^2, in Pinocchio's order.
    """
    inertia = np.empty((3, 3))
    for value, (i, j) in zip(ten[4:], _INERTIA, strict=True):
        inertia[i, j] = inertia[j, i] = value
    found = np.empty((4, 4))
    found[:3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    found[:3, 3] = found[3, :3] = ten[1:4]
    found[3, 3] = ten[0]
    return found


def ten_numbers(pseudo: FloatArray) -> FloatArray:
    """The ten inertial numbers (10,) of a pseudo-inertia.

    Args:
        pseudo: (4, 4), as `pseudo_inertia` gives it.
    """
    moments = pseudo[:3, :3]
    inertia = np.trace(moments) * np.eye(3) - moments
    return np.array([pseudo[3, 3], *pseudo[:3, 3], *(inertia[i, j] for i, j in _INERTIA)])


def body(mass: float, centre: Sequence[float] | FloatArray, extent: Sequence[float]) -> FloatArray:
    """The ten inertial numbers (10,) of a body whose principal axes are the frame's.

    Args:
        mass: kg.
        centre: (3,) m, of mass.
        extent: (3,) m^2, mean square distance from the centre along x, y, z.
    """
    pseudo = np.ones((4, 4))
    pseudo[:3, :3] = np.outer(centre, centre) + np.diag(extent)
    pseudo[:3, 3] = pseudo[3, :3] = centre
    return ten_numbers(mass * pseudo)


def point(mass: float, place: Sequence[float] | FloatArray) -> FloatArray:
    """The ten inertial numbers (10,) of a point mass.

    Args:
        mass: kg.
        place: (3,) m, in the frame.
    """
    x, y, z = map(float, place)
    own = (1.0, x, y, z, y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y)
    return mass * np.array(own)


def turning(moment: float, axis: FloatArray) -> FloatArray:
    """The ten inertial numbers (10,) of what has no mass and turns about one axis only.

    Args:
        moment: kg m^2, about the axis.
        axis: (3,) unit vector.
    """
    inertia = moment * np.outer(axis, axis)
    return np.array([0.0, 0.0, 0.0, 0.0, *(inertia[i, j] for i, j in _INERTIA)])


def in_frame(rotation: FloatArray, place: FloatArray) -> FloatArray:
    """(10, 10) by which a body's ten numbers in one frame become those in another.

    Args:
        rotation: (3, 3) of the first frame in the second.
        place: (3,) m, its origin there.
    """
    turn = np.eye(4)
    turn[:3, :3], turn[:3, 3] = rotation, place
    return np.column_stack([
        ten_numbers(turn @ pseudo_inertia(one) @ turn.T) for one in np.eye(10)
    ])  # fmt: skip


def stretched(ten: FloatArray, changes: Sequence[float]) -> FloatArray:
    """The ten numbers (10,) of a body whose mass is changed, moved, stretched and sheared.

    The pseudo-inertia A A^T becomes A (e^m U U^T) A^T with U upper triangular: whatever the changes
    are, the body can exist, and with none of them it is itself.

    Args:
        ten: (10,) of the body; one that cannot exist is taken as the nearest that can.
        changes: (10,) logarithm of the mass's factor; shift of the centre of mass along the body's
            axes, over its extent; logarithms of its stretch; shears xy, xz, yz.

    Source: Rucker, Wensing, IEEE Robotics and Automation Letters 7(2), 2022 (log-Cholesky).
    """
    size, vectors = np.linalg.eigh(pseudo_inertia(ten))
    whole = (vectors * np.maximum(size, _THIN * size[-1])) @ vectors.T
    # Upper triangular A of A A^T: Cholesky from the last row up.
    own = np.linalg.cholesky(whole[::-1, ::-1])[::-1, ::-1]
    mass, *rest = changes
    upper = np.eye(4)
    upper[:3, 3] = rest[:3]
    upper[np.diag_indices(3)] = np.exp(rest[3:6])
    upper[0, 1], upper[0, 2], upper[1, 2] = rest[6:]
    made = own @ upper
    return np.asarray(ten + ten_numbers(np.exp(mass) * made @ made.T - whole))


def point_masses(ten: FloatArray, reach: float) -> list[tuple[float, tuple[float, ...]]]:
    """Ten point masses, some of them negative, that are together what a body is.

    Args:
        ten: (10,) of the body.
        reach: m, how far from the origin they stand.

    Returns:
        (kg, (3,) m) each.
    """
    points, inverse = _ten_points(reach)
    return list(zip((inverse @ ten).tolist(), points, strict=True))


@cache
def _ten_points(reach: float) -> tuple[list[tuple[float, ...]], FloatArray]:
    """Where ten point masses stand, and what makes their kg of a body's ten numbers, (10, 10)."""
    x, y, z = reach * np.eye(3)
    points = np.array([0 * x, x, -x, y, -y, z, -z, x + y, x + z, y + z])
    columns = np.column_stack([point(1.0, p) for p in points])
    return [tuple(p) for p in points.tolist()], np.linalg.inv(columns)
