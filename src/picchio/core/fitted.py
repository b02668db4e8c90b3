"""Results that fit something: each parameter by name, as lmfit has them, and a report to read."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

from picchio.core.errors import InputError
from picchio.core.results import Result, TableResult


@dataclass(frozen=True)
class FittedValue:
    """A parameter of a fit, SI.

    Attributes:
        name: such as "stiffness.joint_1".
        value: most probable.
        stderr: standard deviation; NaN of one that was not fitted, infinite where the data set no
            bound.
        unit: of both; "1" of a pure number.
        min: smallest value allowed.
        max: largest.
        vary: whether it was fitted; False: held fixed.
        note: what else is to be known of it.
    """

    name: str
    value: float
    stderr: float
    unit: str = "1"
    min: float = -math.inf
    max: float = math.inf
    vary: bool = True
    note: str = ""

    def __str__(self) -> str:
        unit = "" if self.unit == "1" else f" {self.unit}"
        if not self.vary:
            return f"{self.value:.5g}{unit} (fixed)"
        share = f" ({self.stderr / abs(self.value):.2%})" if self.value else ""
        ends = (
            ""
            if math.isinf(self.min) or math.isinf(self.max)
            else (f", within {self.min:g} to {self.max:g}")
        )
        return f"{self.value:.5g} +/- {self.stderr:.2g}{unit}{share}{ends}"


class Parameters(TableResult, Mapping[str, FittedValue]):
    """The parameters of a fit by name, and as a table."""

    LACKS: ClassVar = {"plot": "the fit draws itself", "show": "numbers have no place in space"}

    def __init__(self, values: Iterable[FittedValue]) -> None:
        self._values = {value.name: value for value in values}

    def __getitem__(self, name: str) -> FittedValue:
        if name in self._values:
            return self._values[name]
        raise InputError("no such parameter", key="name", value=name, choices=self._values)

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __contains__(self, name: object) -> bool:
        return name in self._values

    def _headline(self) -> str:
        return f"{len(self)} parameters, {sum(value.vary for value in self.values())} fitted"

    def _rows(self) -> Iterator[Mapping[str, Any]]:
        return map(asdict, self.values())

    def _content(self) -> Mapping[str, Any]:
        return {"parameters": list(self._rows())}


class Fit(Result):
    """A result that has fitted parameters."""

    def _fitted(self) -> Iterable[FittedValue]:
        """Each parameter, those that were held fixed among them."""
        raise NotImplementedError

    @property
    def params(self) -> Parameters:
        """Values, standard errors, bounds, and what was held fixed, by name."""
        return Parameters(self._fitted())

    def fit_report(self) -> str:
        """The parameters as text: a line each, below the line that matters."""
        params = self.params
        width = max(map(len, params), default=0)
        lines = [
            f"  {name + ':':<{width + 1}} {value}{'; ' * bool(value.note)}{value.note}"
            for name, value in params.items()
        ]
        return "\n".join([self._headline(), *lines])
