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
    force, weight, pull = _vectors(columns, "force"), columns.get("weight"), columns.get("pull")
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
        record.file, _poses(record, columns), force, weight, _vectors(columns, "point"),
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
    frames: dict[str, list[str]] = {}
    found: dict[str, Reading] = {}
    for name, channel in record.source.channels.items():
        kind, subject = channel.kind.name, channel.subject or ""
        if kind == "displacement":
            frames.setdefault(subject, []).append(name)
            along = np.eye(3)[[AXES.index(one[-1]) for one in frames[subject]]]
            values = np.column_stack([columns[one] for one in frames[subject]])
            axes = np.broadcast_to(along, (*values.shape, 3))
            of_frame = f"displacement.{subject}"
            found[of_frame] = Reading(of_frame, values, axes, frame=subject)
        elif kind == "deflection":
            found[name] = Reading(name, columns[name][:, None], joint=subject)
        elif kind == "dial":
            way = _ways(record, columns, "dial_direction", "which way does the dial read?")
            point = _vectors(columns, "dial_point")
            found[name] = Reading(name, columns[name][:, None], way[:, None], point=point)
    if not found:
        hint = "give columns displacement.<frame>.x [m], dial [m] or deflection.<joint> [rad]"
        raise record.source.error("tells nothing that moved", hint=hint)
    return tuple(found.values())


def _vectors(columns: Mapping[str, FloatArray], name: str) -> FloatArray | None:
    """(m, 3) of three columns; axes that are left out are zero; None where all are."""
    given = [columns.get(f"{name}.{axis}") for axis in AXES]
    zero = np.zeros(len(next(iter(columns.values()))))
    if all(one is None for one in given):
        return None
    return np.stack([zero if one is None else one for one in given], axis=1)


def _ways(
    record: Record, columns: Mapping[str, FloatArray], name: str, question: str
) -> FloatArray:
    """(m, 3) of unit length; axes that are left out are zero."""
    way = _vectors(columns, name)
    length = np.zeros(1) if way is None else np.linalg.norm(way, axis=1)
    if way is None or not (length > 0.0).all():
        bad = int(np.argmin(length > 0.0))
        raise record.source.error(f"is zero or missing: {question}", channel=name, sample=bad)
    return np.asarray(way / length[:, None])
