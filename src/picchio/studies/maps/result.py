"""What a workspace map found: where each joint is worst, and which joint limits how much of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from picchio.core import spoken
from picchio.core.errors import InputError
from picchio.core.listing import InUnit, Key, Listing
from picchio.core.results import TableResult
from picchio.robot.units import units_of
from picchio.studies.maps.chunk import LEVELS
from picchio.studies.maps.stored import attribute_of, values_of
from picchio.vibration.closed_form.response import described

if TYPE_CHECKING:
    import pandas
    import xarray

_SLICE = 1_000_000
_BANDS = ("peak_deflection_quantiles", "peak_torque_quantiles")


def joint_kinds(found: xarray.Dataset) -> list[str]:
    """The kind of each joint of a map: "revolute" or "prismatic".

    Args:
        found: the map.

    Raises:
        InputError: a damaged map.
    """
    joints = len(values_of(found, "joint", 1))
    if "joint_kinds" not in found.attrs:
        return ["revolute"] * joints  # older maps do not say
    kinds: list[str] = attribute_of(found, "joint_kinds", list)
    if len(kinds) != joints or not {"revolute", "prismatic"}.issuperset(kinds):
        raise _damaged(found, "joint_kinds")
    return kinds


def _count(found: xarray.Dataset) -> int:
    """How many poses a map has, at least one."""
    if "peak_deflection" not in found or found["peak_deflection"].size == 0:
        raise _damaged(found, "peak_deflection")
    return int(found["peak_deflection"].shape[0])


def _damaged(found: xarray.Dataset, name: str) -> InputError:
    return InputError("is a damaged map: values that cannot be",
                      file=found.encoding.get("source"), key=name)  # fmt: skip


def response_of(dataset: xarray.Dataset) -> str:
    """Whether a map is of the steady state or of so many hits from rest, for people.

    Args:
        dataset: of a map.

    Raises:
        InputError: a damaged map.
    """
    return described(attribute_of(dataset, "hits", int) or None)


@dataclass(frozen=True, eq=False, repr=False)
class WorkspaceMap(TableResult):
    """A map on disk, opened lazily; close it, or use it in a `with` block.

    Attributes:
        dataset: `position`, `pose`, `natural_frequency`, `peak_deflection`, `worst_direction` and
            more, a row a point and branch; units in attrs.
        path: the file.
    """

    PLOTS: ClassVar = {"map": "visuals.plots.results:plot_map"}

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
        """The joints' largest values, a row a joint; the map itself is `to_xarray()`.

        Of an estimated robot also the quantiles where a joint's P90 is largest, rad and N m (m
        and N of slides), in columns such as `peak_torque_p10`.
        """
        import pandas

        rows = [
            {key: value for key, value in joint.items() if key != "estimate"}
            | {
                f"{key}_{level.lower()}": value
                for key in ("peak_deflection", "peak_torque")
                for level, value in joint.get("estimate", {}).get(key, {}).items()
            }
            for joint in self._content()["joints"]
        ]
        return pandas.DataFrame(rows).set_index("name")

    def _seen(self) -> Mapping[str, Any]:
        seen = super()._seen()
        if not seen:
            return seen
        worst = max(self._content()["joints"], key=lambda joint: joint["peak_deflection"])
        return {**seen, "workspace": self, "pose": worst["pose"], "joint": worst["name"]}

    def _headline(self) -> str:
        robot = attribute_of(self.dataset, "robot")
        return f"{robot!r}: {_count(self.dataset)} poses in {self.path}"

    def _listing(self) -> Listing:
        content = self.to_dict()
        worst = max(content["joints"], key=lambda joint: float(joint["peak_deflection"]))
        size = f"{1e3 * worst['peak_deflection']:.4g} {units_of(worst['kind']).small}"
        facts = ("file", "excitation", "response", "direction", "poses")
        return replace(
            listing_of(content),
            facts={key: content[key] for key in facts},
            note=". ".join(content["notes"]),
            head=f"{content['poses']} poses; {worst['name']} most, {size}",
        )

    def _likely(self, best: list[dict[str, Any]], first: int, rows: slice) -> None:
        """Of an estimated robot, where each joint's P90 is largest: its quantiles there."""
        found = self.dataset
        ends, torque = (values_of(found, name, 3, rows) for name in _BANDS)
        for name, values in zip(_BANDS, (ends, torque), strict=True):
            if values.shape[1:] != (len(best), len(LEVELS)) or np.isnan(values).any():
                raise _damaged(found, name)
        for j, entry in enumerate(best):
            k = int(ends[:, j, -1].argmax())
            before = entry.get("estimate")
            if before is None or ends[k, j, -1] > before["peak_deflection"]["P90"]:
                row = slice(first + k, first + k + 1)
                entry["estimate"] = {
                    "peak_deflection": dict(zip(LEVELS, ends[k, j].tolist(), strict=True)),
                    "peak_torque": dict(zip(LEVELS, torque[k, j].tolist(), strict=True)),
                    "position": values_of(found, "position", 2, row)[0],
                    "pose": values_of(found, "pose", 2, row)[0],
                }

    def _content(self) -> dict[str, Any]:
        """The largest values of every joint and where they are, read a slice at a time."""
        found = self.dataset
        names = [str(name) for name in values_of(found, "joint", 1)]
        best: list[dict[str, Any]] = [
            {"name": name, "kind": kind, "peak_deflection": -1.0}
            for name, kind in zip(names, joint_kinds(found), strict=True)
        ]
        limits = np.zeros(len(names), dtype=int)
        count = _count(found)

        def read(name: str, rows: slice) -> NDArray[Any]:
            values = values_of(found, name, 2, rows)
            if values.shape[1] != len(names):
                raise _damaged(found, name)
            return values

        for first in range(0, count, _SLICE):
            rows = slice(first, first + _SLICE)
            peaks = read("peak_deflection", rows)
            limiting = values_of(found, "limiting_joint", 1, rows)
            if np.isnan(peaks).any() or not np.isin(limiting, np.arange(len(names))).all():
                raise _damaged(found, "peak_deflection" if np.isnan(peaks).any() else
                               "limiting_joint")  # fmt: skip
            limits += np.bincount(limiting.astype(int), minlength=len(names))
            for j, entry in enumerate(best):
                k = int(peaks[:, j].argmax())
                if peaks[k, j] > entry["peak_deflection"]:
                    row = slice(first + k, first + k + 1)
                    entry |= {
                        "peak_deflection": float(peaks[k, j]),
                        "peak_torque": float(read("peak_torque", row)[0, j]),
                        "peak_shear_stress": float(read("peak_shear_stress", row)[0, j]),
                        "position": values_of(found, "position", 2, row)[0],
                        "pose": values_of(found, "pose", 2, row)[0],
                        "worst_direction": values_of(found, "worst_direction", 3, row)[0, j],
                    }
            if _BANDS[0] in found:
                self._likely(best, first, rows)
            if "damage_per_rivet" in found:
                for entry, damage in zip(best, read("damage_per_rivet", rows).T, strict=True):
                    if np.isfinite(damage).any():
                        largest = float(damage[np.isfinite(damage)].max())
                        entry["damage_per_rivet"] = max(entry.get("damage_per_rivet", 0.0), largest)
        for entry, poses in zip(best, limits, strict=True):
            entry["limits_poses"] = int(poses)
        return {
            "format": "picchio-map/1",
            "robot": attribute_of(found, "robot"),
            "file": self.path,
            "excitation": attribute_of(found, "excitation"),
            "direction": attribute_of(found, "direction"),
            "hits": attribute_of(found, "hits", int) or None,
            "response": response_of(found),
            "hits_of_damage": attribute_of(found, "hits_of_damage", int) or None,
            "poses": count,
            "joints": best,
            "estimated": bool(found.attrs.get("estimated", 0)),
            "notes": [note for note in attribute_of(found, "notes", list) if note],
        }


def listing_of(content: Mapping[str, Any]) -> Listing:
    """Where each joint is deflected most, and how often it limits the robot.

    Args:
        content: of a map, as JSON has it.

    Returns:
        a row a joint.
    """
    joints = content["joints"]
    # Stresses rank joints; of drives, shares of what they bear; else torques.
    stressed = [joint["peak_shear_stress"] is not None for joint in joints]
    limit = "most stress" if all(stressed) else "most torque"
    if content["estimated"]:
        limit = "nearest to its limit"

    def told(joint: Mapping[str, Any], key: str, scale: float) -> float | str:
        if "estimate" not in joint:
            return float(scale * joint[key])
        ends = joint["estimate"][key]
        return spoken.between((scale * ends["P10"], scale * ends["P90"]))

    def small(joint: Mapping[str, Any]) -> InUnit:
        return InUnit(told(joint, "peak_deflection", 1e3), units_of(joint["kind"]).small)

    def load(joint: Mapping[str, Any]) -> InUnit:
        return InUnit(told(joint, "peak_torque", 1.0), units_of(joint["kind"]).load)

    columns: dict[str, Key] = {
        "joint": "name",
        "largest deflection": small,
        "torque there": load,
    }
    if any(stressed):
        columns["stress there [MPa]"] = lambda j: _scaled(j["peak_shear_stress"], 1e-6)
    columns["where [m]"] = lambda j: ", ".join(
        f"{round(c, 3) + 0.0:.3f}" for c in j.get("estimate", j)["position"]
    )
    columns[f"{limit} [% of poses]"] = lambda j: f"{100 * j['limits_poses'] / content['poses']:.1f}"
    if content["hits_of_damage"]:
        columns["damage of a rivet, at most"] = lambda j: spoken.number(
            j.get("damage_per_rivet"), least=0.0
        )
    return Listing.of(f"Workspace map of {content['robot']}", joints, columns)


def _scaled(value: float | None, scale: float) -> float | None:
    return None if value is None else scale * value
