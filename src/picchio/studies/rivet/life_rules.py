"""How a joint's load under one rivet becomes damage: two named methods."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.fatigue.counting.counter import Residue
from picchio.fatigue.mean_stress import Rule
from picchio.fatigue.miner import damage, peak_damage, utilisation
from picchio.fatigue.shaft_stress import shear_stress, shear_stress_from_deflection
from picchio.fatigue.sn.curve import MinerRule, SNCurve
from picchio.fatigue.sn.library import DEFAULT_LIFE_CURVE, DEFAULT_SN_CURVE, load_sn_curve
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.joint import Joint
from picchio.studies.rivet.pose import JointLoad


class JointDamage(NamedTuple):
    """Peak deflection (rad), peak stress (Pa), utilisation and damage of one rivet."""

    peak_deflection: float
    peak_stress: float
    utilisation: float
    damage: float


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

    needs: ClassVar[str] = "rest"

    residue: Residue = "half-cycles"
    mean_stress: Rule = "none"
    miner: MinerRule | None = None

    def __call__(self, joint: Joint, load: JointLoad, hits: int, sn_curve: SNCurve) -> JointDamage:
        """Damage of one rivet; the hits are in the load already."""
        assert load.rest is not None
        rule, miner = self.of(sn_curve)
        steady = load.static_stress(joint)
        cycles = load.stress_cycles(joint, self.residue, float(sn_curve.raised_by(steady)))
        cycles = cycles.shifted(steady)
        stress = math.nan
        if joint.shaft is not None:
            stress = peak(shear_stress(load.stiffness * load.rest, joint.shaft))
        return JointDamage(
            peak(load.rest),
            stress,
            utilisation(cycles, sn_curve, rule),
            damage(cycles, sn_curve, rule, miner),
        )

    def of(self, sn_curve: SNCurve) -> tuple[Rule, MinerRule | None]:
        """The rules that hold for a curve: a drive's is whole, with its own rule for the mean.

        Args:
            sn_curve: of a shaft or a drive.
        """
        return (self.mean_stress, self.miner) if sn_curve.kind == "shear" else ("none", None)

    def assumptions(self, kinds: Collection[str]) -> tuple[str, ...]:
        """What the method takes for granted.

        Args:
            kinds: of the curves in use; none where nothing wears.
        """
        lines = ["each rivet starts from rest and rings down before the next"]
        if "shear" in kinds:
            lines.append("stress k x r / Jp at the surface of a solid round shaft")
        if kinds:
            lines.append(f"cycles by rainflow (ASTM E1049), residue as {self.residue}")
        if "shear" in kinds:
            lines.append(f"mean stress (gravity, feed force): {self.mean_stress}")
        if "torque" in kinds:
            lines.append(
                "a drive whose reducer is not known: torque cycles as shares of its limit for "
                "repeated peaks, raised by the steady torque (Goodman)"
            )
        return (*lines, "Miner's sum of 1 is failure") if kinds else tuple(lines)


@dataclass(frozen=True)
class PaperRule:
    """Nie et al. 2016: steady state, peak stress as amplitude, one cycle a hit."""

    needs: ClassVar[str] = "steady"

    def __call__(self, joint: Joint, load: JointLoad, hits: int, sn_curve: SNCurve) -> JointDamage:
        """Damage of one rivet."""
        assert joint.shaft is not None
        deflection = peak(load.steady)
        stress = float(shear_stress_from_deflection(deflection, joint.shaft))
        return JointDamage(
            deflection, stress, stress / sn_curve.allowable, peak_damage(stress, hits, sn_curve)
        )

    def assumptions(self, kinds: Collection[str]) -> tuple[str, ...]:
        """What the method takes for granted.

        Args:
            kinds: of the curves in use.
        """
        if not kinds:
            return ("the steady state is reached at the first hit",)
        return (
            "the steady state is reached at the first hit",
            "stress G r x / l (paper eqs. 14-17)",
            "the peak stress is the amplitude, and each hit is one cycle",
            "gravity and feed force leave the life alone",
            "Miner's sum of 1 is failure",
        )


LifeRule = RainflowRule | PaperRule
"""A method: it says which response it `needs`, turns a joint's load under `hits` blows into
damage (the joint has a shaft), and says what it takes for granted."""

# Which S-N curve belongs to which joint.


def curves_of(
    robot: FlexibleRobot, override: str | SNCurve | None = None, *, drives: bool = True
) -> tuple[SNCurve | None, ...]:
    """The curve of every flexible joint: of its shaft, else of its drive; None without either.

    Args:
        robot: whose shafts and drives name their curves; one that names none has the default.
        override: a curve, its name or its file, for all shafts.
        drives: False leaves out what is not a shaft.

    Raises:
        InputError: an unknown name, a curve of the wrong kind, or a file that is missing or wrong.
    """
    loaded: dict[str, SNCurve] = {}

    def named(name: str, kind: str) -> SNCurve:
        if name not in loaded:
            loaded[name] = load_sn_curve(name)
        return checked(loaded[name], kind)

    def checked(curve: SNCurve, kind: str) -> SNCurve:
        if curve.kind != kind:
            raise InputError(f"is of the kind {curve.kind}, a {_BORNE_BY[kind]} needs {kind}",
                             key="sn_curve", value=curve.name)  # fmt: skip
        return curve

    curves: list[SNCurve | None] = []
    for joint in robot.flexible_joints:
        if joint.shaft is not None:
            if isinstance(override, SNCurve):
                curves.append(checked(override, "shear"))
            else:
                curves.append(named(override or joint.shaft.sn_curve or DEFAULT_SN_CURVE, "shear"))
        elif joint.strength is not None and drives:
            curves.append(named(joint.strength.life_curve or DEFAULT_LIFE_CURVE, "torque"))
        else:
            curves.append(None)
    return tuple(curves)


_BORNE_BY = {"shear": "shaft", "torque": "drive"}
