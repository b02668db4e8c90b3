"""The catalogue of effects, described for people: what each one is and how it is written."""

from __future__ import annotations

import inspect
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from picchio.core.html import sheet
from picchio.core.results import TableResult, plain
from picchio.model.effects.effect import CHANNEL_UNIT, Effect, Parameter
from picchio.model.effects.registry import catalogue, effect_class
from picchio.model.effects.scales import Scales

FORMAT = "picchio-effects/1"

PLACES: Mapping[str, str] = {
    "structure": "Structure: the robot's equations of motion",
    "nonlinear": "Nonlinear: joints and contact whose force is not in proportion",
    "blows": "Blows: what the tool really does",
    "over-time": "Over time: what changes while a campaign lasts",
    "sensor": "Sensors: how channels read",
    "motion": "Motion records: drives and encoders of a moving robot",
}
"""What an effect changes, with a heading."""

TARGETS: Mapping[str, tuple[str, str]] = {
    "joint": ("a flexible joint", "joint_1"),
    "joint pair": ("the outer of two joints in a row", "joint_2"),
    "link": ("a link", "link_2"),
    "joint or link": ("a joint or a link", "joint_1"),
    "tool": ('always "tool"', "tool"),
    "robot": ('always "robot"', "robot"),
    "axis": ("a world axis at the base: x, y, z, rx, ry or rz", "rx"),
    "channel group": (
        "channels of one kind, such as deflection, accelerometer.tool or position",
        "accelerometer.tool",
    ),
}
"""Kind of target: what it may be, and one that the example table uses."""

# The sizes that `fanuc_like_3dof` has on its example task, so that examples are plausible.
_SCALES = Scales(
    stiffness={"joint_1": 2.4e5},
    inertia={"joint_1": 200.0},
    deflection={"joint_1": 4e-4},
    rate={"joint_1": 0.05},
    gravity={"joint_1": 600.0},
    mass=150.0,
    compliance=1e-5,
    travel=1e-3,
    force=300.0,
    period=0.04,
    width=0.004,
    days=10.0,
    kelvin=20.0,
    reading={"accelerometer.tool": (0.7, 4.0)},
    step=2e-4,
    link_stiffness={"link_2": 1e5},
)
# For effects that have no trials: plausible steps away from the neutral value, by unit.
_STEPS = {"N*m": 5.0, "N*m*s/rad": 20.0, "s": 0.002, "rad/s": 0.1, "1": 0.1}


@dataclass(frozen=True)
class EffectDescription:
    """One effect of the catalogue.

    Attributes:
        name: as written in files.
        where: the part of the simulation that it changes, such as "structure" or "sensor".
        target: the kind of thing that it acts on.
        meaning: what it stands for in the real robot.
        detail: what it does to the model.
        parameters: its numbers, with unit, bounds, neutral value and meaning.
        drawn: what differs from record to record, and is found with the effect; empty if nothing.
        source: publication or data it rests on; empty if none.
        example: a table of a `picchio-model/1` or `picchio-plan/1` file.
    """

    name: str
    where: str
    target: str
    meaning: str
    detail: str
    parameters: tuple[Parameter, ...]
    drawn: str
    source: str
    example: str

    def to_dict(self) -> dict[str, Any]:
        """Plain values; a bound or neutral value at infinity is None.

        Returns:
            the attributes by name.
        """
        shown = ("name", "unit", "lower", "upper", "neutral", "meaning")
        told = {
            **vars(self),
            "target_meaning": target_meaning(self.target),
            "parameters": [{key: getattr(p, key) for key in shown} for p in self.parameters],
            "drawn": self.drawn or None,
            "source": self.source or None,
        }
        return {key: plain(value) for key, value in told.items()}


@dataclass(frozen=True, repr=False)
class EffectList(TableResult):
    """All effects, or one of them; its table is one row an effect.

    Attributes:
        effects: by name.
    """

    LACKS: ClassVar = {"plot": "it is a list to read", "show": "it is a list to read"}

    effects: tuple[EffectDescription, ...]

    def _headline(self) -> str:
        return f"{len(self.effects)} effects"

    def _content(self) -> dict[str, Any]:
        return {"format": FORMAT, "effects": self.effects}

    def _rows(self) -> list[dict[str, Any]]:
        return [
            {
                "name": e.name,
                "where": e.where,
                "target": e.target,
                "parameters": ", ".join(p.name for p in e.parameters),
                "meaning": e.meaning,
            }
            for e in self.effects
        ]

    def _repr_html_(self) -> str:
        rows = [tuple(row.values()) for row in self._rows()]
        return sheet(
            self._headline(), None, ("effect", "where", "target", "parameters", "meaning"), rows
        )


def effects(name: str | None = None) -> EffectList:
    """The effects that can be put into a model, those of installed extensions included.

    Args:
        name: of one effect; all of them if not given.

    Returns:
        their descriptions, by name.

    Raises:
        InputError: no such effect.
    """
    chosen = list(catalogue().values()) if name is None else [effect_class(name)]
    return EffectList(tuple(_describe(effect) for effect in chosen))


def by_place(entries: Iterable[EffectDescription]) -> dict[str, list[EffectDescription]]:
    """Effects by what they change.

    Args:
        entries: to be sorted.

    Returns:
        heading -> effects, the robot's structure first; places without effects are left out.
    """
    found: dict[str, list[EffectDescription]] = {place: [] for place in PLACES}
    for entry in entries:
        found.setdefault(entry.where, []).append(entry)
    return {PLACES.get(place, place): group for place, group in found.items() if group}


def target_meaning(kind: str) -> str:
    """What an effect's target may be.

    Args:
        kind: the effect's `target_kind`.

    Returns:
        a phrase; the kind itself where an extension has one of its own.
    """
    return TARGETS.get(kind, (kind, ""))[0]


def shown_unit(unit: str) -> str:
    """A parameter's unit, for people.

    Args:
        unit: as declared.

    Returns:
        in words for a pure number, or where it depends on what the sensor reads.
    """
    return {"1": "pure number", CHANNEL_UNIT: "the channel's unit"}.get(unit, unit)


def shown_bounds(parameter: Parameter) -> str:
    """A parameter's bounds, for people.

    Args:
        parameter: of an effect.

    Returns:
        such as "0 to 0.2", "at least 0" or "any".
    """
    low, high = parameter.lower, parameter.upper
    if math.isinf(low) and math.isinf(high):
        return "any"
    if math.isinf(high):
        return f"at least {low:g}"
    return f"at most {high:g}" if math.isinf(low) else f"{low:g} to {high:g}"


def _describe(effect: type[Effect]) -> EffectDescription:
    return EffectDescription(
        effect.name,
        effect.where,
        effect.target_kind,
        effect.meaning,
        inspect.cleandoc(effect.__doc__ or "").partition("\n\n")[0].replace("\n", " "),
        effect.parameters,
        effect.latent.what if effect.latent is not None else "",
        effect.source,
        _example(effect),
    )


def _example(effect: type[Effect]) -> str:
    target = TARGETS.get(effect.target_kind, ("", effect.target_kind))[1]
    if effect.where == "motion" and effect.target_kind == "channel group":
        target = "position"  # of a moving robot, encoders are read
    values = _typical(effect, target)
    lines = ["[[effect]]", f'effect = "{effect.name}"', f'target = "{target}"']
    if values:
        inner = ", ".join(f"{name} = {_toml(value)}" for name, value in values.items())
        lines.append(f"parameters = {{ {inner} }}")
    return "\n".join(lines)


def _typical(effect: type[Effect], target: str) -> dict[str, float]:
    """Values at which the effect does something on the example arm; the others stay neutral."""
    try:
        found = next(iter(effect(target).trials(_SCALES)), {})
    except KeyError:  # it needs a size that the example arm does not have
        found = {}
    neutral = {p.name: p.neutral for p in effect.parameters}
    if any(value != neutral[name] for name, value in found.items()):
        return found
    steps = {p.name: p.neutral + _STEPS.get(p.unit, 0.1) for p in effect.parameters}
    inside = {p.name: min(max(steps[p.name], p.lower), p.upper) for p in effect.parameters}
    amounts = {p.name: inside[p.name] for p in effect.parameters if p.unit != "1"}
    return (amounts or inside) | found


def _toml(value: float) -> str:
    text = f"{value:.3g}"
    return text if any(mark in text for mark in ".en") else f"{text}.0"
