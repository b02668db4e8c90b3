"""Drive data that other tools put into a URDF or an SRDF: rotor inertia and gear ratio.

Drake: `<transmission><actuator><drake:rotor_inertia value=/><drake:gear_ratio value=/>`.
SRDF, as Pinocchio reads it: `<rotor_params><joint name= mass= gear_ratio=/>`, where `mass`
is the rotor's inertia. Neither gives a stiffness.
"""

from __future__ import annotations

from lxml import etree

from picchio.robot.annotations.sidecar import JointEntry, Sidecar
from picchio.robot.urdf.tree import to_number
from picchio.robot.urdf.xml import children, local_name


def read_drake(root: etree._Element) -> Sidecar | None:
    """Rotor inertias and gear ratios in Drake's tags, or None where there are none."""
    joints: dict[str, dict[str, float]] = {}
    for transmission in children(root, "transmission"):
        names = [joint.get("name") for joint in children(transmission, "joint")]
        for actuator in children(transmission, "actuator"):
            for element in actuator:
                key = local_name(element)
                if key in ("rotor_inertia", "gear_ratio") and element.tag != key:
                    value = _value(element.get("value"))
                    for name in names:
                        if name and value is not None:
                            joints.setdefault(name, {})[key] = value
    return _sidecar(joints)


def read_rotor_params(srdf: etree._Element) -> Sidecar | None:
    """The SRDF's `<rotor_params>`, or None where there are none."""
    joints: dict[str, dict[str, float]] = {}
    for block in children(srdf, "rotor_params"):
        for joint in children(block, "joint"):
            for attribute, key in (("mass", "rotor_inertia"), ("gear_ratio", "gear_ratio")):
                value = _value(joint.get(attribute))
                if joint.get("name") and value is not None:
                    joints.setdefault(joint.get("name", ""), {})[key] = value
    return _sidecar(joints)


def _value(text: str | None) -> float | None:
    # These tags are other tools' business: what cannot be read is passed over, not refused.
    try:
        return to_number(text or "")
    except ValueError:
        return None


def _sidecar(joints: dict[str, dict[str, float]]) -> Sidecar | None:
    sane = {
        name: {
            key: value
            for key, value in entry.items()
            if (value >= 0 if key == "rotor_inertia" else value != 0)
        }
        for name, entry in joints.items()
    }
    entries = {name: JointEntry.model_validate(entry) for name, entry in sane.items() if entry}
    return Sidecar(joint=entries) if entries else None
