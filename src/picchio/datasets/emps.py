"""EMPS, the electro-mechanical positioning system: a DC motor on a ball screw, one slide.

A. Janot, M. Gautier, M. Brunot, *Data Set and Reference Models of EMPS*, Nonlinear System
Identification Benchmarks, 2019. Files from a mirror of the benchmark.

- The joint is called `slide` and is prismatic: metres and newtons.
- The force is gtau * vir, with gtau = 35.15 N/V and the drive command vir in volts, limited to
  10 V. The encoder sits on the motor: `motor_position`, in metres of the slide.
- TRAP: `pulses_N` of the second file are not newtons. They are a square wave of 5 *volts*
  (176 N), and vir holds them already; nothing is added here.
- The control law vir = kp kv (qg - qm) - kv dq/dt (+ pulses) is in `[controller]`.
- Published values: mass 95.1089 kg, viscous friction 203.50 N s/m, Coulomb friction 20.39 N,
  offset -3.16 N; the authors say that the friction is asymmetric.
- The repository that mirrors it is under Apache-2.0; the original says "freely available
  benchmark", without a licence text.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record
from picchio.core.arrays import FloatArray
from picchio.datasets.fetch import Dataset, RemoteFile, load_variables

_HOME = "examples/EMPS/data/"
DATASET = Dataset(
    name="emps",
    repository="forgi86/sysid-neural-continuous",
    commit="956aa7ecd73061b0321c6f6098d74c9e4a7ce67a",
    licence="Apache-2.0 (the mirror's)",
    cite="A. Janot, M. Gautier, M. Brunot, Data Set and Reference Models of EMPS, 2019",
    files={
        "DATA_EMPS.mat": RemoteFile(
            _HOME + "DATA_EMPS.mat",
            "6cf6814ae14618795da0101aae2bb97ff0c6351b0501b5492751b02b07facf7e",
        ),
        "DATA_EMPS_PULSES.mat": RemoteFile(
            _HOME + "DATA_EMPS_PULSES.mat",
            "0eab75bb1f6b16228ee78791343a88bf9bfd9a51036ac9807d7b5fc11c0e1704",
        ),
    },
)
JOINT = "slide"
_UNITS = {f"motor_position.{JOINT}": "m", f"reference_position.{JOINT}": "m",
          f"torque.{JOINT}": "N"}  # fmt: skip
_NOTES = {
    "DATA_EMPS.mat": "training",
    "DATA_EMPS_PULSES.mat": "validation; pulses of 5 V (176 N) are part of the drive force",
}


def build(files: Mapping[str, Path]) -> Campaign:
    """The campaign: one motion record a file."""
    records = []
    controller: dict[str, object] = {}
    for name, path in files.items():
        raw = _read(path)
        gain = float(raw["gtau"][0])
        controller = {
            "law": "voltage = kp * kv * (reference_position - motor_position) "
            "- kv * motor_velocity; force = gtau * voltage",
            "kp": float(raw["kp"][0]),  # 1/s
            "kv": float(raw["kv"][0]),  # V s/m
            "gtau": gain,  # N/V
            "voltage_limit": 10.0,
        }
        channels = {
            f"motor_position.{JOINT}": raw["qm"],
            f"reference_position.{JOINT}": raw["qg"],
            f"torque.{JOINT}": gain * raw["vir"],
        }
        records.append(
            Record.from_arrays(
                f"{Path(name).stem.lower()}.csv",
                raw["t"],
                channels,
                units=_UNITS,
                kind="motion",
                notes=_NOTES[name],
            )
        )
    return Campaign.from_records(
        records, robot="emps", controller=controller, notes=__doc__, provenance=DATASET.provenance()
    )


def _read(path: Path) -> dict[str, FloatArray]:
    found = load_variables(path, ("t", "qg", "qm", "vir", "kp", "kv", "gtau"))
    return {key: np.ravel(value).astype(np.float64) for key, value in found.items()}
