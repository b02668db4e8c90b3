"""How a joint's response to one rivet becomes damage: two named methods."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.fatigue import (
    SNCurve,
    damage,
    peak_damage,
    rainflow,
    shear_stress,
    shear_stress_from_deflection,
    utilisation,
)
from picchio.fatigue.mean_stress import Rule
from picchio.fatigue.rainflow import Residue
from picchio.fatigue.sn_curve import MinerRule
from picchio.robot import Joint


class History(NamedTuple):
    """A joint's turning points under one rivet.

    Attributes:
        steady: (k,) rad, over one period; None where no steady state exists.
        rest: (k,) rad, from rest to the end of the ring-down; None where it has no end.
        static: rad, deflection before the first blow, by gravity and the feed force.
        stiffness: N m/rad, of the joint at this pose.
        hits: blows.
    """

    steady: FloatArray | None
    rest: FloatArray | None
    static: float
    stiffness: float
    hits: int


class JointDamage(NamedTuple):
    """Peak deflection (rad), peak stress (Pa), utilisation and damage of one rivet."""

    peak_deflection: float
    peak_stress: float
    utilisation: float
    damage: float


class LifeRule(Protocol):
    """A method that turns a joint's history into damage."""

    def __call__(self, joint: Joint, history: History, sn_curve: SNCurve) -> JointDamage:
        """Damage of one rivet."""

    def assumptions(self) -> tuple[str, ...]:
        """What the method takes for granted, a sentence each."""


def peak(values: FloatArray | None) -> float:
    """Largest absolute value, NaN for None."""
    return float("nan") if values is None else float(np.abs(values).max())


@dataclass(frozen=True)
class RainflowRule:
    """From rest, ring-down included, cycles counted by rainflow, Miner's rule.

    Attributes:
        residue: how rainflow treats what does not close.
        mean_stress: the correction; "none" for smooth ductile shafts.
        miner: what cycles below the endurance limit do; None leaves it to the curve.
    """

    residue: Residue = "half-cycles"
    mean_stress: Rule = "none"
    miner: MinerRule | None = None

    def __call__(self, joint: Joint, history: History, sn_curve: SNCurve) -> JointDamage:
        """Damage of one rivet; needs `history.rest`."""
        assert joint.shaft is not None and history.rest is not None
        torque = history.stiffness * history.rest
        stress = shear_stress(torque, joint.shaft)
        static = float(shear_stress(history.stiffness * history.static, joint.shaft))
        cycles = rainflow(stress, residue=self.residue).shifted(static)
        return JointDamage(
            peak(history.rest),
            peak(stress),
            utilisation(cycles, sn_curve, self.mean_stress),
            damage(cycles, sn_curve, self.mean_stress, self.miner),
        )

    def assumptions(self) -> tuple[str, ...]:
        """What the method takes for granted."""
        return (
            "each rivet starts from rest and rings down before the next",
            "stress k x r / Jp at the surface of a solid round shaft",
            f"cycles by rainflow (ASTM E1049), residue as {self.residue}",
            f"mean stress (gravity, feed force): {self.mean_stress}",
            "Miner's sum of 1 is failure",
        )


@dataclass(frozen=True)
class PaperRule:
    """Nie et al. 2016: steady state, peak stress as amplitude, one cycle a hit."""

    def __call__(self, joint: Joint, history: History, sn_curve: SNCurve) -> JointDamage:
        """Damage of one rivet; needs `history.steady`."""
        assert joint.shaft is not None and history.steady is not None
        deflection = peak(history.steady)
        stress = float(shear_stress_from_deflection(deflection, joint.shaft))
        return JointDamage(
            deflection,
            stress,
            stress / sn_curve.allowable,
            peak_damage(stress, history.hits, sn_curve),
        )

    def assumptions(self) -> tuple[str, ...]:
        """What the method takes for granted."""
        return (
            "the steady state is reached at the first hit",
            "stress G r x / l (paper eqs. 14-17)",
            "the peak stress is the amplitude, and each hit is one cycle",
            "gravity and feed force leave the life alone",
            "Miner's sum of 1 is failure",
        )
