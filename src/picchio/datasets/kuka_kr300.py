"""KUKA KR 300 R2500 ultra: three motions of 10 s at 250 Hz, with encoders on both sides.

J. Weigand, J. Ulmen, A. Janot et al., TU Kaiserslautern (the authors' own repository, MIT).
Trajectory A was meant for identification, B and C for validation. Payload about 151 kg.

What is handled here:

- `motor_position` is the motor's angle over the gear ratio. `position` and `velocity` are the
  second encoder's, on the link side; only axes 1 to 3 have one: for axes 4 to 6 the file holds
  zeros, and no channel is made of them. Those axes have their motor side alone.
- Torques are stored at the motor, N m; `torque` is times the gear ratio (257, 267, 252, 221,
  240, 154), which leaves the rotor's own inertia in it (`para.J_mr`, about 0.01 kg m^2 each,
  times the square of the ratio at the joint: 600 to 850 kg m^2).
- The files count axes 2 and 3 from the stretched arm's pose: -90 and +90 deg are added, so that
  positions are those of this project's `kuka_kr300_r2500`. That robot has no payload.
- Axis 2 has a hydraulic counterbalance, which no rigid-body model of the arm alone explains.

What is left as it is, being a cause and no trap: the constant offset between the encoders, which
jumps between records (a nuisance by the contract), and the second encoder's delay of about 3 ms.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.datasets.fetch import Dataset, RemoteFile, load_variables

_HASHES = {
    "A": "4c152c5b7f2c899731fdeebcf0d011cc103df72be19fac160caf47aa9b73ab75",
    "B": "edeb35f65c4ec4bb697e757fc1e4e9668551b6fe7b2c3dbbb526d040dd8d5ce7",
    "C": "c5d5688521ece941e6c4afd39643a01cd36ae8c7790342640277f8b15b5515b4",
}
DATASET = Dataset(
    name="kuka-kr300",
    repository="JonasWeigand/Robot_Identification",
    commit="9e403c07d9dadbb391a9f3921e8d219f714636a8",
    licence="MIT",
    cite="J. Weigand et al., github.com/JonasWeigand/Robot_Identification",
    files={
        f"kr300_traj_{letter}.mat": RemoteFile(
            f"data/recorded_trajectories/2020-10-21 10s FF {letter} 08ms/data.mat", sha256
        )
        for letter, sha256 in _HASHES.items()
    },
)
JOINTS = tuple(f"joint_a{axis}" for axis in range(1, 7))
SECOND_ENCODER = JOINTS[:3]
_ZERO = np.deg2rad([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])


def build(files: Mapping[str, Path]) -> Campaign:
    """The campaign: one motion record a trajectory."""
    records = [_record(path, name.removesuffix(".mat")[-1]) for name, path in files.items()]
    return Campaign.from_records(
        records,
        robot="kuka_kr300_r2500",
        notes=__doc__,
        provenance=DATASET.provenance(),
    )


def _record(path: Path, letter: str) -> Record:
    found = load_variables(path, ("rec", "para"))
    recorded, parameters = found["rec"], found["para"]
    try:
        ratio = np.asarray(parameters.u, dtype=np.float64)
        link = np.deg2rad(recorded.act_pos_se_deg)
        link_velocity = np.deg2rad(recorded.act_vel_se_deg_per_s)
        motor = np.deg2rad(recorded.act_pos_mot_deg)
        reference = np.deg2rad(recorded.ref_pos_deg)
        torque = np.asarray(recorded.act_torque_abs_nm, dtype=np.float64)
        time = np.asarray(recorded.time_cont, dtype=np.float64)
    except AttributeError as error:
        raise InputError(f"is not as expected: {error}", file=path) from None
    channels: dict[str, FloatArray] = {}
    for axis, joint in enumerate(JOINTS):
        if joint in SECOND_ENCODER:
            channels[f"position.{joint}"] = link[axis] + _ZERO[axis]
            channels[f"velocity.{joint}"] = link_velocity[axis]
        channels[f"motor_position.{joint}"] = motor[axis] + _ZERO[axis]
        channels[f"reference_position.{joint}"] = reference[axis] + _ZERO[axis]
        channels[f"torque.{joint}"] = torque[axis] * ratio[axis]
    used = "identification" if letter == "A" else "validation"
    return Record.from_arrays(
        f"trajectory_{letter.lower()}.csv", time, channels,
        kind="motion", notes=f"trajectory {letter}, meant for {used} by the authors",
    )  # fmt: skip
