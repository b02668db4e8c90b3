"""One joint under its controller, simulated forwards: what would the drive have done?

The inverse model takes the measured motion for granted. Where the control law is known the whole
loop can be run instead: reference in, motion and torque out. Errors of the model then show as
errors of both, and encoder noise enters nowhere.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.model.effects.effect import Effect
from picchio.model.motion import Motion

_SUBSTEPS = 4
_GRID = 4001


@dataclass(frozen=True)
class CascadeLaw:
    """Position loop around a velocity loop: force = gtau (kp kv (reference - x) - kv v).

    Attributes:
        kp: 1/s.
        kv: V s/m (V s/rad).
        gtau: N/V (N m/V).
        limit: V, of the drive.
    """

    kp: float
    kv: float
    gtau: float
    limit: float = math.inf

    @classmethod
    def from_controller(cls, controller: Mapping[str, Any] | None) -> CascadeLaw:
        """From a campaign's `[controller]`: kp, kv, gtau and, optionally, voltage_limit.

        Args:
            controller: the campaign's table.

        Raises:
            InputError: a key is missing or no number.
        """
        table = dict(controller or {})
        try:
            limit = float(table.get("voltage_limit", math.inf))
            return cls(float(table["kp"]), float(table["kv"]), float(table["gtau"]), limit)
        except KeyError as error:
            raise InputError("the control law is not known: the key is missing",
                             key=f"controller.{error.args[0]}") from None  # fmt: skip
        except (TypeError, ValueError):
            raise InputError("must be a number", key="controller") from None


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """What the loop did: (m,) each.

    Attributes:
        position: m or rad.
        velocity: m/s or rad/s.
        torque: the drive's, N or N m.
    """

    position: FloatArray
    velocity: FloatArray
    torque: FloatArray


def simulate_closed_loop(
    law: CascadeLaw,
    reference: FloatArray,
    rate: float,
    inertia: float,
    friction: Callable[[float], float],
    *,
    start: tuple[float, float] = (0.0, 0.0),
) -> ClosedLoop:
    """Run the loop: the law is sampled and its torque held, the joint moves in between.

    Dry friction holds a joint that stands until the torque overcomes it.

    Args:
        law: the controller.
        reference: (m,) m or rad.
        rate: samples a second, Hz.
        inertia: kg or kg m^2; constant.
        friction: velocity -> N or N m against positive motion; its jump at zero is dry friction.
        start: position and velocity.

    Returns:
        position, velocity and the drive's torque.
    """
    samples = reference.size
    step = 1.0 / (rate * _SUBSTEPS)
    position, velocity, torque = np.empty(samples), np.empty(samples), np.empty(samples)
    forwards, backwards = friction(1e-9), friction(-1e-9)
    x, v = start
    for i in range(samples):
        volts = law.kp * law.kv * (reference[i] - x) - law.kv * v
        force = law.gtau * min(max(volts, -law.limit), law.limit)
        position[i], velocity[i], torque[i] = x, v, force
        for _ in range(_SUBSTEPS):
            if v == 0.0 and backwards <= force <= forwards:
                continue
            against = friction(v) if v != 0.0 else (forwards if force > forwards else backwards)
            faster = v + step * (force - against) / inertia
            # Through zero within the step: stand there, and see in the next whether it holds.
            if v * faster < 0.0:
                x, v = x + 0.5 * step * v, 0.0
                continue
            x, v = x + 0.5 * step * (v + faster), faster
    return ClosedLoop(position, velocity, torque)


def friction_curve(effects: Sequence[Effect], joint: str, fastest: float) -> Callable[
        [float], float]:  # fmt: skip
    """Friction over velocity, of all effects that give one from the velocity alone.

    Args:
        effects: other effects are passed over.
        joint: whose.
        fastest: m/s or rad/s, up to which it is wanted.

    Returns:
        a function from velocity to N or N m.
    """
    half = np.geomspace(1e-6 * fastest, 1.5 * fastest, _GRID)
    grid = np.concatenate([-half[::-1], half])
    zero = np.zeros_like(grid)
    total = zero.copy()
    for effect in effects:
        if effect.target != joint or "friction" not in effect.name:
            continue
        motion = Motion(
            rate=1e9, angle={joint: zero}, velocity={joint: grid}, acceleration={joint: zero},
            still={joint: 0.0}, body={joint: zero}, stiffness={}, gear_ratio={joint: 1.0},
            tool="", loads=lambda frame: {}, link=lambda link: np.zeros(10),
        )  # fmt: skip
        effect.motion(motion)
        for _, name, values in motion.added:
            if name == joint:
                total = total + values
    table = total.tolist()
    first, count = math.log(half[0]), (_GRID - 1) / math.log(half[-1] / half[0])

    def curve(velocity: float) -> float:
        size = min(max(abs(velocity), half[0]), half[-1])
        place = (math.log(size) - first) * count
        k = min(int(place), _GRID - 2)
        part = place - k
        i, j = (_GRID + k, _GRID + k + 1) if velocity > 0.0 else (_GRID - 1 - k, _GRID - 2 - k)
        return table[i] * (1.0 - part) + table[j] * part

    return curve
