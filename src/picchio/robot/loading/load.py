"""Load a robot: URDF, annotations, sidecar and SRDF into one `FlexibleRobot`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from lxml import etree

from picchio.core.errors import InputError, held_back, warn_user
from picchio.core.guard import guard
from picchio.core.toml import validate
from picchio.robot.annotations.flexibility import (
    Source,
    estimate_notice,
    flexible_joints,
    unused_entries,
)
from picchio.robot.annotations.inline import read_annotations
from picchio.robot.annotations.other_tags import Srdf, find_srdf, read_drake
from picchio.robot.annotations.sidecar import FORMAT, JointEntry, Sidecar, read_sidecar
from picchio.robot.annotations.tool_choice import (
    choose_gun,
    choose_mounting,
    choose_posterior,
    choose_tool,
    mounted_spreads,
)
from picchio.robot.drives.reducer import all_reducers
from picchio.robot.dynamics.rigid_model import RigidModel
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.joint import Joint, is_drive
from picchio.robot.loading.find import FoundRobot, find_robot
from picchio.robot.loading.objects import RobotLike, named
from picchio.robot.loading.saved_model import is_saved_model, read_saved_model
from picchio.robot.masses.check import check_masses
from picchio.robot.masses.doubts import findings_of
from picchio.robot.masses.given import give_masses
from picchio.robot.spread import ESTIMATE
from picchio.robot.urdf.addresses import resolve_mesh
from picchio.robot.urdf.check import read_tree
from picchio.robot.urdf.normalised import normalise
from picchio.robot.urdf.tree import UrdfTree
from picchio.robot.urdf.xml import parse_urdf, read_urdf_bytes


def load_robot(
    robot: RobotLike,
    *,
    flex: str | Path | None = None,
    tool: str | None = None,
    values: Mapping[str, Mapping[str, object]] | None = None,
    carries: Mapping[str, object] | None = None,
    reducers: str | Path | Sequence[str | Path] = (),
    allow_rigid: bool = False,
    payload: float | None = None,
    reach: float | None = None,
    drive_class: str | None = None,
) -> FlexibleRobot:
    """Load a robot by name or path.

    What no file gives of its drives is an estimate, from its masses, levers and limits: stiffness,
    damping and strength where no joint has a stiffness, strength where a flexible joint has
    neither a shaft nor a reducer. Its spreads make every life an interval.

    Args:
        robot: a name from `picchio robots`, a path to a URDF or to a robot's folder, a
            `package://` address, or a saved model (`picchio-model/1`, a .toml file). A robot
            that is loaded already is taken as it is. A `yourdfpy.URDF` is read from the XML that
            it writes, which has no annotations; of a pair of a Pinocchio model and its URDF's
            path the URDF is read, and the model must be the same.
        flex: a sidecar `picchio-sidecar/1`.
        tool: the frame that carries the tool.
        values: values that win over every file, by joint and key, as in a sidecar:
            `{"joint_1": {"stiffness": 1e5}}`.
        carries: what the tool's frame carries, in place of what the files say, by the keys of a
            sidecar's `[tool]`: `{"mass": 4.0}`.
        reducers: catalogues of reducers `picchio-reducers/1`, stronger than the shipped ones.
        allow_rigid: accept a robot none of whose joints is flexible, and estimate nothing.
        payload: kg, the robot's rated one, for the estimate.
        reach: m, likewise.
        drive_class: strain-wave, cycloidal, planetary, direct or ball-screw, likewise.

    Returns:
        the robot, with the origin of every value.

    Raises:
        InputError: with the file, the key, the value and the valid choices.
    """
    if isinstance(robot, FlexibleRobot):
        for key, given in (("flex", flex), ("tool", tool), ("values", values),
                           ("carries", carries), ("reducers", reducers or None)):  # fmt: skip
            if given is not None:
                raise InputError("comes too late for a robot that is loaded", key=key,
                                 hint="give the robot's name or file with it")  # fmt: skip
        return robot
    if isinstance(reducers, str | Path):
        reducers = (reducers,)
    made = partial(_made, named(robot), flex, tool, reducers, values=values, carries=carries)
    with held_back() as remarks:
        loaded = made(None)
    known = {"payload": payload, "reach": reach, "drive_class": drive_class}
    guess = None if allow_rigid else _estimate(loaded, known)
    unused = [key for key, value in known.items() if value is not None]
    if guess is None and unused:
        warn_user(f"{', '.join(unused)}: not used, since nothing of {loaded.name}'s drives is "
                  "estimated")  # fmt: skip
    if guess is not None:
        return made(guess)  # the same again, and what the estimates bring
    for remark in remarks:
        warn_user(remark)
    return loaded


def _made(
    robot: str | Path,
    flex: str | Path | None,
    tool: str | None,
    reducers: Sequence[str | Path],
    guess: Sidecar | None,
    *,
    values: Mapping[str, Mapping[str, object]] | None,
    carries: Mapping[str, object] | None,
) -> FlexibleRobot:
    """A robot that keeps what it was warned of, and can be made again with other values."""
    from picchio.robot.estimate.sidecar import refused_efforts

    argument = _argument("argument", values, carries)
    weakest = None if guess is None else Source(ESTIMATE, guess, strict=False)
    with held_back() as remarks:
        loaded = _load(robot, flex, tool, [argument], reducers, weakest)
        if guess is not None:
            if any(entry.flexible for entry in guess.joint.values()):
                warn_user(estimate_notice(loaded.name, loaded.origins))
            for why in dict.fromkeys(refused_efforts(loaded).values()):
                warn_user(f"the URDF's effort limits are not believed, and count as unknown: {why}")
    said = tuple(dict.fromkeys(remarks))
    for remark in said:
        warn_user(remark)
    again = partial(_made, robot, flex, tool, reducers, guess, values=values, carries=carries)
    return replace(loaded, warnings=said, again=again)


def _argument(
    label: str,
    values: Mapping[str, Mapping[str, object]] | None,
    carries: Mapping[str, object] | None,
) -> Source:
    """Values by joint, and what the tool's frame carries, as a sidecar has them."""
    given: dict[str, Any] = {"joint": {key: dict(v) for key, v in (values or {}).items()}}
    given |= {} if carries is None else {"tool": dict(carries)}
    return Source(label, validate({"format": FORMAT, **given}, Sidecar, format=FORMAT))


def _estimate(robot: FlexibleRobot, known: Mapping[str, Any]) -> Sidecar | None:
    """What no file gives of a robot's drives, estimated; None where nothing is missing.

    Raises:
        InputError: no joint is flexible, and nothing can be estimated.
    """
    from picchio.robot.estimate.sidecar import estimated_sidecar, slide_entries

    drives = [joint for joint in robot.flexible_joints if is_drive(joint.name)]
    if not drives:
        try:
            # The tool's frame was found without it.
            return estimated_sidecar(robot, **known).model_copy(update={"tool": None})
        except InputError as error:
            if error.key in (*known, "joint"):
                raise
            raise InputError(
                f"no joint of this robot has a stiffness, and none can be estimated: {error}",
                file=robot.source,
                key="joint",
                hint="give a sidecar (--flex FILE) with [joint.NAME] stiffness = ...; joints that "
                f"can be flexible: {', '.join(robot.tree.movable()[:12]) or 'none'}",
            ) from None
    bare = {joint.name for joint in drives if joint.worn is None and joint.reducer is None}
    if not bare:
        return None
    slides = slide_entries(robot, bare)
    try:
        whole = estimated_sidecar(robot, **known)
    except InputError as error:
        if error.key in known:
            raise
        # Of the others the verdict says that nothing is known of what they bear.
        return Sidecar(joint=slides) if slides else None
    joints = slides | {name: JointEntry(strength=entry.strength, source=entry.source)
                       for name, entry in whole.joint.items() if name in bare}  # fmt: skip
    kept = {f"strength.repeated_peak_torque.{name}" for name in joints}
    posterior = None if whole.posterior is None else whole.posterior.among(kept)
    return Sidecar(joint=joints, posterior=posterior) if joints else None


def _load(
    robot: str | Path,
    flex: str | Path | None,
    tool: str | None,
    arguments: list[Source],
    reducers: Sequence[str | Path],
    guess: Source | None,
) -> FlexibleRobot:
    if is_saved_model(robot):
        saved = read_saved_model(Path(robot))
        flex, tool = flex or saved.flex, tool or saved.tool
        try:
            own = _argument(Path(robot).name, saved.values, saved.carries)
            loaded = _load(saved.robot, flex, tool, [*arguments, own], reducers, guess)
        except InputError as error:
            if error.key != "ROBOT":
                raise
            raise error.placed(file=robot, key="robot") from None
        tables = tuple(table.model_dump() for table in saved.effect)
        return replace(loaded, effect_tables=tables, fitted_gravity=saved.gravity_stiffness,
                       files=(*loaded.files, Path(robot)))  # fmt: skip
    found = find_robot(robot)
    root = parse_urdf(read_urdf_bytes(found.urdf), found.urdf)
    tree = read_tree(root, found.urdf)
    srdf = find_srdf(tree)
    sources, flex_file = _sources(root, found, flex, arguments, srdf)
    if guess is not None:
        sources.append(guess)
    joints, origins, spreads = flexible_joints(tree, sources, all_reducers(reducers))
    tree, mass_origins, mass_spreads = give_masses(tree, sources, root)
    spreads += mass_spreads
    _check_balancers(sources, joints)
    for remark in _remarks(tree, sources, joints, origins):
        warn_user(remark)
    chosen_tool, tool_origins = choose_tool(tree, tool, sources, srdf)
    gun, gun_origins = choose_gun(sources)
    mounting, base_origins = choose_mounting(sources)
    mounted = {**tool_origins, **gun_origins, **mass_origins, **base_origins}
    spreads += mounted_spreads(chosen_tool, gun, mounting, mounted)
    urdf, tool_point, recoil = normalise(tree, chosen_tool, gun, mounting)
    rigid = RigidModel(urdf, tree, mounting.gravity)
    if gun is not None and gun.recoil_stiffness is not None and recoil is not None:
        joints[recoil] = Joint(recoil, "prismatic", gun.recoil_stiffness, gun.damping_ratio)
    result = FlexibleRobot(
        name=found.name or tree.name,
        source=found.urdf,
        task_path=found.task,
        files=(
            *(file for file in (found.urdf, flex_file, srdf and srdf.path) if file),
            *map(Path, reducers),
        ),
        tree=tree,
        tool=chosen_tool,
        gun=gun,
        mounting=mounting,
        flexible_joints=tuple(joints[name] for name in rigid.joint_names if name in joints),
        origins={**origins, **mounted},
        named_poses={
            pose: tuple(values.get(name, 0.0) for name in rigid.joint_names)
            for pose, values in (srdf.poses if srdf else {}).items()
        },
        rigid=rigid,
        tool_point=tool_point,
        spreads={spread.name: spread for spread in spreads},
        posterior=choose_posterior(sources, spreads),
    )
    for mesh in root.iter("mesh"):
        with suppress(InputError):  # whoever draws it says what is wrong
            guard.reading([resolve_mesh(str(mesh.get("filename")), found.urdf.parent)])
    check_masses(result)
    findings = tuple(findings_of(result, root))
    for finding in findings:
        warn_user(f"{found.urdf.name}: {finding}")
    return replace(result, findings=findings)


def _sources(
    root: etree._Element,
    found: FoundRobot,
    flex: str | Path | None,
    arguments: list[Source],
    srdf: Srdf | None,
) -> tuple[list[Source], Path | None]:
    """Everything that speaks about the joints, the strongest first, and the sidecar used."""
    annotation = read_annotations(root, found.urdf)
    flex_file = Path(flex) if flex is not None else None
    # A robot folder's own sidecar replaces annotations; the two are never combined.
    if flex_file is None and found.flex is not None:
        if annotation is None:
            flex_file = found.flex
        elif not _same(read_sidecar(found.flex), annotation):
            warn_user(f"{found.flex}: is not read, since {found.urdf.name} has annotations that "
                      "say something else; name it with --flex, and it wins")  # fmt: skip
    sources = [*arguments]
    if flex_file is not None:
        sidecar = read_sidecar(flex_file)
        _check_owner(sidecar, flex_file, found, str(root.get("name")))
        sources.append(Source(flex_file.name, sidecar, str(flex_file)))
    urdf = found.urdf.name
    if annotation is not None:
        sources.append(Source(f"{urdf}, picchio annotation", annotation, str(found.urdf)))
    if (drake := read_drake(root)) is not None:
        sources.append(Source(f"{urdf}, drake tags", drake, str(found.urdf), strict=False))
    if srdf is not None and srdf.rotors is not None:
        sources.append(Source(f"{srdf.path.name}, rotor_params", srdf.rotors,
                              str(srdf.path), strict=False))  # fmt: skip
    return sources, flex_file


def _same(one: Sidecar, other: Sidecar) -> bool:
    """Whether both give the same values, whatever their sources."""
    hidden: Any = {"robot": True, "description": True, "tool": {"source"}, "gun": {"source"},
              "base": {"source"}, "links": {"source"}, "joint": {"__all__": {"source"}},
              "link": {"__all__": {"source"}}}  # fmt: skip
    return one.model_dump(exclude=hidden) == other.model_dump(exclude=hidden)


def _check_owner(sidecar: Sidecar, file: Path, found: FoundRobot, name: str) -> None:
    """Warn of a sidecar that names another robot: arms of one maker share their joints' names."""
    known = {text.removesuffix("_robot") for text in (found.name, name, found.urdf.stem) if text}
    if sidecar.robot is not None and sidecar.robot.removesuffix("_robot") not in known:
        warn_user(f"{file}: says that it belongs to robot {sidecar.robot!r}, not to {found.urdf}")


def _remarks(
    tree: UrdfTree,
    sources: list[Source],
    joints: Mapping[str, Joint],
    origins: Mapping[str, str],
) -> Iterator[str]:
    """What the user should know of how the robot was read."""
    for remark in tree.remarks:
        yield f"{tree.path}: {remark}"
    if tree.locked():
        held = ", ".join(tree.locked())
        yield f"{tree.path}: joints of several degrees of freedom are held fixed: {held}"
    yield from unused_entries(sources, joints)
    for name, joint in joints.items():
        if joint.damping_ratio > 1:
            yield (
                f"joint {name!r}: damping_ratio {joint.damping_ratio:g} is above 1 "
                f"(overdamped), which is unusual; from {origins[f'{name}.damping_ratio']}"
            )


def _check_balancers(sources: list[Source], joints: Mapping[str, Joint]) -> None:
    for source in sources:
        for name, entry in source.content.joint.items():
            if entry.balancer is not None and name not in joints:
                raise InputError("a balancer on a rigid joint has no effect",
                                 key=f"joint.{name}.balancer",
                                 hint="give the joint a stiffness")  # fmt: skip
