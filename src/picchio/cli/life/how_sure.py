"""How sure a life is, for the terminal: quantiles with their sampling error, what varied, scans."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from picchio.cli.output import console, table
from picchio.core.errors import InputError
from picchio.studies.assessment.result import format_count

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


def show_spread(found: UncertainLife) -> None:
    """Print how sure the lives are.

    Args:
        found: the lives as distributions.
    """
    out = console()
    rows = []
    for name, spread in {**found.joints, "robot": found.robot}.items():
        if spread.p10 == spread.p90:
            rows.append([name, "P10 to P90", format_count(spread.p50), ""])
            continue
        for key in spread.quantiles:
            low, high = (format_count(float(f"{end:.3g}")) for end in spread.sampling[key])
            told = format_count(spread.rounded(key))
            rows.append([name, key.upper(), told, low if low == high else f"{low} to {high}"])
            name = ""
    out.print(table(
        ["", "", ">rivets", ">95 % of the sampling"], rows,
        title=f"How sure the life is: rivets that 90, 50 and 10 % of {found.robot.samples} drawn "
        "cases exceed",
    ))  # fmt: skip
    robot = found.robot
    named = sorted(found.inputs, key=lambda name: -robot.shares[name])
    inputs = []
    for name in named:
        shares = [f"{100 * robot.shares[name]:.0f}"]
        if robot.totals:
            shares.append(f"{100 * robot.totals[name]:.0f}")
        inputs.append([name, found.spread_words(name), *shares, found.sources[name]])
    heads = [">alone,\n%", *([">with\nothers, %"] if robot.totals else [])]
    out.print(table(
        ["what varies", "by", *heads, "from"], inputs,
        title="Where the doubt is from: shares of the variance",
    ))  # fmt: skip
    for name, scan in found.scans.items():
        lines = [
            [f"{scan.factor[k]:.3g}", format_count(float(f"{scan.life[k]:.3g}"))]
            for k in scan.turning_points()
        ]
        out.print(table(
            [">factor", ">rivets"], lines,
            title=f"The life is not monotone along {name}: its ends and turns, all else as stated",
        ))  # fmt: skip
    for line in found.assumptions:
        out.print(f"  - {line}", style="dim")
