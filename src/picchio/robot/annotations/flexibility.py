"""Which joints are flexible, with what values, and from which source.

Several sources may speak about a joint. The first that gives a value wins: an argument, the
sidecar, the URDF's `picchio:` annotation, Drake's tags, the SRDF. The origin of every value
is kept. Tags that mean a spring beside the drive (Gazebo `springStiffness`, SDF
`spring_stiffness`, `<dynamics>`) are never read.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from picchio.core.errors import InputError
from picchio.core.toml import StrictModel
from picchio.robot.annotations.sidecar import JointEntry, Sidecar, given, spreads_within
from picchio.robot.drives.reducer import Reducer, find_reducer
from picchio.robot.joint import Joint, Strength
from picchio.robot.spread import Spread, is_estimate, numbers_of, overlaid, spreads_in, value_of
from picchio.robot.urdf.tree import MOVABLE, UrdfJoint, UrdfTree

DEFAULT_DAMPING_RATIO = 0.03
# One of these excludes the other, wherever they stand.
# The origin of a stiffness that a reducer's catalogue gives begins so.
ITS_REDUCER = "the catalogue of its reducer"
EXCLUDED = {"stiffness": "stiffness_curve", "stiffness_curve": "stiffness"}


@dataclass(frozen=True)
class Source:
    """A sidecar-like record and where it is from.

    Args:
        label: shown as the origin, such as "flex.toml" or "robot.urdf, picchio annotation".
        content: what it says.
        file: named in errors, or None for an argument.
        strict: unknown joints are an error (a sidecar), not passed over (an SRDF).
    """

    label: str
    content: Sidecar
    file: str | None = None
    strict: bool = True

    def origin(self, source: str | None) -> str:
        """The label, with the value's own source where it has one.

        Args:
            source: of the value itself, if stated.
        """
        return f"{self.label}: {source}" if source else self.label


def strongest(sources: Sequence[Source], table: str) -> tuple[dict[str, Any], dict[str, str]]:
    """Of each value of a sidecar's table the strongest source's, and where it is from.

    Args:
        sources: the strongest first.
        table: such as "tool".
    """
    values: dict[str, Any] = {}
    origins: dict[str, str] = {}
    for source in reversed(sources):
        if (record := getattr(source.content, table)) is None:
            continue
        found = given(record)
        note = found.pop("source", None)
        values = overlaid(type(record), values, found)
        origins |= {f"{table}.{key}": source.origin(note) for key in found}
    return values, origins


def flexible_joints(
    tree: UrdfTree, sources: Sequence[Source], reducers: Mapping[str, Reducer] | None = None
) -> tuple[dict[str, Joint], dict[str, str], list[Spread]]:
    """Merge the sources.

    Args:
        tree: the robot.
        sources: the strongest first.
        reducers: those that can be named; the shipped ones if None.

    Returns:
        Flexible joints by name in the URDF's order; origins such as
        `{"joint_1.stiffness": "flex.toml: 'Dumas 2011'"}`; how well their values are known.

    Raises:
        InputError: an unknown joint, one that cannot be flexible, values that do not fit it.
    """
    for source in sources:
        check_names(tree, source)
    joints: dict[str, Joint] = {}
    origins: dict[str, str] = {}
    spreads: list[Spread] = []
    for name, urdf in tree.joints.items():
        values, where, guessed = _merge(name, sources)
        if "reducer" in values:
            _resolve(name, values, where, sources, reducers)
        flexible = "stiffness" in values or "stiffness_curve" in values
        if "stiffness_curve" in values:
            values["stiffness"] = values["stiffness_curve"].k1
        known = {"damping_ratio": DEFAULT_DAMPING_RATIO, **values}
        try:
            found = _spreads(name, known, where, guessed)
        except InputError as error:
            key = (error.key or "").rpartition(".")[2]
            said = (s for s in sources if key in given(s.content.joint.get(name)))
            raise error.placed(file=next((s.file for s in said), None)) from None
        if not flexible:
            continue
        spreads += found
        known = {key: value for key, value in values.items() if value_of(key) == key}
        joints[name] = _joint(urdf, known, where, tree)
        if "damping_ratio" not in values:
            where["damping_ratio"] = "picchio's default, not measured"
        origins.update({f"{name}.{key}": text for key, text in where.items()})
    return joints, origins, spreads


def estimate_notice(name: str, origins: Mapping[str, str]) -> str:
    """What of a robot's drives is an estimate of picchio's own, in words; "" where nothing is.

    Args:
        name: of the robot.
        origins: of its values.
    """
    made = {key.partition(".")[2] for key, text in origins.items() if is_estimate(text)}
    if not made & {"stiffness", "strength"}:
        return ""
    what = "stiffness, damping and strength" if "stiffness" in made else "strength"
    if any(part.endswith(".mass") for part in made):
        what = f"masses, and the {what}"
    return f"Estimated: nobody measured the {what} of the drives of {name}; results are 80 % ranges"


def unused_entries(sources: Sequence[Source], joints: Iterable[str]) -> Iterator[str]:
    """What a sidecar or annotation says of joints that stay rigid, a sentence each.

    Args:
        sources: every one.
        joints: those that are flexible.
    """
    flexible = set(joints)
    for source in sources:
        for name, entry in source.content.joint.items():
            if not source.strict or name in flexible:
                continue
            keys = [key for key in given(entry) if key not in ("source", "estimated")]
            what = f"{' and '.join(keys)} {'is' if len(keys) == 1 else 'are'} not used"
            yield (
                f"{source.label}: joint {name!r}: {what if keys else 'says nothing that is used'}: "
                "the joint has no stiffness and stays rigid; give it one"
            )


def check_names(tree: UrdfTree, source: Source) -> None:
    """Refuse joints and links that the robot does not have, and joints that cannot have a drive.

    Raises:
        InputError: with those that can be.
    """
    for name in source.content.link:
        if name not in tree.links:
            raise InputError("the robot has no link of this name", file=source.file, key="link",
                             value=name, choices=tree.links)  # fmt: skip
    for name in source.content.joint:
        key = f"joint.{name}"
        if name not in tree.joints:
            if source.strict:
                raise InputError("the robot has no joint of this name", file=source.file,
                                 key="joint", value=name, choices=tree.movable())  # fmt: skip
            continue
        urdf = tree.joints[name]
        if not source.strict:  # other tools' tags speak of their own matters
            continue
        if urdf.type not in MOVABLE:
            raise InputError(f"a {urdf.type} joint cannot be flexible and has no drive",
                             file=source.file, key=key, hint="flexible joints are revolute, "
                             "continuous or prismatic")  # fmt: skip
        if urdf.mimic is not None:
            raise InputError(f"mimics {urdf.mimic.joint!r} and has no spring of its own",
                             file=source.file, key=key,
                             hint=f"give {urdf.mimic.joint!r} the stiffness")  # fmt: skip


def _resolve(
    name: str,
    values: dict[str, Any],
    where: dict[str, str],
    sources: Sequence[Source],
    reducers: Mapping[str, Reducer] | None,
) -> None:
    """Put the catalogue's reducer in place of its name, and its stiffness where none is given."""
    said = next(s for s in sources if "reducer" in given(s.content.joint.get(name)))
    place = {"file": said.file, "key": f"joint.{name}.reducer"}
    try:
        reducer = find_reducer(values["reducer"], reducers)
    except InputError as error:
        raise error.placed(**place) from None
    values["reducer"] = reducer
    if (guess := values.get("strength")) is not None:  # its torques are known now, exactly
        own = {key: getattr(reducer, key) for key in ("repeated_peak_torque", "rated_torque",
                                                      "momentary_peak_torque")}  # fmt: skip
        values["strength"] = Strength(**own, life_curve=guess.life_curve)
        where["strength"] = f"{ITS_REDUCER} {reducer.name} ({reducer.source})"
    if "stiffness" in values or "stiffness_curve" in values:
        return
    if not reducer.spring:
        raise InputError("the catalogue has no stiffness of this reducer", value=reducer.name,
                         hint="give the joint a stiffness", **place)  # fmt: skip
    values.update(reducer.spring)
    for key in reducer.spring:
        where[key] = f"{ITS_REDUCER} {reducer.name} ({reducer.source})"


def _merge(name: str, sources: Sequence[Source]) -> tuple[dict[str, Any], dict[str, str], set[str]]:
    """Every key's value, where it is from, and which values are estimates."""
    values: dict[str, Any] = {}
    where: dict[str, str] = {}
    guessed: set[str] = set()
    for source in sources:
        entry = source.content.joint.get(name)
        if entry is None:
            continue
        stronger = set(values)
        outdone = stronger | {EXCLUDED[key] for key in stronger & EXCLUDED.keys()}
        for key, value in given(entry).items():
            if key == "source" or key in values or EXCLUDED.get(key) in values:
                continue
            # A spread is about the value beside it, not about a stronger source's.
            if value_of(key) in outdone:
                continue
            # An estimate is a statement about the stiffness given beside it.
            if key == "estimated" and (not entry.flexible or "stiffness" in outdone):
                continue
            values[key] = value
            where[key] = source.origin(getattr(value, "source", None) or entry.source)
            if entry.estimated and entry.flexible and not stronger & set(_spread_keys(key)):
                guessed |= {key, *(entry.implied.keys() - outdone)}
    return values, where, guessed


def _spread_keys(key: str) -> tuple[str, str]:
    return f"{key}_spread", f"{key}_std"


def _spreads(
    name: str, values: dict[str, Any], where: dict[str, str], guessed: set[str]
) -> list[Spread]:
    """How well a joint's values are known, those of its shaft and balancer included."""
    found: list[Spread] = []
    for key in numbers_of(JointEntry):
        own = {k: values[k] for k in (key, *_spread_keys(key)) if k in values}
        source = next((where[k] for k in _spread_keys(key) if k in where), where.get(key, ""))
        found += spreads_in(JointEntry, own, {key} & guessed, table="joint", owner=name,
                            source=source)  # fmt: skip
    for key, value in values.items():
        if isinstance(value, StrictModel):
            found += spreads_within(value, "joint", name, (key,), where[key])
    return found


def _joint(urdf: UrdfJoint, values: dict[str, Any], where: dict[str, str], tree: UrdfTree) -> Joint:
    kind = "prismatic" if urdf.type == "prismatic" else "revolute"
    if kind == "prismatic":
        for key in ("shaft", "balancer", "reducer"):
            if key in values:
                raise InputError(f"a prismatic joint has no torsion {key}; its spring is in N/m "
                                 "and its load a force", key=f"joint.{urdf.name}.{key}",
                                 file=where[key])  # fmt: skip
    return Joint(
        name=urdf.name,
        kind=kind,
        effort_limit=urdf.effort if urdf.effort > 0 else float("inf"),
        lower=urdf.lower,
        upper=urdf.upper,
        **{"damping_ratio": DEFAULT_DAMPING_RATIO, **values},
    )
