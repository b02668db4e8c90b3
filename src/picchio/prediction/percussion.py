"""What every channel of a percussion record would have read, by a model with any effects."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence

import numpy as np

from picchio.campaign import Campaign, Channel, Record
from picchio.campaign.tables import CAMPAIGN_FILE
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError, PicchioWarning
from picchio.model import Model
from picchio.model.blows import Blows
from picchio.model.conditions import Conditions
from picchio.model.effects import Effect
from picchio.model.geometry import Geometry
from picchio.prediction.percussion_setup import InCommon, PercussionSetup
from picchio.robot import FlexibleRobot
from picchio.robot.expansion import WideChain
from picchio.vibration.integrate import Samples

PREDICTED = (
    "force",
    "deflection",
    "acceleration",
    "accelerometer",
    "velocity",
    "displacement",
)
POSITION_KINDS = ("deflection", "displacement")
_SECONDS_A_DAY = 86400.0


def percussion_setups(
    robot: FlexibleRobot, campaign: Campaign, *, records: Sequence[Record] | None = None
) -> list[PercussionSetup]:
    """What is needed to predict a campaign's percussion records.

    Poses that are the same share their geometry, blows that are the same their force.

    Args:
        robot: the robot.
        campaign: the records.
        records: only these.

    Raises:
        InputError: a pose that does not fit the robot, a channel of a joint or frame it does
            not have, a record without stated blows or measured force.
    """
    chain, geometries = WideChain(robot), {}  # type: WideChain, dict[bytes, Geometry]
    chosen = [r for r in (records or campaign.records) if r.kind == "percussion"]
    taken = [r.taken for r in chosen if r.taken is not None]
    warm = [r.temperature for r in chosen if r.temperature is not None]
    setups, in_common = [], InCommon()
    for record in chosen:
        pose = _pose(robot, campaign, record)
        geometry = geometries.setdefault(pose.tobytes(), Geometry(chain, pose))
        days = (
            (record.taken - min(taken)).total_seconds() / _SECONDS_A_DAY if record.taken else None
        )
        kelvin = (
            record.temperature - float(np.mean(warm)) if record.temperature is not None else None
        )
        clock = record.clock
        rotation = geometry.motion(robot.tool_frame).rotation
        blows = _blows(record).change(tool_rotation=rotation)
        _warn_of_blows_beyond(record)
        setups.append(
            PercussionSetup(
                record.file,
                geometry,
                blows,
                Conditions(record.file, days, kelvin),
                Samples(clock.start, clock.step, clock.samples),
                _channels(record, robot),
                in_common,
            )
        )
    return setups


def _pose(robot: FlexibleRobot, campaign: Campaign, record: Record) -> FloatArray:
    try:
        return robot.pose(record.pose)  # type: ignore[arg-type]
    except InputError as error:
        number = next((i for i, r in enumerate(campaign.records) if r is record), None)
        place = "record" if number is None else f"record[{number}]"
        file = None if campaign.folder is None else campaign.folder / CAMPAIGN_FILE
        raise error.placed(file=file, key=f"{place}.pose") from None


def _warn_of_blows_beyond(record: Record) -> None:
    """Say that a burst goes on after its record's end: milliseconds given as seconds, often."""
    period, hits = record.excitation.period, record.hits
    end = record.clock.start + record.clock.step * (record.clock.samples - 1)
    if period is None or hits is None or (hits - 1) * period <= end:
        return
    warnings.warn(
        f"{record.file} ends at {end:.3g} s, before the last of {hits} blows at "
        f"{(hits - 1) * period:.3g} s: is the period of {period:g} s right?",
        PicchioWarning,
        stacklevel=3,
    )


def _blows(record: Record) -> Blows:
    direction = record.direction
    assert direction is not None
    excitation = record.blows()
    if excitation is None:
        from picchio.excitation import MeasuredForce

        data = record.read(["force"])
        after = data["time"] >= -1e-12
        excitation = MeasuredForce(data["time"][after], data["force"][after])
        return Blows.of(excitation, 1, direction)
    return Blows.of(excitation, record.hits, direction)


def _channels(record: Record, robot: FlexibleRobot) -> tuple[Channel, ...]:
    found = []
    for name in record.channels:
        channel = record.channel(name)
        kind = channel.kind.name
        if kind not in PREDICTED or (kind == "velocity" and channel.axis is None):
            continue
        if kind == "deflection" and channel.subject not in robot.flexible_names:
            raise InputError(
                f"{record.file} has a deflection of a joint that is not flexible",
                key=name,
                value=channel.subject,
                choices=robot.flexible_names,
            )
        if channel.kind.of == "frame":
            robot.link_of(channel.subject or "")
        found.append(channel)
    return tuple(found)


def predict(
    robot: FlexibleRobot,
    campaign: Campaign,
    effects: Sequence[Effect] = (),
    *,
    gravity_stiffness: bool = True,
) -> Mapping[str, dict[str, FloatArray]]:
    """What every percussion record would have read: {file: {channel: (samples,)}}, SI.

    Raises:
        InputError: as `percussion_setups`.
    """
    model = Model(robot, gravity_stiffness).with_effects(effects)
    return {s.name: s.predict(model) for s in percussion_setups(robot, campaign)}
