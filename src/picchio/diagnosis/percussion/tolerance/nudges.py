"""What is never exact, one number at a time.

A nudge is an effect that no catalogue has: it moves numbers of the robot, the blows or the sensors
by so many standard deviations of their `[tolerance]`. What the records show of them is found by
differences.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin

from picchio.campaign.tables import Tolerance
from picchio.core.arrays import FloatArray
from picchio.diagnosis.percussion.data.problem import MeasuredRecord, Problem
from picchio.excitation.piecewise import PiecewiseForce
from picchio.model.blows import Blows
from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, Where
from picchio.model.geometry import Geometry
from picchio.model.inertia import point, turning
from picchio.model.plant import Changes
from picchio.model.sensing import Sensors
from picchio.robot.dynamics.rigid_model import symmetric

# What moves less than this share of the arm's inertia is not told from nothing.
_LIGHT = 1e-6
# What a nudge changes that is no effect's: where the robot stands.
POSE = "pose"
_ONCE_A_POSE = ("pose_repeat", "damping_by_mode")


@dataclass(frozen=True, eq=False)
class Inexact:
    """A number that is not exact, or one for each blow of a record.

    Attributes:
        name: such as "link_mass.link_2", the same in every record that shares it.
        key: of `[tolerance]`.
        once: whether a campaign has one value of it; else every record has its own.
        where: what it changes, as of an effect; "pose" for a joint's position.
        change: (plant, blows or sensors, (numbers,) standard deviations) -> blows or nothing; for
            "pose" the joint's index, or None.
        means: effect and target that stand for it where it is a cause.
        each_blow: whether every blow has its own number.
        one_way: whether it is moved upwards alone to see what it does: no blow begins before its
            record does.
        factor_on: the fitted value on which it is a factor, as (label, parameter), and the
            logarithm of one standard deviation: what all have in common is that value's.
    """

    name: str
    key: str
    once: bool
    where: Where | str
    change: Any
    means: str = ""
    each_blow: bool = False
    one_way: bool = False
    factor_on: tuple[tuple[str, str], float] | None = None


class Nudge(Effect):
    """Numbers that are not exact, moved.

    Args:
        moved: what is moved, and by how many standard deviations, (numbers,) each.
        where: what all of them change.
    """

    name = "tolerance"
    target_kind = "robot"
    parameters = ()
    meaning = "values that are never exact"

    def __init__(self, moved: Sequence[tuple[Inexact, FloatArray]], where: Where) -> None:
        super().__init__("robot")
        self.where = where  # type: ignore[misc]
        self._moved = moved
        self.__dict__["key"] = (
            self.name, where, *((one.name, size.tobytes()) for one, size in self._moved)
        )  # fmt: skip

    def structure(self, plant: Changes) -> None:
        """Change the plant."""
        if self.where == "structure":
            for one, size in self._moved:
                one.change(plant, float(size[0]))

    def blows(self, blows: Blows, conditions: Conditions) -> Blows:
        """Change the blows."""
        if self.where == "blows":
            for one, size in self._moved:
                blows = one.change(blows, size if one.each_blow else float(size[0]))
        return blows

    def sense(self, sensors: Sensors, conditions: Conditions) -> None:
        """Change the sensors."""
        if self.where == "sensor":
            for one, size in self._moved:
                one.change(sensors, float(size[0]))


def nudged(
    record: MeasuredRecord, moved: Sequence[tuple[Inexact, FloatArray]]
) -> tuple[MeasuredRecord, tuple[Effect, ...]]:
    """A record with numbers moved: where its pose is another, and the effects that do the rest.

    Args:
        record: as stated.
        moved: what, and by how many standard deviations, (numbers,) each.
    """
    shifts = [(one, float(size[0])) for one, size in moved if one.where == POSE and size[0]]
    if shifts:
        setup = record.setup
        pose = setup.geometry.pose.copy()
        for one, size in shifts:
            index, sigma = one.change
            pose[index] += size * sigma
        setup = replace(setup, geometry=setup.geometry.beside(pose))
        record = replace(record, setup=setup, _cuts={})
    return record, as_effects(moved)


def as_effects(moved: Sequence[tuple[Inexact, FloatArray]]) -> tuple[Effect, ...]:
    """Numbers moved as effects, one a kind of thing that they change; no pose is among it.

    Args:
        moved: what, and by how many standard deviations, (numbers,) each.
    """
    by: dict[Where | str, list[tuple[Inexact, FloatArray]]] = {}
    for pair in moved:
        by.setdefault(pair[0].where, []).append(pair)
    places: tuple[Where, ...] = ("structure", "blows", "sensor")
    return tuple(Nudge(by[where], where) for where in places if where in by)


def inexact(
    problem: Problem, record: MeasuredRecord, tolerance: Tolerance, *, measured: bool = True
) -> list[Inexact]:
    """All that is not exact in a record: the record's own first, then what the campaign shares.

    Args:
        problem: robot and campaign.
        record: one of its records.
        tolerance: the standard deviations; what is exact is left out.
        measured: whether the record is one of several that tell of its pose together.
    """
    makers = (_links, _poses, _modes, _gravity, _tool_points, _directions, _blows, _sensors)
    # What is drawn once a pose is taken to be drawn anew in each of its records, and so much wider
    # that together they say no more than one.
    together = sum(other.pose == record.pose for other in problem.records) if measured else 1
    alike = math.sqrt(max(together, 1))
    wider = {key: alike * getattr(tolerance, key) for key in _ONCE_A_POSE}
    tolerance = tolerance.model_copy(update=wider)
    found = [one for make in makers for one in make(problem, record, tolerance)]
    return sorted((one for one in found if getattr(tolerance, one.key) > 0.0), key=lambda x: x.once)


def _links(problem: Problem, record: MeasuredRecord, sigma: Tolerance) -> Iterator[Inexact]:
    n = len(problem.robot.flexible_names)
    moving = {r.setup.geometry: None for r in problem.records}
    for link, own in problem.robot.tree.links.items():
        if own is None or not own.mass > 0.0 or not record.setup.geometry.chain.has_frame(link):
            continue
        # What stands still at every pose is not seen.
        if not any(_share(geometry, link, n) > _LIGHT for geometry in moving):
            continue
        com, axes, moments = principal(own)

        def heavier(plant: Changes, size: float, link: str = link) -> None:
            plant.add_mass(size * sigma.link_mass, link)

        yield Inexact(f"link_mass.{link}", "link_mass", True, "structure", heavier,
                      f"link_mass:{link}")  # fmt: skip
        for k in range(3):

            def moved(plant: Changes, size: float, link: str = link, k: int = k,
                      mass: float = own.mass, centre: FloatArray = com,
                      axes: FloatArray = axes) -> None:  # fmt: skip
                before = centre + plant.centres.get(link, 0.0)
                after = before + size * sigma.link_com * axes[:, k]
                plant.centres[link] = after - centre
                # Its inertia about it stays: only what its mass makes of where it is changes.
                plant.add_body(link, point(mass, after) - point(mass, before))

            turns = turning(moments[k], axes[:, k])

            def larger(plant: Changes, size: float, link: str = link,
                       turns: FloatArray = turns) -> None:  # fmt: skip
                plant.add_body(link, size * sigma.link_inertia * turns)

            yield Inexact(f"link_com.{link}.{k + 1}", "link_com", True, "structure", moved)
            yield Inexact(f"link_inertia.{link}.{k + 1}", "link_inertia", True, "structure", larger)


def principal(own: Any) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Centre of mass (3,) m, principal axes (3, 3) in columns, and moments (3,) kg m^2 of a link.

    Args:
        own: the link's `<inertial>`.

    Returns:
        in the link's frame.
    """
    turn = pin.rpy.rpyToMatrix(*own.rpy)
    moments, axes = np.linalg.eigh(turn @ symmetric(own.inertia) @ turn.T)
    return np.array(own.xyz, dtype=float), axes, moments


def _share(geometry: Geometry, link: str, n: int) -> float:
    """A link's share of the joints' inertia, at a pose."""
    whole = np.abs(geometry.inertia().mass[:n, :n]).max()
    return float(np.abs(geometry.inertia(link).mass[:n, :n]).max() / whole)


def _poses(problem: Problem, record: MeasuredRecord, sigma: Tolerance) -> Iterator[Inexact]:
    robot = problem.robot
    for joint, index in zip(robot.flexible_names, robot.flexible_index, strict=True):
        for key, once in (("pose", True), ("pose_repeat", False)):
            yield Inexact(f"{key}.{joint}", key, once, POSE, (int(index), getattr(sigma, key)))


# What is moved already is moved on, so what multiplies must do so by exponentials: they add up.


def _modes(problem: Problem, record: MeasuredRecord, sigma: Tolerance) -> Iterator[Inexact]:
    count = len(problem.robot.flexible_names)
    for mode in range(count):

        def damped(plant: Changes, size: float, mode: int = mode) -> None:
            scales = list(plant.mode_scales or (1.0,) * count)
            scales[mode] *= math.exp(size * sigma.damping_by_mode)
            plant.mode_scales = tuple(scales)

        on = ("modal_damping:robot", "scale"), sigma.damping_by_mode
        yield Inexact(f"damping_by_mode.{mode + 1}", "damping_by_mode", False, "structure", damped,
                      factor_on=on)  # fmt: skip


def _gravity(problem: Problem, record: MeasuredRecord, sigma: Tolerance) -> Iterator[Inexact]:
    def heavier(plant: Changes, size: float) -> None:
        plant.gravity_scale *= math.exp(size * sigma.gravity_stiffness)

    if problem.model.gravity_stiffness:
        yield Inexact("gravity_stiffness", "gravity_stiffness", True, "structure", heavier)


def _tool_points(problem: Problem, record: MeasuredRecord, sigma: Tolerance) -> Iterator[Inexact]:
    for axis, side in enumerate("xyz"):

        def moved(plant: Changes, size: float, axis: int = axis) -> None:
            plant.force_offset = plant.force_offset + size * sigma.tool_point * np.eye(3)[axis]

        yield Inexact(f"tool_point.{side}", "tool_point", True, "structure", moved,
                      "tool_offset:tool")  # fmt: skip


def _directions(problem: Problem, record: MeasuredRecord, sigma: Tolerance) -> Iterator[Inexact]:
    sides = np.linalg.svd(record.setup.blows.direction[None])[2][1:]
    for k, side in enumerate(sides):

        def turned(blows: Blows, size: float, side: FloatArray = side) -> Blows:
            turn = pin.exp3(size * sigma.direction * side)
            return blows.change(direction=turn @ blows.direction)

        yield Inexact(f"direction.{k + 1}", "direction", False, "blows", turned)


def _blows(problem: Problem, record: MeasuredRecord, sigma: Tolerance) -> Iterator[Inexact]:
    blows = record.setup.blows
    if blows.recorded:
        return  # known as well as the sensor that recorded it

    def each(blows: Blows, size: FloatArray) -> FloatArray:
        """The number of every blow; of a blow that has none, nothing."""
        index = blows.hit.astype(int)
        return np.where(index < size.size, size[np.minimum(index, size.size - 1)], 0.0)

    def harder(blows: Blows, size: FloatArray) -> Blows:
        return blows.change(height=blows.height * (1.0 + sigma.blow_force * each(blows, size)))

    def later(blows: Blows, size: FloatArray) -> Blows:
        return blows.change(start=blows.start + sigma.blow_time * each(blows, size))

    if blows.period is None and blows.start.size > 1:
        yield Inexact("blow_force", "blow_force", False, "blows", harder, each_blow=True)
        yield Inexact("blow_time", "blow_time", False, "blows", later, "pulse_jitter:tool",
                      each_blow=True, one_way=True)  # fmt: skip

    def ramped(blows: Blows, size: float) -> Blows:
        rise = size * sigma.rise_time
        if rise <= 0.0:  # no blow is; but a fit may pass through it
            return blows.change(start=blows.start + 0.5 * rise)
        rise = min(rise, 0.5 * blows.shape.end)
        # A blow of another shape rises anyhow: its middle is where the ramped one's is.
        other = None if blows.other is None else blows.other.delayed(0.5 * rise)
        return blows.change(shape=blows.shape.ramped(rise), other=other)

    if _is_flat(blows.shape):
        yield Inexact("rise_time", "rise_time", True, "blows", ramped, one_way=True)


def _is_flat(shape: PiecewiseForce) -> bool:
    """Whether a blow is rectangular: what rises in no time can rise in some."""
    flat = shape.start.size == 1 and not shape.slope.any() and not shape.amplitude.any()
    return flat and math.isfinite(shape.end)


def _sensors(problem: Problem, record: MeasuredRecord, sigma: Tolerance) -> Iterator[Inexact]:
    kinds: Mapping[str, Any] = {c.group: c.kind for c in record.setup.channels}
    for group, kind in kinds.items():

        def louder(sensors: Sensors, size: float, group: str = group) -> None:
            sensors.chain(group).gain *= 1.0 + size * sigma.sensor_gain

        yield Inexact(f"sensor_gain.{group}", "sensor_gain", True, "sensor", louder,
                      f"sensor_gain:{group}")  # fmt: skip
        if not kind.axes:
            continue
        for axis, side in enumerate("xyz"):

            def turned(sensors: Sensors, size: float, group: str = group, axis: int = axis) -> None:
                chain = sensors.chain(group)
                chain.turn = pin.exp3(size * sigma.sensor_angle * np.eye(3)[axis]).T @ chain.turn

            def aside(sensors: Sensors, size: float, group: str = group, axis: int = axis) -> None:
                chain = sensors.chain(group)
                chain.place = chain.place + size * sigma.sensor_position * np.eye(3)[axis]

            yield Inexact(f"sensor_angle.{group}.{side}", "sensor_angle", True, "sensor", turned,
                          f"sensor_misalignment:{group}")  # fmt: skip
            yield Inexact(f"sensor_position.{group}.{side}", "sensor_position", True, "sensor",
                          aside)  # fmt: skip
