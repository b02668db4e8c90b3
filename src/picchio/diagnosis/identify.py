"""What measured records say of a robot's stiffness and damping, as a sidecar for later work."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from picchio.campaign.campaign import Campaign, load_campaign
from picchio.campaign.tables import CAMPAIGN_FILE, Tolerance
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.core.processes import one_thread
from picchio.core.registry import classes_in, is_concrete, with_entry_points
from picchio.core.toml import validate
from picchio.diagnosis.begin import Begun, begin
from picchio.diagnosis.diagnose import diagnose
from picchio.diagnosis.entries import joint_entry, standing_entries, tool_entry
from picchio.diagnosis.identified import FORMAT, Identification, Identified, IdentifiedJoint, Method
from picchio.diagnosis.percussion.search.state import EXACT
from picchio.diagnosis.result import Cause, Diagnosis, Value, unit_of
from picchio.model.effects.registry import effect_class
from picchio.model.effects.structure.springs.joint_stiffness import JointStiffness
from picchio.model.effects.structure.springs.modal_damping import ModalDamping
from picchio.robot.annotations.sidecar import FORMAT as SIDECAR
from picchio.robot.annotations.sidecar import Sidecar, spreads_of
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.joint import Joint, is_drive
from picchio.robot.loading.load import load_robot
from picchio.robot.loading.objects import RobotLike
from picchio.robot.spread import ESTIMATED

# A spread below this share of the tolerance comes from the records, not from the tolerance.
_TOLD = 0.5
GROUP = "picchio.identification"
_METHOD: Any = Method


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosed(Identification):
    """What a diagnosis of percussion or motion records says of the joints.

    Attributes:
        diagnosis: what the numbers are from.
        tolerance: how well the campaign takes the nominal values to be known.
        begun: where stiffness is far from what was stated: from where the diagnosis began.
    """

    diagnosis: Diagnosis
    tolerance: Tolerance
    begun: Begun | None = None

    @property
    def remarks(self) -> tuple[str, ...]:
        """How many causes were found."""
        count = len(self.diagnosis.causes)
        said = f"{count} cause{'' if count == 1 else 's'} found."
        if self.begun is None:
            return (said,)
        if self.diagnosis.verdict == "nothing-wrong":
            said = "Beside that the diagnosis finds nothing wrong."
        return self.begun.said(self.robot), said

    @property
    def doubt(self) -> str:
        """That the diagnosis has an answer, and it is not one."""
        verdict = self.diagnosis.verdict
        partly = verdict in ("partial", "ambiguous")
        partly |= self.begun is not None and verdict == "unexplained"
        return f"the diagnosis is {verdict!r}: look at picchio diagnose, too" if partly else ""

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

        robot, only = self.robot, None
        if self.begun is not None:
            robot = self.begun.robot
            only = {joint.name for joint in self.joints if joint.stiffness.told}
        table, remarks = _sidecar(robot, self.diagnosis, self.source, self.tolerance, only)
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
            "joints": self.joints,
            "also": [c for c in self.diagnosis.causes if not _is_of(c, "stiffness")],
            "residual": {
                "before": self.begun.nrmse if self.begun else gain.baseline_nrmse if gain else None,
                "after": gain.extended_nrmse if gain else None,
                "held_out": list(gain.held_out_records) if gain else [],
            },
            "from_nothing": None if self.begun is None else self.begun.to_dict(self.robot),
        }

    def _headline(self) -> str:
        if self.begun is not None and self.diagnosis.verdict == "nothing-wrong":
            return f"{self._told()}, far from what was stated; nothing else is wrong"
        return f"{self._told()}; {self.diagnosis._headline()}"


class ByDiagnosis(Method):
    """The extended model's values, from percussion or motion records, or both."""

    name = "diagnosis"
    kinds = frozenset({"percussion", "motion"})
    needs_springs = frozenset({"percussion"})

    def identify(
        self,
        robot: FlexibleRobot,
        campaign: Campaign,
        *,
        workers: int | None = None,
        progress: Callable[[str], None] | None = None,
    ) -> Identification:
        """As `diagnose`, from where the records have stiffness that is far from stated."""
        begun = begin(robot, campaign) if any(r.kind == "percussion" for r in campaign) else None
        if begun is None:
            found = diagnose(robot, campaign, workers=workers, progress=progress)
            return identification(campaign, found)
        # How well the stated values are known is not said of those found.
        left = campaign.tolerance.unsaid("stiffness", "damping_ratio")
        table = campaign.table.model_copy(update={"tolerance": left})
        campaign = replace(campaign, table=table)
        found = _no_surer_than_the_model(
            diagnose(begun.robot, campaign, workers=workers, progress=progress)
        )
        return _from_nothing(robot, identification(campaign, found), begun)


def _no_surer_than_the_model(found: Diagnosis) -> Diagnosis:
    """Fitted values far from stated, as exact as the forward model at best, as causes are."""
    fitted = {
        name: Value(one.value, float(np.hypot(one.std, EXACT * one.value)), one.unit)
        for name, one in found.nuisances.items()
    }
    return replace(found, nuisances=fitted)


def _from_nothing(robot: FlexibleRobot, told: Diagnosed, begun: Begun) -> Diagnosed:
    """The answer of a diagnosis that began elsewhere than at the stated values."""
    clear = told.diagnosis.verdict in ("nothing-wrong", "named")
    why = "far from the stated value: found from the blows alone, then fitted to the records"
    if not clear:
        why = "found from the blows alone, but what else is wrong is not clear"
    joints = []
    for joint in told.joints:
        one, ratio = joint.stiffness, joint.damping_ratio
        if one.told and clear and begun.contradicts(joint.name, one.value):
            apart = "the fit to the records and what the blows alone tell disagree"
            one = replace(one, told=False, why=apart)
        elif one.told:
            one = replace(one, told=clear, why=why)
        if ratio.told:
            factor = "one factor for all modes, as for the springs"
            ratio = replace(ratio, told=clear, why=factor)
        joints.append(replace(joint, stiffness=one, damping_ratio=ratio))
    return replace(told, robot=robot, joints=tuple(joints), begun=begun)


@cache
def methods() -> dict[str, Method]:
    """Every way to find the joints' numbers, by its name: those of `picchio.identification`, too.

    Raises:
        InputError: an entry point that cannot be loaded, or is none.
    """
    own: list[type[Method]] = [ByDiagnosis, *classes_in("picchio.diagnosis.stiffness", _METHOD)]
    found: dict[str, type[Method]] = with_entry_points(
        GROUP, "method of identification", own, lambda value: is_concrete(value, _METHOD),
        lambda way: way.name,
    )  # fmt: skip
    return {name: way() for name, way in found.items()}


def method_for(campaign: Campaign) -> Method:
    """The way to identify with all of a campaign's records.

    Args:
        campaign: the records.

    Raises:
        InputError: there is none for all of them together.
    """
    kinds = {record.test for record in campaign}
    ways = list(methods().values())
    able = [way for way in ways if kinds <= way.kinds]
    if able:  # the one that is made for just these
        return min(able, key=lambda way: len(way.kinds))
    sets = [" and ".join(sorted(way.kinds)) for way in ways]
    file = campaign.folder / CAMPAIGN_FILE if campaign.folder is not None else None
    raise InputError(
        "these kinds of records are not identified together", file=file, key="record[].kind",
        value=" and ".join(sorted(kinds)), choices=sets,
        hint="identify them one after the other, with --flex the sidecar of the first",
    )  # fmt: skip


@one_thread()
def identify(
    robot: RobotLike,
    campaign: str | Path | Campaign,
    *,
    flex: str | Path | None = None,
    tool: str | None = None,
    workers: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> Identification:
    """The stiffness and damping of every joint, from tests made for it or from other records.

    Static loadings tell it from nothing (`picchio.diagnosis.stiffness`); of percussion and motion
    records a diagnosis says how the robot differs from its nominal values.

    Args:
        robot: the nominal robot, its name or its file.
        campaign: the records, or the folder with their campaign.toml.
        flex: sidecar of the robot.
        tool: the frame that carries the tool.
        workers: processes for percussion records (Linux only); as many as cores if None.
        progress: told what is being done.

    Raises:
        InputError: as `diagnose`; kinds of records that are not identified together.
    """
    records = load_campaign(campaign)
    way = method_for(records)
    loaded = load_robot(robot, flex=flex, tool=tool, allow_rigid=not needs_springs(records))
    return way.identify(loaded, records, workers=workers, progress=progress)


def needs_springs(campaign: Campaign) -> bool:
    """Whether these records can only be identified with a robot that has flexible joints.

    Args:
        campaign: the records.

    Raises:
        InputError: as `method_for`.
    """
    kinds = {record.test for record in campaign}
    return kinds <= method_for(campaign).needs_springs


def identification(campaign: Campaign, found: Diagnosis) -> Diagnosed:
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
    return Diagnosed(robot, source, joints, found, tolerance)


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
    robot: FlexibleRobot,
    diagnosis: Diagnosis,
    source: str,
    tolerance: Tolerance,
    only: Collection[str] | None = None,
) -> tuple[dict[str, Any], list[str]]:
    """The sidecar with the values found, and remarks on what has no place in it.

    Of a robot that was begun elsewhere than stated, only these joints' stiffness is that of the
    fit: of the others what was found before, and how far it may be off.
    """
    if not diagnosis.causes and not (only and diagnosis.verdict == "nothing-wrong"):
        stand = diagnosis.verdict == "nothing-wrong"
        raise InputError(f"the diagnosis is {diagnosis.verdict!r}: there is nothing to write",
                         hint="the stated stiffness and damping stand" * stand)  # fmt: skip
    drives = [joint for joint in robot.flexible_joints if is_drive(joint.name)]
    joints = {joint.name: joint_entry(robot, joint) for joint in drives}
    table: dict[str, Any] = {"format": SIDECAR, "description": f"{robot.name}, identified"}
    remarks: list[str] = []
    tool = tool_entry(robot)
    ratios = {joint.name: abs(joint.gear_ratio or 0.0) for joint in drives}
    told: dict[str, tuple[str, str, str]] = {}  # a value's name -> what it was fitted as
    for cause in diagnosis.causes:
        key = effect_class(cause.effect).sidecar
        if key == "stiffness" and cause.target in joints:
            if only is not None and cause.target not in only:
                continue
            _tell_stiffness(joints[cause.target], source, _stiffness(robot, cause))
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
        kept = owner not in only if only is not None else kept
        if name.startswith("stiffness.") and owner in joints and not kept:
            entry = joints[owner]
            if only is not None:
                _tell_stiffness(entry, source, value)
            elif "stiffness" in entry:
                entry |= {"source": _said(source, "stiffness", value)}
                _tell(entry, "stiffness", value)
            if "stiffness" in entry:
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
    table |= {"joint": joints, "tool": tool, **standing_entries(robot)}
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


def _stiffness(robot: FlexibleRobot, cause: Cause) -> Value:
    if "stiffness" in cause.parameters:
        return cause.parameters["stiffness"]
    scale = cause.parameters["scale"]
    nominal = {j.name: j.stiffness for j in robot.flexible_joints}[cause.target]
    unit = unit_of(robot, cause.target, "N*m/rad")
    return Value(scale.value * nominal, scale.std * nominal, unit)


def _tell_stiffness(entry: dict[str, Any], source: str, value: Value) -> None:
    """A joint's stiffness that is another than stated: neither a curve nor an estimate."""
    entry.pop("stiffness_curve", None)
    if entry.pop("estimated", False):  # the damping still is
        entry.setdefault("damping_ratio_spread", ESTIMATED)
    entry |= {"source": _said(source, "stiffness", value)}
    _tell(entry, "stiffness", value)


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
