"""The campaign that a test plan would give: for planning a test before doing it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from picchio.campaign.campaign import Campaign
from picchio.campaign.channels import Channel
from picchio.campaign.record import Record
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.core.processes import one_thread
from picchio.core.provenance import provenance
from picchio.core.results import TableResult
from picchio.core.shown import seeing
from picchio.model.effects.effect import Effect
from picchio.model.model import Model
from picchio.prediction.percussion import PercussionSetup, percussion_setups
from picchio.prediction.plan import Plan, read_plan
from picchio.robot.dynamics.pose import warn_beyond_limits
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.loading.load import load_robot
from picchio.robot.loading.objects import RobotLike, named

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True, eq=False, repr=False)
class Simulation(TableResult):
    """The campaign that a test plan would give.

    Attributes:
        campaign: as it stands on disk; in memory where nothing was to be written.
        plan: what was simulated.
        robot: its name.
        origin: provenance.
    """

    INDEX = "record"
    PLOTS: ClassVar = {"record": "visuals.plots.results:plot_first_record"}

    campaign: Campaign
    plan: Plan
    robot: str
    origin: dict[str, Any]

    def to_frame(self) -> pandas.DataFrame:
        """A row a record, as of its campaign."""
        return self.campaign.to_frame()

    def _headline(self) -> str:
        blows = "steady state" if self.plan.burst is None else f"{self.plan.burst} blows from rest"
        records = len(self.campaign)
        return (
            f"{records} record{'s' if records != 1 else ''}, {len(self.plan.poses)} poses, "
            f"{sum(self.plan.samples)} samples at {self.plan.sample_rate:g} Hz, {blows}"
        )

    def _repr_html_(self) -> str:
        return self.campaign._repr_html_()

    def _content(self) -> dict[str, Any]:
        first = self.campaign.records[0]
        return {
            "format": "picchio-simulation/1",
            "campaign": self.campaign.folder,
            "robot": self.robot,
            "records": [record.file for record in self.campaign],
            "channels": list(first.channels),
            "samples": sum(self.plan.samples),
            "sample_rate": self.plan.sample_rate,
            "effects": [table.model_dump() for table in self.plan.effect],
            "provenance": self.origin,
        }


@one_thread()
def simulate(
    robot: RobotLike,
    plan: str | Path | Plan | Mapping[str, Any],
    to: str | Path | None = None,
    *,
    flex: str | Path | None = None,
    tool: str | None = None,
    robot_name: str | None = None,
    effects: Sequence[Effect] = (),
    seed: int | None = None,
    gravity_stiffness: bool | None = None,
    parquet: bool = False,
    overwrite: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Simulation:
    """Simulate a test before doing it: which sensors, poses, directions, levels.

    Args:
        robot: as `load_robot` takes it.
        plan: poses, directions, levels, blows, sample rate, and sensors with their noise
            (`picchio-plan/1`), or a file's keys and values; effects in it make the world differ
            from the model.
        to: the campaign's folder; None: the campaign stays in memory.
        flex: sidecar of the robot.
        tool: the frame that carries the tool.
        robot_name: what the campaign calls the robot; as `robot` does if None.
        effects: besides those of the plan and of a saved model.
        seed: of the noise and of what effects draw; the plan's if None.
        gravity_stiffness: add gravity's stiffness dg/dq to the springs'.
        parquet: Parquet files instead of CSV.
        overwrite: replace a campaign that stands at `to`.
        progress: called with (done, total) records.

    Returns:
        the campaign, and what was put into it.

    Raises:
        InputError: a robot or a plan that cannot be read or do not fit each other.
    """
    loaded = load_robot(robot, flex=flex, tool=tool)
    file = Path(plan) if isinstance(plan, (str, Path)) else None
    asked = plan if isinstance(plan, Plan) else read_plan(plan)
    if seed is not None:
        asked = asked.model_copy(update={"seed": seed})
    files = [*([] if file is None else [file]), *loaded.files]
    suffix = "parquet" if parquet else "csv"
    try:
        asked.check()
        digits = max(2, len(str(asked.count)))
        names = [f"r{index + 1:0{digits}d}.{suffix}" for index in range(asked.count)]
        warn_beyond_limits(loaded, [loaded.pose(p) for p in asked.poses], "the plan")  # type: ignore[arg-type]
        every = [*(table.build(loaded) for table in asked.effect), *effects]
        _refuse_unread(every, asked, loaded)
        model = Model(loaded, loaded.adds_gravity(gravity_stiffness, usual=True)).with_effects(
            _drawn(asked, every, names)
        )
        table: dict[str, Any] = {
            "robot": robot_name or (loaded.name if robot is loaded else str(named(robot))),
            "tool": loaded.tool_frame,
            "excitation": _excitation(asked),
            "tolerance": asked.tolerance.model_dump(),
            "notes": asked.notes,
            "provenance": _origin(asked, every, files),
        }
        made = _campaign(model, asked, names, table, progress)
    except InputError as error:
        if error.file is not None or file is None:
            raise
        raise error.placed(file=file) from None
    if to is not None:
        made = made.save(to, overwrite=overwrite)
    found = Simulation(made, asked, loaded.name, provenance(files, seed=asked.seed))
    return seeing(found, robot=loaded, pose=loaded.pose(asked.poses[0]))  # type: ignore[arg-type]


def _refuse_unread(effects: Sequence[Effect], plan: Plan, robot: FlexibleRobot) -> None:
    """Raise for an effect on sensors that the plan has not."""
    groups = list(dict.fromkeys(channel.group for channel, _ in _channels(robot, plan)))
    for effect in effects:
        if effect.target_kind == "channel group" and effect.target not in groups:
            raise InputError(
                "no sensor of the plan reads this channel group",
                key=f"{effect.name}.target",
                value=effect.target,
                choices=groups,
            )


def _drawn(plan: Plan, effects: Sequence[Effect], names: Sequence[str]) -> list[Effect]:
    """The effects with what they draw anew in every record (jitter, missed hits, a hum's phase)."""
    rng = np.random.default_rng([plan.seed, 1])
    return [
        effect if effect.latent is None or effect.hidden else
        effect.with_hidden({name: tuple(effect.draw(rng, plan.burst or 1)) for name in names})
        for effect in effects
    ]  # fmt: skip


def _campaign(
    model: Model,
    plan: Plan,
    names: Sequence[str],
    table: dict[str, Any],
    progress: Callable[[int, int], None] | None,
) -> Campaign:
    """The model's exact prediction of every channel, plus white noise, in memory."""
    channels = _channels(model.robot, plan)
    records = [
        _blank(name, planned, plan, [c for c, _ in channels])
        for name, planned in zip(names, plan.records(), strict=True)
    ]
    setups = percussion_setups(model.robot, Campaign.from_records(records, **table))
    filled = []
    for index, (record, setup) in enumerate(zip(records, setups, strict=True)):
        filled.append(_filled(record, setup, model, channels, [plan.seed, 2, index], plan))
        if progress is not None:
            progress(index + 1, len(records))
    return Campaign.from_records(filled, **table)


def _channels(robot: FlexibleRobot, plan: Plan) -> list[tuple[Channel, float]]:
    """Channels and the standard deviation of their noise, SI."""
    found: dict[str, tuple[Channel, float]] = {}
    for number, sensor in enumerate(plan.sensor):
        try:
            members = sensor.expand(robot)
        except InputError as error:
            key = f"sensor[{number}]" + (f".{error.key}" if error.key else "")
            raise InputError(error.problem, key=key, value=error.value,
                             choices=error.choices) from None  # fmt: skip
        for channel, noise in members:
            if channel.name in found:
                raise InputError("is measured twice", key=f"sensor[{number}].channels",
                                 value=channel.name)  # fmt: skip
            found[channel.name] = (channel, noise)
    return list(found.values())


def _excitation(plan: Plan) -> dict[str, Any]:
    table = plan.excitation.model_dump(exclude_none=True)
    if plan.burst is not None:
        table["hits"] = plan.burst
    if "force" not in table and plan.levels:
        table["force"] = plan.levels[0]
    return table


def _blank(name: str, planned: dict[str, Any], plan: Plan, channels: Sequence[Channel]) -> Record:
    """The record with its clock and nothing in its channels."""
    before, after = plan.samples
    time = np.arange(-before, after) / plan.sample_rate
    direction = np.array(planned["direction"], dtype=float)
    return Record.from_arrays(
        name,
        time,
        {channel.name: np.zeros(time.size) for channel in channels},
        units={channel.name: channel.unit for channel in channels},
        **{**planned, "direction": (direction / np.linalg.norm(direction)).tolist()},
    )


def _filled(
    record: Record,
    setup: PercussionSetup,
    model: Model,
    channels: Sequence[tuple[Channel, float]],
    seed: Sequence[int],
    plan: Plan,
) -> Record:
    rng = np.random.default_rng(list(seed))
    predicted = setup.predict(model)
    values: dict[str, FloatArray] = {}
    for channel, std in channels:
        clean = predicted[channel.name]
        noisy = clean + std * rng.standard_normal(clean.size)
        values[channel.name] = noisy - noisy.mean() if plan.burst is None else noisy
    given = record.table.model_dump(exclude_none=True, exclude={"file"})
    units = {channel.name: channel.unit for channel, _ in channels}
    return Record.from_arrays(record.file, record.time, values, units=units, **given)


def _origin(plan: Plan, effects: Sequence[Effect], inputs: Sequence[str | Path]) -> dict[str, Any]:
    """Where the campaign comes from, for its [provenance]."""
    made = provenance(inputs, seed=plan.seed)
    origin: dict[str, Any] = {
        "picchio": made["picchio"],
        "simulated": True,
        "seed": plan.seed,
        "inputs": made["inputs"],
        "libraries": {k: v for k, v in made["libraries"].items() if v is not None},
    }
    if effects:
        origin["effects"] = [
            {"effect": e.name, "target": e.target,
             "parameters": {k: v for k, v in e.values.items() if np.isfinite(v)}}
            for e in effects
        ]  # fmt: skip
    return origin
