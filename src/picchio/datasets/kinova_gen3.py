"""Kinova Gen3, 7 joints with harmonic drives: each joint alone, and three motions of all.

github.com/SedkiLmm/dynamic-identification, MIT, (c) 2024 Wissem Chiha. Upstream documents
neither units nor rate nor payload; what follows was inferred from the data.

What is handled here:

- `Time` counts samples; one sample is taken as 1 ms (positions and velocities say 1.002 ms).
- TRAP: `Torque1..7` look like a sensor's but are a model's output; `TorqueSm` is simulated or
  zero, `TorqueCmptd` zero. None of them is loaded. `torque` is `TorqueCur`, the motor current
  times 9.13 (joints 1 to 4) or 5.852 N m/A (5 to 7), friction included.
- TRAP: the commanded values (`*Cmptd`) are zeros for joints that rest, and memory that was never
  written (up to 1e148) in joint_5_trapez: none of them is loaded.
- There is one encoder a joint: `position`. What the joints' compliance does shows in the current
  alone: joint 2 rings at about 6 Hz.
- The robot is this project's `kinova_gen3`, whose joints stand where those of the authors' URDF do
  (`exemple/kinova/gen3.urdf`); that has other inertias in the shoulder and half of the arm.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np

from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.datasets.fetch import Dataset, RemoteFile, content

_JOINTWISE = "data/kinova/jointwise_motion/"
_ALL = "data/kinova/identification_data/"
_FILES = (
    f"{_ALL}RecordTrajectory_quadratic.csv",
    f"{_ALL}RunTrajectory1.csv",
    f"{_ALL}Trajectory1.csv",
    *(f"{_JOINTWISE}joint_{joint}_trapez.csv" for joint in range(1, 8)),
)
_HASHES = (
    "82b68faf7b12f73f83e82acb6b6660b5cae28c702058f58269c87718f7ee9ed7",
    "2389fbfa1149c7d8884a8a7433fdeaf4cd655f781ae2a8cbb9562a7101e309df",
    "3a90a0ed7b88daafd1eb349e08a1a3d50b91cacc000aa7f587016268af76c7e6",
    "c83dda00c4e42494227ed7ff0e7a5ca06cf65a11d661b41a01b756f448b8ac98",
    "03395d0eab42fced8a31bed09f3dfe89a3c471751f364590c48a9ac5a1a926be",
    "18eea5bcfd48c2f7d9b315f098db2cd8efd391e2ea9c39559882b738eb3d334e",
    "2f981fd8c9ddd2aaed3631ff064c0cc0cadd118bbfa40f5ca03162cc41a50be5",
    "b94a0f4c932ab749e7a8de6cb617ceba0b6571cf138cba6713f36215fc4b7bc7",
    "7f928b34a9402bb2afa01f9cdd5ec863b8af4e239bbad16e9eee327dffac75c1",
    "e3589c3713b3def2a13f06bc6b972c4c29c2e1e83573f94880d741e5de794c43",
)
DATASET = Dataset(
    name="kinova-gen3",
    repository="SedkiLmm/dynamic-identification",
    commit="ff2f3becf7b0f25d4959491404844a29a27d286b",
    licence="MIT",
    cite="W. Chiha, github.com/SedkiLmm/dynamic-identification, 2024",
    files={
        path.rpartition("/")[2]: RemoteFile(path, sha256)
        for path, sha256 in zip(_FILES, _HASHES, strict=True)
    },
)
JOINTS = tuple(f"joint_{joint}" for joint in range(1, 8))
_COLUMNS = {"position": "Position", "velocity": "Velocity", "torque": "TorqueCur",
            "temperature": "Temp"}  # fmt: skip
_STEP = 1e-3


def build(files: Mapping[str, Path]) -> Campaign:
    """The campaign: one motion record a file, each read when it is first used."""
    names = [f"{kind}.{joint}" for kind in _COLUMNS for joint in JOINTS]
    records = []
    for name in DATASET.files:
        read = partial(_read, files[name])
        records.append(
            Record.from_function(name.lower(), names, read, kind="motion", notes=_note(name))
        )
    return Campaign.from_records(
        records,
        robot="kinova_gen3",
        tool="tool0",
        notes=__doc__,
        provenance=DATASET.provenance(),
    )


def _note(name: str) -> str:
    return f"{name.split('_trapez')[0]} alone" if "trapez" in name else "all joints"


def _read(path: Path) -> dict[str, FloatArray]:
    lines = content(path).decode("utf-8", errors="replace").splitlines()
    header = [cell.strip() for cell in lines[0].split(",")] if lines else []
    wanted = {f"{kind}.{joint}": f"{column}{number}" for kind, column in _COLUMNS.items()
              for number, joint in enumerate(JOINTS, start=1)}  # fmt: skip
    wanted["time"] = "Time"
    missing = [column for column in wanted.values() if column not in header]
    if missing:
        raise InputError("the column is missing", file=path, value=missing[0])
    try:
        columns = [header.index(column) for column in wanted.values()]
        table = np.loadtxt(lines[1:], delimiter=",", usecols=columns)
    except ValueError as error:
        raise InputError(f"is not the table expected: {error}", file=path) from None
    found = dict(zip(wanted, np.atleast_2d(table).T, strict=True))
    found["time"] = found["time"] * _STEP
    return found
