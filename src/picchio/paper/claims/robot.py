"""Claims about the arm itself."""

from __future__ import annotations

from picchio.paper.claims.registry import claim
from picchio.paper.statics import holding_torque
from picchio.paper.study import Study
from picchio.paper.verdict import Finding, decided


@claim("mimics", "gravity")
def mimics(study: Study) -> Finding:
    """Whether the actuators could hold the arm up."""
    found = holding_torque(study.base)
    limits = study.printed.arm.actuator_torques
    return decided(
        bool(found.largest[1] <= limits[1] and found.largest[2] <= limits[2]),
        "torque to hold the unloaded arm against gravity, at full horizontal reach, against the "
        "stated actuators",
        f"joint 2: {found.largest[1]:.0f} N m against {limits[1]:.0f} N m, joint 3: "
        f"{found.largest[2]:.0f} N m against {limits[2]:.0f} N m; joint 2 can hold the arm in "
        f"{100 * found.share_held:.0f} % of its range with joint 3 straight",
        float(found.largest[1]),
    )
