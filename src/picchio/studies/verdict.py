"""An assessment in a sentence."""

from __future__ import annotations

import math

from picchio.studies.assessment import Assessment


def verdict(found: Assessment) -> str:
    """The result in a sentence."""
    if found.limiting_joint is None:
        return (
            "No joint has a shaft or a reducer, so no life can be told; give them in the sidecar."
        )
    joint = next(j for j in found.joints if j.name == found.limiting_joint)
    if math.isfinite(joint.life):
        return f"The robot survives {format_count(joint.life)} rivets; {joint.name} fails first."
    over = [j.name for j in found.joints if j.reducer_utilisation > 1.0]
    if over:
        return (
            f"Blows and gravity exceed the torque limits of the reducer in {', '.join(over)}: no "
            "life can be promised there."
        )
    part = f"reducer {joint.reducer}" if joint.reducer_utilisation > joint.utilisation else "shaft"
    if not joint.sn_curve:
        part = f"reducer {joint.reducer}"
    shafts = any(j.sn_curve for j in found.joints)
    first = "No shaft fails: every stress stays below its endurance limit. " if shafts else ""
    return (
        f"{first}The {part} of {joint.name} comes closest, at "
        f"{100 * joint.governing_utilisation:.3g} % of its allowable."
    )


def format_count(value: float) -> str:
    """A number of rivets as people read it; "no end" for infinity."""
    if math.isnan(value):
        return "-"
    if math.isinf(value):
        return "no end"
    if value < 10:
        return f"{value:.3g}"
    # Four digits are more than the physics deserves.
    return f"{float(f'{value:.4g}'):,.0f}" if value < 1e12 else f"{value:.3e}"
