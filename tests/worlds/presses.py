"""Arms whose tool is held fast while their motors press: an independent world for stiffness.

Sample by sample the links stand where gravity, the joints' springs and a fixture that yields
balance, by Newton's method on Pinocchio's own gravity, Jacobian and placement. The motors press one
after the other, forth and back; those that stand are held by a servo that is not infinitely stiff.
Friction is Dahl's, with a level that grows with the load, and the speed's; a drive's torque has a
gain, ripple, noise and a zero of its own. Wrong a little: link masses and joint zeros. The fixture
is from 3 to 100 times as stiff as a base whose turning counts as the stiffest joint's, in axes of
its own that do not pass through the tool.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from .loads import FACTOR, ROBOTS
from .pinocchio_chain import Chain, with_wrong_masses
from .robots import load as shipped

RATE, WAY = 20.0, 1.5  # Hz; s, from one end of a press to the other
SERVO = 60.0  # a motor that stands is held by so many times its joint's stiffness


@dataclass(frozen=True, eq=False)
class Presses:
    """A drawn campaign.

    Attributes:
        robot: name of the shipped folder.
        joints: names.
        nominal, truth: (n,) N m/rad.
        records: (columns, table) of each.
    """

    robot: str
    joints: tuple[str, ...]
    nominal: np.ndarray
    truth: np.ndarray
    records: list[tuple[dict[str, np.ndarray], dict]]


def draw(joints: int, seed: int, *, exact: bool = False, poses: int = 2, one_way: bool = False,
         factors=None) -> Presses:  # fmt: skip
    """A campaign of an arm with 3, 6 or 7 joints.

    Args:
        joints: how many.
        seed: of everything drawn.
        exact: whether nothing but the stiffness differs from the files: no friction either, and a
            fixture along the tool's axes.
        poses: records, at a pose each.
        one_way: whether each motor only presses forth, never back.
        factors: (n,) of the stiffness; drawn if None.
    """
    rng = np.random.default_rng((seed, joints, 23))
    own = shipped(ROBOTS[joints])
    off = 0.0 if exact else 1.0
    model = with_wrong_masses(own.model, rng, 0.01 * off)
    n = len(own.joints)
    nominal = np.array([curve[0] for curve in own.curves])
    drawn = np.exp(rng.uniform(-1.0, 1.0, n) * math.log(FACTOR))
    truth = nominal * (drawn if factors is None else np.asarray(factors))
    zero = 3.5e-4 * off * rng.standard_normal(n)
    gain = 1.0 + 0.03 * off * rng.standard_normal(n)
    level = own.force * 0.8 * rng.uniform(0.5, 1.0, n)  # N m, of each press
    static = off * level * rng.uniform(0.02, 0.15, n)  # N m, friction without load
    loaded, quick = off * rng.uniform(0.0, 0.06, n), off * level * rng.uniform(0.0, 0.04, n)
    before = rng.uniform(0.02, 0.12, n)  # of a press's turn, until friction has turned over
    ripple, waves = off * level * rng.uniform(0.0, 0.012, n), rng.uniform(1.0, 8.0, n)
    low, high = np.maximum(own.lower, -2.0), np.minimum(own.upper, 2.0)
    arm = _Arm(model, own.tool, own.joints)
    # What the fixture is like: six springs in axes of its own, off the tool's origin.
    axes = pin.exp3(off * rng.standard_normal(3))
    hook = 0.05 * off * rng.standard_normal(3)
    strength = np.exp(rng.uniform(math.log(3.0), math.log(100.0), 6))
    records = []
    for _ in range(poses):
        pose = rng.uniform(0.85 * low + 0.15 * high, 0.15 * low + 0.85 * high)
        stand = pose + zero
        place = arm.place(stand)
        reach = max(np.linalg.norm(place.translation), 0.2)
        size = strength * truth.max() * np.array([reach**-2] * 3 + [1.0] * 3)
        turned = np.kron(np.eye(2), place.rotation @ axes)
        shift = np.eye(6)
        shift[:3, 3:] = -pin.skew(place.rotation @ hook)
        hold = shift.T @ (turned * size) @ turned.T @ shift
        time, wanted = _presses(n, one_way)
        turn = level / truth
        position, torque = np.zeros((len(time), n)), np.zeros((len(time), n))
        link, friction = stand.copy(), np.zeros(n)
        standing = arm.gravity(stand)
        motor = stand + standing / truth
        first = motor.copy()
        carried = standing.copy()
        see = arm.jacobian(stand)
        slope = truth * np.eye(n) + arm.pull(stand) + see.T @ hold @ see
        inverse = np.linalg.inv(slope)
        for k in range(len(time)):
            sag = -(carried - standing) / (SERVO * truth)
            new = (
                first
                + wanted[k] * turn
                + np.where(wanted.any(axis=0) & (wanted[k] != 0.0), 0.0, sag)
            )
            for _ in range(40):
                step = inverse @ (
                    truth * (new - link)
                    - arm.gravity(link)
                    - arm.jacobian(link).T @ (hold @ arm.off(link, place))
                )
                link = link + step
                if np.abs(step).max() < 1e-11:
                    break
            else:
                raise RuntimeError("the equilibrium was not found")
            moved = new - motor
            motor, carried = new, truth * (new - link)
            most = static + loaded * np.abs(carried)
            width = before * turn
            for i in range(n):  # Dahl: toward the level of the way it goes
                if most[i] > 0.0:
                    aim = most[i] * np.sign(moved[i])
                    friction[i] = aim + (friction[i] - aim) * np.exp(-abs(moved[i]) / width[i])
            position[k] = motor
            torque[k] = gain * (
                carried
                + friction
                + quick * moved * RATE * WAY / (2.0 * turn)
                + ripple * np.sin(2.0 * np.pi * waves * (motor - first) / turn)
            )
        torque = torque + level * (
            0.004 * off * rng.standard_normal(torque.shape) + 0.05 * off * rng.standard_normal(n)
        )
        position = position - zero + 2e-7 * off * rng.standard_normal(position.shape)
        held = {"time": time}
        for k, name in enumerate(own.joints):
            held[f"motor_position.{name}"] = position[:, k]
            held[f"torque.{name}"] = torque[:, k]
        records.append((held, {"pose": dict(zip(own.joints, pose.tolist(), strict=True))}))
    return Presses(own.name, own.joints, nominal, truth, records)


def _presses(n: int, one_way: bool) -> tuple[np.ndarray, np.ndarray]:
    """Time (m,) and each motor's turn (m, n), -1 to 1: two rounds of each, one after the other."""
    corners = [0.0, 1.0] if one_way else [0.0, 1.0, -1.0, 1.0, -1.0, 0.0]
    per = round(RATE * WAY)
    one = np.concatenate([np.linspace(a, b, per, endpoint=False)
                          for a, b in zip(corners[:-1], corners[1:], strict=True)])  # fmt: skip
    if one_way:  # and lets go at once
        one = np.append(one, 1.0)
    rest = round(RATE * 0.5)
    found = np.zeros((n * (len(one) + rest), n))
    for k in range(n):
        first = k * (len(one) + rest) + rest
        found[first : first + len(one), k] = one
    return np.arange(len(found)) / RATE, found


class _Arm(Chain):
    """A chain whose tool is held."""

    def off(self, pose, place):
        """(6,) how far the tool is from where it was fixed: m, then rad, world axes."""
        here = self.place(pose)
        return np.concatenate([here.translation - place.translation,
                               pin.log3(here.rotation @ place.rotation.T)])  # fmt: skip
