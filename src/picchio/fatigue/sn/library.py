"""The S-N curves that can be named: data files that ship with picchio, and the user's own."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from pathlib import Path

from picchio.core.errors import InputError, warn_user
from picchio.core.results import plain
from picchio.core.toml import Positive, StrictModel, parse_toml
from picchio.fatigue.sn.curve import Kind, MinerRule, SNCurve

DEFAULT_SN_CURVE = "42CrMo4-QT-shaft"
DEFAULT_LIFE_CURVE = "drive-teeth"
PAPER_SN_CURVE = "nie-2016"
SN_FORMAT = "picchio-sn-curve/1"


class SNCurveFile(StrictModel):
    """What an S-N curve's TOML file holds.

    Attributes:
        name: of the curve.
        kind: shear (convert normal stresses first), or torque: every Pa here is then 1, a share
            of a drive's torque for repeated peaks.
        strength: Pa, shear amplitude, fully reversed, that is survived for `cycles` cycles.
        cycles: cycles, where on the curve `strength` is given.
        slopes: 1, k of N ~ amplitude^-k, one for each line, from few cycles to many.
        knees: cycles, at which one line ends and the next begins, ascending. As many as slopes: an
            endurance limit beyond the last. One fewer: no endurance limit.
        miner: damage below the endurance limit: none ("original"), the last line continued
            ("elementary"), or with slope 2k - 1 ("haibach").
        survival: 1, probability that a part survives this curve.
        scatter: 1, standard deviation of log10 strength at a given life.
        ultimate_shear: Pa, static strength, for the mean stress rules.
        yield_shear: Pa, for the mean stress rules.
        tensile_strength: Pa, R_m, for FKM's mean stress sensitivity and surface factor.
        source: where the numbers come from.
        warning: why not to use the curve for real work, if there is a reason.
        unverified: which of its numbers are an engineering assumption without a source, if any.
        assumptions: sentences to print with every result.
    """

    name: str
    kind: Kind
    strength: Positive
    cycles: Positive
    slopes: tuple[Positive, ...]
    knees: tuple[Positive, ...] = ()
    miner: MinerRule = "original"
    survival: Positive | None = None
    scatter: Positive | None = None
    ultimate_shear: Positive | None = None
    yield_shear: Positive | None = None
    tensile_strength: Positive | None = None
    source: str
    warning: str = ""
    unverified: str = ""
    assumptions: tuple[str, ...] = ()


def sn_curve_names() -> tuple[str, ...]:
    """The names of the curves that ship with picchio, the default first."""
    others = sorted(set(_shipped()) - {DEFAULT_SN_CURVE})
    return (DEFAULT_SN_CURVE, *others)


def load_sn_curve(name_or_path: str | Path, *, quiet: bool = False) -> SNCurve:
    """An S-N curve by name, or from a user's TOML file (`picchio-sn-curve/1`).

    Args:
        name_or_path: one of `sn_curve_names()`, or a path (it ends in .toml, or has a folder).
        quiet: do not pass on the warning that the curve carries.

    Raises:
        InputError: an unknown name, or a file that is missing or wrong.
    """
    text = str(name_or_path)
    path = _shipped().get(text, Path(text))
    if text not in _shipped() and not (text.endswith(".toml") or "/" in text or path.is_file()):
        raise InputError("no such S-N curve", key="sn_curve", value=text, choices=sn_curve_names())
    content = parse_toml(path, SNCurveFile, format=SN_FORMAT)
    try:
        curve = SNCurve(**content.model_dump())
    except InputError as error:
        raise InputError(str(error), file=path) from None
    if curve.warning and not quiet:
        warn_user(f"{curve.title} {curve.name}: {curve.warning}")
    return curve


def write_sn_curve(curve: SNCurve, path: str | Path) -> None:
    """Write a curve to a TOML file that `load_sn_curve` reads.

    Args:
        curve: the curve.
        path: the file; its folder must exist.

    Raises:
        OutputError: it cannot be written there.
    """
    import tomlkit

    from picchio.core.files import write_text

    values = {name: getattr(curve, name) for name in SNCurveFile.model_fields}
    known = {name: value for name, value in values.items() if value not in (None, "")}
    content = {"format": SN_FORMAT, **plain(known)}
    write_text(path, tomlkit.dumps(content))


@cache
def _shipped() -> dict[str, Path]:
    folder = Path(str(files("picchio.fatigue"))) / "data" / "sn"
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}
