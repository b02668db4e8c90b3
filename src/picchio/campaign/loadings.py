"""A static record: a row a loading, as arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from picchio.campaign.channels import AXES
from picchio.campaign.record import Record
from picchio.campaign.tables import OFFSET
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError


@dataclass(frozen=True, eq=False)
class Reading:
    """What one instrument read in every loading of a record.

    Attributes:
        name: of the instrument: "displacement.tool", "dial" or "deflection.joint_1".
        values: (m, axes) m or rad, loaded less unloaded.
        axes: (m, axes, 3) the directions that it reads, world; none of a joint's deflection.
        frame: the frame whose origin it reads; None of a dial and a joint.
        joint: the joint whose deflection it is; None of the others.
        point: (m, 3) m, tool frame, where a dial touches; None: where the force acts.
    """

    name: str
    values: FloatArray
    axes: FloatArray | None = None
    frame: str | None = None
    joint: str | None = None
    point: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Loadings:
    """The m loadings of one record.

    Attributes:
        file: the record's name.
        pose: (m,) rad or m by the URDF's joints, as far as the record tells them.
        force: (m, 3) N, world; None where weights hang.
        weight: (m,) N; None where forces pull.
        point: (m, 3) m, tool frame, where they act; None where nothing is said.
        readings: what moved.
        set: (m,) whose zero each row shares; None where each has its own.
    """

    file: str
    pose: Mapping[str, FloatArray]
    force: FloatArray | None
    weight: FloatArray | None
    point: FloatArray | None
    readings: tuple[Reading, ...]
    set: FloatArray | None

    def __len__(self) -> int:
        return len(self.readings[0].values)


def read_loadings(record: Record) -> Loadings:
    """The loadings of a static record.

    Args:
        record: of the kind "static".

    Raises:
        InputError: a number that is missing or none; no load, or two; no pose; nothing that moved;
            a joint of `joint_map` whose columns are not there; a dial or pull without direction.
    """
    columns = record.read()
    if len(next(iter(columns.values()))) == 0:
        raise record.source.error("holds no loading")

    def vectors(name: str) -> FloatArray | None:
        """(m, 3); axes that are left out are zero."""
        given = [columns.get(f"{name}.{axis}") for axis in AXES]
        size = next((len(one) for one in given if one is not None), None)
        if size is None:
            return None
        return np.stack([np.zeros(size) if one is None else one for one in given], axis=1)

    force, weight, pull = vectors("force"), columns.get("weight"), columns.get("pull")
    count = sum(one is not None for one in (force, weight, pull))
    if count != 1:
        raise record.source.error(
            f"the load {'is stated twice' if count else 'is missing'}",
            hint="give columns force.x [N], force.y, force.z, or weight [N], or pull [N] with "
            "pull_direction.x, .y, .z",
        )
    if pull is not None:
        force = pull[:, None] * _ways(record, columns, "pull_direction", "which way does it pull?")
    return Loadings(
        record.file, _poses(record, columns), force, weight, vectors("point"),
        _readings(record, columns), columns.get("set"),
    )  # fmt: skip


def _poses(record: Record, columns: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """(m,) of each joint: the record's own pose, the columns, what `joint_map` makes of them."""
    size = len(next(iter(columns.values())))
    told = {name.partition(".")[2]: x for name, x in columns.items() if name.startswith("pose.")}
    table = record.table.joint_map or {}
    found: dict[str, FloatArray] = {}
    if isinstance(record.pose, dict):
        found = {joint: np.full(size, value) for joint, value in record.pose.items()}
    elif record.pose is not None:
        raise InputError("must name the joints in a static record", file=record.source.path,
                         key=f"{record.source.key}.pose", value=record.pose)  # fmt: skip
    used = {name for row in table.values() for name in row}
    found |= {name: x for name, x in told.items() if name not in used or name in table}
    for joint, row in table.items():
        found[joint] = np.full(size, row.get(OFFSET, 0.0))
        for name, factor in row.items():
            if name == OFFSET:
                continue
            if name not in told:
                raise InputError(f"{record.file} has no column of this name",
                                 key=f"{record.source.key}.joint_map.{joint}",
                                 value=f"pose.{name}",
                                 choices=[f"pose.{known}" for known in told])  # fmt: skip
            found[joint] = found[joint] + factor * told[name]
    # An angle that only others follow, and no row gives anew, is the joint's own, too.
    found |= {name: x for name, x in told.items() if name in used and name not in found}
    if not found:
        raise record.source.error("tells no pose", hint="give columns pose.<joint> [rad]")
    return found


def _readings(record: Record, columns: Mapping[str, FloatArray]) -> tuple[Reading, ...]:
    size = len(next(iter(columns.values())))
    found: dict[str, Reading] = {}
    for name, channel in record.source.channels.items():
        values = columns[name]
        if channel.kind.name == "displacement":
            frame = channel.subject
            axis = np.tile(np.eye(3)[AXES.index(channel.axis or "x")], (size, 1))[:, None]
            before = found.get(f"displacement.{frame}")
            if before is not None and before.axes is not None:
                values = np.column_stack([before.values, values])
                axis = np.concatenate([before.axes, axis], axis=1)
            else:
                values = values[:, None]
            found[f"displacement.{frame}"] = Reading(
                f"displacement.{frame}", values, axis, frame=frame
            )
        elif channel.kind.name == "deflection":
            found[name] = Reading(name, values[:, None], joint=channel.subject)
        elif channel.kind.name == "dial":
            found[name] = _dial(record, columns)
    if not found:
        hint = "give columns displacement.<frame>.x [m], dial [m] or deflection.<joint> [rad]"
        raise record.source.error("tells nothing that moved", hint=hint)
    return tuple(found.values())


def _dial(record: Record, columns: Mapping[str, FloatArray]) -> Reading:
    size = len(columns["dial"])
    way = _ways(record, columns, "dial_direction", "which way does the dial read?")

    def column(name: str, axis: str) -> FloatArray:
        return columns.get(f"{name}.{axis}", np.zeros(size))

    point = None
    if any(f"dial_point.{axis}" in columns for axis in AXES):
        point = np.stack([column("dial_point", axis) for axis in AXES], axis=1)
    return Reading("dial", columns["dial"][:, None], way[:, None], point=point)


def _ways(
    record: Record, columns: Mapping[str, FloatArray], name: str, question: str
) -> FloatArray:
    """(m, 3) of unit length; axes that are left out are zero."""
    size = len(next(iter(columns.values())))
    way = np.stack([columns.get(f"{name}.{axis}", np.zeros(size)) for axis in AXES], axis=1)
    length = np.linalg.norm(way, axis=1)
    if not (length > 0.0).all():
        bad = int(np.argmin(length > 0.0))
        raise record.source.error(f"is zero or missing: {question}", channel=name, sample=bad)
    return np.asarray(way / length[:, None])
