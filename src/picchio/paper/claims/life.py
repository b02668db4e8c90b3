"""Claims about the life: Table 2, Miner, the S-N curve."""

from __future__ import annotations

import math

import numpy as np

from picchio.fatigue.sn.library import load_sn_curve
from picchio.paper.equations import miner_gap, printed_total
from picchio.paper.study import Study
from picchio.paper.verdict import Finding, claim, decided, unknown
from picchio.paper.waterfall import STEEL, paper_lives


@claim("table-2")
def lives_differ(study: Study) -> Finding:
    """Lives by joint, printed and ours."""
    printed = study.printed.cycles[np.isfinite(study.printed.cycles)]
    ours = paper_lives(study.base)
    ratio = float(ours.max() / ours.min())
    return decided(
        ratio > 1.1,
        "longest over shortest life of the three joints by the paper's own method",
        f"a factor of {ratio:.3g} in the base world; {printed.max() / printed.min():.3g} between "
        "the entries of Table 2",
        ratio,
    )


@claim("equations")
def miner_algebra(study: Study) -> Finding:
    """Eqs. 19a-21b against eq. 18, with numbers."""
    gap = miner_gap(study.printed)
    return decided(
        gap < 1e-12,
        "rivets to failure by eqs. 20 and 21 against Miner's sum of eq. 18, on Table 2's N",
        f"they differ by {gap:.1g}",
        gap,
    )


@claim("fig-11")
def shaft_steel(study: Study) -> Finding:
    """The curve against a shaft steel's shear strength."""
    steel = load_sn_curve(STEEL, quiet=True)
    assert steel.ultimate_shear is not None
    curve = study.printed.sn_curve
    strength = curve.a * 1000.0**curve.b
    limit = steel.ultimate_shear / 1e6
    crossing = (limit / curve.a) ** (1.0 / curve.b)
    return decided(
        strength < limit,
        f"shear stress that the curve allows at 1000 cycles, against the static shear strength of "
        f"{STEEL} (0.577 of its tensile strength)",
        f"{strength:,.0f} MPa against {limit:,.0f} MPa; the curve is above it up to "
        f"{crossing:,.0f} cycles, and has no endurance limit",
        strength,
    )


@claim("table-2-lives")
def curve_of_table(study: Study) -> Finding:
    """The printed N against the printed curve at the printed mean stresses."""
    table, off = study.curve_of_table, study.curve_of_table.over_printed
    values = table.other.values
    return decided(
        bool((np.abs(np.log(off)) < math.log(1.05)).all()),
        "the printed curve's N at the printed means over the printed N",
        f"{off.min():.3g} to {off.max():.3g} times too long. Seven of the eight lie within "
        f"rounding on another curve at the same means, S = {values['a']:,.0f} "
        f"N^{values['b']:.4f}; the eighth ({table.misprint}) is off by a factor of "
        f"{table.misprint_factor:.3g}",
        float(off.max()),
    )


@claim()
def hits(study: Study) -> Finding:
    """No data."""
    return unknown(
        "no measurement is shown",
        "0 data points are printed; the life goes with 1 over this number",
    )


@claim()
def force_level(study: Study) -> Finding:
    """No data."""
    factor = 10.0 ** (1.0 / study.printed.sn_curve.exponent)
    return unknown(
        "no measurement is shown, nor what of the blow 300 N is (peak, mean, or an equivalent)",
        f"0 data points are printed; a force {factor:.3g} times as large would take the life "
        "down ten times",
    )


@claim()
def three_joints(study: Study) -> Finding:
    """The wrist is not in the paper."""
    return unknown(
        "the paper gives no length, mass or stiffness of the wrist",
        "3 of the robot's 6 joints are left out; in such arms the wrist's gears are the smallest",
    )


@claim()
def total(study: Study) -> Finding:
    """The sum is not in the text; what Table 2 would give."""
    value, joint = printed_total(study.printed)
    many = study.printed.task.hits_per_rivet * value
    return unknown(
        "the sentence breaks off in the text at hand, and eq. 22 is not in it",
        f"Table 2's N in eqs. 18–21 give {value:,.0f} rivets if N counts hits and {many:,.0f} if "
        f"it counts rivets; joint {joint} is the first to fail",
    )
