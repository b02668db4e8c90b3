"""What measured records say of a robot's stiffness and damping, as a sidecar for later work."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from scipy.linalg import block_diag

from picchio.campaign.campaign import Campaign, load_campaign
from picchio.campaign.tables import Tolerance
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.core.processes import one_thread
from picchio.core.results import TableResult
from picchio.core.toml import StrictModel, validate
from picchio.diagnosis.diagnose import diagnose
from picchio.diagnosis.result import Cause, Diagnosis, Value, unit_of
from picchio.model.effects.registry import effect_class
from picchio.model.effects.structure.joint_stiffness import JointStiffness
from picchio.model.effects.structure.modal_damping import ModalDamping
from picchio.robot.annotations.sidecar import FORMAT as SIDECAR
from picchio.robot.annotations.sidecar import Sidecar, spreads_of
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.joint import Joint, is_drive
from picchio.robot.loading.load import load_robot
from picchio.robot.spread import ESTIMATED
from picchio.robot.tool import Mounting

FORMAT = "picchio-identification/1"
# Half of a two-sided 90 % interval, standard deviations.
_HALF = 1.645
# A spread below this share of the tolerance comes from the records, not from the tolerance.
_TOLD = 0.5


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


@dataclass(frozen=True, eq=False, repr=False)
class Identification(TableResult):
    """What `identify` found; its table is the joints.

    Attributes:
        robot: as it was before.
        diagnosis: what the numbers are from.
        source: where the data are from, such as the campaign's name.
        joints: every flexible joint.
        tolerance: how well the campaign takes the nominal values to be known.
    """

    INDEX = "joint"
    UNITS: ClassVar = {f"stiffness_{part}": "N*m/rad" for part in ("value", "low", "high")}

    robot: FlexibleRobot
    diagnosis: Diagnosis
    source: str
    joints: tuple[IdentifiedJoint, ...]
    tolerance: Tolerance

    def sidecar_text(self) -> str:
        """The robot's sidecar with the values that were found in it, for `--flex`.

        Stiffnesses, damping ratios, rotor inertias (of joints whose gear ratio is known) and the
        tool's mass are put in with their standard deviations, and `[posterior]` says how these
        hang together; everything else of the joints stays as it was. What a sidecar has no place
        for (friction, ripple, delays) stands in comments.

        Raises:
            InputError: no cause was found.
        """
        import tomlkit

        table, remarks = _sidecar(self.robot, self.diagnosis, self.source, self.tolerance)
        made = self.diagnosis.extra["provenance"]
        document = tomlkit.document()
        said = f"Written by picchio {made['picchio']}; verdict: {self.diagnosis.verdict}."
        document.add(tomlkit.comment(said))
        for source in made["inputs"]:
            document.add(tomlkit.comment(f"{source['file']} sha256 {source['sha256']}"))
        document.add(
            tomlkit.comment("Found as well, and no sidecar's:" if remarks else "Nothing else.")
        )
        for line in remarks:
            document.add(tomlkit.comment(f"  {line}"))
        document.update(table)
        return tomlkit.dumps(document)

    def _content(self) -> dict[str, Any]:
        gain = self.diagnosis.gain
        return {
            **self.diagnosis.to_dict(),
            "format": FORMAT,
            "joints": [asdict(joint) for joint in self.joints],
            "also": [c.to_dict() for c in self.diagnosis.causes if not _is_of(c, "stiffness")],
            "residual": {
                "before": gain.baseline_nrmse if gain else None,
                "after": gain.extended_nrmse if gain else None,
                "held_out": list(gain.held_out_records) if gain else [],
            },
        }

    def _headline(self) -> str:
        told = sum(joint.stiffness.told for joint in self.joints)
        return f"stiffness of {told} of {len(self.joints)} joints; {self.diagnosis._headline()}"

    def _rows(self) -> list[dict[str, Any]]:
        return [
            {
                "joint": joint.name,
                **{f"stiffness_{k}": v for k, v in asdict(joint.stiffness).items()},
                **{f"damping_ratio_{k}": v for k, v in asdict(joint.damping_ratio).items()},
            }
            for joint in self.joints
        ]


@one_thread()
def identify(
    robot: str | Path | FlexibleRobot,
    campaign: str | Path | Campaign,
    *,
    flex: str | Path | None = None,
    tool: str | None = None,
    workers: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> Identification:
    """The stiffness and damping of every joint, from percussion or motion records, or both.

    Args:
        robot: the nominal robot, its name or its file.
        campaign: the records, or the folder with their campaign.toml.
        flex: sidecar of the robot.
        tool: the frame that carries the tool.
        workers: processes for percussion records (Linux only); as many as cores if None.
        progress: told what is being done.

    Raises:
        InputError: as `diagnose`.
    """
    records = load_campaign(campaign)
    moves = any(record.kind == "motion" for record in records)
    loaded = load_robot(robot, flex=flex, tool=tool, allow_rigid=moves)
    return identification(records, diagnose(loaded, records, workers=workers, progress=progress))


def identification(campaign: Campaign, found: Diagnosis) -> Identification:
    """What a diagnosis of these records says of every joint.

    Args:
        campaign: the records.
        found: the answer of `picchio.diagnose`.
    """
    assert found.model is not None
    robot, tolerance = found.model.robot, campaign.tolerance
    source = "memory" if campaign.folder is None else campaign.folder.resolve().name
    joints = tuple(
        IdentifiedJoint(
            joint.name,
            _stiffness_of(robot, joint, found, tolerance),
            _damping_of(robot, joint, found, tolerance),
        )
        for joint in robot.flexible_joints
        if is_drive(joint.name)
    )
    return Identification(robot, found, source, joints, tolerance)


def _is_of(cause: Cause, tolerance: str) -> bool:
    """Whether a cause is about what a key of `[tolerance]` is about."""
    return effect_class(cause.effect).tolerance == tolerance


def _stiffness_of(
    robot: FlexibleRobot, joint: Joint, found: Diagnosis, tolerance: Tolerance
) -> Identified:
    for cause in found.causes:
        if _is_of(cause, "stiffness") and cause.target == joint.name:
            value = _stiffness(robot, cause)
            why = "differs from the nominal value by more than the tolerance"
            return Identified.of(value.value, value.std, True, why)
    fitted = found.nuisances.get(f"stiffness.{joint.name}")
    stated = joint.stiffness * tolerance.stiffness
    if fitted is None:
        why = "no record shows this joint yield: the nominal value and its tolerance"
        return Identified.of(joint.stiffness, stated, False, why)
    told = fitted.std < _TOLD * stated
    why = "fitted within the tolerance" if told else "the records hardly depend on it"
    return Identified.of(fitted.value, fitted.std, told, why)


def _damping_of(
    robot: FlexibleRobot, joint: Joint, found: Diagnosis, tolerance: Tolerance
) -> Identified:
    value = _damping(robot, joint, found)
    if value is None:
        why = "no record shows the robot vibrate: the nominal value and its tolerance"
        ratio = joint.damping_ratio
        return Identified.of(ratio, ratio * tolerance.damping_ratio, False, why)
    if any(_is_of(cause, "damping_ratio") for cause in found.causes):
        why = "the robot's modal damping differs from the nominal one, by one factor"
        return Identified.of(value.value, value.std, True, why)
    told = _tells(value, tolerance.damping_ratio)
    why = "one factor for all modes, fitted within the tolerance"
    return Identified.of(value.value, value.std, told, why)


def _damping(robot: FlexibleRobot, joint: Joint, found: Diagnosis) -> Value | None:
    """A joint's damping ratio by the fit, which has one factor for all modes; None without it."""
    for cause in found.causes:
        if _is_of(cause, "damping_ratio"):
            scale, ratio = cause.parameters["scale"], joint.damping_ratio
            return Value(scale.value * ratio, scale.std * ratio, "1")
    fitted = found.nuisances.get("damping_ratio")
    if fitted is None or not fitted.value > 0.0:
        return None
    share = joint.damping_ratio / float(np.mean(robot.damping_ratio))
    return Value(fitted.value * share, fitted.std * share, "1")


def _tells(value: Value, tolerance: float) -> bool:
    """Whether the records tell a value, beside the tolerance of its nominal value."""
    return value.std < _TOLD * tolerance * value.value


def _sidecar(
    robot: FlexibleRobot, diagnosis: Diagnosis, source: str, tolerance: Tolerance
) -> tuple[dict[str, Any], list[str]]:
    """The sidecar with the values found, and remarks on what has no place in it."""
    if not diagnosis.causes:
        raise InputError(f"the diagnosis is {diagnosis.verdict!r}: there is nothing to write")
    drives = [joint for joint in robot.flexible_joints if is_drive(joint.name)]
    joints = {joint.name: _joint(robot, joint) for joint in drives}
    table: dict[str, Any] = {"format": SIDECAR, "description": f"{robot.name}, identified"}
    remarks: list[str] = []
    # Without a mass there is neither its centre nor an inertia.
    left_out = {"source"} if robot.tool.mass > 0.0 else {"source", "com", "inertia"}
    tool = robot.tool.model_dump(mode="json", exclude=left_out, exclude_none=True)
    ratios = {joint.name: abs(joint.gear_ratio or 0.0) for joint in drives}
    told: dict[str, tuple[str, str, str]] = {}  # a value's name -> what it was fitted as
    for cause in diagnosis.causes:
        key = effect_class(cause.effect).sidecar
        if key == "stiffness" and cause.target in joints:
            value = _stiffness(robot, cause)
            entry = joints[cause.target]
            entry.pop("stiffness_curve", None)
            if entry.pop("estimated", False):  # the damping still is
                entry.setdefault("damping_ratio_spread", ESTIMATED)
            entry |= {"source": _said(source, "stiffness", value)}
            _tell(entry, "stiffness", value)
            told[f"stiffness.{cause.target}"] = (cause.effect, cause.target, "scale")
        elif key == "rotor_inertia" and (ratio := ratios.get(cause.target)):
            value = cause.parameters["inertia"]
            inertia = Value(max(value.value, 0.0) / ratio**2, value.std / ratio**2, "kg*m^2")
            _tell(joints[cause.target], "rotor_inertia", inertia)
            told[f"rotor_inertia.{cause.target}"] = (cause.effect, cause.target, "inertia")
            remarks.append(_remark(cause) + f" (written as rotor_inertia, over {ratio:g}^2)")
        elif key == "mass" and tool["mass"] + cause.parameters["mass"].value >= 0.0:
            value = cause.parameters["mass"]
            _tell(tool, "mass", Value(tool["mass"] + value.value, value.std, "kg"))
            told["mass.tool"] = (cause.effect, cause.target, "mass")
            tool["source"] = _said(source, "mass", value)
        elif key != "damping_ratio":
            remarks.append(_remark(cause))
    for name, value in diagnosis.nuisances.items():
        owner = name.partition(".")[2]
        # What was said of a value is not replaced by the tolerance.
        kept = name in robot.spreads and not _tells(value, tolerance.stiffness)
        if name.startswith("stiffness.") and owner in joints and not kept:
            entry = joints[owner]
            if "stiffness" in entry:
                entry |= {"source": _said(source, "stiffness", value)}
                _tell(entry, "stiffness", value)
                told[name] = (JointStiffness.name, owner, "scale")
        elif name != "damping_ratio":
            remarks.append(f"{name} = {_number(value)}")
    fitted = any(_is_of(cause, "damping_ratio") for cause in diagnosis.causes)
    for joint in drives:
        found, entry = _damping(robot, joint, diagnosis), joints[joint.name]
        if found is None or not (fitted or _tells(found, tolerance.damping_ratio)):
            continue
        said = _said(source, "damping_ratio", found)
        entry["source"] = f"{entry['source']}; {said}" if "source" in entry else said
        _tell(entry, "damping_ratio", found)
        told[f"damping_ratio.{joint.name}"] = (ModalDamping.name, "robot", "scale")
    table |= {"joint": joints, "tool": tool, **_standing(robot)}
    known = spreads_of(validate(table, Sidecar, format=SIDECAR))
    posterior = _posterior(robot, diagnosis, told, [spread.name for spread in known])
    return {**table, **posterior}, remarks


def _posterior(
    robot: FlexibleRobot,
    diagnosis: Diagnosis,
    told: Mapping[str, tuple[str, str, str]],
    known: Collection[str],
) -> dict[str, Any]:
    """How the sidecar's values hang together: those found and, of the others, as was known."""
    parts: list[tuple[list[str], FloatArray]] = []
    if diagnosis.correlation is not None:
        parts.append((list(told), diagnosis.correlation.among(list(told.values()))))
    others = [name for name in known if name not in told]
    before = robot.posterior.among(others) if robot.posterior is not None else None
    if before is not None:
        parts.append((list(before.names), np.array(before.correlation)))
    parts = [(names, matrix) for names, matrix in parts if (matrix != np.eye(len(names))).any()]
    if not parts:
        return {}
    matrix = block_diag(*(matrix for _, matrix in parts))
    names = [name for names, _ in parts for name in names]
    return {"posterior": {"names": names, "correlation": matrix.tolist()}}


def _joint(robot: FlexibleRobot, joint: Joint) -> dict[str, Any]:
    """A joint as it is now, with where its stiffness is from."""
    found: dict[str, Any] = {"stiffness": joint.stiffness, "damping_ratio": joint.damping_ratio}
    if joint.stiffness_curve is not None:
        del found["stiffness"]
    for key in ("stiffness_curve", "rotor_inertia", "gear_ratio", "shaft", "strength", "balancer"):
        if (value := getattr(joint, key)) is not None:
            model = isinstance(value, StrictModel)
            found[key] = value.model_dump(exclude_none=True) if model else value
    if joint.reducer is not None:
        found["reducer"] = joint.reducer.name
    if joint.estimated:
        found["estimated"] = True
    for spread in robot.spreads.values():
        if spread.table == "joint" and spread.owner == joint.name and len(spread.path) == 1:
            usual = spread.estimated and math.isclose(spread.size, math.log(ESTIMATED))
            found |= {} if usual else {f"{spread.path[0]}_spread": math.exp(spread.size)}
    if joint.estimated:  # not of values that are no estimates, whatever source they are from
        sure = [key for key in ("stiffness", "damping_ratio") if key in found
                and f"{key}.{joint.name}" not in robot.spreads]  # fmt: skip
        found |= {f"{key}_spread": 1.0 for key in sure}
    origin = robot.origins.get(f"{joint.name}.stiffness")
    if origin:
        found["source"] = origin
    return found


def _standing(robot: FlexibleRobot) -> dict[str, Any]:
    """Gun and mounting, where they are not the usual."""
    found: dict[str, Any] = {}
    if robot.gun is not None:
        found["gun"] = robot.gun.model_dump(exclude_none=True)
    if robot.mounting != Mounting():
        found["base"] = robot.mounting.model_dump(exclude_none=True)
    return found


def _stiffness(robot: FlexibleRobot, cause: Cause) -> Value:
    if "stiffness" in cause.parameters:
        return cause.parameters["stiffness"]
    scale = cause.parameters["scale"]
    nominal = {j.name: j.stiffness for j in robot.flexible_joints}[cause.target]
    unit = unit_of(robot, cause.target, "N*m/rad")
    return Value(scale.value * nominal, scale.std * nominal, unit)


def _tell(table: dict[str, Any], key: str, value: Value) -> None:
    """Put a value that was found, and how well it is known, in place of what was stated."""
    table.pop(f"{key}_spread", None)
    table[key] = value.value
    table[f"{key}_std"] = value.std


def _said(source: str, what: str, value: Value) -> str:
    return f"picchio identify on {source}: {what} {_number(value)}"


def _number(value: Value) -> str:
    return f"{value.value:.5g} +- {value.std:.2g} {value.unit}"


def _remark(cause: Cause) -> str:
    text = ", ".join(f"{name} {_number(value)}" for name, value in cause.parameters.items())
    return f"{cause.effect} of {cause.target}: {text}"
