"""What measured records say of a robot's joints: the answer of every way to find it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

from picchio.campaign.campaign import Campaign
from picchio.core import spoken
from picchio.core.arrays import FloatArray
from picchio.core.fitted import Fit, FittedValue
from picchio.core.listing import Key, Listing
from picchio.core.results import TableResult
from picchio.robot.flexible_robot import FlexibleRobot

FORMAT = "picchio-identification/1"
# Half of a two-sided 90 % interval, standard deviations.
_HALF = 1.645


@dataclass(frozen=True)
class Identified:
    """One number of a joint.

    Attributes:
        value, low, high: SI; the interval is 90 %, two-sided.
        told: whether the records tell it, or only the nominal value and its tolerance do.
        why: a sentence.
    """

    value: float
    low: float
    high: float
    told: bool
    why: str

    @classmethod
    def of(cls, value: float, std: float, told: bool, why: str) -> Identified:
        """From a standard deviation.

        Args:
            value: in SI.
            std: standard deviation, same unit.
            told: whether the data constrain it.
            why: the reason where they don't.
        """
        return cls(value, max(value - _HALF * std, 0.0), value + _HALF * std, told, why)


@dataclass(frozen=True)
class IdentifiedJoint:
    """A joint's stiffness (N m/rad or N/m) and damping ratio."""

    name: str
    stiffness: Identified
    damping_ratio: Identified


@dataclass(frozen=True, eq=False)
class Compared:
    """What one record or instrument read, over what the fit has.

    Attributes:
        title: of it.
        across, up: words and unit of the two axes.
        x: (m,) lines or numbers of readings.
        measured, fitted: (m,).
        spread: (m,) standard deviation of what was measured.
        left: residual over signal.
        lines: whether the readings follow each other.
        logarithmic: whether they are told on such a scale.
        coherence: (m,) of a function, 0 to 1; None where it is not told.
    """

    title: str
    across: str
    up: str
    x: FloatArray
    measured: FloatArray
    fitted: FloatArray
    spread: FloatArray
    left: float
    lines: bool
    logarithmic: bool = False
    coherence: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class ModeSeen:
    """A peak of the functions measured at a pose, and the mode of the fit that it is.

    Attributes:
        stand: number of the pose, from 1.
        pose: (nv,) rad or m.
        measured, fitted: Hz.
        damping_ratio: of the fit.
        mac: modal assurance criterion of the functions there, measured against fitted (Allemang,
            Sound and Vibration 37 (2003) 14); NaN of a single function, whose shape is one number.
        shape: (nv,) how the joints turn in it, the largest by one.
    """

    stand: int
    pose: FloatArray
    measured: float
    fitted: float
    damping_ratio: float
    mac: float
    shape: FloatArray


@dataclass(frozen=True)
class PoseLeft:
    """What is left at one pose.

    Attributes:
        where: its records or rows.
        readings: how many.
        left: residual over signal.
    """

    where: str
    readings: int
    left: float


@dataclass(frozen=True, eq=False, repr=False)
class Identification(TableResult, Fit):
    """What `identify` found; its table is the joints.

    Attributes:
        robot: as it was before.
        source: where the data are from, such as the campaign's name.
        joints: every flexible joint.
    """

    BARS = ("stiffness_value",)
    PLOTS: ClassVar = {"bars": "visuals.plots.results:plot_columns"}

    PAGE = "visuals.report.identification:identification_page"
    INDEX = "joint"
    UNITS: ClassVar = {f"stiffness_{part}": "N*m/rad" for part in ("value", "low", "high")}

    robot: FlexibleRobot
    source: str
    joints: tuple[IdentifiedJoint, ...]

    @abstractmethod
    def sidecar_text(self) -> str:
        """The robot's sidecar with the values that were found in it, for `--flex`.

        Values have their spreads, and `[posterior]` says how these are correlated; everything else
        of the joints stays as it was.
        """

    @property
    @abstractmethod
    def remarks(self) -> tuple[str, ...]:
        """What else to say of the answer, a line each."""

    @property
    def doubt(self) -> str:
        """Why to look twice at it; empty where there is no reason."""
        return ""

    def compared(self) -> list[Compared]:
        """What was measured over what was fitted, where the method fits readings."""
        return []

    def modes(self) -> list[ModeSeen]:
        """Every measured peak that a mode explains, where the method fits functions."""
        return []

    def by_pose(self) -> list[PoseLeft]:
        """What is left at each pose, where the method fits readings."""
        return []

    def _told(self) -> str:
        told = sum(joint.stiffness.told for joint in self.joints)
        return f"stiffness of {told} of {len(self.joints)} joints"

    def _fitted(self) -> Iterator[FittedValue]:
        for joint in self.joints:
            units = self.robot.joints[joint.name].units
            for key, unit in (("stiffness", units.of("N*m/rad")), ("damping_ratio", "1")):
                one: Identified = getattr(joint, key)
                std = (one.high - one.low) / (2.0 * _HALF)
                yield FittedValue(
                    f"{key}.{joint.name}",
                    one.value,
                    std,
                    unit,
                    0.0,
                    note=one.why if not one.told else "",
                )

    def _seen(self) -> Mapping[str, Any]:
        return {"robot": self.robot}

    def _listing(self) -> Listing:
        """What the joints are, within which bounds, and whether the data say so."""
        between = lambda one: spoken.between((one.low, one.high))  # noqa: E731
        columns: dict[str, Key] = {
            "joint": "name",
            "stiffness [N m/rad, N/m]": lambda j: j.stiffness.value,
            "90 % interval": lambda j: between(j.stiffness),
            "determined by the data": lambda j: j.stiffness.told,
            "damping ratio": lambda j: j.damping_ratio.value,
            "its 90 % interval": lambda j: between(j.damping_ratio),
            "damping determined": lambda j: j.damping_ratio.told,
        }
        return Listing.of("Stiffness and damping", self.joints, columns)

    def _rows(self) -> list[dict[str, Any]]:
        return [
            {
                "joint": joint.name,
                **{f"stiffness_{k}": v for k, v in asdict(joint.stiffness).items()},
                **{f"damping_ratio_{k}": v for k, v in asdict(joint.damping_ratio).items()},
            }
            for joint in self.joints
        ]


class Method(ABC):
    """A way to find the joints' numbers from some kinds of records.

    Attributes:
        name: of the way.
        kinds: of the records that it takes, any mix of them.
        needs_springs: kinds with which every robot needs flexible joints.
    """

    name: ClassVar[str]
    kinds: ClassVar[frozenset[str]]
    needs_springs: ClassVar[frozenset[str]]

    @abstractmethod
    def identify(
        self,
        robot: FlexibleRobot,
        campaign: Campaign,
        *,
        workers: int | None = None,
        progress: Callable[[str], None] | None = None,
    ) -> Identification:
        """What the records say of every joint.

        Args:
            robot: the nominal one.
            campaign: records of these kinds.
            workers: processes; as many as cores if None.
            progress: told what is being done.
        """
