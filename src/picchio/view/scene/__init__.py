"""The 3-D scene: a robot, what shakes it and what that costs, in one offline HTML file."""

from __future__ import annotations

from picchio.view.scene.build import build_scene
from picchio.view.scene.compare import compare_scene
from picchio.view.scene.diagnosed import diagnosis_scene
from picchio.view.scene.scene import Scene

__all__ = ["Scene", "build_scene", "compare_scene", "diagnosis_scene"]
