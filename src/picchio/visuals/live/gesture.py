"""What a page may say: one message of one hand, checked before anything is done."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from picchio.core.toml import as_input_error

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Count = Annotated[int, Field(ge=0)]


class Blows(BaseModel):
    """Numbers of the blows; those that are left out stay."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    force: Number | None = None  # N
    rate: Annotated[Number, Field(gt=0.0)] | None = None  # Hz
    width: Number | None = None  # s
    preload: Number | None = None  # N
    hits: Annotated[int, Field(ge=1, le=1000)] | None = None


class Gesture(BaseModel):
    """A message: any of these, at once."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    id: int | None = None  # which the answer repeats
    joints: dict[Count, Number] = {}  # index: rad or m
    tool: tuple[Number, Number, Number] | None = None  # m, world
    direction: tuple[Number, Number, Number] | None = None
    blows: Blows = Blows()
    worst: Count | None = None  # joint along whose worst direction the force shall act
    along_tool: bool = False
    home: bool = False
    keeps_axis: bool | None = None
    joint: Count | None = None  # whose envelope is shown
    write: bool = False  # put the place into the task file
    toml: bool = False  # show it as one

    @classmethod
    def of(cls, message: Gesture | Mapping[str, Any] | str | bytes) -> Gesture:
        """A message as it came.

        Args:
            message: JSON, or what it holds.

        Raises:
            InputError: it is none, with the key and the value that are wrong.
        """
        try:
            if isinstance(message, (str, bytes)):
                return cls.model_validate_json(message)
            return cls.model_validate(message)
        except ValidationError as error:
            raise as_input_error(error, cls, "message") from None
