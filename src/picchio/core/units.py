"""Units as people write them, and their conversion to SI: every unit of picchio is read here.

pint does the parsing and the dimensions. It gets its own short list of units, because its default
one takes an angle for a plain number (then `deflection [1]` or `[%]` would pass for radians, and
hertz for rad/s) and `Nm` for something else than a newton metre. Mega and giga are no prefixes
of everything: Grad is German for degrees.
"""

from __future__ import annotations

import itertools
import re
import unicodedata
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError

_DEFINITIONS = """
nano- = 1e-9 = n-
micro- = 1e-6 = u- = µ- = μ-
milli- = 1e-3 = m-
centi- = 1e-2 = c-
deci- = 1e-1 = d-
deca- = 1e1 = da-
hecto- = 1e2 = h-
kilo- = 1e3 = k-
second = [time] = s = sec = seconds = secs
minute = 60 * second = min = minutes
hour = 60 * minute = h = hours
day = 24 * hour = d = days
hertz = 1 / second = Hz
megahertz = 1e6 * hertz = MHz
metre = [length] = m = meter = metres = meters
inch = 0.0254 * metre = in = inches
foot = 0.3048 * metre = ft = feet
gram = [mass] = g = grams
pound = 453.59237 * gram = lb = lbs = pounds
ounce = pound / 16 = oz
newton = kilogram * metre / second ** 2 = N = newtons
meganewton = 1e6 * newton = MN
pound_force = pound * g_n = lbf
ounce_force = ounce * g_n = ozf
gram_force = gram * g_n = gf
kilopond = kilogram * g_n = kp
dyne = 1e-5 * newton = dyn
newton_metre = newton * metre = Nm
newton_second = newton * second = Ns
pascal = newton / metre ** 2 = Pa
megapascal = 1e6 * pascal = MPa = MPA = Mpa = mpa
gigapascal = 1e9 * pascal = GPa
bar = 1e5 * pascal
psi = pound_force / inch ** 2
ksi = 1000 * psi = kpsi
standard_gravity = 9.80665 * metre / second ** 2 = g_n = g0 = gn = G = gee
galileo = 0.01 * metre / second ** 2 = Gal
radian = [angle] = rad = radians
degree = 0.017453292519943295 * radian = deg = ° = degrees
turn = 6.283185307179586 * radian = rev = turns = revolution = revolutions
arcminute = 0.0002908882086657216 * radian = arcmin
arcsecond = 4.84813681109536e-06 * radian = arcsec
rpm = turn / minute = RPM
percent = 0.01 = percents
kelvin = [temperature]; offset: 0 = K
degree_Celsius = kelvin; offset: 273.15 = degC = degreeC = celsius
degree_Fahrenheit = 5 / 9 * kelvin; offset: 255.37222222222223 = degF = degreeF = fahrenheit
cycle = [cycle] = cycles
megacycle = 1e6 * cycle = Mcycle = Mcycles = megacycles
reversal = 0.5 * cycle = reversals
"""
# Offered where a text is not understood, as far as they fit.
_EXAMPLES = (
    "s", "ms", "us", "min", "Hz", "N", "kN", "lbf", "kgf", "rad", "deg", "mrad", "m", "mm", "um",
    "in", "rad/s", "deg/s", "rpm", "m/s", "mm/s", "m/s^2", "g", "mm/s^2", "N*m", "kN*m", "lbf*in",
    "degC", "K", "Pa", "MPa", "N/mm^2", "ksi", "m/s^2/N", "g/N", "g/lbf", "m/s/N", "mm/s/N", "m/N",
    "mm/N", "cycles", "kcycles", "Mcycles", "reversals",
)  # fmt: skip
# What a symbol may also stand for, where the quantity asks for it: in an acceleration a bare g is
# standard gravity, not a gram; in a torque lb is a force.
_ALSO = {"gram": "standard_gravity", "pound": "pound_force", "ounce": "ounce_force"}
_SIGNS = str.maketrans({"·": "*", "⋅": "*", "∙": "*", "•": "*", "×": "*", "−": "-", "º": "°",
                        "[": "(", "]": ")", "\ufffd": "^2", "%": "percent"})  # fmt: skip
"""The last is what a reader of UTF-8 makes of the ² of an older code page."""
_LONGEST = 40  # characters of a unit
_MOST = 64  # readings of one that are tried
# Names, products, quotients and one-digit powers: pint would also compute 9**9**9.
_UNIT_LIKE = re.compile(r"[\s(]*(1\s*/)?[\s(]*[^\W\d_][\w°*/^()\s-]*|[\s(]*°[\w°*/^()\s-]*")
_TOWER = re.compile(r"\d\d|\^[^\d(-]|\^\(?-?\d\)?\s*\^")
_TURNS = re.compile(r"1\s*/\s*min|min\^-1", re.I)
_SYMBOL = re.compile(r"[^\W\d_][^\W\d]*")


@dataclass(frozen=True)
class Conversion:
    """SI value = scale * value + offset; with scale 1 and offset 0 the bits stay as they are."""

    scale: float = 1.0
    offset: float = 0.0

    def __call__(self, values: FloatArray) -> FloatArray:
        """The values in SI, float64."""
        result = np.asarray(values, dtype=np.float64)
        if self.scale != 1.0:
            result = result * self.scale
        return result + self.offset if self.offset != 0.0 else result


@cache
def _registry() -> Any:
    import pint

    registry: Any = pint.UnitRegistry(None, autoconvert_offset_to_baseunit=True)
    registry.load_definitions([line for line in _DEFINITIONS.splitlines() if line.strip()])
    registry._suffixes = {"": ""}  # plurals are in the list: pint would take Ns for newtons
    return registry


@cache
def _parse(text: str) -> Any:
    """The pint unit, or None if the text is not one."""
    if len(text) > _LONGEST or not _UNIT_LIKE.fullmatch(text) or _TOWER.search(text):
        return None
    try:
        return _registry().parse_units(text)
    except Exception:  # pint raises many kinds, some of the tokenizer's own
        return None


def _spelt(text: str) -> str:
    """As pint takes it: acquisition systems write "m/s2", "m s^-2", "m·s⁻²", "N.m" and "N-m"."""
    text = re.sub(r"[⁺⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+", lambda m: "^" + unicodedata.normalize("NFKC", m[0]), text)
    text = text.strip().translate(_SIGNS).replace("**", "^")
    text = re.sub(r"(?<=[^\W\d_])\s*[.-]\s*(?=[^\W\d_])", "*", text)
    return re.sub(r"(?<=[^\W\d_])(-?[1-9])\b", r"^\1", text)


def _readings(text: str, anew: bool) -> list[str]:
    """What it is with symbols that may also stand for something else, or be in other capitals.

    Known ones keep theirs, unless `anew`: then they are units without a prefix.
    """
    symbols = list(dict.fromkeys(_SYMBOL.findall(text)))
    choices = []
    for symbol in symbols:
        known = _registry().parse_unit_name(symbol)[:1]
        # A prefix has its case, too; but Mm may not pass for mm.
        other_case = "" if symbol[0] == "M" and not symbol.isupper() else symbol[0].swapcase()
        spelt = (symbol, (other_case or symbol[0]) + symbol[1:])
        other = [x for s in spelt for x in _registry().parse_unit_name(s, case_sensitive=False)]
        found = [x for x in other if not x[0]] if anew else known or other
        names = [(prefix, name) for prefix, name, _ in found]
        names += [(prefix, _ALSO[name]) for prefix, name in names if name in _ALSO]
        choices.append([prefix + name for prefix, name in names])
    pools = (dict(zip(symbols, made, strict=True)) for made in itertools.product(*choices))
    return [_replaced(text, by) for by in itertools.islice(pools, _MOST)]


def _replaced(text: str, by: dict[str, str]) -> str:
    return _SYMBOL.sub(lambda found: by[found[0]], text)


def _target(text: str) -> Any:
    """The pint unit of an SI unit; a pure number's for "1"."""
    return _parse("dimensionless" if text == "1" else _spelt(text))


@cache
def _meant(unit: str, targets: tuple[str, ...]) -> set[tuple[str, Conversion]]:
    """What a unit may mean where one of the targets is asked for; none where it is none of them."""
    text = _spelt(unit)
    if len(text) > _LONGEST:
        return set()
    turns = [_TURNS.sub("rpm", text)]  # what drives' speeds in 1/min count
    for readings in ([text], _readings(text, False), _readings(text, True), turns):
        pairs = itertools.product(targets, map(_parse, readings))
        if found := {(t, c) for t, one in pairs if (c := _conversion(one, _target(t)))}:
            return found
    return set()


@cache
def conversion(unit: str, targets: tuple[str, ...]) -> tuple[str, Conversion]:
    """How values in `unit` become one of the SI units that a quantity may have.

    Args:
        unit: as a person wrote it, such as "mm", "g/N", "lbf.in" or "m·s⁻²".
        targets: the SI units that would do, such as ("rad", "m").

    Returns:
        the target that fits, and the conversion to it.

    Raises:
        InputError: not a unit, one of another dimension, or one that may be read in two ways.
    """
    if unit.strip() in targets:
        return unit.strip(), Conversion()
    meant = _meant(unit, targets)
    if len(meant) == 1:
        return next(iter(meant))
    problem = "is not a unit" if _parse(_spelt(unit)) is None else (
        f"the unit must be a multiple of {' or '.join(targets)}"
    )  # fmt: skip
    if meant:
        problem = "may be several units, by its capital letters"
    examples = (e for e in _EXAMPLES if len(_meant(e, targets)) == 1)
    raise InputError(problem, value=unit, choices=dict.fromkeys([*targets, *examples]))


def is_unit(text: str) -> bool:
    """Whether a text is a unit, of whatever.

    Args:
        text: as a person wrote it.
    """
    return _parse(_spelt(text)) is not None


def _conversion(found: Any, wanted: Any) -> Conversion | None:
    """From one pint unit to another; None where they are no units of the same quantity."""
    registry = _registry()
    if found is None or wanted is None or found.dimensionality != wanted.dimensionality:
        return None
    one = float(registry.Quantity(1.0, found).to(wanted).magnitude)
    if "[temperature]" not in wanted.dimensionality:
        return Conversion(one)
    # Temperatures have a zero of their own, which costs the last digits.
    zero = float(registry.Quantity(0.0, found).to(wanted).magnitude)
    return Conversion(float(f"{one - zero:.12g}"), float(f"{zero:.12g}"))
