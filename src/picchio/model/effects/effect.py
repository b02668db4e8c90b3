"""The base of everything that can be wrong with a simulation: an effect on the model.

An effect is a small immutable object: a name, a target, parameters with units and bounds, and how
it changes the robot's equations, its blows, its sensors or its motion. What else must be known of
it, it declares: where it may be at work, how it is drawn, what numbers it draws anew in every
record. To add one, write a class in a file of its own in this folder, or anywhere and name it in
the entry-point group `picchio.effects`.
"""

from __future__ import annotations

import math
from abc import ABC
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

import numpy as np

from picchio.core.errors import InputError
from picchio.model.conditions import Conditions

if TYPE_CHECKING:
    from picchio.core.arrays import FloatArray
    from picchio.model.blows import Blows
    from picchio.model.effects.evidence import Evidence
    from picchio.model.effects.scales import Scales
    from picchio.model.motion import Motion
    from picchio.model.plant import Changes
    from picchio.model.sensing import Sensors
    from picchio.robot.flexible_robot import FlexibleRobot

Where = Literal["structure", "nonlinear", "blows", "over-time", "sensor", "motion"]
TargetKind = Literal[
    "joint", "joint pair", "link", "joint or link", "tool", "robot", "axis", "channel group"
]


@dataclass(frozen=True)
class Parameter:
    """One number that says how strong an effect is.

    Attributes:
        name: as in JSON.
        unit: SI; "1" for a pure number.
        neutral: the value at which nothing changes (may be infinite).
        lower: smallest value allowed.
        upper: largest.
        logarithmic: whether steps are ratios rather than differences.
        meaning: one line.
        size: of a linear one, in what steps it is fitted from 0; see `size_beside` where 0.
        share: of the other parameters' size, where they start away from 0 and it does not.
        by_inverse: of one that is neutral at infinity: whether half of it does twice as much.
        shape: whether it says where or how, not how much: by itself it changes nothing.
        whole: whether it is a whole number: tried, not fitted.
        spread: what is known beforehand: its standard deviation about `centre`; 0: nothing.
        centre: what that is about; `neutral` where None.
        moving: the smallest value that a motion may tell; as `lower` where None.
    """

    name: str
    unit: str = "1"
    _: KW_ONLY
    neutral: float = 0.0
    lower: float = -math.inf
    upper: float = math.inf
    logarithmic: bool = False
    meaning: str = ""
    size: float = 0.0
    share: float = 1.0
    by_inverse: bool = False
    shape: bool = False
    whole: bool = False
    spread: float = 0.0
    centre: float | None = None
    moving: float | None = None

    def size_beside(self, typical: float) -> float:
        """The size of a linear parameter that starts at 0.

        Args:
            typical: size of the effect's largest linear parameter.
        """
        return self.size or self.share * typical


@dataclass(frozen=True)
class Latent:
    """Numbers that an effect draws anew in every record (`Effect.hidden`).

    A fit moves them together with what all records share, by differences; where the numbers
    have a structure that makes more possible, it is declared here.

    Attributes:
        what: the numbers, for people.
        spread: the effect's parameter that says how large they are; it follows from them.
        step: by which a number is moved to see what it changes.
        lower, upper: bounds of a number.
        count: how many a record has; None: one for each blow, that of the first being 0.
        whole: a number is 0 or 1.
        times: the numbers are by how many s blows come late, at most half an interval: blows are
            looked for one after the other.
        linear: readings change in proportion to the numbers: they are solved for in the
            residual (`Effect.take_out`), not fitted.
    """

    what: str
    spread: str
    step: float = 1e-3
    lower: float = -1e6
    upper: float = 1e6
    count: int | None = None
    whole: bool = False
    times: bool = False
    linear: bool = False

    @property
    def first(self) -> int:
        """The index of the first number that is free."""
        return 1 if self.count is None else 0

    def size(self, hits: int) -> int:
        """How many numbers a record of so many blows has.

        Args:
            hits: blows of the record.
        """
        return hits if self.count is None else self.count


class Effect(ABC):
    """One departure of the world from the simulation.

    Args:
        target: the joint, link, axis, channel group, "tool" or "robot" that it is about.
        **values: its parameters, SI; those left out are neutral.

    Attributes:
        values: its parameters.
        hidden: record -> numbers that are drawn anew in every record.
        name: as in files.
        where: what it changes.
        target_kind: what it is about.
        parameters: what says how strong it is.
        meaning: one line for people.
        motion_meaning: another line where it is seen in a motion; `meaning` where empty.
        source: of the model.
        latent: what `hidden` holds; None where it draws nothing anew.
        discrete: nothing lies between its values: they are tried, not fitted.
        mark: how a scene draws it (`picchio.visuals.scene.causes.drawings`); by its target where
            empty.
        tried: values of typical size to try in screening; where they depend on the campaign, the
            effect overrides `trials`.
        takes: what the records must have to show it, a key of `evidence.LACKING`; empty where
            any will do.
        among: fields of `Evidence`: the channel groups at which it may be at work.
        tolerance: the key of `[tolerance]` that says how far its `scale` may be from 1 without
            being a cause; empty where nothing is tolerated.
        exceeds: the key of `[tolerance]` that it goes beyond where it is a cause, if that is not
            `tolerance`; empty where nothing of the kind is tolerated.
        sidecar: the key of a sidecar that its value belongs to: "stiffness" or "rotor_inertia" of
            a joint, "damping_ratio" of all, "mass" of the tool; empty where a sidecar has no place
            for it.
        urdf: attribute of URDF's <dynamics> -> the parameter that it states.
        needs: the effect without which, at the same target, this one has no meaning.
        refines: the effect that this one tells with more numbers: where that one shows, too, it
            takes the place of one that was found (`finer_than`); from blows it is not looked for
            otherwise.
        over: effects on joints that do in each joint by themselves what this one does: in a motion
            it has to gain beside all of them, found or not. What couples joints is told by that.
        beside: parameters of which bodies may do as much: in a motion, the others have to gain.
        weighs: in a motion, it is told by what bodies weigh: not where nobody says how they stand.
        within: in a motion, parameter -> (effect, parameter) at the same target, which it is no
            larger than: friction does not push.
        everywhere: in a motion, it gains in each channel that it acts in, or is not there.
        usual: where effects explain a motion equally well, the smallest comes first.
        elastic: in a motion, it winds the gear up, which is looked for once loads are known.
        periodic: in a motion, a wave of `order` periods a turn, found as a line in the residual.
        late: in a motion, its `delay` is by how many s its channel group is late.
        inverse: parameters whose inverse a motion tells, 0 being a rigid drive.
        told_by: what else a motion should have for it to be told from others.
        linear: of a class on a joint: parameters, neutral at 0, in which what `motion` adds is
            linear, all together; such an effect adds to no body torque, scales and delays nothing.
            Fits of motion records go faster by it; nothing else changes.
        refused: of a class: question -> why it has no answer with this effect, a sentence;
            "steady state" is such a question.

    Raises:
        InputError: an unknown parameter, a value out of bounds.
    """

    name: ClassVar[str]
    where: ClassVar[Where]
    target_kind: ClassVar[TargetKind]
    parameters: ClassVar[tuple[Parameter, ...]]
    meaning: ClassVar[str]
    motion_meaning: ClassVar[str] = ""
    source: ClassVar[str] = ""
    latent: ClassVar[Latent | None] = None
    discrete: ClassVar[bool] = False
    mark: ClassVar[str] = ""
    tried: ClassVar[tuple[Mapping[str, float], ...]] = ()
    takes: ClassVar[str] = ""
    among: ClassVar[tuple[str, ...]] = ("groups",)
    tolerance: ClassVar[str] = ""
    exceeds: ClassVar[str] = ""
    sidecar: ClassVar[str] = ""
    urdf: ClassVar[Mapping[str, str]] = {}
    needs: ClassVar[str] = ""
    refines: ClassVar[str] = ""
    over: ClassVar[tuple[str, ...]] = ()
    beside: ClassVar[tuple[str, ...]] = ()
    weighs: ClassVar[bool] = False
    within: ClassVar[Mapping[str, tuple[str, str]]] = {}
    everywhere: ClassVar[bool] = False
    usual: ClassVar[int] = 99
    elastic: ClassVar[bool] = False
    periodic: ClassVar[bool] = False
    late: ClassVar[bool] = False
    inverse: ClassVar[tuple[str, ...]] = ()
    told_by: ClassVar[str] = ""
    linear: ClassVar[tuple[str, ...]] = ()
    refused: ClassVar[Mapping[str, str]] = {}

    def __init__(self, target: str, **values: float) -> None:
        known = {p.name: p for p in self.parameters}
        for key, value in values.items():
            if key not in known:
                raise InputError(
                    "no such parameter", key=f"{self.name}.{key}", value=value, choices=known
                )
            bounds = known[key]
            inside = bounds.lower <= value <= bounds.upper or value == bounds.neutral
            if math.isnan(value) or not inside:
                raise InputError(
                    f"must lie between {bounds.lower:g} and {bounds.upper:g} "
                    f"{'' if bounds.unit == '1' else bounds.unit}".rstrip(),
                    key=f"{self.name}.{key}",
                    value=value,
                )
        self.target = target
        self.values: Mapping[str, float] = {
            p.name: float(values.get(p.name, p.neutral)) for p in self.parameters
        }
        self.hidden: Mapping[str, tuple[float, ...]] = {}

    def __repr__(self) -> str:
        numbers = ", ".join(f"{k}={v:.6g}" for k, v in self.values.items())
        return f"{type(self).__name__}({self.target!r}{', ' if numbers else ''}{numbers})"

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and self.key == other.key  # type: ignore[attr-defined]

    def __hash__(self) -> int:
        return hash(self.key)

    @cached_property
    def key(self) -> tuple[Any, ...]:
        """What tells this effect from another."""
        return (self.name, self.target, *self.values.items(), *self.hidden.items())

    @property
    def fitted(self) -> tuple[Parameter, ...]:
        """The parameters that a fit moves: not those that are whole numbers, which are tried."""
        return tuple(p for p in self.parameters if not p.whole)

    @property
    def label(self) -> str:
        """Name and target, for people."""
        return f"{self.name}:{self.target}"

    def unit(self, parameter: str) -> str:
        """The unit of a parameter at this effect's target, SI.

        Args:
            parameter: its name.
        """
        return next(p.unit for p in self.parameters if p.name == parameter)

    def with_values(self, **values: float) -> Self:
        """The same effect with other values.

        Args:
            values: parameter = value in SI; others stay.
        """
        neutral = {p.name: p.neutral for p in self.parameters}
        kept = {k: v for k, v in self.values.items() if v != neutral[k]}
        return type(self)(self.target, **{**kept, **values}).with_hidden(self.hidden)

    @classmethod
    def finer_than(cls, coarse: Effect) -> list[Self]:
        """This effect where it does what the one does that it refines: where to start a fit.

        Args:
            coarse: at work at the same target.
        """
        own = {p.name for p in cls.parameters}
        return [cls(coarse.target, **{k: v for k, v in coarse.values.items() if k in own})]

    def bounded(self, **values: float) -> Self:
        """The same effect with other values, brought within their bounds.

        Args:
            **values: SI, by parameter.
        """
        known = {p.name: p for p in self.parameters}
        return self.with_values(
            **{k: min(max(v, known[k].lower), known[k].upper) for k, v in values.items()}
        )

    def with_hidden(self, hidden: Mapping[str, tuple[float, ...]]) -> Self:
        """The same effect with other numbers drawn anew in every record.

        Args:
            hidden: record -> its numbers.
        """
        other = type(self).__new__(type(self))
        other.target, other.values = self.target, self.values
        other.hidden = {k: tuple(float(x) for x in v) for k, v in hidden.items()}
        return other

    def coarser(self, intervals: Mapping[str, float]) -> tuple[Effect, ...]:
        """Effects of few numbers that do nearly what the hidden ones do.

        Args:
            intervals: record -> time from blow to blow as programmed, s.

        Returns:
            with their values; none where the hidden numbers follow no rule.
        """
        return ()

    def drawn(self, blows: Blows, conditions: Conditions) -> FloatArray | None:
        """The numbers (h,) of a record's blows; zero beyond those drawn, None for other records.

        Args:
            blows: of the record.
            conditions: of the record.
        """
        numbers = self.hidden.get(conditions.record)
        if numbers is None:
            return None
        index = blows.hit.astype(int)
        every = np.zeros(max(len(numbers), index.max(initial=0) + 1))
        every[: len(numbers)] = numbers
        return np.asarray(every[index])

    def tolerances(self, tolerated: Mapping[str, float]) -> float | None:
        """By how many standard deviations of what is tolerated it is away from doing nothing.

        Args:
            tolerated: key of `[tolerance]` -> standard deviation: relative of a factor, else SI.

        Returns:
            None where nothing of the kind is tolerated.
        """
        sigma = tolerated.get(self.exceeds or self.tolerance, 0.0)
        if sigma <= 0.0:
            return None
        away = [
            math.log(self.values[p.name] / p.neutral) if p.logarithmic and p.neutral > 0.0
            else self.values[p.name] - p.neutral
            for p in self.parameters
        ]  # fmt: skip
        return math.hypot(*away) / sigma

    def to_dict(self) -> dict[str, Any]:
        """As in a model file."""
        table = {"effect": self.name, "target": self.target, "parameters": dict(self.values)}
        if self.hidden:
            table["hidden"] = {record: list(numbers) for record, numbers in self.hidden.items()}
        return table

    def without_load(self, conditions: Conditions) -> str | None:
        """Why this effect leaves the joints' loads under the tool alone; None if it changes them.

        Args:
            conditions: under which the loads are asked for.
        """
        if self.where == "sensor" or self.takes == "recorded":
            return "changes what a sensor reads, not the loads"
        if self.where == "motion":
            return "acts while the robot moves, not while the tool hits"
        if self.latent is not None and conditions.record not in self.hidden:
            return "is drawn anew in every record, and no record is named here"
        return None

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """Values of typical size, to see what the effect would do to these data.

        Args:
            scales: sizes of deflections, torques and readings in the campaign.

        Returns:
            a dictionary of values a trial.
        """
        return [dict(values) for values in self.tried]

    def early_trials(self, scales: Scales) -> list[dict[str, float]]:
        """As `trials`, for the first few cycles: more of them where a resonance is narrow.

        Args:
            scales: sizes of deflections, torques and readings in the campaign.
        """
        return self.trials(scales)

    def tried_at(self, scales: Scales, early: bool = False) -> list[Self]:
        """The effect at the values of its trials, each brought within its bounds.

        Args:
            scales: sizes of deflections, torques and readings in the campaign.
            early: those for the first few cycles.
        """
        sizes = self.early_trials(scales) if early else self.trials(scales)
        return [self.bounded(**values) for values in sizes]

    def follows(self, robot: FlexibleRobot) -> dict[str, tuple[float, str]]:
        """Quantities that follow from its values, for people.

        Args:
            robot: that it is at work in.

        Returns:
            name -> value and unit, SI; none of its parameters.
        """
        return {}

    def possible(self, robot: FlexibleRobot) -> Mapping[str, tuple[float, float]]:
        """What a motion of this robot may tell of it: no body that cannot exist.

        Args:
            robot: that it is at work in.

        Returns:
            parameter -> least and most, SI, where that is narrower than the parameter's bounds.
        """
        return {}

    # Where it may be at work -----------------------------------------------------------------

    @classmethod
    def shows(cls, motion: bool) -> bool:
        """Whether it changes anything in motion records, or else in percussion records.

        Args:
            motion: of the record.
        """
        return cls.motion is not Effect.motion if motion else cls.where != "motion"

    @classmethod
    def targets(cls, evidence: Evidence) -> list[str]:
        """Where it could be at work, as far as the target goes.

        Args:
            evidence: what the records can show.
        """
        if evidence.motion and cls.elastic:
            return list(evidence.wound)
        return evidence.targets(cls.target_kind, cls.among)

    @classmethod
    def why_not(cls, evidence: Evidence) -> str:
        """Why these records cannot show it, one clause; empty where they can.

        Args:
            evidence: what the records can show.
        """
        return evidence.lacks("posed" if cls.weighs and evidence.motion else cls.takes)

    @classmethod
    def applies(cls, evidence: Evidence) -> list[str]:
        """The targets at which it may be looked for in some records; none where it may not.

        Args:
            evidence: what the records can show.
        """
        if not cls.shows(evidence.motion) or cls.why_not(evidence):
            return []
        return cls.targets(evidence)

    @classmethod
    def yields_along(cls, target: str) -> str:
        """The coordinate along which a spring of its own yields under the robot's load.

        Args:
            target: of the effect.

        Returns:
            a name of `WideChain`, such as a joint's; empty where there is none.
        """
        return ""

    # Hooks: an effect overrides those that concern it ----------------------------------------

    def structure(self, plant: Changes) -> None:  # noqa: B027
        """Change the robot's equations of motion.

        Args:
            plant: what may be changed.
        """

    def blows(self, blows: Blows, conditions: Conditions) -> Blows:
        """Change the blows.

        Args:
            blows: as programmed, or as other effects left them.
            conditions: of the record.

        Returns:
            the changed blows.
        """
        return blows

    def sense(self, sensors: Sensors, conditions: Conditions) -> None:  # noqa: B027
        """Change how channels read.

        Args:
            sensors: the chains that may be changed.
            conditions: of the record.
        """

    def motion(self, motion: Motion) -> None:  # noqa: B027
        """Change what drives and encoders read while the robot moves.

        Args:
            motion: of the record, to be changed.
        """

    def draw(self, rng: np.random.Generator, hits: int) -> FloatArray:
        """The numbers of one more record, drawn at random; see `latent`.

        Args:
            rng: of the random numbers.
            hits: blows of the record.

        Returns:
            `latent.size(hits)` numbers.

        Raises:
            InputError: an effect without such numbers.
        """
        raise InputError("draws no numbers", key=self.label)

    def take_out(self, rows: FloatArray, time: FloatArray) -> tuple[FloatArray, tuple[float, ...]]:
        """What is left of readings without what its own numbers explain; see `Latent.linear`.

        Args:
            rows: (channels, m) of its channel group.
            time: (m,) s.

        Returns:
            (channels, m), and the numbers.

        Raises:
            InputError: an effect without such numbers.
        """
        raise InputError("has no numbers that readings are linear in", key=self.label)

    def motion_trials(self, motion: Motion) -> list[dict[str, float]]:
        """Values to try of what enters a motion record nonlinearly; the rest is solved for.

        Args:
            motion: of the record.

        Returns:
            a dictionary of values a trial.
        """
        return [{}]


# A parameter in the unit of whatever its group of channels reads.
CHANNEL_UNIT = "channel"


def factor(name: str, lower: float, upper: float, meaning: str) -> Parameter:
    """A parameter that multiplies what is stated: 1 changes nothing, and steps are ratios.

    Args:
        name: as in JSON.
        lower: smallest value allowed.
        upper: largest.
        meaning: one line.
    """
    return Parameter(name, neutral=1.0, lower=lower, upper=upper, logarithmic=True, meaning=meaning)
