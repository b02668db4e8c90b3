"""What a count found: blows, damage, what is left, what changed, as it is told."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from picchio.core import spoken
from picchio.core.arrays import FloatArray
from picchio.core.listing import Key, Listing
from picchio.core.results import TableResult
from picchio.fatigue.sn.curve import SNCurve
from picchio.ledger.counted import Counted
from picchio.ledger.forecast import Worlds, quantiles
from picchio.ledger.store import DAY, HOUR
from picchio.ledger.watch.changes import date_of
from picchio.model.model import Model

_LATELY = 28  # days that today's pace is taken from
_STATIONS = 12


@dataclass(frozen=True, eq=False, repr=False)
class Count(TableResult):
    """What the logs of a robot have done to it, and what is left.

    Attributes:
        model: the robot and its effects.
        ledger: its file.
        logs: how many it holds.
        added: names of the logs that are new.
        known: names of the logs that were counted before.
        refused: (name, why) of logs that could not be read.
        detected: what was found out about each new log.
        counted: blows and damage.
        worlds: what they may have done; None where nothing was counted.
        changes: what is no longer as it was.
        curves: of the flexible joints.
        notes: what was taken for granted.
        origin: provenance.
        hours_per_day: h, that the robot works, where that was stated.
    """

    PLOTS: ClassVar = {
        "life used": "visuals.report.count:plot_life_used",
        "blows": "visuals.report.count:plot_blows",
    }

    INDEX = "name"
    PAGE: ClassVar[str] = "visuals.report.count:count_page"
    UNITS: ClassVar[dict[str, str]] = {"damage": "1", "blows_left_p50": "1"}

    model: Model
    ledger: Path
    logs: int
    added: tuple[str, ...]
    known: tuple[str, ...]
    refused: tuple[tuple[str, str], ...]
    detected: dict[str, tuple[str, ...]]
    counted: Counted
    worlds: Worlds | None
    changes: tuple[dict[str, Any], ...]
    curves: tuple[SNCurve | None, ...]
    notes: tuple[str, ...]
    origin: dict[str, Any]
    hours_per_day: float | None = None

    @property
    def blows(self) -> int:
        """How many."""
        return self.counted.blows

    @property
    def seen_share(self) -> float:
        """Of the blows whose size was logged; 1 where there is none."""
        return self.counted.seen / self.blows if self.blows else 1.0

    @property
    def hours(self) -> float:
        """h, the time that was logged."""
        spans = self.counted.spans
        return float((spans[:, 1] - spans[:, 0]).sum() / HOUR)

    @property
    def logged(self) -> str:
        """The same, for people."""
        return f"{self.hours:.4g} h" if self.hours >= 1.0 else f"{60.0 * self.hours:.3g} min"

    @property
    def blows_per_hour(self) -> float:
        """Of logged time, over the last 28 days; 0 of no blow."""
        if not self.blows:
            return 0.0
        hour, table = self.counted.hours
        lately = int(hour[-1]) - 24 * _LATELY
        spans = np.maximum(self.counted.spans, (lately + 1) * HOUR)
        logged = float((spans[:, 1] - spans[:, 0]).sum()) / HOUR
        return float(table[hour > lately, 0].sum()) / max(logged, 1.0 / 3600.0)

    @property
    def blows_a_day(self) -> float | None:
        """Today's pace: by the stated hours a day, or over the last 28 days of the calendar.

        None where less than a day was logged and nobody says how long the robot works.
        """
        if self.hours_per_day is not None or not self.blows:
            return self.blows_per_hour * (self.hours_per_day or 0.0)
        if self.hours < 24.0:
            return None
        span = (self.counted.last - self.counted.first) / DAY
        hour, table = self.counted.hours
        lately = hour > hour[-1] - 24 * _LATELY
        return float(table[lately, 0].sum() / min(max(span, 1.0), _LATELY))

    @property
    def pace(self) -> str:
        """The same, for people."""
        if self.blows_a_day is None:
            return f"{self.blows_per_hour:.4g} blows an hour of work"
        stated = f" of {self.hours_per_day:g} h" if self.hours_per_day is not None else ""
        return f"{self.blows_a_day:.4g} blows a day{stated}"

    def left(self, joint: int) -> dict[str, float] | None:
        """P10, P50 and P90 of the blows until a joint's sum is one.

        Args:
            joint: which of the flexible ones.

        Returns:
            them by name; None without a curve, or where nothing was counted.
        """
        if self.worlds is None or self.curves[joint] is None:
            return None
        return quantiles(self.worlds.blows_left(joint, self.blows))

    def dates(self, left: dict[str, float] | None) -> dict[str, str | None]:
        """When so many blows will have come, at today's pace.

        Args:
            left: as `left` gives it.
        """
        found: dict[str, str | None] = {}
        for name in ("p10", "p50", "p90"):
            blows = math.inf if left is None else left[name]
            days = blows / self.blows_a_day if self.blows_a_day else math.inf
            then = self.counted.last + days * DAY
            found[name] = date_of(int(then)) if days < 36500 else None
        return found

    def reached(self, left: dict[str, float] | None) -> str | None:
        """The month in which the median of the blows left will have come, for people.

        Args:
            left: as `left` gives it.

        Returns:
            such as "2041-07", or hours of work where nobody says how many a day has; None without
            end.
        """
        if left is None or not math.isfinite(left["p50"]):
            return None
        date = self.dates(left)["p50"]
        if self.blows_a_day is None:
            return f"{spoken.count(left['p50'] / self.blows_per_hour)} h of work"
        return "> 100 y" if date is None else date.rpartition("-")[0]

    @property
    def first_to_fail(self) -> int | None:
        """The joint that ends the life: the fewest blows left in the median; None of none."""
        left = [self.left(j) for j in range(len(self.curves))]
        finite = {j: x["p50"] for j, x in enumerate(left) if x and math.isfinite(x["p50"])}
        return min(finite, key=finite.__getitem__) if finite else None

    def if_force(self, factor: float) -> FloatArray:
        """(n,) how many times as long the joints live with all blows so many times as hard.

        Args:
            factor: of the force.
        """
        now = self.counted.totals.at(np.array([1.0, factor]))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.where(now[:, 0] > 0.0, now[:, 0] / now[:, 1], np.nan))

    def days(self) -> list[dict[str, Any]]:
        """Of each day with blows: date, blows, and the damage of each joint."""
        hour, table = self.counted.hours
        day = hour // 24
        found = []
        for which in np.unique(day).tolist():
            rows = table[day == which].sum(axis=0)
            date = date_of(which * DAY)
            found.append({"date": date, "blows": int(rows[0]), "damage": rows[2:]})
        return found

    def stations(self) -> list[dict[str, Any]]:
        """Where the damage comes from: pose, direction, blows, share of each joint's damage."""
        whole = np.maximum(np.nan_to_num(self.counted.totals.damage), 1e-300)
        return [
            {"pose": place.pose, "direction": place.direction, "blows": place.blows,
             "share": place.damage / whole}
            for place in self.counted.places[:_STATIONS]
        ]  # fmt: skip

    def _headline(self) -> str:
        text = f"{self.blows} blows in {self.logs} log{'s' * (self.logs != 1)}"
        j = int(np.nanargmax(self.counted.totals.damage)) if self._any_damage else None
        if j is None:
            return f"{text}, no damage"
        names = self.model.robot.flexible_names
        used = spoken.per_cent(self.counted.totals.damage[j])
        text += f", {names[j]} has used {used} % of its life"
        first = self.first_to_fail
        left = None if first is None else self.left(first)
        if first is None or left is None:
            return text
        low, middle, high = (spoken.count(float(f"{left[p]:.2g}")) for p in ("p10", "p50", "p90"))
        return f"{text}; {names[first]} lasts {middle} blows more (P10 to P90: {low} to {high})"

    @property
    def _any_damage(self) -> bool:
        return bool(np.nan_to_num(self.counted.totals.damage).any())

    def _rows(self) -> list[dict[str, Any]]:
        return [
            {key: joint[key] for key in ("name", "damage")}
            | {"blows_left_p50": (joint["blows_left"] or {"p50": math.nan})["p50"]}
            for joint in self.joints()
        ]

    def _listing(self) -> Listing:
        """Life used and left."""
        end = lambda p: lambda j: spoken.count(j["blows_left"][p]) if j["blows_left"] else None  # noqa: E731
        columns: dict[str, Key] = {
            "joint": "name",
            "life used [%]": lambda j: spoken.per_cent(j["damage"]),
            "90 % interval [%]": lambda j: spoken.between(
                j["damage_interval"] or [None], spoken.per_cent
            ),
            "blows left, P10": end("p10"),
            "P50": end("p50"),
            "P90": end("p90"),
            "P50 is reached": lambda j: self.reached(j["blows_left"]) or None,
        }
        return Listing.of("Life used and left", self.joints(), columns)

    def joints(self) -> list[dict[str, Any]]:
        """What is told of each joint."""
        found = []
        for j, name in enumerate(self.model.robot.flexible_names):
            left = self.left(j)
            known = self.worlds is not None and self.curves[j] is not None
            found.append({
                "name": name,
                "damage": float(self.counted.totals.damage[j]),
                "damage_interval": list(self.worlds.interval(j)) if known and self.worlds else None,
                "damage_each_alone": float(self.counted.totals.alone[j]),
                "blows_left": left,
                "date": self.dates(left) if left else None,
                "reason": None if self.curves[j] else "neither shaft nor drive with a curve",
            })  # fmt: skip
        return found

    def _content(self) -> dict[str, Any]:
        first = self.first_to_fail
        return {
            "format": "picchio-count/1",
            "robot": self.model.robot.name,
            "ledger": self.ledger,
            "logs": self.logs,
            "blows": self.blows,
            "seen_share": self.seen_share,
            "hours_logged": self.hours,
            "from": _iso(self.counted.first) if self.blows else None,
            "to": _iso(self.counted.last) if self.blows else None,
            "blows_a_day": self.blows_a_day,
            "blows_per_hour": self.blows_per_hour,
            "hours_per_day": self.hours_per_day,
            "usual_blow": self.counted.usual_blow,
            "seconds_without_separate_blows": self.counted.steady,
            "joints": self.joints(),
            "ends": None if first is None else self.model.robot.flexible_names[first],
            "force_10_percent_less": dict(
                zip(self.model.robot.flexible_names, self.if_force(0.9), strict=True)
            ),
            "changes": list(self.changes),
            "days": self.days(),
            "stations": self.stations(),
            "added": list(self.added),
            "known": list(self.known),
            "refused": [{"log": name, "why": why} for name, why in self.refused],
            "detected": {name: list(lines) for name, lines in self.detected.items()},
            "notes": list(self.notes),
            "provenance": self.origin,
        }


def _iso(ns: int) -> str:
    return datetime.fromtimestamp(ns / 1e9, UTC).isoformat(timespec="milliseconds")
