"""An arm's numbers against each other: which are out of proportion, and which unit explains them.

Lengths, masses, inertias and angles of real arms correlate: an arm's mass grows with its length
cubed, a link's radius of gyration with its own size. A file in millimetres or grams breaks that by
powers of ten. Each number has a normal distribution of its logarithm, from some 170 public
URDFs of arms; the units under which all of them together are most probable are the likely cause.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np

from picchio.core import spoken
from picchio.robot.finding import Finding
from picchio.robot.urdf.shapes import link_ends
from picchio.robot.urdf.tree import MOVABLE, UrdfTree

_SURE = 3.0
"""Standard deviations beyond which a number is out of proportion, and that a slip must explain."""
_MIXED = 4.0  # so seldom are a file's lengths in two units, as the odds of one unit below
_UNLIMITED = 1e3  # rad or m of travel: a way to write "no limit"
_AIR, _STEEL = 1.2, 7850.0  # kg/m^3
_THICK = math.pi / 16.0  # volume of a rod half as thick as it is long, over its length cubed


@dataclass(frozen=True)
class _Measure:
    """A number of an arm.

    Attributes:
        told: the number in words; {1} is over what is typical.
        typical: the median of public arms.
        spread: standard deviation of its decadic logarithm there.
        powers: how it grows with each number of the file, by the number's name.
        least: below this, none can be.
        most: above this, none can be.
        why: of these ends.
        small: whether it is worth a word where it is small.
    """

    told: str
    typical: float
    spread: float
    powers: Mapping[str, float]
    least: float = 0.0
    most: float = math.inf
    why: str = ""
    small: bool = True

    def strain(self, value: float) -> float:
        """How many standard deviations a value is away."""
        away = math.log10(value / self.typical) / self.spread
        return away if self.small else max(away, 0.0)

    def said(self, value: float) -> str:
        return self.told.format(
            *(spoken.number(x, least=0.0) for x in (value, value / self.typical))
        )

    def possible(self, value: float) -> bool:
        return self.least <= value <= self.most


_MEASURES = {
    "length": _Measure(
        "{} m from joint to joint", 1.0, 0.35, {"lengths": 1}, 1e-3, 100.0,
        "the longest arms, of space stations and concrete pumps, have 17 to 70 m"),
    "density": _Measure(
        "links that weigh {1} times what arms of its length weigh", 15.0, 0.45,
        {"lengths": -3, "masses": 1}, _AIR * _THICK, _STEEL * _THICK,
        "a rod of its length and half as thick weighs less of air, and more of steel"),
    "gyration": _Measure(
        "links whose radius of gyration is {} times the way between their joints", 0.45, 0.25,
        {"inertias": 0.5, "masses": -0.5, "lengths": -1}),
    "centre": _Measure(
        "a centre of mass {} times its length from its joint", 0.2, 0.35,
        {"centres of mass": 1, "lengths": -1}, 0.0, 5.0, "it would be outside of all links",
        small=False),
    "rotation": _Measure(
        "an rpy of {} rad", 1.57, 0.2, {"rotations": 1}, 0.0, 2.0 * math.pi + 0.01,
        "no program that writes URDFs turns a frame by more than once round", small=False),
    "turn": _Measure("a joint that turns by {} rad", 6.0, 0.25, {"limits of angles": 1},
                     small=False),
    "slide": _Measure("a joint that slides by {} m", 0.5, 0.6, {"limits of slides": 1},
                      small=False),
}  # fmt: skip

# What a file's numbers may be in: how many decades too large they then are, and how seldom that is
# (minus twice the logarithm of the odds against SI, as a sum of squared strains has it).
_SI = (0.0, 0.0)
_LENGTHS = {"m": _SI, "millimetres": (3.0, 4.0), "centimetres": (2.0, 6.0), "inches": (1.595, 8.0)}
_ANGLES = {"rad": _SI, "degrees": (math.log10(180.0 / math.pi), 4.0)}
_UNITS = {
    "lengths": _LENGTHS,
    "centres of mass": _LENGTHS,
    "masses": {"kg": _SI, "grams": (3.0, 4.0)},
    "inertias": {"kg m^2": _SI, "kg mm^2": (6.0, 4.0), "g mm^2": (9.0, 4.0), "kg cm^2": (4.0, 6.0),
                 "g cm^2": (7.0, 6.0)},
    "rotations": _ANGLES,
    "limits of angles": _ANGLES,
    "limits of slides": _LENGTHS,
}  # fmt: skip


def out_of_proportion(tree: UrdfTree, tool: str) -> Iterator[Finding]:
    """What is wrong with an arm as a whole, one finding a unit.

    Args:
        tree: with its masses.
        tool: the frame that the arm carries.
    """
    values = _measured(tree, tool)
    strained = {n for n, v in values.items() if abs(_MEASURES[n].strain(v)) > _SURE}
    strained |= {name for name, value in values.items() if not _MEASURES[name].possible(value)}
    if not strained:
        return
    slips = _likely_units(values)
    explained = {name for name in strained if slips.keys() & _MEASURES[name].powers.keys()}
    by_unit: dict[str, list[str]] = {}
    for kind, unit in slips.items():
        by_unit.setdefault(unit, []).append(kind)
    cause = ", ".join(f"{' and '.join(k)} look like {unit}" for unit, k in by_unit.items())
    for names, why in ((explained, cause), (strained - explained, "")):
        wrong = [n for n in _MEASURES if n in names and not _MEASURES[n].possible(values[n])]
        told = [n for n in _MEASURES if n in names and (why or n in wrong)]
        if told:
            what = " and ".join(_MEASURES[name].said(values[name]) for name in told)
            reasons = "".join(f" ({_MEASURES[name].why})" for name in wrong[:1])
            severity = "impossible" if wrong else "doubtful"
            yield Finding("the whole arm", f"it has {what}{reasons}", why, severity)  # type: ignore[arg-type]


def _measured(tree: UrdfTree, tool: str) -> dict[str, float]:
    """Those of the measures that this arm has."""
    chain = tree.chain(tool)
    moving = [joint for joint in chain if joint.type in MOVABLE and joint.mimic is None]
    found: dict[str, float] = {}
    bodies = {j.child: b for j in chain if (b := tree.links[j.child]) is not None and b.mass > 0}
    frames = [*(joint.rpy for joint in chain), *(body.rpy for body in bodies.values())]
    found["rotation"] = float(np.abs(frames).max(initial=0.0))
    travel = {j.name: j.upper - j.lower for j in moving if j.upper - j.lower < _UNLIMITED}
    for name, kind in (("turn", False), ("slide", True)):
        found[name] = max((travel[j.name] for j in moving if j.name in travel
                           and (j.type == "prismatic") is kind), default=0.0)  # fmt: skip
    length = float(np.linalg.norm(link_ends(tree, tool), axis=1).sum())
    if len(moving) > 1 and length > 0.0:
        found["length"] = length
        links = (tree.links[link] for link in tree.beyond(moving[0].name))
        mass = sum(body.mass for body in links if body is not None)
        found["density"] = mass / length**3 if len(moving) > 2 else 0.0  # not of casters
        found["centre"] = max((math.hypot(*b.xyz) for b in bodies.values()), default=0.0) / length
    pairs = [(gyration(tree, j.child), math.hypot(*after.xyz)) for j, after in pairwise(chain)]
    ratios = [own / size for own, size in pairs if own and size]
    found["gyration"] = float(np.median(ratios)) if len(ratios) > 1 else 0.0
    return {name: value for name, value in found.items() if value > 0.0}


def gyration(tree: UrdfTree, link: str) -> float:
    """The largest radius of gyration of a link with mass, m; 0 where no axis has inertia.

    Args:
        tree: of the robot.
        link: its name.
    """
    body = tree.links[link]
    if body is None or not body.mass > 0.0:
        return 0.0
    return math.sqrt(max(np.linalg.eigvalsh(body.tensor)[-1], 0.0) / body.mass)


def extent(tree: UrdfTree, link: str) -> float:
    """The largest distance from a link's centre of mass to its joints, m.

    Args:
        tree: of the robot.
        link: its name.
    """
    body = tree.links[link]
    centre = np.zeros(3) if body is None else np.array(body.xyz)
    ends = [np.zeros(3), *(np.array(joint.xyz) for joint in tree.carried.get(link, ()))]
    return max(float(np.linalg.norm(end - centre)) for end in ends)


def _likely_units(values: Mapping[str, float]) -> dict[str, str]:
    """The units that are not SI under which the values are most probable."""
    best: tuple[float, dict[str, str]] = (math.inf, {})
    kinds = [kind for kind in _UNITS if any(kind in _MEASURES[name].powers for name in values)]
    for chosen in product(*(_UNITS[kind] for kind in kinds)):
        units = dict(zip(kinds, chosen, strict=True))
        decades = {kind: _UNITS[kind][unit][0] for kind, unit in units.items()}
        # A file in millimetres has its centres, and often its inertias, in them, too.
        implied = {"centres of mass": decades.get("lengths", 0.0)}
        if implied["centres of mass"]:
            implied["inertias"] = 2.0 * decades["lengths"] + decades.get("masses", 0.0)
        cost = sum(_UNITS[kind][unit][1] for kind, unit in units.items()
                   if decades[kind] != implied.get(kind))  # fmt: skip
        mixed = decades.get("centres of mass", implied["centres of mass"])
        cost += _MIXED * (mixed != implied["centres of mass"])
        for name, value in values.items():
            shift = sum(p * decades.get(kind, 0.0) for kind, p in _MEASURES[name].powers.items())
            cost += _MEASURES[name].strain(value / 10.0**shift) ** 2
        slips = {kind: unit for kind, unit in units.items() if decades[kind]}
        best = min(best, (cost, slips), key=lambda one: one[0])
    return best[1]
