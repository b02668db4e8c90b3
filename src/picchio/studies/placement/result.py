"""What a placement study found."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from picchio.core import spoken
from picchio.core.arrays import FloatArray
from picchio.core.listing import Listing
from picchio.core.results import TableResult
from picchio.studies.placement.search import Spot
from picchio.studies.placement.sureness import Sureness

FORMAT = "picchio-placement/1"


@dataclass(frozen=True)
class JointUse:
    """One joint over the whole task.

    Attributes:
        name: of the joint.
        rivets_to_failure: of the mix; infinite where the life is unlimited or is not known.
        utilisation: largest over the rivet places; of the shaft or the reducer, or of the URDF's
            effort limit where no joint has either.
    """

    name: str
    rivets_to_failure: float
    utilisation: float


@dataclass(frozen=True, eq=False)
class Standing:
    """The work at one place, as exactly as `assess` has it.

    Attributes:
        spot: the move, the period and the poses.
        joints: one entry a flexible joint.
        base_position: (3,) m, where the base stands if the base is moved instead of the work.
        base_heading: rad, how far the base is turned then, about the vertical.
    """

    spot: Spot
    joints: tuple[JointUse, ...]
    base_position: FloatArray
    base_heading: float

    @property
    def limiting_joint(self) -> str:
        """Shortest life, or the largest utilisation where every life is unlimited."""
        return min(self.joints, key=lambda j: (j.rivets_to_failure, -j.utilisation)).name

    @property
    def rivets_to_failure(self) -> float:
        """Of the weakest joint."""
        return min(joint.rivets_to_failure for joint in self.joints)

    @property
    def utilisation(self) -> float:
        """Of the most utilised joint."""
        return max(joint.utilisation for joint in self.joints)

    def to_dict(self, centre: FloatArray) -> dict[str, Any]:
        """The standing as plain values; an infinite life is left as inf.

        Args:
            centre: (3,) m, about which the work turns.
        """
        move = self.spot.move
        return {
            "rivets_to_failure": self.rivets_to_failure,
            "utilisation": self.utilisation,
            "limiting_joint": self.limiting_joint,
            "work": {"shift": move[:3], "heading": move[3], "about": centre},
            "base": {"position": self.base_position, "heading": self.base_heading},
            "period": self.spot.period,
            "joints": [vars(joint) for joint in self.joints],
            "poses": self.spot.poses,
        }


@dataclass(frozen=True)
class Gain:
    """What one standing of the work has over another.

    Attributes:
        life: by how much longer the weakest joint lives; NaN where both lives are unlimited,
            infinite where only the second has none.
        utilisation: by how much less the most utilised joint is utilised.
    """

    life: float
    utilisation: float

    @classmethod
    def between(cls, before: Standing, after: Standing) -> Gain:
        """The gain of `after` over `before`.

        Args:
            before: where one comes from.
            after: where one gets to.
        """
        finite, used = math.isfinite(before.rivets_to_failure), after.utilisation
        return cls(
            after.rivets_to_failure / before.rivets_to_failure if finite else math.nan,
            before.utilisation / used if used > 0.0 else math.inf,
        )

    @property
    def words(self) -> str:
        """The life's part, or, where every life is unlimited, the utilisation's."""
        if math.isinf(self.life):
            return "an unlimited life"
        if not math.isnan(self.life):
            return f"{self.life:.4g} times the life"
        if self.utilisation < 1.0:
            return f"{1.0 / self.utilisation:.4g} times the highest utilisation"
        return f"a highest utilisation that is {self.utilisation:.4g} times lower"


@dataclass(frozen=True)
class Off:
    """The work a little beside where it should be, the robot following on its branch.

    Attributes:
        shift: (3,) m.
        rivets_to_failure: infinite where the life is unlimited; NaN where it cannot be reached.
        utilisation: NaN where it cannot be reached.
    """

    shift: tuple[float, float, float]
    rivets_to_failure: float
    utilisation: float

    @property
    def reached(self) -> bool:
        """Whether every rivet can still be set."""
        return not math.isnan(self.utilisation)


@dataclass(frozen=True, eq=False, repr=False)
class Placement(TableResult):
    """Where to put the work.

    Attributes:
        robot: its name.
        by_effort: ranked by torque over the URDF's effort limits, for want of shafts and reducers.
        start: where the work is now, with the task's own poses.
        start_valid: whether these are within the joints' limits and free of self-collisions.
        poses_alone: the best poses found with the work where it is now; None where none of them
            is within the limits.
        best: the best place found.
        sure: how sure the gain is; None where no value of the robot has a spread.
        off: what it costs to be beside it.
        centre: (3,) m, of the work now; it turns about the vertical through it.
        placements: how many were tried all over.
        reached: at how many of these every rivet could be set.
        nearby: how many more were tried near the best of them.
        self_collision: what was checked, in words.
        assumptions: what was taken for granted, a sentence each.
        provenance: version, seed and hashes.
    """

    BARS = ("utilisation_now", "utilisation_best")
    PLOTS: ClassVar = {"bars": "visuals.plots.results:plot_columns"}

    robot: str
    by_effort: bool
    start: Standing
    start_valid: bool
    poses_alone: Standing | None
    best: Standing
    sure: Sureness | None
    off: tuple[Off, ...]
    centre: FloatArray
    placements: int
    reached: int
    nearby: int
    self_collision: str
    assumptions: tuple[str, ...]
    provenance: Mapping[str, Any]

    @property
    def moved(self) -> bool:
        """Whether anything was gained."""
        return self.best is not self.start

    @property
    def life_gain(self) -> float:
        """By how much longer the weakest joint lives; NaN where both lives are unlimited."""
        return self.gain.life

    @property
    def utilisation_gain(self) -> float:
        """By how much less the most utilised joint is utilised."""
        return self.gain.utilisation

    @property
    def gain(self) -> Gain:
        """All that the best place and its poses have over the work as it is now."""
        return Gain.between(self.start, self.best)

    @property
    def parts(self) -> dict[str, Gain]:
        """The gain in two: `poses`, other poses at the old place; `place`, what is left."""
        if self.poses_alone is None:
            return {}
        return {
            "poses": Gain.between(self.start, self.poses_alone),
            "place": Gain.between(self.poses_alone, self.best),
        }

    def explained(self) -> str:
        """A sentence: what of the gain is the place's; empty where it cannot be told apart."""
        if not self.parts:
            return ""
        place = "the place itself"
        if self.best.spot.period not in (None, self.poses_alone and self.poses_alone.spot.period):
            place = "the place and its hit rate"
        return (
            "Of this, other poses (another branch, say) at the old place give "
            f"{self.parts['poses'].words}; {place} gives, over these, {self.parts['place'].words}."
        )

    def _listing(self) -> Listing:
        both = zip(self.start.joints, self.best.joints, strict=True)
        told = [self.explained(), self.sure.words() if self.sure else ""]
        return Listing.of(
            "Placement of the work",
            both,
            {
                "joint": lambda pair: pair[0].name,
                "rivets, now": lambda pair: spoken.count(pair[0].rivets_to_failure),
                "utilisation, now [%]": lambda pair: spoken.per_cent(pair[0].utilisation),
                "rivets, best": lambda pair: spoken.count(pair[1].rivets_to_failure),
                "utilisation, best [%]": lambda pair: spoken.per_cent(pair[1].utilisation),
            },
            facts={"work moved by [m, rad]": self.best.spot.move},
            note=" ".join(filter(None, told)),
        )

    def _headline(self) -> str:
        if not self.moved:
            return f"{self.robot!r}: nothing better than where the work is"
        shift = ", ".join(f"{c:.3g}" for c in self.best.spot.move[:3])
        return (
            f"{self.robot!r}: move the work by ({shift}) m and {self.best.spot.move[3]:.3g} rad; "
            f"utilisation {100 * self.start.utilisation:.3g} -> "
            f"{100 * self.best.utilisation:.3g} %"
        )

    def _rows(self) -> list[dict[str, Any]]:
        return [
            {
                "name": now.name,
                "rivets_now": now.rivets_to_failure,
                "utilisation_now": now.utilisation,
                "rivets_best": best.rivets_to_failure,
                "utilisation_best": best.utilisation,
            }
            for now, best in zip(self.start.joints, self.best.joints, strict=True)
        ]

    def _content(self) -> dict[str, Any]:
        content: dict[str, Any] = {
            "format": FORMAT,
            "robot": self.robot,
            "ranked_by": "effort" if self.by_effort else "life, then utilisation",
            "start": self.start.to_dict(self.centre) | {"valid": self.start_valid},
            "best": self.best.to_dict(self.centre),
            "poses_alone": self.poses_alone and self.poses_alone.to_dict(self.centre),
            "gain": vars(self.gain) | {name: vars(part) for name, part in self.parts.items()},
            "off": [vars(off) | {"reached": off.reached} for off in self.off],
            "searched": {
                "placements": self.placements,
                "reached": self.reached,
                "nearby": self.nearby,
            },
            "self_collision": self.self_collision,
            "assumptions": list(self.assumptions),
            "provenance": dict(self.provenance),
        }
        for part, told in (self.sure.to_dict() if self.sure else {}).items():
            content[part] |= told
        return content
