"""The units that a measured file may use, and their conversion to SI.

pint does the parsing and the dimensions. It gets its own short list of units, because its default
one takes an angle for a plain number (then `deflection [1]` or `[%]` would pass for radians, and
hertz for rad/s) and `Nm` for something else than a newton metre.
"""

from __future__ import annotations

import re
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
hecto- = 1e2 = h-
kilo- = 1e3 = k-
mega- = 1e6 = M-
second = [time] = s = sec
minute = 60 * second = min
hour = 60 * minute = h
hertz = 1 / second = Hz
metre = [length] = m = meter
inch = 0.0254 * metre = in
foot = 0.3048 * metre = ft
gram = [mass] = g
pound = 453.59237 * gram = lb
newton = kilogram * metre / second ** 2 = N
pound_force = pound * g_n = lbf
kilogram_force = kilogram * g_n = kgf = kp
newton_metre = newton * metre = Nm
standard_gravity = 9.80665 * metre / second ** 2 = g_n = g0 = gn
galileo = 0.01 * metre / second ** 2 = Gal
radian = [angle] = rad
degree = 0.017453292519943295 * radian = deg = °
turn = 6.283185307179586 * radian = rev = revolution
arcminute = 0.0002908882086657216 * radian = arcmin
arcsecond = 4.84813681109536e-06 * radian = arcsec
rpm = turn / minute
kelvin = [temperature]; offset: 0 = K
degree_Celsius = kelvin; offset: 273.15 = degC = degreeC = celsius
degree_Fahrenheit = 5 / 9 * kelvin; offset: 255.37222222222223 = degF = degreeF = fahrenheit
"""
EXAMPLES = ("s", "ms", "N", "kN", "rad", "deg", "m", "mm", "m/s^2", "g", "N*m", "degC")
# In an acceleration a bare g is standard gravity, not a gram.
_GRAVITIES = re.compile(r"^(m|u|µ|μ|milli)?g$")
_ACCELERATION = "m/s^2"
_LONGEST = 40
# Names, products, quotients and one-digit powers: pint would also compute 9**9**9.
_UNIT_LIKE = re.compile(r"(1/)?[^\W\d_][\w°²³·*/^()\s-]*|[°(][\w°²³·*/^()\s-]*")
_TOWER = re.compile(r"\d\d|\^[^\d(-]|\^\(?-?\d\)?\s*\^")


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
    return registry


@cache
def _parse(text: str) -> Any:
    """The pint unit, or None if the text is not one."""
    # "m/s2" and "m s^-2" are what acquisition systems write.
    spelt = re.sub(r"(?<=[a-zA-Z])([23])\b", r"**\1", text.strip()).replace("**", "^")
    if len(spelt) > _LONGEST or not _UNIT_LIKE.fullmatch(spelt) or _TOWER.search(spelt):
        return None
    try:
        return _registry().parse_units(spelt)
    except Exception:  # pint raises many kinds, some of the tokenizer's own
        return None


@cache
def conversion(unit: str, targets: tuple[str, ...]) -> tuple[str, Conversion]:
    """How values in `unit` become one of the SI units that a channel may have.

    Args:
        unit: as a person wrote it, such as "mm", "g" or "N*m".
        targets: the SI units that would do, such as ("rad", "m").

    Returns:
        the target that fits, and the conversion to it.

    Raises:
        InputError: not a unit, or one of another dimension.
    """
    if unit.strip() in targets:
        return unit.strip(), Conversion()
    if _ACCELERATION in targets and _GRAVITIES.match(unit.strip()):
        unit = unit.strip() + "_n"
    found = _parse(unit)
    if found is None:
        raise InputError("is not a unit", value=unit, choices=dict.fromkeys([*targets, *EXAMPLES]))
    registry = _registry()
    for target in targets:
        wanted = _parse(target)
        if registry.get_dimensionality(found) != registry.get_dimensionality(wanted):
            continue
        one = float(registry.Quantity(1.0, found).to(wanted).magnitude)
        if "[temperature]" not in registry.get_dimensionality(wanted):
            return target, Conversion(one)
        # Temperatures have a zero of their own, which costs the last digits.
        zero = float(registry.Quantity(0.0, found).to(wanted).magnitude)
        return target, Conversion(float(f"{one - zero:.12g}"), float(f"{zero:.12g}"))
    raise InputError(f"the unit must be a multiple of {' or '.join(targets)}", value=unit)
