"""Build a scene: robot, envelopes, rivets, vibration; data only, no page."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.diagnosis.result import Diagnosis
from picchio.excitation.excitation import Excitation
from picchio.model.model import Model, ModelLike
from picchio.robot.annotations.flexibility import estimate_notice
from picchio.studies.assessment.result import Assessment
from picchio.studies.envelopes import DirectionEnvelope
from picchio.studies.envelopes import envelope as envelope_of
from picchio.studies.maps.result import WorkspaceMap, response_of
from picchio.studies.maps.stored import values_of
from picchio.vibration.closed_form.response import described, unit_vector
from picchio.visuals.kinematics import frames, world
from picchio.visuals.plots.style import direction_label
from picchio.visuals.plots.workspace import best_branch, dataset_of, spacing
from picchio.visuals.scene.cards import joint_card, rivet_card
from picchio.visuals.scene.causes.causes import add_causes
from picchio.visuals.scene.causes.site import Site
from picchio.visuals.scene.motion import vibration
from picchio.visuals.scene.overlay import Scale, joint_values, ring_radius, rivet_values
from picchio.visuals.scene.robot.body import Body, build_body
from picchio.visuals.scene.robot.mesh import Mesh, arrow, ring, sphere, turned_to
from picchio.visuals.scene.scene import Item, Scene

if TYPE_CHECKING:
    import xarray

    from picchio.diagnosis.percussion.diagnosis import PercussionDiagnosis

_MOST_PLACES = 8000  # of a map in a page


def build_scene(
    robot: ModelLike,
    pose: ArrayLike | Mapping[str, float],
    excitation: Excitation,
    *,
    hits: int | None = None,
    direction: ArrayLike | None = None,
    assessment: Assessment | None = None,
    joint: str | None = None,
    workspace: WorkspaceMap | xarray.Dataset | None = None,
    diagnosis: Diagnosis | None = None,
    gravity_stiffness: bool | None = None,
    subdivisions: int = 4,
) -> Scene:
    """The scene of a robot at a pose, shaken by blows.

    Args:
        robot: the robot, or a model of it; its meshes are read here and nowhere before.
        pose: (nv,) rad or m.
        excitation: the blows.
        hits: of a burst from rest; None for the steady state.
        direction: (3,) of the force, for the vibration; the worst one if not given.
        assessment: of a task, for the rivets and the joints' colours.
        joint: whose envelope is shown first; the verdict's if not given.
        workspace: of `picchio.workspace_map`, coloured by the peak of the joint shown.
        diagnosis: of this robot: its causes are drawn where they sit, and the layers about life
            start hidden.
        gravity_stiffness: add dg/dq to the springs.
        subdivisions: fineness of the envelopes.

    Raises:
        InputError: a bad pose, direction or joint; a diagnosis of another robot; a nonlinear
            model, which has no envelope in closed form.
    """
    model = Model.of(robot, gravity_stiffness=gravity_stiffness)
    robot = model.robot
    checked = robot.pose(pose)
    envelope = envelope_of(model, checked, excitation, hits=hits)
    tree = frames(robot, checked)
    places = world(tree)
    body = build_body(robot, checked, tree, places)
    where = ", ".join(f"{q:.3g}" for q in np.round(checked, 4) + 0.0)
    how = described(hits)
    scene = Scene(robot.name, f"pose ({where}); {excitation.describe()}; {how}", envelope, tree)
    scene.chosen, scene.reach = _first(envelope, assessment, joint), body.reach
    scene.notice = estimate_notice(robot.name, robot.origins)
    _add_body(scene, body)
    units = [joint.units.small for joint in robot.flexible_joints]
    _add_rings(scene, body, assessment, units)
    _add_envelopes(scene, body, units, subdivisions)
    for k, joint_shown in enumerate(scene.joints):
        joint_shown["card"] = joint_card(robot, k, envelope, assessment)
    blow = unit_vector(direction) if direction is not None else None
    _add_tool(scene, body, blow)
    if assessment is not None:
        _add_rivets(scene, body, assessment)
        scene.verdict = assessment.verdict.headline
    if workspace is not None:
        _add_workspace(scene, dataset_of(workspace), units)
    if diagnosis is not None:
        along = blow
        if along is None:
            # Of a tool that hits along its own axis.
            axis = np.array(robot.tool.axis)
            along = -robot.state(checked).tool_rotation @ axis / np.linalg.norm(axis)
        site = partial(Site, robot, checked, tree, places, body, along)
        add_causes(scene, site, diagnosis)
    scene.motion = vibration(robot, envelope, body.reach, blow, scene.chosen)
    _aim(scene, body, places)
    return scene


def diagnosis_scene(found: PercussionDiagnosis, **options: Any) -> Scene:
    """The robot with the causes where they sit; in a notebook the cell shows it.

    Pose, blows and direction are those of the record that the nominal model explains worst.

    Args:
        found: a diagnosis of percussion records.
        **options: of `build_scene`: joint, subdivisions, ...
    """
    levels = [float(np.mean(residual**2)) for residual in found.baseline.residuals]
    setup = found.baseline.records[int(np.argmax(levels))].setup
    record = found.problem.campaign[setup.name]
    blows, hits = record.acting()
    return build_scene(
        found.problem.robot,
        setup.geometry.pose,
        blows,
        hits=hits,
        direction=setup.blows.direction,
        diagnosis=found.diagnosis,
        gravity_stiffness=found.problem.model.gravity_stiffness,
        **options,
    )


def _first(envelope: DirectionEnvelope, assessment: Assessment | None, joint: str | None) -> int:
    names = envelope.joint_names
    if joint is not None:
        if joint not in names:
            raise InputError("no such flexible joint", key="joint", value=joint, choices=names)
        return names.index(joint)
    if assessment is not None:
        return names.index(assessment.verdict.joint)
    return int(np.argmax(envelope.peak_deflection))


def _add_body(scene: Scene, body: Body) -> None:
    scene.layers.append(("robot", "robot", True))
    scene.layers.append(("ghost", "robot at rest, as a ghost", False))
    path = {frame.link: frame.path for frame in scene.frames}
    own = [scene.add(shape) for shape in body.shapes]
    for link, index, matrix in body.parts:
        scene.items.append(Item(own[index], "robot", path[link], matrix))


def _add_rings(scene: Scene, body: Body, assessment: Assessment | None, units: list[str]) -> None:
    slides = np.array([unit == "mm" for unit in units])
    values, scale = joint_values(assessment, scene.envelope, slides)
    scene.layers.append(("joints", scale.title, True))
    scene.scales["joints"] = scale
    by_joint = {frame.joint: frame for frame in scene.frames}
    for k, (name, value) in enumerate(zip(scene.envelope.joint_names, values, strict=True)):
        frame = by_joint.get(name)
        if frame is None or frame.axis is None:
            continue
        radius = ring_radius(frame, body)
        # A force has no place on a scale of torques.
        alone = slides[k] and scale.unit == "N m"
        colour = scale.colour(np.nan if alone else float(value))
        mesh = scene.add(ring(radius, 0.012 * body.reach, colour))
        matrix = turned_to(frame.axis, np.zeros(3))
        scene.items.append(Item(mesh, "joints", frame.path, matrix, joint=k))
        told = f"{value:.3g} N" if alone else _told(float(value), scale)
        if assessment is not None and assessment.notice and scale.unit == "%":
            used = assessment.joint(name)
            told = f"{used.told_percent(used.governing_key)} %"
        scene.labels.append({"text": f"{name}: {told}", "layer": "joints", "node": frame.path})


def _told(value: float, scale: Scale) -> str:
    if not np.isfinite(value):
        return "no shaft"
    # Next to the largest it is nothing.
    return "\N{ALMOST EQUAL TO} 0" if value < 1e-3 * scale.top else f"{value:.3g} {scale.unit}"


def _add_envelopes(scene: Scene, body: Body, units: list[str], subdivisions: int) -> None:
    envelope = scene.envelope
    scene.layers.append(("envelope", "direction envelope at the tool", True))
    scene.layers.append(("worst", "worst direction", True))
    # A translucent double ball a joint, in rad (m for a prismatic joint).
    surfaces, faces = envelope.surfaces(subdivisions)
    size = 0.26 * body.reach
    pointer = scene.add(arrow(1.18 * size, 0.011 * body.reach, "#c2410c", head=0.075 * body.reach))
    interval = envelope.peak_interval()
    for k, (name, unit, surface) in enumerate(
        zip(envelope.joint_names, units, surfaces, strict=True)
    ):
        peak = float(envelope.peak_deflection[k])
        scale = Scale(f"peak deflection of {name}", unit, peak * 1e3)
        colours = scale.colours(np.linalg.norm(surface, axis=1) * 1e3)
        mesh = Mesh(surface, faces, colours, opacity=0.5, exact=True, crease=180.0)
        factor = size / peak if peak > 0 else 1.0
        place = np.diag([factor, factor, factor, 1.0])
        place[:3, 3] = envelope.tool_position
        scene.items.append(Item(scene.add(mesh), "envelope", "", place, joint=k))
        along = envelope.worst_direction[k]
        scene.items.append(
            Item(pointer, "worst", "", turned_to(along, envelope.tool_position), joint=k)
        )
        told = f"{peak * 1e3:.3g} {unit}"
        if envelope.estimated:
            low, high = (f"{1e3 * end:.2g}" for end in interval[k])
            told = f"{peak * 1e3:.2g} {unit} ({low} to {high})"
        text = f"{name}: {told} along {direction_label(along)}"
        tip = envelope.tool_position + 1.2 * size * along
        scene.labels.append({"text": text, "layer": "worst", "at": tip.tolist(), "joint": k})
        scene.joints.append({"name": name, "scale": scale.to_dict(), "peak": peak, "text": text})


def _add_tool(scene: Scene, body: Body, direction: FloatArray | None) -> None:
    scene.layers.append(
        ("tool", "tool point" + (" and force" if direction is not None else ""), True)
    )
    place = np.eye(4)
    place[:3, 3] = scene.envelope.tool_position
    scene.items.append(Item(scene.add(sphere(0.013 * body.reach, "#a21caf")), "tool", "", place))
    if direction is None:
        return
    length = 0.17 * body.reach
    mesh = scene.add(arrow(length, 0.008 * body.reach, "#a21caf", head=0.05 * body.reach))
    at = scene.envelope.tool_position - direction * (length + 0.015 * body.reach)
    scene.items.append(Item(mesh, "tool", "", turned_to(direction, at)))
    scene.labels.append({"text": "force", "layer": "tool", "at": at.tolist()})


def _add_rivets(scene: Scene, body: Body, assessment: Assessment) -> None:
    values, scale = rivet_values(assessment)
    joints = scene.scales["joints"]
    if scale.unit == joints.unit and scale.top <= joints.top:
        scale = joints  # one bar for the joints and for what wears them
    else:
        scene.scales["rivets"] = scale
    length = 0.055 * body.reach
    mesh = scene.add(arrow(length, 0.0065 * body.reach, head=0.03 * body.reach))
    for k, (operation, row) in enumerate(zip(assessment.operations, values, strict=True)):
        layer = f"rivets-{k}"
        scene.layers.append((layer, f"rivets: {operation.name}", True))
        for i, (position, value) in enumerate(zip(operation.tool_position, row, strict=True)):
            place = turned_to(operation.direction, position - operation.direction * length)
            told = rivet_card(assessment, operation, i)
            scene.items.append(Item(mesh, layer, "", place, scale.colour(value), told=told))


def _add_workspace(scene: Scene, workspace: xarray.Dataset, units: list[str]) -> None:
    mapped = [str(name) for name in values_of(workspace, "joint", 1)]
    step, every, count = 0.0, 1, 0
    for k, name in enumerate(scene.envelope.joint_names):
        if name not in mapped and k != scene.chosen:
            continue
        places, peak = best_branch(workspace, name)
        count = len(places)
        every = -(-count // _MOST_PLACES)
        places, peak = places[::every], peak[::every]
        step = step or spacing(places)
        scale = Scale(f"workspace: peak of {name}", units[k], 1e3 * float(peak.max()))
        grain = sphere(0.4 * step, subdivisions=0)
        corners = len(grain.vertices)
        cloud = Mesh(
            (places[:, None] + grain.vertices[None]).reshape(-1, 3),
            (np.arange(len(places))[:, None, None] * corners + grain.faces[None]).reshape(-1, 3),
            np.repeat(scale.colours(1e3 * peak), corners, axis=0),
        )
        scene.joints[k]["map"] = scale.to_dict()
        scene.items.append(Item(scene.add(cloud), "map", "", np.eye(4), joint=k))
        if k == scene.chosen:
            scene.scales["map"] = scale
    text = f"workspace map, {response_of(workspace)}: peak of the joint, best branch"
    if every > 1:
        text += f"; one of {every} of the {count} places"
    scene.layers.append(("map", text, True))


def _aim(scene: Scene, body: Body, places: dict[str, FloatArray]) -> None:
    points = np.array([*(p[:3, 3] for p in places.values()), scene.envelope.tool_position])
    # The envelope that is shown at first, and the map, shall be in the picture.
    along = 0.3 * body.reach * scene.envelope.worst_direction[scene.chosen]
    balls = scene.envelope.tool_position + np.stack([along, -along])
    mapped = [scene.meshes[item.mesh].vertices for item in scene.items if item.layer == "map"]
    seen = np.concatenate([points, balls, *mapped[:1]])
    low, high = seen.min(axis=0), seen.max(axis=0)
    centre = 0.5 * (low + high)
    span = float(np.linalg.norm(high - low)) * (0.85 if mapped else 1.0) + 0.2 * body.reach
    # From the side of the arm, a little from above: the plane it moves in is seen face on.
    outward = scene.envelope.tool_position[:2] - points[0][:2]
    heading = np.arctan2(outward[1], outward[0]) if np.linalg.norm(outward) > 1e-6 else 0.0
    azimuth = heading - 1.05
    view = np.array([np.cos(azimuth), np.sin(azimuth), 0.42])
    cell = next((c for c in (0.05, 0.1, 0.25, 0.5) if 24 * c > 2.4 * body.reach), 1.0)
    squares = 2 * int(np.ceil(1.2 * body.reach / cell))
    middle = np.round(centre[:2] / cell) * cell
    # Who reaches below the robot's foot has it on a pedestal.
    ground = min([float(points[0][2]), *(float(part[:, 2].min()) for part in mapped)])
    scene.floor = {"cell": cell, "squares": squares, "at": [*middle.tolist(), ground]}
    scene.camera = np.array([centre + view / np.linalg.norm(view) * 1.25 * span, centre])
