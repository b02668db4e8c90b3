"""The stick figure of a report: every cause's name can be read, wherever its joint stands."""

import numpy as np
import pytest

import picchio
from picchio.visuals.plots.diagnosis import plot_place
from picchio.visuals.plots.style import blank_figure

NAMES = ("joint_stiffness", "joint_damping")


@pytest.mark.parametrize("robot", ["fanuc_like_3dof", "ur10"])
@pytest.mark.parametrize("lean", [-0.9, 0.0, 0.9])
def test_no_name_leaves_the_picture(robot, lean):
    arm = picchio.load_robot(robot)
    pose = np.full(len(arm.joint_names), 0.3)
    pose[1] = lean
    for joint in arm.flexible_names:
        causes = [(name, joint) for name in NAMES]
        ax = plot_place(arm, pose, causes, blank_figure(3.7, 3.9), direction=(1.0, 0.0, 0.0))
        figure = ax.figure
        figure.canvas.draw()
        page = figure.bbox
        named = [text for text in ax.texts if text.get_text()]
        # Both are at the same joint: they share a text.
        assert [text.get_text() for text in named] == ["joint stiffness\njoint damping"]
        for text in named:
            place = text.get_window_extent()
            inside = (page.x0 <= place.x0, place.x1 <= page.x1)
            assert all(inside), (joint, text.get_text(), place, page)
