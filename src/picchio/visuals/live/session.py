"""What somebody explores: where the arm stands, how it is hit, and what that does to it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from picchio.core.arrays import FloatArray, IndexArray
from picchio.core.errors import InputError
from picchio.core.results import plain
from picchio.model.model import Model
from picchio.robot.ik.follow import Follower
from picchio.studies.envelopes import icosphere
from picchio.studies.instant import Instant, InstantStudy, Place
from picchio.studies.placement.self_collision import SelfCollision
from picchio.studies.task_file import add_place, task_text
from picchio.vibration.closed_form.response import unit_vector
from picchio.visuals.live.gesture import Blows, Gesture

FORMAT = "picchio-exploration/1"
# Cases of a life's interval, and fineness of the envelope: while dragging, and at rest.
DRAGGED, STILL = 32, 512
COARSE, FINE = 2, 3
_NEAR = 1e-6  # rad or m: a joint this near to its limit stands at it
_OUT = 1e-4  # m: the tool misses its place by more
_BLOWS = ("force", "period", "width", "preload")


@cache
def half_ball(subdivisions: int) -> tuple[FloatArray, IndexArray]:
    """One of each pair of opposite directions of a ball, (d, 3), and which of them, (v,).

    Args:
        subdivisions: of an icosahedron.
    """
    every = icosphere(subdivisions)[0].round(9)
    x, y, z = every.T
    upper = (z > 0) | ((z == 0) & ((y > 0) | ((y == 0) & (x > 0))))
    line = np.where(upper[:, None], every, -every) + 0.0
    found, which = np.unique(line, axis=0, return_inverse=True)
    return np.ascontiguousarray(found), which.ravel()


class Session:
    """One robot as it is explored.

    Args:
        models: by name; directions are sought on the first. All are of one robot.
        place: where it begins.
        file: the task file that places go into.
    """

    def __init__(self, models: Mapping[str, Model], place: Place, file: Path) -> None:
        self.place, self.file = place, file
        self.studies = {name: InstantStudy(model, place) for name, model in models.items()}
        self.robot = next(iter(models.values())).robot
        self.home = place
        self.follower = Follower(self.robot)
        self.keeps_axis = self.follower.aims
        self.joint = 0
        self.notes: list[str] = []
        found = SelfCollision.of(self.robot, place.pose)
        self.collisions = None if isinstance(found, str) else found
        self.why_none = found if isinstance(found, str) else ""
        self.last: dict[str, Instant] = {}
        self.intervals: dict[str, FloatArray] = {}
        self.joint = int(np.nanargmax(self._asked()))

    def _asked(self) -> FloatArray:
        self.answer()
        found = next(iter(self.last.values()))
        use = np.nan_to_num(found.governing, nan=-1.0)
        return use if (use >= 0.0).any() else found.peak_deflection

    # --- gestures ---------------------------------------------------------------------------
    def take(self, gesture: Gesture | Mapping[str, Any]) -> None:
        """Do what a hand did.

        Args:
            gesture: any of the keys of `Gesture`, at once.

        Raises:
            InputError: a value out of range; nothing has changed then.
        """
        asked = Gesture.of(gesture)
        pose, direction = self.place.pose.copy(), self.place.direction
        excitation, hits = self.place.excitation, self.place.hits
        keeps, chosen = self.keeps_axis, self.joint
        notes: list[str] = []
        if asked.home:
            pose, direction = self.home.pose.copy(), self.home.direction
            excitation, hits = self.home.excitation, self.home.hits
        if asked.keeps_axis is not None:
            keeps = asked.keeps_axis and self.follower.aims
        if asked.joint is not None:
            chosen = self._index(asked.joint, len(self.robot.flexible_names))
        for key, value in asked.joints.items():
            j = self._index(key, len(pose))
            pose[j] = min(max(value, self.robot.lower[j]), self.robot.upper[j])
        if asked.tool is not None:
            point = np.array(asked.tool)
            axis = self._axis(self.place.pose) if keeps else None
            pose, missed = self.follower.follow(pose, point, axis)
            if missed > _OUT:
                far = f"{missed:.3g} m" if missed >= 1.0 else f"{1e3 * missed:.3g} mm"
                notes.append(f"the tool is {far} short of that place")
        excitation = self._blows(asked.blows, excitation)
        hits = asked.blows.hits or hits
        if asked.direction is not None:
            direction = unit_vector(np.array(asked.direction))
        if asked.along_tool:
            direction = -self._axis(pose)
        if asked.worst is not None:
            j = self._index(asked.worst, len(self.robot.flexible_names))
            here = dataclasses.replace(self.place, pose=pose, excitation=excitation, hits=hits)
            worst = next(iter(self.studies.values())).values(here).worst_direction[j]
            if not np.isfinite(worst).all():
                raise InputError("a nonlinear model has no worst direction in closed form",
                                 key="worst", value=self.robot.flexible_names[j])  # fmt: skip
            # Either sign is as bad: the one that is nearer to what was.
            direction = worst if worst @ direction >= 0.0 else -worst
            chosen = j
        before = self.place, self.last
        self.place = Place(pose, direction, excitation, hits)
        try:
            self.answer()
        except Exception:
            self.place, self.last = before
            raise
        self.keeps_axis, self.joint, self.notes = keeps, chosen, notes

    def _axis(self, pose: FloatArray) -> FloatArray:
        """The way the tool points, (3,) unit, world."""
        turn = self.robot.frame_placement(pose, self.robot.tool_frame)[1]
        axis = turn @ np.array(self.robot.tool.axis)
        return np.asarray(axis / np.linalg.norm(axis))

    def _index(self, number: int, count: int) -> int:
        if number >= count:
            raise InputError(f"no such joint: there are {count}", key="joint", value=number)
        return number

    def _blows(self, asked: Blows, blows: Any) -> Any:
        changes = asked.model_dump(exclude_none=True, exclude={"hits"})
        if "rate" in changes:
            changes["period"] = 1.0 / changes.pop("rate")
        for key in changes:
            if key not in self.blow_keys:
                raise InputError(f"blows of the kind {blows.kind} have no such number to change",
                                 key=key, choices=self.blow_keys)  # fmt: skip
        return dataclasses.replace(blows, **changes) if changes else blows

    @property
    def blow_keys(self) -> list[str]:
        """Which numbers of the blows can be changed."""
        blows: Any = self.place.excitation
        fields = {one.name for one in dataclasses.fields(blows)}
        return [key for key in _BLOWS if key in fields and getattr(blows, key) is not None]

    # --- answers ----------------------------------------------------------------------------
    def answer(self) -> None:
        """Work out what is asked of every model that is fast enough; of others what is old goes."""
        found = {
            name: study.values(self.place) for name, study in self.studies.items() if study.fast
        }
        if not found:  # nothing is fast: then everything is waited for
            found = {name: study.values(self.place) for name, study in self.studies.items()}
        intervals = {
            name: study.life_intervals(self.place, DRAGGED)
            for name, study in self.studies.items()
            if study.fast
        }
        self.last, self.intervals = found, intervals

    def settle(self) -> Iterator[None]:
        """What is not waited for while dragging, in pieces: slow models, better intervals."""
        for name, study in self.studies.items():
            if name not in self.last:
                self.last[name] = study.values(self.place)
                yield
            if study.compiled:  # else each case takes as long as the model itself
                cases = STILL if study.fast else DRAGGED
                self.intervals[name] = study.life_intervals(self.place, cases)
            yield

    def values(self, settled: bool = False) -> dict[str, Any]:
        """All numbers on the screen.

        Args:
            settled: whether they are of `settle`.
        """
        place, robot = self.place, self.robot
        blows: Any = place.excitation
        at = [
            name for name, q, low, high in zip(robot.joint_names, place.pose, robot.lower,
                                               robot.upper, strict=True)
            if q <= low + _NEAR or q >= high - _NEAR
        ]  # fmt: skip
        touching = self.collisions.touching(place.pose) if self.collisions else []
        return plain({
            "pose": place.pose,
            "tool": robot.tool_position(place.pose),
            "direction": place.direction,
            "blows": {**{key: getattr(blows, key) for key in self.blow_keys},
                      "rate": 1.0 / blows.period, "hits": place.hits, "kind": blows.kind},
            "keeps_axis": self.keeps_axis,
            "joint": self.joint,
            "at_limit": at,
            "touching": touching,
            "notes": self.notes,
            "settled": settled,
            "models": {name: self._model(name) for name in self.studies},
        })  # fmt: skip

    def _model(self, name: str) -> dict[str, Any] | None:
        found = self.last.get(name)
        if found is None:
            return None
        ends = self.intervals.get(name)
        life = found.life
        return {
            "notes": self.studies[name].model.without_load(),
            "natural_frequencies": found.natural_frequencies,
            "joints": [
                {
                    "name": joint.name,
                    "kind": joint.kind,
                    "peak_deflection": found.peak_deflection[j],
                    "worst_deflection": found.worst_deflection[j],
                    "worst_direction": found.worst_direction[j],
                    "peak_torque": found.peak_torque[j],
                    "stress": found.stress[j],
                    "utilisation": found.utilisation[j],
                    "drive_utilisation": found.drive_utilisation[j],
                    "life": None if math.isnan(life[j]) else _count(life[j]),
                    "life_interval": None if ends is None or np.isnan(ends[j]).any()
                    else [_count(end) for end in ends[j]],
                }
                for j, joint in enumerate(self.robot.flexible_joints)
            ],
        }  # fmt: skip

    def balls(self, subdivisions: int) -> Iterator[dict[str, Any] | None]:
        """The envelope of the joint that is shown, of each linear model, in pieces.

        Args:
            subdivisions: of an icosahedron.

        Yields:
            None while it is not done, at last {"subdivisions", "radii": {model: (v,) rad}}.
        """
        half, which = half_ball(subdivisions)
        joint, place, radii = self.joint, self.place, {}
        for name, study in self.studies.items():
            if study.model.nonlinear or (subdivisions == COARSE and not study.fast):
                continue
            parts = []
            for part in study.envelope(place, half, 4 if subdivisions == COARSE else 12):
                parts.append(part[joint])
                yield None
            radii[name] = [float(f"{r:.4g}") for r in np.concatenate(parts)[which]]
        yield {"joint": joint, "subdivisions": subdivisions, "radii": plain(radii)}

    # --- files ------------------------------------------------------------------------------
    def toml(self) -> str:
        """The place as a task file."""
        return task_text(self.robot, self.place)

    def add(self) -> int:
        """Put the place into the task file.

        Returns:
            how many poses that has now.
        """
        return add_place(self.file, self.robot, self.place)


def _count(value: float) -> float | str:
    """A number of rivets; one without end as the word, which JSON has no number for."""
    return "unlimited" if math.isinf(value) else float(f"{value:.6g}")
