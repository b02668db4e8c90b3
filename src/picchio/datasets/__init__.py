"""Measured robots that anyone can load: `picchio.datasets.load("emps")`.

| name | robot | records |
|---|---|---|
| `kuka-kr300` | KUKA KR 300 R2500 ultra, encoders on both sides of the gears | 3 motions of 10 s |
| `emps` | a ball-screw axis driven by a DC motor | 2 motions of 25 s |
| `kinova-gen3` | Kinova Gen3, harmonic drives, motor currents | 10 motions of 2 to 7 s |

Each data set's own module documents its pitfalls and how they are handled:
`picchio.datasets.kuka_kr300`, `.emps`, `.kinova_gen3`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from types import MappingProxyType

from picchio.campaign.campaign import Campaign
from picchio.core.errors import InputError
from picchio.datasets.fetch import Dataset, find_files

_HOME = MappingProxyType({"kuka-kr300": "kuka_kr300", "emps": "emps", "kinova-gen3": "kinova_gen3"})

__all__ = ["load", "names"]


def names() -> tuple[str, ...]:
    """The data sets that can be loaded."""
    return tuple(_HOME)


def load(name: str, folder: str | Path | None = None) -> Campaign:
    """A public data set as a campaign of motion records, in memory; `.save(folder)` writes it.

    The files are taken from `folder`; else from `<name>` in the folder that PICCHIO_DATA names;
    else they are downloaded once from the authors' repository, at a fixed commit, into the
    user's cache (needs pooch), and their SHA-256 is verified. A local file of another SHA-256 is
    used, with a warning.

    What is not obvious in the data is handled here:

    - `kuka-kr300`: axes 4 to 6 have no second encoder (the file holds zeros): they have no
      `position`. Torques are stored at the motor and become the joint's by the gear ratio; axes
      2 and 3 count from another zero than the robot's URDF.
    - `emps`: the force is gtau * vir. `pulses_N` are volts, not newtons, and already inside
      `vir`: they are not added again.
    - `kinova-gen3`: `Torque1..7` is a model's output, not a sensor, and is left out; the torque
      is the motor current's. Units, rate and payload are not documented upstream.

    Args:
        name: "kuka-kr300", "emps" or "kinova-gen3".
        folder: where the files are, under their own names or in a sub-folder called `name`.

    Raises:
        InputError: an unknown name, files missing from a folder that was named, no network, or
            a download whose checksum is wrong.
    """
    if name not in _HOME:
        raise InputError("no such data set", key="name", value=name, choices=_HOME)
    module = import_module(f"picchio.datasets.{_HOME[name]}")
    dataset: Dataset = module.DATASET
    build: Callable[[Mapping[str, Path]], Campaign] = module.build
    return build(find_files(dataset, folder))
