"""How sure a life is, for the terminal: quantiles with their sampling error, what varied, scans."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from picchio.cli.output import console, styled, table
from picchio.core import spoken
from picchio.core.errors import InputError
from picchio.robot.spread import ESTIMATE, is_estimate

if TYPE_CHECKING:
    from picchio.fatigue.uncertain_lives import Uncertain
    from picchio.studies.uncertainty.result import UncertainLife


def parse_spreads(given: Sequence[str]) -> dict[str, Uncertain]:
    """What `--spread NAME=FACTOR` asks for.

    Args:
        given: texts such as "stiffness=1.3".

    Returns:
        name -> a log-normal distribution one standard deviation of which is the factor.

    Raises:
        InputError: no "=", or a factor below 1.
    """
    from picchio.fatigue.uncertain_lives import Uncertain

    found = {}
    for text in given:
        name, _, number = text.partition("=")
        try:
            factor = float(number)
        except ValueError:
            factor = math.nan
        if not (name and math.isfinite(factor) and factor >= 1.0):
            raise InputError("must be NAME=FACTOR with a factor of 1 or more", key="--spread",
                             value=text, hint="such as stiffness=1.3")  # fmt: skip
        found[name.strip()] = Uncertain(1.0, math.log(factor))
    return found


# Of many inputs, those that explain less than this share alone are only named.
_MANY, _SMALL = 8, 0.02
# Measurements that are listed, and commands that use them.
_BEST, _COMMANDS = 6, 2


def _show_measurements(found: UncertainLife) -> None:
    """Print what to measure first."""
    best = found.measure_first[:_BEST]
    if not best:
        return
    out = console()
    known = not math.isnan(best[0].interval_decades[0])
    rows = []
    for one in best:
        left = spoken.factor(one.interval_decades[1]) if known else f"{100 * one.kept:.0f}"
        rows.append([one.words, left])
    now = spoken.factor(best[0].interval_decades[0]) if known else "100 %"
    title = f"What to measure first, and the range of the life that remains (now {now})"
    if not known:
        title = "What to measure first, and the range of the utilisation that remains"
    heads = ["to know", ">range that\nremains" + ("" if known else ", %")]
    out.print(table(heads, rows, title=title))
    commands = dict.fromkeys(one.command for one in best if one.command is not None)
    for command in list(commands)[:_COMMANDS]:
        out.print(styled(f"  {command}", style="dim"), soft_wrap=True)  # in one line, to copy
    out.print()


def show_spread(found: UncertainLife) -> None:
    """Print how sure the lives are.

    Args:
        found: the lives as distributions.
    """
    out = console()
    rows = []
    # Of estimates the joints' intervals stand in their table already.
    joints = {} if found.estimated else found.joints
    for name, spread in {**joints, "robot": found.robot}.items():
        if spread.p10 == spread.p90:
            rows.append([name, "P10 to P90", spoken.count(spread.p50), ""])
            continue
        for key in spread.quantiles:
            low, high = (spoken.count(float(f"{end:.3g}")) for end in spread.sampling[key])
            told = spoken.count(spread.rounded(key))
            rows.append([name, key.upper(), told, low if low == high else f"{low} to {high}"])
            name = ""
    robot = found.robot
    if joints or robot.p10 != robot.p90:
        out.print(table(
            ["", "", ">rivets", ">95 % of the sampling"], rows,
            title=f"How sure the life is: rivets that 90, 50 and 10 % of {robot.samples} drawn "
            "cases exceed",
        ))  # fmt: skip
    if found.utilisation:
        ends = " to ".join(f"{100 * found.utilisation[key]:.3g}" for key in ("p10", "p90"))
        middle = f"{100 * found.utilisation['p50']:.3g}"
        out.print(f"Highest utilisation of the robot, P10 to P90: {ends} % (median {middle} %).\n")
    named = sorted(found.inputs, key=lambda name: -robot.shares[name])
    small = [name for name in named if robot.shares[name] < _SMALL] if len(named) > _MANY else []
    named = [name for name in named if name not in small]
    inputs = []
    for name in named:
        shares = [f"{100 * robot.shares[name]:.0f}"]
        if robot.totals:
            shares.append(f"{100 * robot.totals[name]:.0f}")
        source = found.sources[name]
        source = ESTIMATE if is_estimate(source) else source
        inputs.append([name, found.spread_words(name), *shares, source])
    heads = [">alone,\n%", *([">with\nothers, %"] if robot.totals else [])]
    out.print(table(
        ["what varies", "by", *heads, "from"], inputs,
        title="Main sources of uncertainty: shares of the variance",
    ))  # fmt: skip
    if small:
        out.print(f"Below {100 * _SMALL:g} % each: {', '.join(small)}.\n", style="dim")
    _show_measurements(found)
    for name, scan in found.scans.items():
        lines = [
            [f"{scan.factor[k]:.3g}", spoken.count(float(f"{scan.life[k]:.3g}"))]
            for k in scan.turning_points()
        ]
        out.print(table(
            [">factor", ">rivets"], lines,
            title=f"The life is not monotone along {name}: its ends and turns, all else as stated",
        ))  # fmt: skip
    for line in found.assumptions:
        out.print(f"  - {line}", style="dim")
