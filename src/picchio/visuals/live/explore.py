"""`picchio.explore`: drag the tool, see envelopes and life change."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping
from dataclasses import replace
from html import escape
from io import BytesIO
from pathlib import Path
from typing import Any, ClassVar

from matplotlib.axes import Axes

from picchio.core.errors import InputError
from picchio.core.provenance import provenance
from picchio.core.results import Result
from picchio.model.model import Model, ModelLike
from picchio.studies.default_task import TaskLike, task_of
from picchio.studies.instant import Place
from picchio.studies.tasks import Task
from picchio.visuals.live.page import live_html
from picchio.visuals.live.server import Server
from picchio.visuals.live.session import FORMAT, Session
from picchio.visuals.plots.style import BLUE, PAPER, blank_figure
from picchio.visuals.scene.portrait import Arrow, plot_pose


class Explorer(Result):
    """A robot that answers while it is moved, in a page of this machine's browser.

    Attributes:
        url: of the page.
        session: where the arm stands now, and what that does to it.
    """

    PLOTS: ClassVar = {"robot": "visuals.live.explore:plot_explored"}
    LACKS: ClassVar = {"to_frame": "its values change: see `to_dict`"}

    def __init__(self, session: Session) -> None:
        self.session = session
        self._server = Server(session, live_html(session))
        self._server.start()
        self.url = self._server.url

    @property
    def alive(self) -> bool:
        """Whether it still answers."""
        return self._server.alive

    @property
    def task(self) -> Task:
        """The place that is on the screen, as a task for `picchio.assess`."""
        return self.session.place.task

    def close(self) -> None:
        """End it; the page says that it has ended."""
        self._server.stop()

    def show(self, **_: Any) -> Explorer:
        """Itself: in a notebook the cell shows it."""
        return self

    def _headline(self) -> str:
        pose = ", ".join(f"{q:.4g}" for q in self.session.place.pose)
        return f"{self.session.robot.name!r} at ({pose}), {self.url}"

    def _content(self) -> Mapping[str, Any]:
        robot = self.session.robot
        for _ in self.session.settle():
            pass
        values = self.session.values(settled=True)
        return {
            "format": FORMAT,
            "robot": robot.name,
            **values,
            # Of the model that was asked about: the extended one where there is one.
            **list(values["models"].values())[-1],
            "provenance": provenance([*robot.files]),
        }

    def _repr_html_(self) -> str:
        # Where the page cannot be had (the kernel has ended, or runs elsewhere) a browser shows
        # what stands within the object instead: the robot as it stood, and why.
        self._server.framed = True
        name, url = escape(self.session.robot.name), escape(self._server.address)
        return (
            f'<object title="{name}" type="text/html" data="{url}" '
            'style="display:block;width:100%;height:640px">'
            f'<p><strong>{name}</strong> is live at <a href="{url}">{url}</a> while its kernel '
            "runs, in a browser on the kernel's machine, or on a JupyterHub that has "
            "jupyter-server-proxy. Run the cell again to explore it; "
            "<code>picchio.view</code> makes a page that needs no kernel.</p>"
            f'<img src="{self._picture()}" style="max-width:100%" '
            f'alt="{name} at the pose explored; the arrow is the force">'
            "</object>"
        )

    def _picture(self) -> str:
        """The robot and the force where they stand now, as a PNG's data URL."""
        axes = plot_explored(self, blank_figure(4.0, 3.2))
        stream = BytesIO()
        figure = axes.get_figure(root=True)
        assert figure is not None
        figure.savefig(stream, format="png", dpi=100, facecolor=PAPER)
        return f"data:image/png;base64,{b64encode(stream.getvalue()).decode('ascii')}"


def plot_explored(found: Explorer, ax: Axes | None = None) -> Axes:
    """The robot and the force where they stand now.

    Args:
        found: the explorer.
        ax: where to draw.
    """
    place = found.session.place
    force = Arrow(place.direction, "", "comes", BLUE)
    return plot_pose(found.session.robot, place.pose, [force], ax)


def explore(
    robot: ModelLike,
    *,
    task: TaskLike = None,
    model: ModelLike | None = None,
    flex: str | Path | None = None,
    tool: str | None = None,
    save: str | Path | None = None,
) -> Explorer:
    """Explore a robot by hand: drag its tool or turn its joints, and see its life change.

    A server on 127.0.0.1 shows the page and answers; nothing leaves this machine. In Jupyter the
    cell shows it, as long as the kernel runs on the machine of the browser; on a JupyterHub through
    jupyter-server-proxy, which must be installed there.

    Args:
        robot: the robot, its name or file, or a model of it. The nominal model stands beside a
            model that has effects.
        task: where to begin: its first pose, direction and blows; the robot's example if None.
        model: an extended model of the same robot, as `picchio diagnose --model` writes it.
        flex: sidecar of the robot.
        tool: the frame that carries the tool.
        save: the task file that a click puts the pose into; ROBOT-explored.toml if None.

    Returns:
        the explorer: its `url`, its `task` as it stands on the screen, `close()` to end it.

    Raises:
        InputError: a file that cannot be read, no flexible joint, a model of another robot.
    """
    models = _models(Model.of(robot, flex=flex, tool=tool), model)
    arm = models["nominal"].robot
    first = task_of(arm, task).operations[0]
    place = Place(first.poses[0], first.direction, first.excitation, first.hits_per_rivet)
    file = Path(save) if save is not None else Path(f"{_plain(arm.name)}-explored.toml")
    return Explorer(Session(models, place, file))


def _models(given: Model, extended: ModelLike | None) -> dict[str, Model]:
    """The nominal model, and the extended one where there is one."""
    bare = replace(given.robot, effect_tables=())
    nominal = Model(bare, given.gravity_stiffness, given.gravity_balanced)
    if extended is None:
        return {"nominal": nominal} | ({"extended": given} if given.effects else {})
    other = Model.of(extended)
    if other.robot.joint_names != bare.joint_names or (
        other.robot.flexible_names != bare.flexible_names
    ):
        raise InputError("is of another robot: its joints are not the same", key="model",
                         value=other.robot.name, choices=[bare.name])  # fmt: skip
    return {"nominal": nominal, "extended": other}


def _plain(name: str) -> str:
    """A name that can be a file's."""
    return "".join(c if c.isalnum() or c in "-_" else "_" for c in name) or "robot"
