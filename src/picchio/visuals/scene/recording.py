"""The vibration of a scene as a Rerun recording: the robot, its joints' deflections, over time."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from picchio.core.errors import InputError
from picchio.core.files import swap_in, writing
from picchio.core.unfinished import unfinished
from picchio.visuals.kinematics import joint_motion
from picchio.visuals.scene.robot.mesh import moved, rgb

if TYPE_CHECKING:
    from picchio.visuals.scene.scene import Scene


def write_recording(scene: Scene, path: str | Path) -> Path:
    """Write what the page animates as a Rerun recording, whole or not at all.

    The robot bends as in the page, exaggerated; `deflection/NAME` is what it is, mrad (mm), and
    `force_direction` the force. The timeline `time` is the vibration's own, not slowed.

    Args:
        scene: with its vibration.
        path: of the .rrd file.

    Returns:
        the path.

    Raises:
        InputError: rerun-sdk is not installed.
        OutputError: it cannot be written there.
    """
    try:
        import rerun as rr
    except ImportError:
        raise InputError("a Rerun recording needs rerun-sdk",
                         hint="pip install 'picchio[rerun]'") from None  # fmt: skip
    target = Path(path)
    with unfinished(lambda: target.with_name(f".{target.name}.part")) as part:
        stream = rr.RecordingStream(f"picchio {scene.title}", send_properties=False)
        with writing(target):
            stream.save(part)
        _record(scene, stream)
        with writing(target):
            swap_in(part, target)
    return target


def _record(scene: Scene, stream: Any) -> None:
    """All of the scene into an open recording, which is then closed."""
    import rerun as rr

    motion = scene.motion
    along = np.asarray(motion["directions"][0]["along"])
    samples = np.einsum("ndk,d->nk", np.asarray(motion["samples"]), along)
    when = rr.TimeColumn("time", duration=motion["step"] * np.arange(samples.shape[1]))
    stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    for frame in scene.frames:
        if frame.axis is None or not frame.follows.any():
            matrix = frame.matrix @ joint_motion(frame)
            place = rr.Transform3D(translation=matrix[:3, 3], mat3x3=matrix[:3, :3])
            stream.log(frame.path, place, static=True)
            continue
        bent = frame.position + motion["factor"] * (frame.follows @ samples)
        places = np.array(
            [frame.matrix @ joint_motion(replace(frame, position=float(q))) for q in bent]
        )
        columns = rr.Transform3D.columns(translation=places[:, :3, 3], mat3x3=places[:, :3, :3])
        rr.send_columns(frame.path, [when], columns, recording=stream, strict=True)
    for k, item in enumerate(scene.items):
        if item.layer != "robot":
            continue
        mesh = moved(scene.meshes[item.mesh], item.matrix)
        colours = mesh.colours
        if colours is None:
            colours = np.tile(rgb(item.colour or mesh.colour), (len(mesh.vertices), 1))
        shape = rr.Mesh3D(vertex_positions=mesh.vertices, triangle_indices=mesh.faces,
                          vertex_colors=np.rint(colours).astype(np.uint8))  # fmt: skip
        stream.log(f"{item.node}/shape{k}", shape, static=True)
    for joint, row in zip(scene.joints, samples, strict=True):
        columns = rr.Scalars.columns(scalars=1e3 * row)
        entity = rr.new_entity_path(["deflection", joint["name"]])
        rr.send_columns(entity, [when], columns, recording=stream, strict=True)
    length = 0.17 * scene.reach
    tool = scene.envelope.tool_position
    arrow = rr.Arrows3D(origins=[tool - length * along], vectors=[length * along])
    stream.log("force_direction", arrow, static=True)
    stream.flush()
    stream.disconnect()
