"""S-N curves in shear, and torque-life curves of whole drives.

A torque-life curve (kind "torque") has a drive's torque amplitude over its limit for repeated peaks
in place of a stress: where another curve has Pa, it has 1.

A curve is straight lines in log amplitude over log cycles (Basquin), steepest first, with an
endurance limit beyond the last knee or without one. The life of a scalar, of an array, and the
inverse all read the same knots, so they cannot disagree.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from statistics import NormalDist
from typing import TYPE_CHECKING, Any, ClassVar, Literal, get_args

import numpy as np
import numpy.typing as npt

from picchio.core.arrays import FloatArray, as_floats
from picchio.core.errors import InputError
from picchio.core.shown import Shown

if TYPE_CHECKING:
    import pandas

Kind = Literal["shear", "torque"]
MinerRule = Literal["original", "elementary", "haibach"]
MINER_RULES: tuple[MinerRule, ...] = get_args(MinerRule)

ALLOWABLE_CYCLES = 1e7
"""Where the allowable is read from a curve that has no endurance limit."""
# A steady load this near to what breaks a drive alone is beyond its limits anyway.
_MOST_STEADY = 0.95
_POSITIVE = (
    "strength", "cycles", "slopes", "knees", "ultimate_shear", "yield_shear", "tensile_strength",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class SNCurve(Shown):
    """Shear stress amplitude against cycles to failure, fully reversed.

    Attributes:
        name: what to call it.
        strength: Pa, the amplitude that is survived for `cycles` cycles.
        cycles: where on the curve `strength` is given.
        slopes: k of N ~ amplitude^-k, one for each line, from few cycles to many.
        knees: cycles at which one line ends and the next begins, ascending. One fewer than
            slopes: no endurance limit. As many as slopes: beyond the last knee lies the limit.
        miner: what damage cycles below the endurance limit do. "original": none. "elementary":
            the last line goes on. "haibach": it goes on with slope 2k - 1 (Haibach, 1970).
            The curve's `endurance_limit` and `allowable` do not depend on it.
        survival: probability that a part survives this curve; None where it is not known.
        scatter: standard deviation of log10 strength at a given life; None where not known.
        ultimate_shear: Pa, static strength in shear, for the mean stress rules.
        yield_shear: Pa, likewise.
        tensile_strength: Pa, R_m, for the FKM mean stress sensitivity and surface factor.
        source: where the numbers come from.
        warning: why not to use it for real work, if there is a reason.
        unverified: which of its numbers are an engineering assumption, no source, if any.
        assumptions: what was changed since, in words, to print with a result.
        kind: "shear", or "torque" (amplitudes are shares of a drive's torque for repeated peaks;
            `ultimate_shear` is the share that a steady torque alone would have to reach).

    Raises:
        InputError: values that do not make a curve.
    """

    PLOTS: ClassVar = {"curve": "visuals.plots.sn:plot_sn_curve"}
    LACKS: ClassVar = {"show": "a curve has no place in space"}

    name: str
    strength: float
    cycles: float
    slopes: tuple[float, ...]
    knees: tuple[float, ...] = ()
    miner: MinerRule = "original"
    survival: float | None = None
    scatter: float | None = None
    ultimate_shear: float | None = None
    yield_shear: float | None = None
    tensile_strength: float | None = None
    source: str = ""
    warning: str = ""
    unverified: str = ""
    assumptions: tuple[str, ...] = ()
    kind: Kind = "shear"
    _knots: FloatArray = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name in ("slopes", "knees", "assumptions"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        self._check()
        object.__setattr__(self, "_knots", self._knot_amplitudes())

    def _check(self) -> None:
        if self.kind not in get_args(Kind):
            raise InputError("no such kind of curve", key="kind", value=self.kind,
                             choices=get_args(Kind))  # fmt: skip
        if self.miner not in MINER_RULES:
            raise InputError("unknown rule", key="miner", value=self.miner, choices=MINER_RULES)
        for name in _POSITIVE:
            value = getattr(self, name)
            if value is not None and (as_floats(value, name) <= 0).any():
                raise InputError("must be positive", key=name, value=value)
        if self.scatter is not None and float(as_floats(self.scatter, "scatter")) < 0:
            raise InputError("must not be negative", key="scatter", value=self.scatter)
        if self.survival is not None:
            check_probability(self.survival)
        if not self.slopes or len(self.slopes) - len(self.knees) not in (0, 1):
            raise InputError(
                "needs as many knees as slopes (endurance limit) or one fewer",
                key="knees",
                value=self.knees,
            )
        if any(b <= a for a, b in zip(self.knees, self.knees[1:], strict=False)):
            raise InputError("must ascend", key="knees", value=self.knees)
        if len(self.knees) == len(self.slopes) and self.cycles > self.knees[-1]:
            raise InputError("lies beyond the last knee", key="cycles", value=self.cycles)

    @property
    def endurance_limit(self) -> float | None:
        """Pa, the amplitude below which constant-amplitude life is unlimited, or None."""
        return float(self._knots[-1]) if len(self.knees) == len(self.slopes) else None

    @property
    def allowable(self) -> float:
        """Pa, the endurance limit, or the strength at 1e7 cycles where there is none."""
        limit = self.endurance_limit
        return float(self.amplitude(ALLOWABLE_CYCLES)) if limit is None else limit

    def told(self, amplitude: float) -> str:
        """An amplitude as people read it.

        Args:
            amplitude: Pa, or a share.
        """
        if self.kind == "shear":
            return f"{amplitude / 1e6:.4g} MPa"
        return f"{100.0 * amplitude:.4g} % of the torque for repeated peaks"

    @property
    def title(self) -> str:
        """What kind of curve it is, in words."""
        return "S-N curve" if self.kind == "shear" else "torque-life curve"

    @property
    def static_strength(self) -> float:
        """Pa in shear, at which a shaft yields, or else breaks; NaN where not known.

        A drive has limits of its own in its place.
        """
        if self.kind == "torque":
            return math.nan
        return self.yield_shear or self.ultimate_shear or math.nan

    def raised_by(self, steady: npt.ArrayLike) -> FloatArray:
        """What a steady load makes of every amplitude beside it: a factor.

        1 in shear, where smooth shafts do not feel it; a rule for the mean stress may be asked for.
        Teeth do: a drive's amplitudes are divided by 1 - T / T_u (Goodman), T_u from the 0.7 by
        which ISO 6336-3 lowers a tooth's strength from pulsating to reversed loads.

        Args:
            steady: (...) Pa, or shares; either sign.
        """
        share = np.abs(np.asarray(steady, dtype=float))
        if self.kind == "shear" or self.ultimate_shear is None:
            return np.ones_like(share)
        return np.asarray(1.0 / (1.0 - np.minimum(share / self.ultimate_shear, _MOST_STEADY)))

    def cycles_to_failure(self, amplitude: npt.ArrayLike) -> FloatArray:
        """Life at a stress amplitude.

        Args:
            amplitude: (...) Pa, not negative.

        Returns:
            (...) cycles; inf where nothing fails.

        Raises:
            InputError: negative or NaN amplitudes.
        """
        stress = as_floats(amplitude, "amplitude", finite=False)
        if (stress < 0).any():
            raise InputError("must not be negative", key="amplitude", value=float(stress.min()))
        anchors, amplitudes, slopes = self.lines()
        # Knot amplitudes fall; a stress equal to one still belongs to the line above it.
        line = np.searchsorted(-self._knots, -stress, side="left")
        with np.errstate(divide="ignore", over="ignore"):
            cycles = anchors[line] * _power(stress / amplitudes[line], -slopes[line])
        return np.asarray(cycles)

    def amplitude(self, cycles: npt.ArrayLike) -> FloatArray:
        """Strength at a life: the inverse of `cycles_to_failure`.

        Args:
            cycles: (...) positive; inf for the amplitude that is survived for ever.

        Returns:
            (...) Pa; the endurance limit beyond its knee (Miner original).

        Raises:
            InputError: cycles that are not positive, or NaN.
        """
        life = as_floats(cycles, "cycles", finite=False)
        if (life <= 0).any():
            raise InputError("must be positive", key="cycles", value=float(life.min()))
        anchors, amplitudes, slopes = self.lines()
        line = np.searchsorted(np.array(self.knees), life, side="left")
        return np.asarray(amplitudes[line] * _power(life / anchors[line], -1.0 / slopes[line]))

    def with_miner(self, rule: MinerRule) -> SNCurve:
        """The same curve with another rule for cycles below the endurance limit.

        Args:
            rule: "original", "elementary" or "haibach".
        """
        return dataclasses.replace(self, miner=rule)

    def scaled(self, factor: float, why: str) -> SNCurve:
        """The same curve with every amplitude times `factor`.

        Args:
            factor: positive.
            why: what the factor stands for; it joins `assumptions`.

        Raises:
            InputError: a factor that is not positive.
        """
        number = float(as_floats(factor, "factor"))
        if number <= 0:
            raise InputError("must be positive", key="factor", value=factor)
        note = f"strength times {number:.6g}: {why}"
        return dataclasses.replace(
            self, strength=self.strength * number, assumptions=(*self.assumptions, note)
        )

    def at_survival(self, probability: float, scatter: float | None = None) -> SNCurve:
        """The same curve for another probability of survival.

        The amplitude at a given life is log-normal with one standard deviation everywhere, so
        the whole curve shifts: log10 S = log10 S_50 - z(P) s (ISO 12107:2012, DIN 50100:2016).

        Args:
            probability: of survival, in (0, 1).
            scatter: standard deviation of log10 strength, if not the curve's own.

        Raises:
            InputError: a probability outside (0, 1), or a curve whose own survival or scatter
                is not known.
        """
        spread = self.scatter if scatter is None else scatter
        if self.survival is None:
            raise InputError("the curve has no survival probability", key=self.name)
        if spread is None:
            raise InputError("the curve has no scatter; give one", key=self.name)
        wanted = check_probability(probability)
        shift = NormalDist().inv_cdf(self.survival) - NormalDist().inv_cdf(wanted)
        moved = self.scaled(10.0 ** (spread * shift), f"survival {self.survival:g} to {wanted:g}")
        return dataclasses.replace(moved, survival=wanted, scatter=spread)

    def to_frame(self) -> pandas.DataFrame:
        """Where one line ends and the next begins: cycles, amplitude, and the slope up to there."""
        import pandas

        at = [*self.knees, *([] if len(self.knees) == len(self.slopes) else [self.cycles])]
        rows = {"cycles": at, "amplitude": self.amplitude(np.array(at)), "slope": self.slopes}
        return pandas.DataFrame(rows)

    def _repr_html_(self) -> str:
        from picchio.core.html import sheet

        limit = self.endurance_limit
        unit, size = ("MPa", 1e-6) if self.kind == "shear" else ("1", 1.0)
        facts = {
            "slopes": self.slopes,
            "knees [cycles]": self.knees or None,
            f"endurance limit [{unit}]": "none" if limit is None else size * limit,
            "Miner below it": None if limit is None else self.miner,
            "survival": self.survival,
            "scatter of log10 strength": self.scatter,
            "source": self.source or None,
            "assumed": "; ".join(self.assumptions) or None,
        }
        told = "no endurance limit"
        if limit is not None:
            told = f"endurance limit {size * limit:.4g} {unit}"
        head = "; ".join(filter(None, [told, self.warning]))
        return sheet(f"{self.title} {self.name}", facts, head=head)

    def describe(self) -> str:
        """One line for a report: the curve's numbers and what was assumed."""
        lines = ", ".join(f"{slope:g}" for slope in self.slopes)
        limit = self.endurance_limit
        end = (
            "no endurance limit"
            if limit is None
            else (
                f"endurance limit {self.told(limit)} at {self.knees[-1]:.3g} cycles, "
                f"Miner {self.miner}"
            )
        )
        chance = "" if self.survival is None else f", survival {self.survival:g}"
        notes = "".join(f"; {note}" for note in self.assumptions)
        return f"{self.name} ({self.kind}): slope {lines}, {end}{chance}{notes}"

    def to_dict(self) -> dict[str, Any]:
        """Its values and what follows from them, for JSON."""
        values = {f.name: getattr(self, f.name) for f in dataclasses.fields(self) if f.init}
        return values | {"endurance_limit": self.endurance_limit, "allowable": self.allowable}

    def lines(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The curve as lines; beyond an endurance limit lies one more, as `miner` has it.

        Returns:
            cycles and amplitude (Pa) of a point on each line, and the line's slope, each (k,).
        """
        slopes, knots = list(self.slopes), self._knots
        if len(self.knees) == len(self.slopes):
            last = slopes[-1]
            beyond = {"original": math.inf, "elementary": last, "haibach": 2.0 * last - 1.0}
            slopes.append(beyond[self.miner])
        if not self.knees:
            return np.array([self.cycles]), np.array([self.strength]), np.array(slopes)
        # A line is anchored at the knee it ends in; the last one at the knee it starts from.
        ends = [*range(len(self.knees)), len(self.knees) - 1]
        return np.array(self.knees)[ends], knots[ends], np.array(slopes)

    def _knot_amplitudes(self) -> FloatArray:
        knees, slopes = self.knees, self.slopes
        home = int(np.searchsorted(np.array(knees), self.cycles, side="left"))
        knots = np.empty(len(knees))
        # From the given point up, by the line that ends in a knee; and down, by the next one.
        for order, line in ((range(home, len(knees)), 0), (range(home - 1, -1, -1), 1)):
            at, stress = self.cycles, self.strength
            for i in order:
                stress *= (knees[i] / at) ** (-1.0 / slopes[i + line])
                knots[i], at = stress, knees[i]
        return knots


def check_probability(value: float) -> float:
    """A probability of survival.

    Raises:
        InputError: not between 0 and 1.
    """
    number = float(as_floats(value, "survival"))
    if not 0.0 < number < 1.0:
        raise InputError("must lie between 0 and 1", key="survival", value=value)
    return number


def _power(base: FloatArray, exponent: FloatArray) -> FloatArray:
    # numpy's scalar and vector power differ in the last bit; always take the vector's.
    return np.asarray(np.power(np.atleast_1d(base), exponent)).reshape(np.shape(base))
