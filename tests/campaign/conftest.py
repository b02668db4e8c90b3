"""A small campaign on disk that tests may break, and the data sets."""

import numpy as np
import pytest

from picchio.campaign.campaign import load_campaign
from picchio.campaign.importing.mapping import read_mapping

TABLE = """format = "picchio-campaign/1"
robot = "fanuc_like_3dof"
tool = "tool"
[excitation]
kind = "pulse_train"
force = 300.0
period = 0.040
width = 0.004
hits = 12
[[record]]
file = "r01.csv"
kind = "percussion"
pose = { joint_1 = 0.3, joint_2 = 0.5, joint_3 = -0.8 }
direction = [1.0, 0.0, 0.0]
force = 250.0
time = 2026-03-01T08:00:00Z
temperature = 22.0
[[record]]
file = "r02.csv"
kind = "motion"
"""
PERCUSSION = "time [s],force [N],deflection.joint_1 [rad],accelerometer.tool.x [m/s^2]"
MOTION = "time [s],position.joint_1 [rad],torque.joint_1 [N*m]"


def csv_text(header, columns):
    rows = zip(*(np.asarray(c).tolist() for c in columns), strict=True)
    return header + "\n" + "".join(",".join(map(repr, row)) + "\n" for row in rows)


def write_good(folder):
    folder.mkdir()
    rng = np.random.default_rng(7)
    time = np.arange(-10, 90) / 1024.0
    (folder / "campaign.toml").write_text(TABLE)
    noise = rng.normal(size=(5, time.size)) * [[300.0], [1e-6], [20.0], [0.5], [900.0]]
    (folder / "r01.csv").write_text(csv_text(PERCUSSION, [time, *noise[:3]]))
    (folder / "r02.csv").write_text(csv_text(MOTION, [time, *noise[3:]]))
    return folder


@pytest.fixture
def campaign_folder(tmp_path):
    return write_good(tmp_path / "campaign")


@pytest.fixture
def campaign(campaign_folder):
    return load_campaign(campaign_folder)


MAPPING_HEAD = 'format = "picchio-mapping/1"\n'
MAPPING_RECORD = """[record]
kind = "percussion"
pose = { joint_1 = 0.3, joint_2 = 0.5, joint_3 = -0.8 }
direction = [0.0, 0.0, 1.0]
hits = 12
[campaign]
robot = "fanuc_like_3dof"
excitation = { kind = "pulse_train", force = 300.0, period = 0.04, width = 0.004 }
"""


def mapped(tmp_path, text):
    path = tmp_path / "mapping.toml"
    path.write_text(MAPPING_HEAD + text)
    return read_mapping(path)


@pytest.fixture
def signals():
    rng = np.random.default_rng(3)
    return np.arange(400) / 2048.0, rng.normal(size=(2, 400))
