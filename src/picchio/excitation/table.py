"""The `[excitation]` table of task and campaign files."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from picchio.core.errors import InputError
from picchio.core.toml import Finite, Positive, StrictModel
from picchio.excitation.trains import Excitation, HalfSineTrain, MeasuredForce, PulseTrain

Kind = Literal["pulse_train", "half_sine_train", "measured"]
_TRAINS: dict[str, type[PulseTrain] | type[HalfSineTrain]] = {
    "pulse_train": PulseTrain,
    "half_sine_train": HalfSineTrain,
}


class ExcitationTable(StrictModel):
    """One blow train as a file states it; any key may be missing where another table fills it.

    Attributes:
        kind: "pulse_train", "half_sine_train" or "measured".
        force: N, height or peak.
        period: s.
        width: s.
        preload: N, steady feed force along the direction.
        file: CSV with `time [s]` and `force [N]`, relative to the file that names it.
    """

    kind: Kind | None = None
    force: Positive | None = None
    period: Positive | None = None
    width: Positive | None = None
    preload: Finite | None = None
    file: str | None = None

    def overridden_by(self, other: ExcitationTable | None) -> ExcitationTable:
        """This table with every key that `other` gives taken from it."""
        if other is None:
            return self
        given: dict[str, Any] = {**self._given(), **other._given()}
        return ExcitationTable(**given)

    def _given(self) -> dict[str, Any]:
        return {k: v for k, v in self.model_dump().items() if v is not None}

    def build(self, *, file: str | Path | None = None, key: str = "excitation") -> Excitation:
        """The excitation itself.

        Args:
            file: the file that holds the table; a measured history is found relative to it.
            key: the table's name, for messages.

        Raises:
            InputError: a key that the kind needs is missing, or one that it has no use for
                is given, or a value is out of range.
        """
        kind = self.kind or "pulse_train"
        needed = ["file"] if kind == "measured" else ["force", "period", "width"]
        optional = ["period", "preload"] if kind == "measured" else ["preload"]
        given = self._given()
        given.pop("kind", None)
        for name in needed:
            if name not in given:
                raise InputError(f"a {kind} needs this key", file=file, key=f"{key}.{name}")
        for name, value in given.items():
            if name not in needed + optional:
                raise InputError(
                    f"a {kind} has no use for this key",
                    file=file,
                    key=f"{key}.{name}",
                    value=value,
                    choices=needed + optional,
                )
        try:
            if kind == "measured":
                base = Path(file).parent if file is not None else Path()
                return MeasuredForce.from_csv(
                    base / given["file"], period=self.period, preload=self.preload or 0.0
                )
            return _TRAINS[kind](**given)
        except InputError as error:
            if error.file is not None:
                raise
            raise InputError(
                error.problem, file=file, key=f"{key}.{error.key}", value=error.value
            ) from None
