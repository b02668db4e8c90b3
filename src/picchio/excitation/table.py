"""The `[excitation]` table of task and campaign files, and the kinds that it may name."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import Any, Self

from pydantic import ConfigDict, ValidationError, field_validator, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

from picchio.core.errors import InputError
from picchio.core.registry import classes_in, is_concrete, with_entry_points
from picchio.core.toml import Finite, Positive, StrictModel
from picchio.excitation.excitation import Excitation

GROUP = "picchio.excitations"
DEFAULT = "pulse_train"


@cache
def catalogue() -> dict[str, type[Excitation]]:
    """Every excitation's class by its kind.

    Raises:
        InputError: two of one kind, or an entry point that is no excitation.
    """
    own = classes_in("picchio.excitation", Excitation)  # type: ignore[type-abstract]
    return with_entry_points(
        GROUP, "excitation", own, lambda x: is_concrete(x, Excitation), lambda x: x.kind
    )


def excitation_class(kind: str | None) -> type[Excitation]:
    """The excitation of a kind; of None, that of a table that names none.

    Raises:
        InputError: there is none.
    """
    try:
        return catalogue()[kind or DEFAULT]
    except KeyError:
        raise InputError("no such excitation", value=kind, choices=catalogue()) from None


class ExcitationTable(StrictModel):
    """One blow train as a file states it; any key may be missing where another table fills it.

    Keys beside these are those that a kind declares; see `Excitation.needed`.

    Attributes:
        kind: shape of the blows; "pulse_train" (rectangular) where no table gives one.
        force: N, peak of a pulse or half-sine.
        period: s, from the start of one blow to the start of the next.
        width: s, duration of one blow.
        preload: N, steady feed force along the direction.
        file: measured force: a CSV file with columns `time [s]` and `force [N]`, relative to
            this file.
    """

    model_config = ConfigDict(extra="allow")

    kind: str | None = None
    force: Positive | None = None
    period: Positive | None = None
    width: Positive | None = None
    preload: Finite | None = None
    file: str | None = None

    @field_validator("kind")
    @classmethod
    def _known_kind(cls, kind: str | None) -> str | None:
        if kind is not None and kind not in catalogue():
            raise ValueError(f"must be one of {', '.join(map(repr, catalogue()))}")
        return kind

    @model_validator(mode="after")
    def _known_keys(self) -> Self:
        for key, value in (self.model_extra or {}).items():
            problem: str | PydanticCustomError | None = None
            if not any(key in c.needed + c.optional for c in catalogue().values()):
                problem = "extra_forbidden"
            elif isinstance(value, bool) or not isinstance(value, int | float | str):
                problem = PydanticCustomError("excitation", "must be a number or a text")
            elif isinstance(value, float) and not math.isfinite(value):
                problem = PydanticCustomError("excitation", "must be a finite number")
            if problem:
                raise ValidationError.from_exception_data(
                    type(self).__name__, [InitErrorDetails(type=problem, loc=(key,), input=value)]
                )
        return self

    def overridden_by(self, other: ExcitationTable | None) -> Self:
        """This table with every key that `other` gives taken from it.

        Args:
            other: another table of the same kind; None changes nothing.
        """
        return self if other is None else type(self)(**{**self.given(), **other.given()})

    def given(self) -> dict[str, Any]:
        """The keys that are given."""
        return self.model_dump(exclude_none=True)

    def build(self, *, file: str | Path | None = None, key: str = "excitation") -> Excitation:
        """The excitation itself.

        Args:
            file: the file that holds the table; a measured history is found relative to it.
            key: the table's name, for messages.

        Raises:
            InputError: a key that the kind needs is missing, or one that it has no use for
                is given, or a value is out of range.
        """
        made = excitation_class(self.kind)
        given = self.given()
        given.pop("kind", None)
        for name in made.needed:
            if name not in given:
                raise InputError(f"a {made.kind} needs this key", file=file, key=f"{key}.{name}")
        for name, value in given.items():
            if name not in made.needed + made.optional:
                raise InputError(
                    f"a {made.kind} has no use for this key",
                    file=file,
                    key=f"{key}.{name}",
                    value=value,
                    choices=[*made.needed, *made.optional],
                )
        try:
            return made.from_table(given, Path(file).parent if file is not None else Path())
        except InputError as error:
            if error.file is not None:
                raise
            raise error.placed(file=file, key=f"{key}.{error.key}") from None
