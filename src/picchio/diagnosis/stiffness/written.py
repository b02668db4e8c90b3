"""What was found as a sidecar: values, spreads and how they hang together."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from picchio.core.arrays import FloatArray
from picchio.core.provenance import provenance
from picchio.core.toml import validate
from picchio.diagnosis.entries import joint_entry, standing_entries, tool_entry
from picchio.diagnosis.identified import IdentifiedJoint
from picchio.robot.annotations.sidecar import FORMAT, Sidecar, spreads_of
from picchio.robot.flexible_robot import FlexibleRobot


def sidecar(
    robot: FlexibleRobot,
    joints: Sequence[IdentifiedJoint],
    source: str,
    files: Iterable[Path],
    remarks: Iterable[str],
    covariance: FloatArray,
    *,
    damping: bool = False,
) -> str:
    """A sidecar's text.

    Args:
        robot: as it was before.
        joints: what was found of its drives.
        source: where the data are from.
        files: that were read.
        remarks: comments.
        covariance: (n, n) of the logarithms of all flexible joints' stiffness; with the damping
            ratios' behind them (2 n, 2 n).
        damping: whether those were found, too.
    """
    import tomlkit

    names = [f"stiffness.{joint.name}" for joint in robot.flexible_joints]
    if damping:
        names += [f"damping_ratio.{joint.name}" for joint in robot.flexible_joints]
    size = dict(zip(names, np.sqrt(np.diag(covariance)).tolist(), strict=True))
    document = tomlkit.document()
    document.add(tomlkit.comment("Found by tests made for it, each value with its spread."))
    for one in provenance(files)["inputs"]:
        document.add(tomlkit.comment(f"{one['file']} sha256 {one['sha256']}"))
    for line in remarks:
        document.add(tomlkit.comment(line))
    entries: dict[str, Any] = {}
    old = {joint.name: joint for joint in robot.flexible_joints}
    for joint in joints:
        entry = entries[joint.name] = joint_entry(robot, old[joint.name])
        for key in ("stiffness_std", "stiffness_curve"):
            entry.pop(key, None)
        guess = entry.pop("estimated", False)
        entry |= {
            "stiffness": joint.stiffness.value,
            "stiffness_spread": math.exp(size[f"stiffness.{joint.name}"]),
            "source": f"picchio identify on {source}: {joint.stiffness.why}",
        }
        if damping:
            entry.pop("damping_ratio_std", None)
            entry |= {
                "damping_ratio": joint.damping_ratio.value,
                "damping_ratio_spread": math.exp(size[f"damping_ratio.{joint.name}"]),
            }
        elif guess:  # the damping still is
            entry.setdefault("damping_ratio_spread", 2.0)
    table: dict[str, Any] = {
        "format": FORMAT, "description": f"{robot.name}, identified", "joint": entries,
        "tool": tool_entry(robot), **standing_entries(robot),
    }  # fmt: skip
    known = [one.name for one in spreads_of(validate(table, Sidecar, format=FORMAT))]
    kept = [k for k, name in enumerate(names) if name in known]
    among = covariance[np.ix_(kept, kept)]
    deviation = np.sqrt(np.diag(among))
    matrix = np.clip(among / np.outer(deviation, deviation), -1.0, 1.0)
    matrix = 0.5 * (matrix + matrix.T)
    np.fill_diagonal(matrix, 1.0)
    told, parts = [names[k] for k in kept], [matrix]
    others = [name for name in known if name not in told]
    before = robot.posterior.among(others) if robot.posterior is not None else None
    if before is not None:
        told += before.names
        parts.append(np.array(before.correlation))
    table["posterior"] = {"names": told, "correlation": block_diag(*parts).tolist()}
    document.update(table)
    return tomlkit.dumps(document)
