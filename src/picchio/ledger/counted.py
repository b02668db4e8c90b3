"""What bursts add up to, in bounded memory: by hour, by place, and some that stand for all.

The bursts of a shift are added up, and shifts are: what a shift tells can be kept as text.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from picchio.core.arrays import FloatArray, IndexArray
from picchio.fatigue.sn.curve import SNCurve
from picchio.ledger.blows import SEEN, Burst
from picchio.ledger.damage import AS_LOGGED, BurstDamage, Sum, Totals
from picchio.ledger.finding import NEAR
from picchio.ledger.store import HOUR

_STRETCHES = 64  # at most
_PLACES = 4096  # that are told apart; of more the half with the least damage are forgotten
_LONGEST = 4000  # pieces of the force: a longer burst is not typical


@dataclass(frozen=True, eq=False)
class Stretch:
    """Neighbouring bursts.

    Attributes:
        bursts: how many.
        damage: (n,) of each by itself, added up.
        last: ns, the onset of the last.
        onset: ns, of one that stands for them.
        pieces: of its force.
        own: (n,) its damage by itself.
    """

    bursts: int
    damage: FloatArray
    last: int
    onset: int
    pieces: int
    own: FloatArray

    @property
    def short(self) -> bool:
        """Whether the burst is one that may be computed often."""
        return self.pieces <= _LONGEST


@dataclass(eq=False)
class Place:
    """Bursts at one pose along one direction.

    Attributes:
        pose: (nv,) rad or m, of the first.
        direction: (3,) unit, world, of the first.
        blows: how many.
        damage: (n,) of each burst by itself, added up.
    """

    pose: FloatArray
    direction: FloatArray
    blows: int
    damage: FloatArray


class Counted:
    """What a ledger holds, added up burst by burst; memory does not grow with their number.

    Args:
        curves: of the n joints.
    """

    spans: IndexArray
    """(s, 2) ns, the time that was logged; set where all has been added, as is `totals`."""
    totals: Totals
    """The damage of all bursts."""
    typical: dict[int, Burst]
    """By their onsets: bursts that stand for some of the stretches."""

    def __init__(self, curves: Sequence[SNCurve | None]) -> None:
        self.shown: dict[int, dict[str, Any]] = {}  # by shift: see `Shown`
        self.kinds: Counter[str] = Counter()
        self.cut = 0
        self.forgotten = 0  # places
        # Of the blows that were seen: how many, sums of ln N, ln s and samples; of their steps.
        self.seen_sums = np.zeros(6)
        self.steady = 0.0  # s, of a tool without separate blows
        self.first = self.last = 0  # ns, onsets
        self.stretches: list[Stretch] = []
        self._each = 1  # bursts of a stretch
        self._sum = Sum(curves)
        self._hours: dict[int, FloatArray] = {}
        self._places: dict[tuple[float, ...], Place] = {}

    def add(self, bursts: Sequence[Burst], damages: Sequence[BurstDamage]) -> None:
        """Further bursts.

        Args:
            bursts: by time.
            damages: of each.
        """
        self.first = self.first or bursts[0].onset
        self.last = bursts[-1].blows[-1].onset
        self._sum.add(damages)
        for burst, made in zip(bursts, damages, strict=True):
            own, blows = made.alone[:, AS_LOGGED], len(burst.blows)
            self.kinds.update(blow.kind for blow in burst.blows)
            self.cut += sum(bool(blow.cut) for blow in burst.blows)
            self._see(burst)
            row, hour = np.array([blows, 1.0, *own]), burst.onset // HOUR
            self._hours[hour] = self._hours.get(hour, 0.0) + row
            self._put(Place(burst.pose, burst.direction, blows, own))
            self._stand(Stretch(1, own, burst.onset, burst.onset, burst.start.size, own))
        self._forget()

    def _see(self, burst: Burst) -> None:
        """Add to what the blows that were seen are like."""
        seen = [blow for blow in burst.blows if blow.seen and not blow.cut and blow.impulse]
        size = np.array([(b.peak, abs(b.impulse) / b.peak, b.samples) for b in seen]).reshape(-1, 3)
        step = np.diff([blow.onset for blow in seen]) * 1e-9
        near = np.log(step[(step > 0.0) & (step < 3.0 * np.median(step))]) if step.size else step
        logs = np.log(size[:, :2]).sum(axis=0)
        self.seen_sums += [len(seen), *logs, size[:, 2].sum(), near.size, near.sum()]

    @property
    def usual_blow(self) -> dict[str, float | None] | None:
        """What the blows that were seen are like, in the mean; None of none.

        Returns:
            force N; width s, impulse over force; samples in it; rate Hz, None of single ones.
        """
        count, force, width, samples, steps, step = self.seen_sums.tolist()
        if not count:
            return None
        rate = float(np.exp(-step / steps)) if steps else None
        return {"force": float(np.exp(force / count)), "width": float(np.exp(width / count)),
                "samples": samples / count, "rate": rate}  # fmt: skip

    @property
    def told(self) -> dict[str, Any]:
        """All of it, as numbers and text for `merge`."""
        whole = self._sum.burst
        return {
            "first": self.first, "last": self.last, "cut": self.cut, "forgotten": self.forgotten,
            "steady": self.steady, "seen_sums": self.seen_sums.tolist(),
            "kinds": self.kinds, "closed": whole.closed.tolist(), "alone": whole.alone.tolist(),
            "residue": [part.tolist() for part in whole.residue],
            "hours": {hour: row.tolist() for hour, row in self._hours.items()},
            "places": [_listed(place) for place in self._places.values()],
            "each": self._each, "stretches": [_listed(each) for each in self.stretches],
        }  # fmt: skip

    def merge(self, told: dict[str, Any]) -> None:
        """What a later shift adds up to.

        Args:
            told: as `told` gives it.
        """
        self.steady += told["steady"]
        self.seen_sums += told["seen_sums"]
        if not told["first"]:
            return
        self.first, self.last = self.first or told["first"], told["last"]
        self.cut += told["cut"]
        self.forgotten += told["forgotten"]
        self.kinds.update(told["kinds"])
        parts = [np.array(part, float) for part in told["residue"]]
        self._sum.add(
            [BurstDamage(np.array(told["closed"]), np.array(told["alone"]), tuple(parts))]
        )
        for hour, row in told["hours"].items():
            self._hours[int(hour)] = self._hours.get(int(hour), 0.0) + np.array(row)
        for pose, direction, blows, damage in told["places"]:
            self._put(Place(np.array(pose), np.array(direction), blows, np.array(damage)))
        self._each = max(self._each, told["each"])
        for bursts, damage, last, onset, pieces, own in told["stretches"]:
            self._stand(Stretch(bursts, np.array(damage), last, onset, pieces, np.array(own)))
        self._forget()

    def _put(self, new: Place) -> None:
        """Add what was done at a place."""
        key = (*np.round(new.pose / NEAR).tolist(), *np.round(2 * new.direction).tolist())
        place = self._places.get(key)
        if place is None:
            self._places[key] = new
            return
        place.blows += new.blows
        place.damage = place.damage + new.damage

    def _forget(self) -> None:
        if len(self._places) > _PLACES:
            worst = sorted(self._places.items(), key=lambda each: -self._weight(each[1].damage))
            self.forgotten += len(worst) - _PLACES // 2
            self._places = dict(worst[: _PLACES // 2])

    def close(self, spans: IndexArray) -> None:
        """All has been added.

        Args:
            spans: (s, 2) ns, the time that was logged.
        """
        self.spans, self.totals = spans, self._sum.totals

    def _stand(self, new: Stretch) -> None:
        """Add a burst to the stretches; where they are too many, join each two."""
        if self.stretches and self.stretches[-1].bursts < self._each:
            self.stretches[-1] = self._joined(self.stretches[-1], new)
            return
        self.stretches.append(new)
        if len(self.stretches) > _STRETCHES:
            *pairs, last = self.stretches
            self.stretches = [*map(self._joined, pairs[::2], pairs[1::2]), last]
            self._each *= 2

    def _joined(self, one: Stretch, other: Stretch) -> Stretch:
        best = max(one, other, key=lambda s: (
            s.short, self._weight(s.own) if s.short else -s.pieces
        ))  # fmt: skip
        return replace(best, bursts=one.bursts + other.bursts, damage=one.damage + other.damage,
                       last=other.last)  # fmt: skip

    def _weight(self, damage: FloatArray) -> float:
        """The largest share of any joint's damage so far."""
        return float(np.max(damage / np.maximum(np.nan_to_num(self._sum.alone), 1e-300)))

    @property
    def blows(self) -> int:
        """How many."""
        return self.kinds.total()

    @property
    def seen(self) -> int:
        """How many of them have a size that was logged."""
        return sum(self.kinds[kind] for kind in SEEN)

    @property
    def bursts(self) -> int:
        """How many."""
        return sum(stretch.bursts for stretch in self.stretches)

    @property
    def together(self) -> FloatArray:
        """(n,) the damage of all bursts over that of each by itself; 0 where there is none."""
        alone = np.nan_to_num(self.totals.alone)
        whole = np.nan_to_num(self.totals.damage)
        return np.divide(whole, alone, out=np.zeros_like(whole), where=alone > 0.0)

    @property
    def hours(self) -> tuple[IndexArray, FloatArray]:
        """(h,) hours since 1970 with bursts, and (h, 2 + n): blows, bursts, damage by joint."""
        if not self._hours:
            return np.empty(0, np.int64), np.empty((0, 2 + self.together.size))
        when, table = zip(*sorted(self._hours.items()), strict=True)
        return np.array(when), np.array(table) * np.concatenate([[1.0, 1.0], self.together])

    @property
    def places(self) -> list[Place]:
        """Where the damage comes from; those with the most of a joint's damage first."""
        found = [replace(p, damage=p.damage * self.together) for p in self._places.values()]
        return sorted(found, key=lambda p: (-self._weight(p.damage), -p.blows))


def _listed(record: Place | Stretch) -> list[Any]:
    """Its fields, arrays as lists."""
    return [x.tolist() if isinstance(x, np.ndarray) else x for x in vars(record).values()]
