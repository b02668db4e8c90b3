"""A diagnosis as `picchio diagnose --json` wrote it, read back to be drawn."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from picchio.core.errors import InputError
from picchio.core.json_files import read_json
from picchio.core.toml import Finite, validate
from picchio.diagnosis.result import FORMAT, Cause, Diagnosis, Value, Verdict
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.visuals.scene.causes.site import check_place

_Name = Annotated[str, Field(min_length=1)]


class _Table(BaseModel):
    """Keys may be added to the format: those not known are left alone."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class _Pair(_Table):
    effect: _Name
    target: _Name


class _Value(_Table):
    value: Finite | None
    std: Finite | None = None
    unit: str = "1"


class _Cause(_Pair):
    confidence: Finite = 0.0
    parameters: dict[str, _Value] = Field(default_factory=dict)


class _File(_Table):
    verdict: Verdict
    causes: list[_Cause]
    alternatives: list[list[_Pair]] = Field(default_factory=list)
    leads: list[_Pair] = Field(default_factory=list)


def read_diagnosis(path: str | Path, robot: FlexibleRobot) -> Diagnosis:
    """Verdict, causes, alternatives and leads of a `picchio-diagnosis/1` file.

    What only numbers can say (nuisances, gain, life, scores) is left in the file.

    Args:
        path: the file.
        robot: what it is a diagnosis of.

    Raises:
        InputError: missing, no JSON, another format, a key that is missing or wrong, an effect
            that is not known, a target that this robot does not have.
    """
    content = read_json(path, "diagnosis", [FORMAT])
    table = validate(content, _File, format=FORMAT, file=path)

    def values(cause: _Cause) -> dict[str, Value]:
        # JSON has no infinity: a value without end is null there, and nothing to draw.
        return {name: Value(v.value, v.std or 0.0, v.unit)
                for name, v in cause.parameters.items() if v.value is not None}  # fmt: skip

    found = Diagnosis(
        table.verdict,
        tuple(Cause(c.effect, c.target, c.confidence, values(c)) for c in table.causes),
        tuple(tuple((p.effect, p.target) for p in each) for each in table.alternatives),
        tuple((p.effect, p.target) for p in table.leads),
    )
    named = [*table.causes, *(p for each in table.alternatives for p in each), *table.leads]
    for pair in named:
        try:
            check_place(robot, pair.effect, pair.target)
        except InputError as error:
            raise error.placed(file=path) from None
    return found
