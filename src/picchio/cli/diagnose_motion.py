"""What `picchio diagnose` does with motion records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from picchio.core.errors import InputError

if TYPE_CHECKING:
    from picchio.campaign import Campaign
    from picchio.diagnosis.motion.carried import Carried, MotionLife
    from picchio.diagnosis.result import Diagnosis
    from picchio.robot import FlexibleRobot


@dataclass(frozen=True)
class MotionAnswer:
    """A diagnosis of motion records, and what it says of blows.

    Attributes:
        diagnosis: the answer.
        carried: which causes act while the tool hits.
        life: what they do to the task's life.
    """

    diagnosis: Diagnosis
    carried: Carried
    life: MotionLife

    @property
    def notes(self) -> str:
        """What a model's file says of causes that it does not hold."""
        head = "found by picchio diagnose in motion records"
        why: dict[str, list[str]] = {}
        for effect, reason in self.carried.left:
            names = why.setdefault(reason, [])
            name = f"{effect.name} of {effect.target}"
            if name not in names:
                names.append(name)
        said = [f"{', '.join(names)}: {reason}" for reason, names in why.items()]
        return f"{head}; found as well, and not in this model: {'; '.join(said)}" if said else head

    def extra(self) -> dict[str, Any]:
        """Keys that JSON has beside the contract's."""
        blows = {side: dict(joints) for side, joints in self.life.blows.items()}
        return {"life_note": self.life.why, "blows": blows or None}

    def page(
        self, campaign: Campaign, model_toml: str, command: str, warnings: Sequence[str]
    ) -> str:
        """The report."""
        from picchio.view.report.motion_diagnosis import motion_diagnosis_report

        return motion_diagnosis_report(
            self.diagnosis,
            life=self.life,
            carried=self.carried,
            model_toml=model_toml if self.diagnosis.causes else "",
            command=command,
            folder=None if campaign.folder is None else campaign.folder.name,
            warnings=warnings,
        )


def diagnose_motion_records(
    robot: FlexibleRobot, campaign: Campaign, without: Sequence[str], task: Path | None
) -> MotionAnswer:
    """Diagnose, and follow the task's blows before and after.

    Args:
        robot: the nominal robot.
        campaign: its motion records.
        without: effects that must not be considered.
        task: for the life; the robot's own if None.

    Raises:
        InputError: as `diagnose_motion`; a bad task that was asked for.
    """
    from picchio.cli.output import progress
    from picchio.diagnosis.motion import diagnose_motion
    from picchio.diagnosis.motion.carried import MotionLife, carried, motion_life
    from picchio.studies import load_task

    with progress("diagnosis") as report:
        found = diagnose_motion(robot, campaign, without=without, progress=report)
    path = task or robot.task_path
    try:
        work = load_task(path, robot) if path is not None else None
        life = motion_life(robot, work, found)
    except InputError as error:
        if task is not None:
            raise
        life = MotionLife(None, f"the life could not be computed: {error}")
    return MotionAnswer(found, carried(found), life)
