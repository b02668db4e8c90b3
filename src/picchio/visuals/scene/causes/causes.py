"""A diagnosis in the scene: every cause drawn where it sits, with a label."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from picchio.core import spoken
from picchio.diagnosis.result import VERDICTS, Cause, Diagnosis
from picchio.model.expansion import BASE_AXES
from picchio.visuals.plots.style import GREY, SKY, VERMILION
from picchio.visuals.scene.causes.drawings import draw, note
from picchio.visuals.scene.causes.site import Site
from picchio.visuals.scene.scene import Item, Scene

LAYERS = {
    "causes": ("causes", VERMILION, True),
    "alternatives": ("what would explain it as well", SKY, True),
    "leads": ("what helped, but is no cause", GREY, False),
}
"""Layer: its words, its colour, whether it is shown at first."""


def add_causes(scene: Scene, site: Callable[..., Site], found: Diagnosis) -> None:
    """Draw a diagnosis into a scene; of the other layers only robot and tool stay shown.

    Args:
        scene: with its frames.
        site: makes a `Site` of effect, target, values and colour.
        found: the diagnosis.

    Raises:
        InputError: an effect that is not known, or a target that this robot does not have.
    """
    scene.layers = [(i, text, on and i in ("robot", "tool")) for i, text, on in scene.layers]
    scene.playing = False  # what moves is hard to point at
    labels: list[dict[str, Any]] = []
    told: list[dict[str, str]] = []
    named = "; ".join(map(cause_text, found.causes)) or VERDICTS[found.verdict]
    scene.verdict = f"{found.verdict.replace('-', ' ').capitalize()}: {named}."
    scene.diagnosis = {"verdict": f"{found.verdict.replace('-', ' ')}: {VERDICTS[found.verdict]}",
                       "lines": told}  # fmt: skip
    for layer, cause in _causes(found):
        colour = scene.swatches[layer] = LAYERS[layer][1]
        values = {name: value.value for name, value in cause.parameters.items()}
        here = site(effect=cause.effect, target=cause.target, values=values, colour=colour)
        told.append({"text": cause_text(cause) + note(here), "layer": layer})
        for piece in draw(here):
            node = next((f.path for f in scene.frames if f.link == piece.link), "")
            back = np.linalg.inv(here.places[piece.link]) if piece.link else np.eye(4)
            for shape in piece.shapes:
                scene.items.append(Item(scene.add(shape), layer, node, back))
            if piece.at is not None:
                at = (back @ [*piece.at, 1.0])[:3].tolist()
                text = cause.effect.replace("_", " ")
                labels.append({"text": text, "layer": layer, "node": node, "at": at})
    shown = [(layer, LAYERS[layer][0], LAYERS[layer][2]) for layer in scene.swatches]
    # First in the panel, and first to find a place in the picture.
    scene.layers, scene.labels = shown + scene.layers, labels + scene.labels


def _causes(found: Diagnosis) -> Iterator[tuple[str, Cause]]:
    """Everything that a diagnosis points at, once, by layer."""
    seen = {(cause.effect, cause.target) for cause in found.causes}
    yield from (("causes", cause) for cause in found.causes)
    others = [("alternatives", pair) for each in found.alternatives for pair in each]
    for layer, pair in (*others, *(("leads", pair) for pair in found.leads)):
        if pair not in seen:
            seen.add(pair)
            yield layer, Cause(*pair, confidence=0.0)


def cause_text(cause: Cause) -> str:
    """A cause in a few words: effect, place, and its first value (a vector's three)."""
    text = cause.effect.replace("_", " ")
    if cause.target in BASE_AXES:
        text += f" {'about' if cause.target.startswith('r') else 'along'} {cause.target[-1]}"
    elif cause.target not in ("tool", "robot"):
        text += f" of {cause.target}"
    known = list(cause.parameters.items())
    if not known:
        return text
    unit = known[0][1].unit
    told = [(name, v) for name, v in known if v.unit == unit] if len(known) == 3 else known[:1]
    numbers = ", ".join(f"{name.replace('_', ' ')} {spoken.number(v.value)}" for name, v in told)
    numbers = numbers.replace("-", "\N{MINUS SIGN}")
    return f"{text}: {numbers}" + ("" if unit == "1" else f" {unit.replace('*', ' ')}")
