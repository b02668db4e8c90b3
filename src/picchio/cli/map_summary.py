"""A map in a few lines: where each joint is worst, and which joint limits how much of it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import xarray

_SLICE = 1_000_000


def summary_of(found: xarray.Dataset, out: Path) -> dict[str, Any]:
    """The largest values of every joint and where they are, read a slice at a time."""
    count = int(found.sizes["point"])
    names = [str(name) for name in found["joint"].values]
    best: list[dict[str, Any]] = [{"name": name, "peak_deflection": -1.0} for name in names]
    limits = np.zeros(len(names), dtype=int)
    for first in range(0, count, _SLICE):
        part = found.isel(point=slice(first, first + _SLICE))
        peaks = part["peak_deflection"].values
        limits += np.bincount(part["limiting_joint"].values, minlength=len(names))
        for j, entry in enumerate(best):
            k = int(peaks[:, j].argmax())
            if peaks[k, j] > entry["peak_deflection"]:
                row = part.isel(point=k)
                entry |= {
                    "peak_deflection": float(peaks[k, j]),
                    "peak_torque": float(row["peak_torque"].values[j]),
                    "peak_shear_stress": float(row["peak_shear_stress"].values[j]),
                    "position": row["position"].values,
                    "pose": row["pose"].values,
                    "worst_direction": row["worst_direction"].values[j],
                }
        if "damage_per_rivet" in part:
            _add_damage(best, part["damage_per_rivet"].values)
    for entry, poses in zip(best, limits, strict=True):
        entry["limits_poses"] = int(poses)
    return {
        "format": "picchio-map/1",
        "robot": found.attrs["robot"],
        "file": str(out),
        "excitation": found.attrs["excitation"],
        "direction": found.attrs["direction"],
        "hits": int(found.attrs["hits"]) or None,
        "hits_of_damage": int(found.attrs["hits_of_damage"]) or None,
        "poses": count,
        "joints": best,
    }


def _add_damage(best: list[dict[str, Any]], damage: Any) -> None:
    for j, entry in enumerate(best):
        known = damage[:, j][np.isfinite(damage[:, j])]
        if len(known):
            entry["damage_per_rivet"] = max(entry.get("damage_per_rivet", 0.0), float(known.max()))


def show(summary: dict[str, Any]) -> None:
    """Print it."""
    from rich import box
    from rich.table import Table

    from picchio.cli.output import console

    out = console()
    out.print(f"[bold]{summary['robot']}[/bold]: {summary['poses']} poses in {summary['file']}")
    hits, counted = summary["hits"], summary["hits_of_damage"]
    when = "steady state" if hits is None else f"{hits} hits from rest"
    along = {"worst": "each joint's worst direction", "normal": "along the surface's normal"}
    out.print(
        f"  {summary['excitation']}; {when}, "
        f"{along.get(summary['direction'], 'along ' + summary['direction'])}"
    )
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("joint")
    # Stresses rank joints; where not every joint has a shaft, torques do.
    shafts = all(np.isfinite(joint["peak_shear_stress"]) for joint in summary["joints"])
    limit = "most stress" if shafts else "most torque"
    heads = ["largest\ndeflection\nmrad", "torque\nthere\nN m", "stress\nthere\nMPa",
             "where\nm", f"{limit},\n% of\nposes"]  # fmt: skip
    for head in heads + (["damage of\na rivet,\nat most"] if counted else []):
        table.add_column(head, justify="right")
    for joint in summary["joints"]:
        stress = joint["peak_shear_stress"]
        cells = [
            f"{1e3 * joint['peak_deflection']:.4g}",
            f"{joint['peak_torque']:.4g}",
            "-" if np.isnan(stress) else f"{stress / 1e6:.4g}",
            ", ".join(f"{c:.3f}" for c in joint["position"].round(3) + 0.0),
            f"{100 * joint['limits_poses'] / summary['poses']:.1f}",
        ]
        if counted:
            damage = joint.get("damage_per_rivet")
            cells.append("-" if damage is None else f"{damage:.3g}")
        table.add_row(joint["name"], *cells)
    out.print(table)
    if counted:
        none = all(joint.get("damage_per_rivet", 0.0) == 0.0 for joint in summary["joints"])
        out.print(
            f"Damage: a rivet of {counted} hits from rest, cycles counted"
            + ("; no stress is beyond an endurance limit, so none does any." if none else ".")
        )
