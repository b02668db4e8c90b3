"""The tree of a URDF, without a model of its dynamics."""

from pathlib import Path

from picchio.robot.urdf.check import read_tree
from picchio.robot.urdf.tree import UrdfTree
from picchio.robot.urdf.xml import parse_urdf, read_urdf_bytes


def load_tree(urdf: Path) -> UrdfTree:
    return read_tree(parse_urdf(read_urdf_bytes(urdf), urdf), urdf)
