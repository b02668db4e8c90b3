"""False brinelling: what is known of a bearing that swings in one place under blows.

No catalogue and no standard gives a life for it, so none is given here: only the indicators that
the literature uses, and a class of risk.

The bearing is the reducer's output bearing, whose rings turn against each other by the joint's
deflection. A swing of phi (rad, end to end) moves each contact by x = phi d_p / 4 along its raceway
(the rollers go half as far as the ring). What matters is x over the contact's width 2b: below 1
the contact never leaves its own place and standstill marks form, above 1 false brinelling
(amplitude ratio: Lubricants 2023, 11, 311, doi 10.3390/lubricants11070311). In tests of real pitch
bearings every steady oscillation wore the raceway, whatever load, speed and amplitude, and none did
with longer movements in between (Behnke and Schleich 2023, doi 10.5194/wes-8-289-2023); under some
conditions wear was severe after 250,000 cycles (Schwack et al. 2020,
doi 10.1016/j.wear.2020.203335). So the class depends on whether the joint moves between the poses
of its task by more than a contact's width (how long a longer movement must be is nowhere said: the
width is picchio's reading). The wave generator's and the cranks' bearings are not
judged: no maker publishes them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from picchio.core.arrays import FloatArray
from picchio.robot.drives.reducer import OutputBearing

Risk = Literal["high", "medium", "low", "not known"]
RISKS: tuple[Risk, ...] = get_args(Risk)

SEVERE_CYCLES = 250_000
_C0_PRESSURE = 4000e6  # Pa, of roller bearings at their static load rating (ISO 76)
_C0_FACTOR = 44e6  # Pa, of radial roller bearings in C0 (ISO 76)
_EFFECTIVE_MODULUS = 206e9 / (2.0 * (1.0 - 0.3**2))  # Pa, steel on steel
_ANGLE = math.radians(45.0)  # of crossed rollers
# Crossed rollers are about as long as thick, stand a fifth of that apart, and every second one
# carries in each direction: half of them share a moment.
_SHARE_OF_CIRCLE = 0.5 / 1.2


@dataclass(frozen=True)
class FalseBrinelling:
    """The indicators for one joint over a task; never a life.

    Attributes:
        risk: low (the joint moves on after every pose), medium (after some), high (it never moves,
            or stays for 250,000 cycles), or not known.
        ratio: travel of the contact over its width, largest over the poses; NaN if not known.
        travel: m, of the contact along its raceway, end to end, there; likewise.
        contact_width: m, 2b, at the moment that the catalogue allows; a smaller moment gives a
            narrower contact and a larger ratio, by the square root; likewise.
        cycles: of the swing, the most at one place in a pass of the task.
        pose: index of the pose with the largest swing, counted over all operations.
        why: in a sentence.
    """

    risk: Risk
    ratio: float
    travel: float
    contact_width: float
    cycles: float
    pose: int
    why: str

    def to_dict(self) -> dict[str, Any]:
        """As plain values; the pose counted from 1, as text and tables do."""
        return vars(self) | {"pose": self.pose + 1}

    @property
    def sentence(self) -> str:
        """The indicators as a report says them; never a life."""
        text = f"risk of false brinelling of the output bearing: {self.risk} ({self.why})"
        if math.isnan(self.ratio):
            return text
        return (
            f"{text}; at most {self.cycles:,.0f} cycles at one place in a pass, which move a "
            f"contact by up to {1e3 * self.travel:.2g} mm, {self.ratio:.2g} of its width"
        )


def roller_diameter(bearing: OutputBearing) -> float:
    """The rollers' diameter that fits a crossed roller bearing's static load rating, m.

    From C0 = 44 (1 - D cos a / d_p) Z L D cos a (ISO 76; mm, N) with L = D and the number of
    rollers that fill the pitch circle: an estimate.

    Args:
        bearing: pitch diameter and static load rating.

    Returns:
        D.
    """
    pitch, cosine = bearing.pitch_diameter, math.cos(_ANGLE)
    per_metre = _C0_FACTOR * math.pi * pitch * _SHARE_OF_CIRCLE * cosine
    # D (1 - D cos a / d_p) = C0 / per_metre, the smaller root.
    target = bearing.static_load_rating / per_metre
    inside = max(1.0 - 4.0 * target * cosine / pitch, 0.0)
    return pitch / (2.0 * cosine) * (1.0 - math.sqrt(inside))


def contact_width(bearing: OutputBearing) -> float:
    """Width 2b of the most loaded contact at the moment that the catalogue allows, m.

    Line contact by Hertz, scaled from 4000 MPa at the static load rating; the moment M counts as a
    load of 2 M / d_p (as makers of crossed roller rings count it).

    Args:
        bearing: the output bearing.

    Returns:
        2b.
    """
    load = 2.0 * bearing.permissible_moment / bearing.pitch_diameter
    pressure = _C0_PRESSURE * math.sqrt(load / bearing.static_load_rating)
    half = pressure * roller_diameter(bearing) / _EFFECTIVE_MODULUS
    return 2.0 * half


def swings(turning_points: FloatArray) -> tuple[float, int]:
    """The largest swing of a joint, and how many cycles reach a tenth of it.

    Args:
        turning_points: (k,) rad, of the deflection over a rivet.

    Returns:
        end to end in rad, and the number of cycles.
    """
    steps = np.abs(np.diff(turning_points))
    largest = float(np.ptp(turning_points))
    if largest == 0.0:
        return 0.0, 0
    return largest, math.ceil(0.5 * np.count_nonzero(steps >= 0.1 * largest))


def false_brinelling(
    bearing: OutputBearing | None,
    swing: ArrayLike,
    cycles: ArrayLike,
    positions: ArrayLike,
) -> FalseBrinelling:
    """Indicators and class of risk of a joint over a task's poses, in their order.

    Args:
        bearing: the reducer's output bearing, where it is known.
        swing: (p,) rad, end to end, of the joint's deflection at each pose.
        cycles: (p,) of the swing at each pose, in one pass.
        positions: (p,) rad, where the joint stands; the task starts over after the last.

    Returns:
        the indicators; "not known" without a bearing, and what would tell.
    """
    angle, count = np.asarray(swing, dtype=float), np.asarray(cycles, dtype=float)
    worst = int(np.argmax(angle))
    if bearing is None:
        why = (
            "no output bearing is known: its pitch diameter, static load rating and permissible "
            "moment in a catalogue (output_bearing, --reducers FILE) would tell"
        )
        return FalseBrinelling(
            "not known", math.nan, math.nan, math.nan, float(count.max()), worst, why
        )
    width = contact_width(bearing)
    travel = angle * bearing.pitch_diameter / 4.0
    where = np.asarray(positions, dtype=float)
    moved = np.abs(np.roll(where, -1) - where) * bearing.pitch_diameter / 4.0 > width + travel
    longest = _longest_stay(count, moved)
    ratio = float(travel[worst] / width)
    risk: Risk
    if not angle.any():
        risk, why = "low", "nothing swings"
    elif not moved.any():
        risk, why = "high", "the joint stands in one place all through the task"
    elif longest >= SEVERE_CYCLES:
        risk, why = "high", f"it stays in one place for {longest:,.0f} cycles"
    elif moved.all():
        risk, why = "low", "after every pose the joint moves on by more than a contact's width"
    else:
        risk, why = "medium", "the joint does not move on after every pose"
    return FalseBrinelling(risk, ratio, float(travel[worst]), width, longest, worst, why)


def _longest_stay(cycles: FloatArray, moved: np.ndarray) -> float:
    """The most cycles between two movements, round and round."""
    if not moved.any():
        return float(cycles.sum())
    # Start just behind a movement, so that no stay is cut in two.
    start = int(np.argmax(moved)) + 1
    turned, ends = np.roll(cycles, -start), np.roll(moved, -start)
    stay = np.concatenate([[0], np.cumsum(ends)[:-1]])
    return float(np.bincount(stay, weights=turned).max())
