"""A count for other programs: Prometheus text, diagnostic_msgs/DiagnosticArray as MCAP, OPC UA."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from picchio.core.errors import InputError
from picchio.core.files import atomic_write, write_text

if TYPE_CHECKING:
    from picchio.ledger.result import Count

_HELP = {
    "picchio_blows_total": ("counter", "Blows in the ledger."),
    "picchio_blows_seen_ratio": ("gauge", "Share of the blows whose size was logged."),
    "picchio_logged_seconds_total": ("counter", "Time that was logged."),
    "picchio_last_blow_timestamp_seconds": ("gauge", "When the last blow was, Unix time."),
    "picchio_damage_ratio": ("gauge", "Miner's sum of a joint; 1 is failure."),
    "picchio_damage_low_ratio": ("gauge", "Lower end of its 90 % interval."),
    "picchio_damage_high_ratio": ("gauge", "Upper end of its 90 % interval."),
    "picchio_blows_left": ("gauge", "Blows until the sum is 1, by quantile; +Inf without end."),
    "picchio_changes": ("gauge", "How many things are no longer as they were."),
}


def prometheus(found: Count) -> str:
    """A count as Prometheus's text format has it (a textfile collector reads it).

    Args:
        found: the count.

    Source: Prometheus, exposition formats, text format 0.0.4.
    """
    robot = _escaped(found.model.robot.name)
    values: dict[str, list[tuple[str, float]]] = {name: [] for name in _HELP}
    own = f'robot="{robot}"'
    spans = found.counted.spans
    values["picchio_blows_total"].append((own, found.blows))
    values["picchio_blows_seen_ratio"].append((own, found.seen_share))
    logged = float((spans[:, 1] - spans[:, 0]).sum() * 1e-9) if len(spans) else 0.0
    values["picchio_logged_seconds_total"].append((own, logged))
    values["picchio_changes"].append((own, len(found.changes)))
    if found.blows:
        last = found.counted.last * 1e-9
        values["picchio_last_blow_timestamp_seconds"].append((own, last))
    for joint in found.joints():
        if math.isnan(joint["damage"]):
            continue
        where = f'{own},joint="{_escaped(joint["name"])}"'
        values["picchio_damage_ratio"].append((where, joint["damage"]))
        if joint["damage_interval"]:
            low, high = joint["damage_interval"]
            values["picchio_damage_low_ratio"].append((where, low))
            values["picchio_damage_high_ratio"].append((where, high))
        for name, level in (("p10", 0.1), ("p50", 0.5), ("p90", 0.9)):
            if joint["blows_left"]:
                at = f'{where},quantile="{level}"'
                values["picchio_blows_left"].append((at, joint["blows_left"][name]))
    lines = []
    for name, (kind, meaning) in _HELP.items():
        if values[name]:
            lines += [f"# HELP {name} {meaning}", f"# TYPE {name} {kind}"]
            lines += [f"{name}{{{labels}}} {_number(value)}" for labels, value in values[name]]
    return "\n".join(lines) + "\n"


def _number(value: float) -> str:
    return "+Inf" if value == math.inf else repr(float(value))


def _escaped(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")


def write_prometheus(found: Count, path: Path) -> None:
    """Write `prometheus`, whole or not at all.

    Args:
        found: the count.
        path: the file; a textfile collector takes names that end in .prom.
    """
    write_text(path, prometheus(found))


def opc_ua(found: Count) -> dict[str, Any]:
    """The names under which an OPC UA server of the robot would show a count.

    OPC 40010-1 (OPC UA for Robotics) has MotionDevices with Axes and ParameterSets; the life of an
    axis is no part of it, so these stand beside its own parameters, in a ParameterSet of the axis.

    Args:
        found: the count.

    Source: OPC 40010-1, OPC UA for Robotics, part 1: vertical integration (2019), 7.5 and 7.7.
    """
    device = f"MotionDeviceSystem/MotionDevices/{found.model.robot.name}"
    return {
        f"{device}/Axes/{joint['name']}/ParameterSet/{key}": value
        for joint in found.joints()
        for key, value in (
            ("LifeUsed", joint["damage"]),
            ("BlowsLeftP50", (joint["blows_left"] or {}).get("p50")),
        )
    }


_DEFINITION = """std_msgs/Header header
diagnostic_msgs/DiagnosticStatus[] status
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: diagnostic_msgs/DiagnosticStatus
byte OK=0
byte WARN=1
byte ERROR=2
byte STALE=3
byte level
string name
string message
string hardware_id
diagnostic_msgs/KeyValue[] values
================================================================================
MSG: diagnostic_msgs/KeyValue
string key
string value
"""


def diagnostics(found: Count) -> dict[str, Any]:
    """A diagnostic_msgs/DiagnosticArray of the joints.

    WARN where the damage may have reached 1 or something changed, ERROR where it has.

    Args:
        found: the count.
    """
    now = time.time_ns()
    status = []
    for joint in found.joints():
        high = (joint["damage_interval"] or (0.0, 0.0))[1]
        changed = [c["words"] for c in found.changes if c["target"] == joint["name"]]
        level = 2 if joint["damage"] >= 1.0 else int(high >= 1.0 or bool(changed))
        left = joint["blows_left"]
        values = {"damage": joint["damage"], "damage_p95": high,
                  "blows_left_p50": left["p50"] if left else math.nan}  # fmt: skip
        status.append({
            "level": level, "name": f"picchio: {joint['name']}",
            "message": "; ".join(changed) or f"{100 * joint['damage']:.3g} % of the life used",
            "hardware_id": found.model.robot.name,
            "values": [{"key": key, "value": repr(value)} for key, value in values.items()],
        })  # fmt: skip
    stamp = {"sec": now // 10**9, "nanosec": now % 10**9}
    return {"header": {"stamp": stamp, "frame_id": ""}, "status": status}


def write_diagnostics(found: Count, path: Path) -> None:
    """Write `diagnostics` as an MCAP log of ROS 2, topic /diagnostics.

    Args:
        found: the count.
        path: the file.

    Raises:
        InputError: mcap-ros2-support is missing.
    """
    try:
        from mcap_ros2.writer import Writer
    except ImportError:
        raise InputError("MCAP files need mcap and mcap-ros2-support",
                         hint="pip install 'picchio[import]'") from None  # fmt: skip
    message = diagnostics(found)
    stamp = message["header"]["stamp"]
    when = stamp["sec"] * 10**9 + stamp["nanosec"]
    with atomic_write(path, "wb") as stream:
        writer = Writer(stream)
        schema = writer.register_msgdef("diagnostic_msgs/msg/DiagnosticArray", _DEFINITION)
        writer.write_message("/diagnostics", schema, message, when, when)
        writer.finish()
