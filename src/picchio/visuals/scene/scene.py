"""A scene: what is placed where, on which layer, and how it moves."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.html import Page
from picchio.core.processes import safe_start
from picchio.core.results import Result
from picchio.studies.envelopes import DirectionEnvelope
from picchio.visuals.kinematics import Frame
from picchio.visuals.notebook import in_notebook
from picchio.visuals.scene.live import send
from picchio.visuals.scene.overlay import Scale
from picchio.visuals.scene.page import scene_html
from picchio.visuals.scene.robot.mesh import Mesh

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True, eq=False)
class Item:
    """A mesh in the scene: on which layer, under which node, where, in which colour.

    `told` is what a click on it tells: words, value, source.
    """

    mesh: int
    layer: str
    node: str
    matrix: FloatArray
    colour: str | None = None
    joint: int | None = None
    told: list[tuple[str, str, str]] | None = None


@dataclass(eq=False, repr=False)
class Scene(Page, Result):
    """Everything that a page, a notebook cell or a live viewer shows.

    Attributes:
        title: the robot's name.
        subtitle: pose and blows, in words.
        frames: the robot's links.
        meshes: distinct geometry.
        items: what is placed where.
        layers: (id, words, shown at first).
        labels: text at a place: {"text", "layer", "at" (3,) m, "node" that it is in, "joint"}.
        joints: the flexible joints: {"name", "scale", "peak", "text", "card", and "map" its colour
            bar}.
        scales: colour bars by layer.
        swatches: colours of layers that have one, "#rrggbb".
        motion: the vibration, see `picchio.visuals.scene.motion`.
        tracks: recorded motions to play as ghosts in its place: {"layer", "text", "colour",
            "samples" (n, k) rad}, see `picchio.visuals.scene.compare`.
        diagnosis: what the panel shows: {"verdict", "lines": [{"text", "layer"}]}, or None.
        playing: whether the vibration is shown at once.
        camera: position and target, (2, 3) m.
        floor: "cell" m, "squares" along a side, "at" the middle (3,) m.
        chosen: index of the joint whose envelope is shown at first.
        reach: m, size of the robot.
        envelope: what the double balls are of.
        verdict: of the diagnosis that is shown, or else of the task's assessment.
        notice: what of the drives is an estimate; "" where nothing is.
        file: where it was saved last, or None.
    """

    LACKS: ClassVar = {"plot": "it has three dimensions: `show` it"}

    title: str
    subtitle: str
    envelope: DirectionEnvelope
    frames: list[Frame] = field(default_factory=list)
    meshes: list[Mesh] = field(default_factory=list)
    items: list[Item] = field(default_factory=list)
    layers: list[tuple[str, str, bool]] = field(default_factory=list)
    labels: list[dict[str, Any]] = field(default_factory=list)
    joints: list[dict[str, Any]] = field(default_factory=list)
    scales: dict[str, Scale] = field(default_factory=dict)
    swatches: dict[str, str] = field(default_factory=dict)
    motion: dict[str, Any] = field(default_factory=dict)
    tracks: list[dict[str, Any]] = field(default_factory=list)
    diagnosis: dict[str, Any] | None = None
    verdict: str = ""
    notice: str = ""
    playing: bool = True
    camera: FloatArray = field(default_factory=lambda: np.zeros((2, 3)))
    floor: dict[str, Any] = field(default_factory=dict)
    chosen: int = 0
    reach: float = 1.0
    file: Path | None = None

    def html(self) -> str:
        """One HTML page that needs nothing but itself."""
        return scene_html(self)

    def show(self, viewer: Any = None, **_: Any) -> Any:
        """In a notebook the scene itself, which the cell shows; else a live meshcat viewer.

        Args:
            viewer: of meshcat, to draw in; a new one if not given.
            **_: nothing: it is drawn already.

        Returns:
            the scene or the viewer.
        """
        if viewer is None and in_notebook():
            return self
        if viewer is None:
            import meshcat

            # Its server is a process of its own. It reaches for pyngrok, which would open the page
            # to the world, where it is asked for a tunnel, and only there.
            with safe_start():
                viewer = meshcat.Visualizer()
        send(self, viewer)
        return viewer

    def save(self, path: str | Path) -> Path:
        """Write the page to a file, whole or not at all, and return the path.

        Raises:
            OutputError: it cannot be written there.
        """
        self.file = super().save(path)
        return self.file

    def to_frame(self) -> pandas.DataFrame:
        """The table of its envelope."""
        return self.envelope.to_frame()

    def _headline(self) -> str:
        return f"{self.title}, {self.subtitle}"

    def _content(self) -> dict[str, Any]:
        return {
            "format": "picchio-scene/1",
            "file": self.file,
            "bytes": 0 if self.file is None else self.file.stat().st_size,
            "verdict": self.verdict or None,
            "estimated": bool(self.notice),
            "layers": [{"id": name, "text": text} for name, text, _ in self.layers],
            "envelope": self.envelope.to_dict(),
            "provenance": self.envelope.origin,
        }

    def add(self, mesh: Mesh) -> int:
        """Put geometry in.

        Args:
            mesh: to be drawn.

        Returns:
            its index.
        """
        self.meshes.append(mesh)
        return len(self.meshes) - 1
