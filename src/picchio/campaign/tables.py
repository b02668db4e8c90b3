"""What `campaign.toml` holds: `picchio-campaign/1`."""

from __future__ import annotations

import math
from collections.abc import Collection
from datetime import UTC, datetime
from pathlib import PurePosixPath, PureWindowsPath
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, PlainValidator

from picchio.campaign.clock import FASTEST, SLOWEST
from picchio.core.toml import Finite, FiniteVector, Name, NotNegative, Positive, StrictModel
from picchio.excitation.piecewise import Hits
from picchio.excitation.table import ExcitationTable

FORMAT = "picchio-campaign/1"
CAMPAIGN_FILE = "campaign.toml"
SUFFIXES = (".csv", ".parquet")
UFF_SUFFIXES = (".uff", ".unv", ".uf")
_ABSOLUTE_ZERO = -273.15


def _inside(value: str) -> str:
    """A relative path with forward slashes that does not leave the campaign's folder."""
    path = PurePosixPath(value)
    leaves = path.is_absolute() or ".." in path.parts or PureWindowsPath(value).drive
    if not value or leaves or "\\" in value or "\0" in value:
        raise ValueError("must be a file inside the campaign's folder")
    return path.as_posix()


def _data_file(value: str) -> str:
    known = (*SUFFIXES, *UFF_SUFFIXES)
    if PurePosixPath(value).suffix not in known:
        raise ValueError(f"must be one of {', '.join(known)}")
    return value


def _date(value: Any) -> Any:
    # TOML has dates of its own; a number would silently be seconds since 1970.
    if not isinstance(value, datetime):
        raise ValueError("must be a date and time such as 2026-03-01T08:00:00Z, without quotes")
    return value if value.tzinfo else value.replace(tzinfo=UTC)


def _direction(value: list[float]) -> list[float]:
    if math.hypot(*value) == 0.0:
        raise ValueError("must not be the zero vector")
    if not 1e-100 < math.hypot(*value) < 1e100:
        raise ValueError("must be a vector of about the length 1")
    return value


def _pose(value: Any) -> Any:
    """By joint name or in the robot's order; one message for both, so no union of types."""
    named = isinstance(value, dict)
    if not named and not isinstance(value, list):
        raise ValueError("must be a table of joint names and values, or a list of values")
    if not value:
        raise ValueError("names no joint")
    for name, number in value.items() if named else enumerate(value):
        if isinstance(number, bool) or not isinstance(number, (int, float)):
            raise ValueError(f"joint {name!r} must be a number")
        if not math.isfinite(number):
            raise ValueError(f"joint {name!r} must be finite")
        if name == "":
            raise ValueError("a joint has no name")
    if named:
        return {name: float(number) for name, number in value.items()}
    return [float(number) for number in value]


def _finite_leaves(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError("every number must be finite")
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    for part in inner:
        _finite_leaves(part)
    return value


def _joint_map(value: dict[str, dict[str, float]]) -> dict[str, dict[str, float]]:
    for joint, row in value.items():
        if not [name for name in row if name != OFFSET]:
            raise ValueError(f"{joint} follows no angle of the controller")
    return value


OFFSET = "offset"
JointMap = Annotated[dict[str, dict[str, Finite]], AfterValidator(_joint_map)]
InsideFile = Annotated[str, AfterValidator(_inside)]
DataFile = Annotated[str, AfterValidator(_inside), AfterValidator(_data_file)]
Direction = Annotated[list[Finite], Field(min_length=3, max_length=3), AfterValidator(_direction)]
_AnyPose = dict[str, float] | list[float]
Pose = Annotated[_AnyPose, PlainValidator(_pose, json_schema_input_type=_AnyPose)]
SampleRate = Annotated[Positive, Field(ge=SLOWEST, le=FASTEST)]
FreeTable = Annotated[dict[str, Any], AfterValidator(_finite_leaves)]


class CampaignExcitation(ExcitationTable):
    """`[excitation]`: the blows as programmed.

    Attributes:
        hits: blows of the burst, followed by silence; a steady state where it is left out.
    """

    file: InsideFile | None = None
    hits: Hits | None = None

    @property
    def blows(self) -> ExcitationTable:
        """The table without `hits`."""
        return ExcitationTable(**self.model_dump(exclude_none=True, exclude={"hits"}))


class Tolerance(StrictModel):
    """`[tolerance]`: standard deviations of the nominal values, all normal.

    What is within them is known beforehand never to be exact: it is no cause of anything. Zero
    means that a value is exact.

    Attributes:
        stiffness: 1, of each joint; drawn once a campaign, as all where nothing else is said.
        damping_ratio: 1, of all modes together.
        damping_by_mode: 1, of each mode by itself; once a pose.
        force: 1, of the blows.
        link_mass: 1, of each link.
        link_com: m, of each link's centre of mass along each axis.
        link_inertia: 1, of each link's moments of inertia.
        pose: rad or m, of each joint's zero.
        pose_repeat: rad or m, of each joint; once a pose.
        direction: rad, of the force; once a record.
        tool_point: m, of where the force acts, along each axis.
        sensor_angle: rad, about each axis of an accelerometer and the like.
        sensor_position: m, of its place along each axis.
        sensor_gain: 1, of each channel group, and of a force that is read in place of stated blows.
        blow_force: 1, from blow to blow.
        blow_time: s, from blow to blow.
        rise_time: s, of how long a blow's force takes to rise and to fall.
        gravity_stiffness: 1, of gravity's change with the deflection.
        static_force: 1, of a scale or load cell.
        dial: m, of a dial gauge.
        torque_gain: 1, of a drive's torque.
    """

    stiffness: NotNegative = 0.05
    damping_ratio: NotNegative = 0.20
    damping_by_mode: NotNegative = 0.10
    force: NotNegative = 0.05
    link_mass: NotNegative = 0.01
    link_com: NotNegative = 0.002
    link_inertia: NotNegative = 0.03
    pose: NotNegative = 3.5e-4
    pose_repeat: NotNegative = 1e-4
    direction: NotNegative = 0.005
    tool_point: NotNegative = 0.001
    sensor_angle: NotNegative = 0.005
    sensor_position: NotNegative = 0.002
    sensor_gain: NotNegative = 0.01
    blow_force: NotNegative = 0.01
    blow_time: NotNegative = 2e-5
    rise_time: NotNegative = 2e-4
    gravity_stiffness: NotNegative = 0.05
    static_force: NotNegative = 0.01
    dial: NotNegative = 1e-5
    torque_gain: NotNegative = 0.03

    def beyond(self, keys: Collection[str]) -> bool:
        """Whether anything but some keys is not exact.

        Args:
            keys: those that do not count.
        """
        return any(value > 0.0 for key, value in self.model_dump().items() if key not in keys)

    @classmethod
    def zero(cls) -> Tolerance:
        """Everything exact."""
        return cls(**dict.fromkeys(cls.model_fields, 0.0))

    def unsaid(self, *keys: str) -> Tolerance:
        """The same with nothing said of some keys.

        Args:
            keys: left out.
        """
        return Tolerance(**self.model_dump(include=self.model_fields_set - set(keys)))


class RecordTable(StrictModel):
    """One `[[record]]`.

    Attributes:
        file: CSV or Parquet file, relative to the campaign's folder.
        kind: "percussion" (the robot stands, the tool hits), "motion" (it moves, nothing hits)
            "static" (a row a loading: weights and pulls, and what moved), "frf" (a row a
            line of one frequency response function) or "clamped" (the tool is held, and motors
            press).
        pose: rad or m, by joint name or in the robot's joint order; of a static
            or motion record, of the joints that have no column.
        force_direction: frf only: the way of the force, world, of any length.
        force_point: m, frf only: where it acts, in `force_frame`; else where the tool's force does.
        force_frame: frf only: the frame of that point; the tool's where it is left out.
        response_direction: frf only: the way in which the sensor reads, world, of any length.
        response_point: m, frf only: where it sits, in `response_frame`; else at its origin.
        response_frame: frf only: the frame that carries it; the tool's where it is left out.
        quantity: frf only: accelerance ((m/s^2)/N, an accelerometer's, tilt included), mobility
            ((m/s)/N) or receptance (m/N).
        response: frf only: which function of a UFF file, by response node and direction: "12+X".
        reference: frf only: likewise, by reference node and direction.
        function: frf only: likewise, by its number among the functions of the file, from 1, or by
            one of the lines that name it there: "H1 : # 2 / # 1".
        joint_map: static only: how the angles of the controller become the URDF's. For each
            joint that differs: the factors of the columns `pose.<name>` whose sum it is, such as
            `joint_3 = { joint_2 = -1, joint_3 = -1 }`, and an `offset` (rad or m) that is added.
        direction: world, of any length; percussion only.
        excitation: keys that override the campaign's `[excitation]`.
        hits: blows of the burst, overriding `[excitation]`.
        force: N, overriding `[excitation]`.
        period: s, overriding `[excitation]`.
        width: s, overriding `[excitation]`.
        preload: N, overriding `[excitation]`.
        time: when it was taken; UTC where it names no zone.
        temperature: deg C, of the robot.
        notes: free text.
    """

    file: DataFile
    kind: Literal["percussion", "motion", "static", "frf", "clamped"] = "percussion"
    pose: Pose | None = None
    joint_map: JointMap | None = None
    force_direction: Direction | None = None
    force_point: FiniteVector | None = None
    force_frame: Name | None = None
    response_direction: Direction | None = None
    response_point: FiniteVector | None = None
    response_frame: Name | None = None
    quantity: Literal["accelerance", "mobility", "receptance"] | None = None
    response: Name | None = None
    reference: Name | None = None
    function: Annotated[int, Field(ge=1, strict=True)] | Name | None = None
    direction: Direction | None = None
    excitation: CampaignExcitation | None = None
    hits: Hits | None = None
    force: Finite | None = None
    period: Positive | None = None
    width: Positive | None = None
    preload: Finite | None = None
    time: Annotated[datetime, BeforeValidator(_date)] | None = None
    temperature: Annotated[float, Field(gt=_ABSOLUTE_ZERO, allow_inf_nan=False)] | None = None
    notes: str | None = None

    def own_excitation(self) -> CampaignExcitation:
        """The excitation's keys given here, in a table of their own or flat."""
        names = ("hits", "force", "period", "width", "preload")
        flat = {name: value for name in names if (value := getattr(self, name)) is not None}
        return (self.excitation or CampaignExcitation()).overridden_by(CampaignExcitation(**flat))

    def percussion_keys(self) -> list[str]:
        """The keys given here that only a percussion record has a use for."""
        names = ("pose", "direction", "excitation", "hits", "force", "period", "width", "preload")
        kept = () if self.kind == "percussion" else ("pose",)
        return [name for name in names if name not in kept and getattr(self, name) is not None]

    def frf_keys(self) -> list[str]:
        """The keys given here that only a frequency response function has a use for."""
        of_frf = ("force_", "response", "reference", "function", "quantity")
        names = [name for name in type(self).model_fields if name.startswith(of_frf)]
        return [name for name in names if getattr(self, name) is not None]


class CampaignTable(StrictModel):
    """A campaign file as it is written.

    Attributes:
        robot: a name from `picchio robots`, or a URDF relative to this file.
        tool: frame where the tool's force acts.
        excitation: the blows as programmed; a record may override any key.
        tolerance: how well the nominal values are known.
        controller: a known control law of motion records; any keys.
        record: the records, one table for each.
        notes: free text.
        provenance: where the data come from; any keys.
    """

    robot: Name | None = None
    tool: Name | None = None
    excitation: CampaignExcitation = CampaignExcitation()
    tolerance: Tolerance = Tolerance()
    controller: FreeTable | None = None
    record: list[RecordTable] = Field(min_length=1)
    notes: str | None = None
    provenance: FreeTable | None = None
