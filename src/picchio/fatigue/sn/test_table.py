"""Read S-N tests from a table: stress amplitude, cycles, and whether the specimen failed.

What a column is follows from its name, by the table `_MEANINGS`; how an amplitude follows from what
there is, by the table `_AMPLITUDES`. A further habit is a line there. What is not sure is refused.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from picchio.core.arrays import BoolArray, FloatArray
from picchio.core.errors import InputError, warn_user
from picchio.core.tables import Column, Table, read_table
from picchio.core.units import conversion

STRESSES = {"amplitude": "amplitude", "range": "range", "max": "maximum"}
"""What a column of stresses may be said to be, and which quantity that is."""


def _compiled(words: str) -> re.Pattern[str]:
    return re.compile(words.replace("~", r"(s|sigma|tau|stress|load)"), re.X)


# Quantity and rank, by a name in small letters without units and signs; the first that fits counts,
# of several columns those of the lowest rank. "~" stands for any sign or word of a stress.
_MEANINGS = [
    (quantity, rank, _compiled(words))
    for quantity, rank, words in (
        ("", 0, r".*\b(strain|yield|ultimate|tensile|residual|proof|strength|modulus|concentration|"
                r"temperature|frequency|per|rate|time|date|hours?)\b.*"),
        ("ratio", 0, r"r|(~\ )?(r\ )?ratio(\ r)?|r\ value|min\ max|~?min\ ~?max|~\ r\ ratio"),
        ("alive", 0, r"(is\ )?(run\ ?outs?|censor(ed|ing)?|surviv(ed|al|or)s?|suspen(ded|sions?)|"
                     r"unbroken|unfailed|alive|intact|(not|non|no)\ (failed|broken|failure)|"
                     r"right\ censored|durchlaufer)"),
        ("broken", 0, r"(is\ )?(fail(ed|ure)?s?|fractured?s?|broken|ruptured?|bruch|event)"),
        ("outcome", 1, r"outcome|(test\ )?(results?|status|state)|ausgang|ergebnis"),
        ("outcome", 2, r"(comments?|remarks?|notes?|observations?|bemerkung)"),
        ("cycles", 0, r"2\ ?n(\ ?f)?|reversals(\ to\ failure)?|n\ ?f|fatigue\ life|life(time)?|"
                      r"(\w+\ )*(cycles?|n|life|lives|reversals)\ (to|at|until|till|before)\ "
                      r"(failure|fracture|rupture|break)(\ n\ ?f?)?|bruchlastspiel\w*|"
                      r"cycles\ n\ ?f|n\ (failure|fail)|endurance"),
        ("cycles", 1, r"((total|number|num|no|of|load|stress|life|test)\ )*"
                      r"cycles?(\ (n|count|number))?|n|n\ cycles|count|lastspiel\w*|"
                      r"schwingspiel\w*|lastwechsel\w*"),
        ("range", 0, r".*\b(range|delta|double\ amplitude|peak\ to\ peak|schwingbreite)\b.*|"
                     r"d\ ?(s|sigma|tau)|(s|sigma)\ ?r"),
        ("amplitude", 0, r".*\b(ampl?(itude)?s?|alternating|ausschlag\w*|\w*amplitude)\b.*|"
                         r"~\ ?(a|alt|amp)"),
        ("maximum", 0, r".*\b(max(imum)?|maximal|upper|peak|oberspannung)\b.*|~\ ?(max|o)"),
        ("minimum", 0, r".*\b(min(imum)?|minimal|lower|valley|unterspannung)\b.*|~\ ?(min|u)"),
        ("mean", 0, r".*\b(mean|average|mittelspannung)\b.*|~\ ?m"),
        ("stress", 0, r"(\w+\ )*~(\ (s|level))?|\w*spannung|load\ level"),
        ("cycles", 2, r".*\b(cycles?|life)\b.*"),
    )
]  # fmt: skip
_STRESSES = ("amplitude", "range", "maximum", "minimum", "mean", "stress")
_OUTCOMES = ("broken", "alive", "outcome")
# The amplitude by what it follows from: range / 2, max (1 - R) / 2 (of tension and of shear alike:
# a stress between R max and max swings by half of what lies between), ...
_AMPLITUDES: list[tuple[tuple[str, ...], Callable[..., FloatArray], str]] = [
    (("amplitude",), lambda a: a, "the amplitude"),
    (("range",), lambda r: r / 2.0, "half the range"),
    (("maximum", "minimum"), lambda h, low: (h - low) / 2.0, "(max - min) / 2"),
    (("maximum", "ratio"), lambda h, r: h * (1.0 - r) / 2.0, "max (1 - R) / 2"),
    (("maximum", "mean"), lambda h, m: h - m, "max - mean"),
    (("mean", "ratio"), lambda m, r: m * (1.0 - r) / (1.0 + r), "mean (1 - R) / (1 + R)"),
]
_ROUNDED = 0.02  # relative, between two columns that tell the same amplitude, as tables round them
_YES, _NO = (
    {"true", "yes", "y", "1", "x", "ja", "wahr"},
    {"false", "no", "n", "0", "nein", "falsch"},
)
_BROKE = {"failure", "failed", "fail", "fracture", "fractured", "broken", "broke", "rupture", "f",
          "ruptured", "bruch", "break", "uncensored"}  # fmt: skip
_LIVES = {"runout", "run out", "run outs", "ro", "survived", "survivor", "survival", "suspended",
          "suspension", "alive", "censored", "unbroken", "not failed", "not broken", "no failure",
          "intact", "durchlaufer", "unfailed"}  # fmt: skip
_TIMES = {"k": 1e3, "kilo": 1e3, "thousand": 1e3, "thousands": 1e3, "tsd": 1e3, "mega": 1e6,
          "million": 1e6, "millions": 1e6, "mio": 1e6}  # fmt: skip
_TIMES_NAMED = re.compile(
    r"\b(kilo|mega|k|mio|thousand|million)s?(?: of)? ?(?=cycles?\b)"
    r"|\b(?:in )?(thousand|million|kilo|k|mio|tsd)s?$"
)
_POWERS = str.maketrans({"³": "^3", "⁴": "^4", "⁵": "^5", "⁶": "^6"})
_POWER = re.compile(
    r"[x×*·/]?\s*(?<![\d.])(?:10\s*(?:\^|\*\*)\s*(\d)|1[eE]\+?0?(\d)|1(?:[ .,]?000)+)(?![\d.])"
)
_CODE = re.compile(r"\b(0|1|true|false|yes|no)\s*[=:]\s*([^\W\d][\w -]*)", re.I)
_SI = ("Pa", "cycle", "s", "N")
_LOGARITHM = re.compile(r"\b(log ?10|log|lg|ln)(?:\s*[(\[]\s*([^()\[\]]*)[)\]])?", re.I)
_SIGNS = {"σ": "sigma", "τ": "tau", "Δ": "delta ", "δ": "delta ", "∆": "delta ", "ä": "a"}
_LEAST_LIFE = 100.0  # cycles: the longest life of tests is not below, but its logarithm is


@dataclass(frozen=True)
class SNTests:
    """S-N tests.

    Attributes:
        amplitude: (n,) Pa.
        cycles: (n,) at failure, or reached without.
        failed: (n,) bool.
        assumptions: what was taken for what, and what the reader had to assume.
        file: the table they are from; None for arrays.
    """

    amplitude: FloatArray
    cycles: FloatArray
    failed: np.ndarray
    assumptions: tuple[str, ...] = ()
    file: Path | None = None


@dataclass(frozen=True)
class _Named:
    """A column and what its name says.

    Attributes:
        column: of the table.
        quantity: of `_MEANINGS`; empty where the name says nothing.
        rank: of several columns of a quantity the lowest counts.
        unit: as the name or a line of units says, or None.
        factor: 1, of the numbers, as "[x1000]" says.
        base: of the logarithm that the column holds, or None.
    """

    column: Column
    quantity: str
    rank: int = 0
    unit: str | None = None
    factor: float = 1.0
    base: float | None = None

    def values(self, file: str | Path, lines: np.ndarray) -> FloatArray:
        """Its numbers; one that is missing is refused with its line."""
        cells = self.column.values
        if self.column.kind != "number":
            raise InputError("is not a number", file=file, value=str(cells[0]),
                             key=f"line {lines[0]}, {self.column.name}")  # fmt: skip
        found = np.asarray(cells, float)
        if not np.isfinite(found).all():
            line = int(lines[np.flatnonzero(~np.isfinite(found))[0]])
            raise InputError("is not a number", file=file, key=f"line {line}, {self.column.name}")
        return found if self.base is None else self.base**found


def _named(column: Column) -> _Named:
    """What the name of a column says."""
    name, unit, base = _spaced(column.name.strip()), column.unit, None
    name = re.sub(r"(?i)\b(log|lg|ln)(?=n\b)", r"\1 ", name)
    if found := _LOGARITHM.search(name):
        base = math.e if found[1].lower() == "ln" else 10.0
        name = name.replace(found[0], found[2] or "", 1)
    factor, name = _factor(name)
    inside = re.findall(r"[\[(<]([^\[<>\]]*?)[\])>](?=\s*(?:$|[\[(<]))", name)
    known = [text for text in inside if any(_in(text, si) for si in _SI)]
    for text in known[:1] or [t for t in inside if not _meaning(_words(name))[0]]:
        unit, name = text.strip() or unit, name.replace(text, "", 1)
    last = re.split(r"[\s_,/]+", name.strip())[-1]
    if unit is None and len(last) > 1 and _in(last, "Pa"):
        unit, name = last, name.strip()[: -len(last)]
    words = re.sub(r" (in|at)$", "", _words(name))
    if times := re.search(_TIMES_NAMED, words):
        factor *= _TIMES[times[1] or times[2]]
        words = " ".join(words.replace(times[0], " ").split())
    quantity, rank = _meaning(words)
    if quantity == "cycles" and re.match(r"2|rev", words):
        factor *= 0.5
    if quantity in _OUTCOMES and (means := _CODE.search(column.name)):
        said = _words(means[2])
        alive = said in _LIVES if said in _LIVES | _BROKE else quantity == "alive"
        quantity = "alive" if alive == (means[1].lower() not in _NO) else "broken"
    return _Named(column, quantity, rank, unit, factor, base)


def _meaning(words: str) -> tuple[str, int]:
    """Quantity and rank of a name."""
    return next(((q, rank) for q, rank, p in _MEANINGS if p.fullmatch(words)), ("", 0))


def _factor(name: str) -> tuple[float, str]:
    """By what a name says that its numbers are multiplied, and the name without."""
    found = _POWER.search(name.translate(_POWERS))
    if found is None:
        return 1.0, name
    power = found[1] or found[2] or found[0].count("0")
    return 10.0 ** int(power), name.translate(_POWERS).replace(found[0], "", 1)


def _spaced(name: str) -> str:
    """With a blank before a capital within a word: "RunOut", "logN"."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)


def _words(text: str) -> str:
    """In small letters, with no signs but blanks."""
    for sign, word in _SIGNS.items():
        text = text.replace(sign, word)
    return " ".join(re.sub(r"[\W_]+", " ", _spaced(text).lower()).split())


def _in(unit: str | None, target: str) -> bool:
    try:
        return unit is not None and bool(conversion(unit, (target,)))
    except InputError:
        return False


@dataclass
class _Reading:
    """A table of tests that is being read; `notes` tell what was taken for what."""

    file: str | Path
    table: Table
    named: list[_Named]
    notes: list[str] = field(default_factory=list)

    def choose(self, quantities: Sequence[str], asked: str | None, option: str) -> list[_Named]:
        """The columns of these quantities: the one asked for, or those of the lowest rank."""
        if asked is not None:
            found = [
                one for one in self.named if asked in (one.column.name, one.column.name.strip())
            ]
            if not found:
                raise InputError("no such column", file=self.file, key=option, value=asked,
                                 choices=self.table.columns)  # fmt: skip
            return found
        found = [one for one in self.named if one.quantity in quantities]
        return [one for one in found if one.rank == min(other.rank for other in found)]

    def one(self, found: list[_Named], option: str) -> _Named:
        """The only one of some columns."""
        if len(found) > 1:
            names = [one.column.name for one in found]
            raise InputError(f"several columns may be meant: {option} COLUMN says which",
                             file=self.file, choices=names)  # fmt: skip
        return found[0]

    def missing(self, what: str, option: str) -> InputError:
        return InputError(f"no column named like {what!r}", file=self.file,
                          value=list(self.table.columns),
                          hint=f"{option} COLUMN says which")  # fmt: skip


def read_sn_tests(
    path: str | Path,
    *,
    run_out_cycles: float | None = None,
    stress: str | None = None,
    stress_column: str | None = None,
    stress_unit: str | None = None,
    ratio: float | None = None,
    cycles: str | None = None,
    outcome: str | None = None,
) -> SNTests:
    """Read a table with a header, written in any habit.

    Columns are known by their names. Stress: amplitude, range, maximum, minimum, mean, R, with the
    unit in brackets (`Stress range [MPa]`); one that says none of these is the amplitude. Cycles:
    also in thousands, as logarithms, as reversals. Outcome (optional): `fracture`, `Runout`,
    `Failure`, `censored` with yes and no, or a column with words such as Failure and RunOut.

    Args:
        path: the file.
        run_out_cycles: without an outcome column, tests that reached this many cycles are
            run-outs. None: the longest life, if two tests at least share it exactly.
        stress: what the stresses are where their name does not say: "amplitude", "range" or "max".
        stress_column: name of the column of stresses.
        stress_unit: of the stresses, where their name does not say.
        ratio: 1, R = min / max of all tests, where no column says.
        cycles: name of the column of cycles.
        outcome: name of the column that says which specimens failed.

    Raises:
        InputError: missing columns, an unknown unit, a cell that can't be read (with its line), or
            columns that may be several things (with the option that decides).
    """
    if stress is not None and stress not in STRESSES:
        raise InputError("unknown", key="stress", value=stress, choices=STRESSES)
    table = read_table(path)
    if not table.layout.header:
        raise InputError("needs a header that names its columns", file=path)
    named = [_named(column) for column in table.columns.values()]
    reading = _Reading(path, table, named, [one.told for one in table.left if one.column is None])
    amplitude, used = _amplitude(reading, stress, stress_column, stress_unit, ratio)
    life, by = _cycles(reading, cycles)
    failed, told = _outcome(reading, outcome, life, run_out_cycles)
    used |= {by, *told}
    for values, what in ((amplitude, "the stress amplitude"), (life, "cycles")):
        bad = np.flatnonzero(~(np.isfinite(values) & (values > 0.0)))
        if bad.size:
            where = f"line {table.lines[bad[0]]}"
            raise InputError(f"{what} must be a positive number", file=path, key=where,
                             value=float(values[bad[0]]))  # fmt: skip
    if rest := [name for name in table.columns if name not in used]:
        reading.notes.append(f"columns not used: {', '.join(rest)}")
    return SNTests(amplitude, life, failed, tuple(reading.notes), Path(path))


def _amplitude(
    reading: _Reading, kind: str | None, column: str | None, unit: str | None, ratio: float | None
) -> tuple[FloatArray, set[str]]:
    """(n,) Pa, and the columns that it is from."""
    file, lines = reading.file, reading.table.lines
    every = reading.choose(_STRESSES, column, "--stress-column")
    pressures = [one for one in every if _in(one.unit, "Pa")]
    every = pressures or every  # beside a stress a load in kN is none
    if not every:
        raise reading.missing("stress", "--stress-column")
    by: dict[str, list[_Named]] = {}
    for one in every:
        by.setdefault(one.quantity, []).append(one)
    if len(by) > 1:
        by.pop("stress", None)
    plain = next(iter(by)) if len(by) == 1 else None
    ratios = [one for one in reading.named if one.quantity == "ratio"]
    if kind is not None:
        if plain is None:
            raise InputError("several columns hold stresses: --stress-column says which", file=file,
                             choices=[one.column.name for one in every])  # fmt: skip
        by = {STRESSES[kind]: by[plain]}
    elif plain in ("stress", "", "ratio", "cycles"):
        swings = [r for r in ratios if (r.values(file, lines) != -1.0).any()]
        if swings or ratio not in (None, -1.0):
            raise InputError("amplitude, range or maximum? R is not -1, so --stress range, "
                             "--stress amplitude or --stress max must say", file=file,
                             key=by[plain or ""][0].column.name)  # fmt: skip
        by = {"amplitude": by[plain or ""]}
    known: dict[str, FloatArray] = {}
    used = set()
    for quantity, several in by.items():
        one = reading.one(several, "--stress-column")
        try:
            if (one.unit or unit) is None:
                raise InputError("the stress needs a unit in brackets, or --stress-unit",
                                 choices=["MPa", "N/mm^2", "ksi"])  # fmt: skip
            to_si = conversion(unit or one.unit or "", ("Pa",))[1]
        except InputError as error:
            raise error.placed(file=file, key=one.column.name) from None
        known[quantity] = to_si(one.factor * one.values(file, lines))
        used.add(one.column.name)
    if ratio is not None:
        known["ratio"] = np.full(lines.size, ratio)
    elif ratios:
        one = reading.one(ratios, "--ratio R or --stress-column")
        known["ratio"] = one.values(file, lines)
        used.add(one.column.name)
    found = [
        (words, rule(*(known[name] for name in needed)))
        for needed, rule, words in _AMPLITUDES if set(needed) <= known.keys()
    ]  # fmt: skip
    if not found:
        raise InputError(f"the amplitude does not follow from the {' and '.join(known)} alone",
                         file=file, key=", ".join(used), hint="--ratio R says R of all tests, "
                         "--stress what the column is")  # fmt: skip
    words, amplitude = found[0]
    for other, values in found[1:]:
        off = ~(np.abs(values - amplitude) <= _ROUNDED * np.abs(amplitude))
        if off.any():
            at = int(np.flatnonzero(off)[0])
            raise InputError(f"{words} is {amplitude[at] / 1e6:.4g} MPa, but {other} is "
                             f"{values[at] / 1e6:.4g} MPa", file=file, key=f"line {lines[at]}",
                             hint="--stress-column says which column counts")  # fmt: skip
    unsaid = plain == "stress" and kind is None
    note = ", as nothing else is said (--stress)" if unsaid else ""
    reading.notes.append(f"stress: {words}, of {', '.join(sorted(used))}{note}")
    _mean(reading, known, amplitude)
    return amplitude, used


def _mean(reading: _Reading, known: dict[str, FloatArray], amplitude: FloatArray) -> None:
    """Tell of a mean stress, which no curve is corrected for."""
    mean = known.get("mean", np.zeros(1))
    if "maximum" in known:
        mean = known["maximum"] - amplitude
    elif "ratio" in known:
        with np.errstate(divide="ignore", invalid="ignore"):
            mean = amplitude * (1.0 + known["ratio"]) / (1.0 - known["ratio"])
    share = np.unique(np.round(np.abs(mean / amplitude), 2))
    if (share > 0.01).any():
        reading.notes.append(
            f"the mean stress is up to {share.max():.3g} times the amplitude: the curve holds "
            "about this mean and is not corrected to none (in shear its sign does not matter)"
        )
        if share.size > 1 and np.ptp(share) > 0.1:
            warn_user(f"{reading.file}: tests about several mean stresses are fitted as one curve")


def _cycles(reading: _Reading, column: str | None) -> tuple[FloatArray, str]:
    """(n,) and the column that holds them."""
    found = reading.choose(("cycles",), column, "--cycles")
    if not found:
        raise reading.missing("cycles", "--cycles")
    one = reading.one(found, "--cycles")
    factor, unit = one.factor, one.unit
    if unit is not None and (_in(unit, "s") or _in(unit, "Hz")):
        raise InputError("is a unit of time, not of cycles", file=reading.file, key=one.column.name,
                         value=unit, choices=["cycles", "kcycles", "x1000", "10^6"])  # fmt: skip
    if unit is not None and _in(unit, "cycle"):
        factor *= conversion(unit, ("cycle",))[1].scale
    elif unit is not None:
        factor *= next((_TIMES[w] for w in _words(unit).split() if w in _TIMES), 1.0)
        if re.match(r"(log ?10|log|lg|ln)\b", unit, re.I):
            one = replace(one, base=math.e if unit.lower().startswith("ln") else 10.0)
    life = factor * one.values(reading.file, reading.table.lines)
    longest = float(np.nanmax(life, initial=0.0))
    if 0.0 < longest < _LEAST_LIFE:
        raise InputError(f"the longest life is {longest:.4g} cycles", file=reading.file,
                         key=one.column.name, hint="logarithms are told by a name such as 'log10 "
                         "cycles', thousands by 'Cycles [x1000]'")  # fmt: skip
    how = [f"times {factor:g}"] if factor != 1.0 else []
    how += (
        ["natural logarithms" if one.base == math.e else "logarithms to base 10"]
        if one.base
        else []
    )
    reading.notes.append(", ".join([f"cycles: {one.column.name}", *how]))
    return life, one.column.name


def _outcome(
    reading: _Reading, column: str | None, life: FloatArray, run_out_cycles: float | None
) -> tuple[BoolArray, list[str]]:
    """(n,) which failed, and the columns that say so."""
    found = reading.choose(_OUTCOMES, column, "--outcome")
    told = [(one, broke) for one in found if (broke := _broke(reading, one, life)) is not None]
    if any((broke != told[0][1]).any() for _, broke in told):
        names = [one.column.name for one, _ in told]
        raise InputError("these columns do not agree on what failed: --outcome COLUMN says which",
                         file=reading.file, choices=names)  # fmt: skip
    if told:
        return told[0][1], [one.column.name for one, _ in told]
    longest = float(life.max())
    if run_out_cycles is None and int((life == longest).sum()) < 2:
        reading.notes.append("no outcome column: every test failed")
        return np.ones(life.size, dtype=bool), []
    limit = longest if run_out_cycles is None else float(run_out_cycles)
    note = f"no outcome column: tests that reached {limit:g} cycles are run-outs"
    reading.notes.append(note)
    if run_out_cycles is None:
        warn_user(note)
    return life < limit, []


def _broke(reading: _Reading, one: _Named, life: FloatArray) -> BoolArray | None:
    """(n,) what a column says of each specimen; None where it is a comment on something else."""
    name, column = one.column.name, one.column
    if column.kind == "number":
        words = ["" if np.isnan(value) else f"{value:g}" for value in column.values]
    else:
        words = [_words(str(cell)) for cell in column.values]
    lines = dict(zip(words[::-1], reading.table.lines[::-1], strict=True))
    marks = set(lines) - {""}
    known = _BROKE | _LIVES | _YES | _NO
    if one.rank == 2 and not marks & (_BROKE | _LIVES):
        return None
    # A mark in one column: what is left empty is the other.
    blank = "" in lines and one.quantity in ("broken", "alive") and not marks & _NO
    if unknown := [w for w in lines if w not in known and not (w == "" and blank)]:
        text = "is empty" if not unknown[0] else "unknown outcome"
        raise InputError(text, file=reading.file, key=f"line {lines[unknown[0]]}, {name}",
                         value=unknown[0], choices=("Failure", "RunOut", "yes", "no"))  # fmt: skip
    alive = one.quantity == "alive"
    yes = np.array([w in _YES for w in words])
    plain = np.array([w in _YES | _NO | {""} for w in words])
    broke = np.where(plain, yes != alive, np.array([w in _BROKE for w in words]))
    last = life == life.max()
    neutral = one.quantity not in ("broken", "alive") and plain.any()
    if neutral and last.sum() > 1 and broke[last].all() and not broke.all():
        raise InputError("1 seems to be a run-out, as the longest lives have it: name the column "
                         "Runout or Failure", file=reading.file, key=name)  # fmt: skip
    means = "a run-out" if alive else "a failure"
    said = f": {sorted(marks & _YES)[0]} is {means}" if yes.any() else ""
    reading.notes.append(f"outcome: {name}{said}" + (", empty is the other" if blank else ""))
    return broke
