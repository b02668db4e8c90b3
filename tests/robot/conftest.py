"""Small URDFs to spoil, bend and compare."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

ARM = """<?xml version="1.0"?>
<robot name="arm">
  <link name="base"/>
  <joint name="a" type="revolute">
    <parent link="base"/><child link="upper"/>
    <origin xyz="0 0 0.3" rpy="0.1 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="100" velocity="1"/>
  </joint>
  <link name="upper">
    <inertial><origin xyz="0.2 0.01 0" rpy="0 0.2 0"/><mass value="8"/>
      <inertia ixx="0.1" ixy="0.01" ixz="0" iyy="0.3" iyz="0" izz="0.3"/></inertial>
  </link>
  <joint name="b" type="continuous">
    <parent link="upper"/><child link="lower"/>
    <origin xyz="0.5 0 0" rpy="0 0 0.4"/><axis xyz="0 0.6 0.8"/>
  </joint>
  <link name="lower">
    <inertial><origin xyz="0.15 0 0.02"/><mass value="5"/>
      <inertia ixx="0.05" ixy="0" ixz="0.01" iyy="0.15" iyz="0" izz="0.12"/></inertial>
  </link>
  <joint name="c" type="prismatic">
    <parent link="lower"/><child link="slide"/>
    <origin xyz="0.4 0 0"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="0.3" effort="500" velocity="1"/>
  </joint>
  <link name="slide">
    <inertial><origin xyz="0.05 0 0"/><mass value="3"/>
      <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.03"/></inertial>
  </link>
  <joint name="end" type="fixed">
    <parent link="slide"/><child link="tip"/><origin xyz="0.1 0 0"/>
  </joint>
  <link name="tip"/>
</robot>
"""

SIDECAR = """format = "picchio-sidecar/1"
[joint.a]
stiffness = 2e4
damping_ratio = 0.02
source = "a test"
[joint.b]
stiffness = 1e4
[joint.c]
stiffness = 5e5
"""


@pytest.fixture
def arm_text() -> str:
    return ARM


@pytest.fixture
def sidecar_text() -> str:
    return SIDECAR


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str, str], Path]:
    """Write a text to a file in a folder of this test's own."""

    def writer(name: str, text: str) -> Path:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return path

    return writer


@pytest.fixture
def arm(write) -> Path:
    return write("arm.urdf", ARM)


@pytest.fixture
def flex(write) -> Path:
    return write("flex.toml", SIDECAR)
