"""What a diagnosis says: `picchio-diagnosis/1`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from picchio.core import spoken
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.core.fitted import Fit, FittedValue
from picchio.core.results import TableResult
from picchio.core.shown import named_function
from picchio.model.effects.effect import Effect
from picchio.model.effects.registry import effect_class
from picchio.model.model import Model
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.loading.saved_model import saved_model_text

if TYPE_CHECKING:
    from picchio.visuals.report.motion_figures import View

# What percussion and motion records are judged by alike.

BEYOND_DOUBT = 0.99
"""The least confidence, over the poses, of what is claimed though not all is explained."""

MOSTLY = 0.8
"""The least share of the held-out excess that the causes of a `partial` verdict explain.

Of motion records, and where one kind of records is unexplained; of blows, where all but the causes
is exact, more is asked for (`percussion/conclude/verdict.py`).

"Most of it" in the verdict's words. Four fifths, not a half: a wrong cause that is merely like the
true one takes away half of its power as soon as the two are correlated by 0.71 (the share is the
correlation squared), which stiffness, inertia and friction of one joint often are; by 0.89 they
hardly ever are without being told as a set.
"""

FORMAT = "picchio-diagnosis/1"
_HARDLY = 1e-4  # of the signal, RMS, that is not worth a sentence
_SHOWN = 3  # causes that one line names
# Of noise's power: by how much that of a campaign's records is not just what it is on average.
_SCATTER = 0.01

Verdict = Literal["nothing-wrong", "named", "ambiguous", "partial", "unexplained"]
VERDICTS: dict[str, str] = {
    "nothing-wrong": "the model agrees with the records within noise and tolerances",
    "named": "the cause is found; no more than noise, or little more, is unexplained",
    "ambiguous": "several sets of causes explain the records; these data cannot tell them apart",
    "partial": "most is explained by these causes, or by what acts much like them; not all",
    "unexplained": "the model is wrong, and no cause can be claimed",
}


@dataclass(frozen=True)
class Value:
    """A fitted number: value and standard deviation, in `unit` (SI)."""

    value: float
    std: float
    unit: str


def unit_of(robot: FlexibleRobot, target: str, unit: str) -> str:
    """A parameter's unit, SI; newtons and metres where the target is a prismatic joint.

    Args:
        robot: the robot.
        target: a joint, or anything else.
        unit: at a revolute joint.
    """
    joint = robot.tree.joints.get(target)
    return unit if joint is None else joint.units.of(unit)


@dataclass(frozen=True)
class Cause:
    """An effect that is held to be there.

    Attributes:
        effect: its name.
        target: the joint, link, axis, channel group, "tool" or "robot".
        confidence: 0 to 1, from score differences with one pose (or record) left out at a time.
        parameters: name -> value.
        tolerances: how many standard deviations of what `[tolerance]` allows it is off by; None
            where nothing of the kind is tolerated.
    """

    effect: str
    target: str
    confidence: float
    parameters: Mapping[str, Value] = field(default_factory=dict)
    tolerances: float | None = None

    def told(self, model: Model | None) -> str:
        """The cause with its values, such as "payload of tool: mass 2.1 kg".

        Args:
            model: that has it; what is stated of its robot is held against the value.
        """
        what = effect_class(self.effect).sidecar
        joint = next((j for j in model.robot.flexible_joints if j.name == self.target), None) \
            if model else None  # fmt: skip
        scale, stated = self.parameters.get("scale"), getattr(joint, what or "", None)
        if scale is not None and isinstance(stated, float):
            ways = ("softer", "stiffer") if what == "stiffness" else ("lower", "higher")
            part = "" if what == "stiffness" else f"{what.replace('_', ' ')} of "
            unit = joint.units.of("N m/rad") if what == "stiffness" and joint else ""
            size = spoken.number(100.0 * abs(scale.value - 1.0), 2)
            return (
                f"{part}{self.target} is {size} % {ways[scale.value > 1.0]} than stated "
                f"({spoken.number(scale.value * stated)} instead of {spoken.number(stated)} {unit})"
            ).replace(" )", ")")
        values = (
            f"{name.replace('_', ' ')} {spoken.number(v.value)}"
            + ("" if v.unit == "1" else f" {v.unit.replace('*', ' ')}")
            for name, v in self.parameters.items()
        )
        named = f"{self.effect.replace('_', ' ')} of {self.target}"
        return ": ".join(filter(None, (named, ", ".join(values))))

    def to_dict(self) -> dict[str, Any]:
        """As in JSON."""
        found = asdict(self)
        if self.tolerances is None:
            del found["tolerances"]
        return found


@dataclass(frozen=True, eq=False)
class Correlation:
    """How numbers that were fitted to the same data hang together.

    Attributes:
        names: (effect, target, parameter) of each.
        matrix: (k, k), 1, of the parameters; of positive ones it is that of their logarithms.
    """

    names: tuple[tuple[str, str, str], ...]
    matrix: FloatArray

    @classmethod
    def of(cls, names: Sequence[tuple[str, str, str]], covariance: FloatArray) -> Correlation:
        """From a covariance matrix; of numbers of one name the first counts.

        Args:
            names: (effect, target, parameter) of each.
            covariance: (k, k), in any units.
        """
        std = np.sqrt(np.maximum(covariance.diagonal(), 0.0))
        kept = [k for k, name in enumerate(names) if std[k] > 0.0 and name not in names[:k]]
        found = covariance[np.ix_(kept, kept)] / np.outer(std[kept], std[kept])
        found = np.clip(0.5 * (found + found.T), -1.0, 1.0)
        np.fill_diagonal(found, 1.0)
        return cls(tuple(names[k] for k in kept), found)

    def beside(self, other: Correlation) -> Correlation:
        """With the numbers that only other data tell, as independent of these.

        Args:
            other: by those data.
        """
        more = [name for name in other.names if name not in self.names]
        names = (*self.names, *more)
        matrix = self.among(names)
        matrix[len(self.names) :, len(self.names) :] = other.among(more)
        return Correlation(names, matrix)

    def among(self, names: Sequence[tuple[str, str, str]]) -> FloatArray:
        """The correlation matrix of some numbers, (n, n); the same number twice is one.

        Args:
            names: n of them; one that is not known here is independent of the others.
        """
        index = {name: k for k, name in enumerate(self.names)}
        at = [(m, index[name]) for m, name in enumerate(names) if name in index]
        found = np.eye(len(names))
        if at:
            rows, own = (list(part) for part in zip(*at, strict=True))
            found[np.ix_(rows, rows)] = self.matrix[np.ix_(own, own)]
        return found


@dataclass(frozen=True)
class Estimate:
    """A cause as one kind of records has it, for the other kind to start from.

    Attributes:
        effect: at the values that were found.
        std: parameter -> standard deviation, SI.
        values: what is told of it, quantities that follow from its parameters included.
    """

    effect: Effect
    std: Mapping[str, float]
    values: Mapping[str, Value] = field(default_factory=dict)


@dataclass(frozen=True)
class Gain:
    """How much better the extended model predicts records that it has not seen.

    Attributes:
        train_records: files that the model was fitted to.
        held_out_records: files that it was judged on.
        baseline_nrmse: of the nominal model with its nuisances fitted.
        extended_nrmse: of the extended model.
        noise_floor_nrmse: what noise alone leaves.
        channels: how many channels of records were judged, to put gains together by.
    """

    train_records: tuple[str, ...]
    held_out_records: tuple[str, ...]
    baseline_nrmse: float
    extended_nrmse: float
    noise_floor_nrmse: float
    channels: int = 0

    def plus(self, other: Gain) -> Gain:
        """On the records of both, each channel counting alike.

        Args:
            other: the gain on other records.
        """
        signal = [g.channels / g.noise_floor_nrmse**2 for g in (self, other)]

        def together(name: str) -> float:
            powers = (getattr(g, name) ** 2 * s for g, s in zip((self, other), signal, strict=True))
            return math.sqrt(sum(powers) / sum(signal))

        return Gain(
            self.train_records + other.train_records,
            self.held_out_records + other.held_out_records,
            together("baseline_nrmse"),
            together("extended_nrmse"),
            together("noise_floor_nrmse"),
            self.channels + other.channels,
        )

    @property
    def explained(self) -> float | None:
        """(baseline^2 - extended^2) / (baseline^2 - floor^2), 1 at most.

        None where nothing is to explain, or no more than noise may be off by itself: a share of
        that would say nothing. Nor does one where more is left than the signal.
        """
        if self.extended_nrmse >= 1.0:
            return None
        to_explain = self.baseline_nrmse**2 - self.noise_floor_nrmse**2
        if to_explain <= _SCATTER * self.noise_floor_nrmse**2:
            return None
        return min((self.baseline_nrmse**2 - self.extended_nrmse**2) / to_explain, 1.0)

    @property
    def told(self) -> str:
        """The end of a sentence that begins with the records, without its stop."""
        was, now, noise = (
            f"{spoken.per_cent(x)} %"
            for x in (self.baseline_nrmse, self.extended_nrmse, self.noise_floor_nrmse)
        )
        way = "falls" if self.extended_nrmse < self.baseline_nrmse else "rises"
        change = f"stays at {was}" if was == now else f"{way} from {was} to {now}"
        share = (
            f": {self.share} of what is wrong is explained" if (self.explained or 0.0) > 0.0 else ""
        )
        return f"the error {change} of the signal (noise alone: {noise}){share}"

    @property
    def share(self) -> str:
        """How much is explained, in words: never rounded up to all of it."""
        share = self.explained or 0.0
        return f"{min(100.0 * share, 99.9 if share < 1.0 else 100.0):.1f} %"

    def to_dict(self) -> dict[str, Any]:
        """As in JSON."""
        found = asdict(self)
        del found["channels"]
        return {**found, "explained": self.explained}


@dataclass(frozen=True)
class Left:
    """What a model leaves of records that it has not seen, beside noise and what is tolerated.

    Attributes:
        nrmse: of the signal, RMS.
        within_tolerance: whether a model that is right may leave as much (1 % of the signal).
        by_pose: pose -> the same, of its records.
        by_frequency: such as "3.1-9.4 Hz" -> what is left there, of all of the signal, RMS.
    """

    nrmse: float
    within_tolerance: bool
    by_pose: Mapping[str, float]
    by_frequency: Mapping[str, float] = field(default_factory=dict)

    @property
    def told(self) -> str:
        """A sentence without its stop."""
        if self.nrmse < _HARDLY:
            return "beside noise and tolerances next to nothing is left"
        most = [
            f"at {max(shares, key=lambda each: shares[each])}"
            for shares in (self.by_frequency, self.by_pose)
            if len(shares) > 1
        ]
        where = f", most of it {' and '.join(most)}" if most else ""
        small = "" if self.within_tolerance else "; a model that is right leaves at most 1 %"
        return (
            f"beside noise and tolerances {spoken.per_cent(self.nrmse, 2)} % of the signal is left"
            f"{where}{small}"
        )


@dataclass(frozen=True, repr=False)
class Diagnosis(TableResult, Fit):
    """The answer.

    Attributes:
        verdict: see `VERDICTS`.
        causes: those claimed; empty for "nothing-wrong" and "unexplained".
        alternatives: other sets of (effect, target) that these data cannot tell from the causes.
        leads: what helped a little though nothing may be claimed.
        nuisances: fitted values that are within tolerance: "stiffness.joint_1" -> value.
        gain: on held-out records; None where nothing was fitted.
        life: {"baseline": {...}, "extended": {...}}; None where it can't be known.
        life_note: what the life takes into account, or why there is none; empty where it is plain.
        next_measurement: what to measure to know more; None where there is nothing to ask.
        note: why, where it is not what `VERDICTS` says; empty otherwise.
        remainder: what is left beside noise and tolerance; None where that was not looked at.
        untold: percussion records from which no value is, as small errors grow too large in them;
            what was found explains them all the same.
        not_looked_for: effect -> why these records cannot show it; of percussion records.
        scores: every candidate's score, for the report: dicts with effect, target, numbers.
        kinds: of a campaign with percussion and motion records, each kind's verdict and gain.
        shared: of such a campaign, what both kinds say of the causes that both could show.
        model: the extended model; None where no whole diagnosis was asked for.
        extra: more keys of the JSON.
        details: anything else that the report shows; not part of the JSON contract.
    """

    INDEX = "name"
    PLOTS: ClassVar = {"candidates": "visuals.report.percussion_figures:plot_candidates"}

    PAGE = "visuals.report.diagnosis:diagnosis_page"

    verdict: Verdict
    causes: tuple[Cause, ...] = ()
    alternatives: tuple[tuple[tuple[str, str], ...], ...] = ()
    leads: tuple[tuple[str, str], ...] = ()
    nuisances: Mapping[str, Value] = field(default_factory=dict)
    gain: Gain | None = None
    life: Mapping[str, Any] | None = None
    life_note: str = ""
    next_measurement: Mapping[str, Any] | None = None
    note: str = ""
    remainder: Left | None = None
    untold: tuple[str, ...] = ()
    not_looked_for: Mapping[str, str] = field(default_factory=dict)
    scores: tuple[Mapping[str, Any], ...] = ()
    kinds: Mapping[str, Any] = field(default_factory=dict)
    shared: tuple[Mapping[str, Any], ...] = ()
    model: Model | None = None
    correlation: Correlation | None = None
    extra: Mapping[str, Any] = field(default_factory=dict)
    details: Mapping[str, Any] = field(default_factory=dict)

    @property
    def plan(self) -> str | None:
        """What to measure next as a `picchio-plan/1` file; None where no plan can say it."""
        return (self.next_measurement or {}).get("plan")

    @property
    def told_without(self) -> str:
        """A sentence on the records from which no value is; empty where there are none."""
        if not self.untold:
            return ""
        return (
            f"No value is from {', '.join(self.untold)}: errors of a tolerance or less grow too "
            "large there. What was found explains them all the same"
        )

    @property
    def answer(self) -> str:
        """The verdict as sentences, causes with their values first."""
        text = self.note or VERDICTS[self.verdict]
        if not self.causes:
            return f"{self.verdict.replace('-', ' ').capitalize()}: {text}"
        causes = "; ".join(cause.told(self.model) for cause in self.causes[:_SHOWN])
        rest = len(self.causes) - _SHOWN
        head = f"Cause{'s' * (len(self.causes) > 1)} found: {causes}"
        return f"{head}{f' and {rest} more' if rest > 0 else ''} ({self.verdict}: {text})"

    def model_text(self, folder: Path | None = None) -> str:
        """The extended model as a `picchio-model/1` file.

        Args:
            folder: where the file will stand; paths are written relative to it.

        Raises:
            InputError: a diagnosis that was not made by `picchio.diagnose`.
        """
        if "saved" not in self.details:
            raise InputError("has no extended model", key="diagnosis", hint="use picchio.diagnose")
        return saved_model_text(**self.details["saved"], folder=folder)

    def _content(self) -> dict[str, Any]:
        named = lambda pair: {"effect": pair[0], "target": pair[1]}  # noqa: E731
        more = {"records": self.kinds, "shared": self.shared} if self.kinds else {}
        return {
            "format": FORMAT,
            "verdict": self.verdict,
            "causes": self.causes,
            "alternatives": [[named(pair) for pair in each] for each in self.alternatives],
            "leads": [named(pair) for pair in self.leads],
            "nuisances": self.nuisances,
            "gain": self.gain,
            "life": self.life,
            "next_measurement": self.next_measurement,
            "note": self.note or None,
            "remainder": self.remainder,
            **more,
            **({"life_note": self.life_note} if self.life_note else {}),
            **({"untold": list(self.untold)} if self.untold else {}),
            "not_looked_for": self.not_looked_for,
            "scores": self.scores,
            **self.extra,
        }

    def _rows(self) -> list[dict[str, Any]]:
        return [asdict(value) for value in self._fitted()]

    def views(self, which: str = "train") -> list[View]:
        """What is left of every torque and twist of motion records, before and after.

        Args:
            which: the records "train", which were fitted to, or those "held_out".
        """
        return named_function("visuals.report.motion_figures:views")(self, which)  # type: ignore[no-any-return]

    def _seen(self) -> Mapping[str, Any]:
        return {"robot": self.model.robot, "diagnosis": self} if self.model else {}

    def _fitted(self) -> Iterator[FittedValue]:
        for cause in self.causes:
            for one in effect_class(cause.effect).parameters:
                name = f"{cause.effect}.{cause.target}.{one.name}"
                found = cause.parameters.get(one.name, Value(one.neutral, math.nan, one.unit))
                yield FittedValue(
                    name,
                    found.value,
                    found.std,
                    found.unit,
                    one.lower,
                    one.upper,
                    one.name in cause.parameters,
                    f"confidence {cause.confidence:.3g}",
                )
        for name, value in self.nuisances.items():
            yield FittedValue(name, value.value, value.std, value.unit, note="a tolerance")

    def _headline(self) -> str:
        named = dict.fromkeys(f"{c.effect.replace('_', ' ')} of {c.target}" for c in self.causes)
        causes = " and ".join(list(named)[:_SHOWN])
        text = self.verdict + (f", {causes}" if causes else "")
        if len(named) > _SHOWN:
            text += f" and {len(named) - _SHOWN} more"
        if self.gain is not None and self.gain.explained is not None and self.causes:
            text += f"; {self.gain.share} of the error explained"
        return text

    def _repr_html_(self) -> str:
        from picchio.core.html import sheet

        rows = [
            (c.effect.replace("_", " "), c.target, c.confidence, name, v.value, v.std, v.unit)
            for c in self.causes for name, v in c.parameters.items()
        ]  # fmt: skip
        columns = ("cause", "where", "confidence", "parameter", "value", "std", "unit")
        facts = {
            "alternatives": "; ".join(map(in_words, differences(self))) or None,
            "leads": ", ".join(f"{e} of {t}" for e, t in self.leads) or None,
            "measure next": (self.next_measurement or {}).get("why"),
        }
        text = self.note or VERDICTS[self.verdict]
        return sheet(self._headline(), facts, columns if rows else (), rows, head=f"{text}.")


def in_tolerances(cause: Cause) -> str:
    """How far a cause is off by what is tolerated, as a phrase.

    Args:
        cause: of which something of the kind is tolerated.
    """
    size = cause.tolerances or 0.0
    return f"off by {size:.{0 if size >= 10.0 else 1}f} times its tolerance"


# Other sets of causes, told by what they have in place of what.

Pairs = tuple[tuple[str, str], ...]


def differences(diagnosis: Diagnosis) -> list[tuple[Pairs, Pairs]]:
    """What each alternative set has that the causes lack, and the other way round.

    Returns:
        (effect, target) that come, and those that go; each difference once.
    """
    mine = tuple(dict.fromkeys((c.effect, c.target) for c in diagnosis.causes))
    found = []
    for other in diagnosis.alternatives:
        come = tuple(dict.fromkeys(pair for pair in other if pair not in mine))
        gone = tuple(pair for pair in mine if pair not in other)
        if come or gone:
            found.append((come, gone))
    return list(dict.fromkeys(found))


def in_words(difference: tuple[Pairs, Pairs]) -> str:
    """A difference as a phrase."""
    come, gone = (
        " and ".join(f"{effect.replace('_', ' ')} of {target}" for effect, target in pairs)
        for pairs in difference
    )
    if come and gone:
        return f"{come} in place of {gone}"
    return f"{come} as well" if come else f"all but {gone}"
