"""What a workspace map found: where each joint is worst, and which joint limits how much of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from picchio.core.html import sheet
from picchio.core.results import TableResult
from picchio.robot.units import column, units_of
from picchio.vibration.closed_form.response import described

if TYPE_CHECKING:
    import pandas
    import xarray

_SLICE = 1_000_000


def joint_kinds(found: xarray.Dataset) -> list[str]:
    """The kind of each joint of a map: "revolute" or "prismatic".

    Args:
        found: the map.
    """
    turning = ["revolute"] * found.sizes["joint"]  # older maps do not say
    return [str(kind) for kind in np.atleast_1d(found.attrs.get("joint_kinds", turning))]


def response_of(dataset: xarray.Dataset) -> str:
    """Whether a map is of the steady state or of so many hits from rest, for people.

    Args:
        dataset: of a map.
    """
    return described(int(dataset.attrs.get("hits", 0)) or None)


@dataclass(frozen=True, eq=False, repr=False)
class WorkspaceMap(TableResult):
    """A map on disk, opened lazily; close it, or use it in a `with` block.

    Attributes:
        dataset: `position`, `pose`, `natural_frequency`, `peak_deflection`, `worst_direction` and
            more, a row a point and branch; units in attrs.
        path: the file.
    """

    dataset: xarray.Dataset
    path: Path

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self.dataset.close()

    def to_xarray(self) -> xarray.Dataset:
        """The whole map, read as it is used."""
        return self.dataset

    def to_frame(self) -> pandas.DataFrame:
        """The joints' largest values, a row a joint; the map itself is `to_xarray()`."""
        import pandas

        return pandas.DataFrame(self._content()["joints"]).set_index("name")

    def _headline(self) -> str:
        attrs = self.dataset.attrs
        return f"{attrs['robot']!r}: {self.dataset.sizes['point']} poses in {self.path}"

    def _repr_html_(self) -> str:
        content = self._content()
        joints = content["joints"]
        units = [units_of(j["kind"]) for j in joints]
        small, peaks = column([u.small for u in units],
                              [f"{1e3 * j['peak_deflection']:.4g}" for j in joints])  # fmt: skip
        load, torques = column([u.load for u in units],
                               [f"{j['peak_torque']:.4g}" for j in joints])  # fmt: skip
        columns = ("joint", f"largest deflection [{small}]", f"torque there [{load}]",
                   "stress there [MPa]", "where [m]", "limits [poses]")  # fmt: skip
        rows = [
            (j["name"], peaks[k], torques[k], 1e-6 * j["peak_shear_stress"], j["position"],
             j["limits_poses"])
            for k, j in enumerate(joints)
        ]  # fmt: skip
        facts = {
            key: content[key] for key in ("file", "excitation", "response", "direction", "poses")
        }
        return sheet(f"Workspace map of {content['robot']}", facts, columns, rows)

    def _content(self) -> dict[str, Any]:
        """The largest values of every joint and where they are, read a slice at a time."""
        found = self.dataset
        count = int(found.sizes["point"])
        names = [str(name) for name in found["joint"].values]
        best: list[dict[str, Any]] = [
            {"name": name, "kind": kind, "peak_deflection": -1.0}
            for name, kind in zip(names, joint_kinds(found), strict=True)
        ]
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
                for entry, damage in zip(best, part["damage_per_rivet"].values.T, strict=True):
                    if np.isfinite(damage).any():
                        largest = float(damage[np.isfinite(damage)].max())
                        entry["damage_per_rivet"] = max(entry.get("damage_per_rivet", 0.0), largest)
        for entry, poses in zip(best, limits, strict=True):
            entry["limits_poses"] = int(poses)
        attrs = found.attrs
        return {
            "format": "picchio-map/1",
            "robot": attrs["robot"],
            "file": self.path,
            "excitation": attrs["excitation"],
            "direction": attrs["direction"],
            "hits": int(attrs["hits"]) or None,
            "response": response_of(found),
            "hits_of_damage": int(attrs["hits_of_damage"]) or None,
            "poses": count,
            "joints": best,
            "notes": [str(note) for note in np.atleast_1d(attrs["notes"]) if str(note)],
        }
