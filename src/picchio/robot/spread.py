"""How well values are known: `KEY_spread`, `KEY_std` or `estimated` beside a table's numbers."""

from __future__ import annotations

import inspect
import math
import re
import typing
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Self, TypeVar

import numpy as np
from pydantic import Field, create_model, model_validator

from picchio.core.errors import InputError
from picchio.core.toml import Finite, NotNegative, StrictModel, leaf_types

ESTIMATE = "picchio's estimate"
"""The label of the source that stands in where no file says anything."""
ESTIMATED = 2.0
"""The factor by which an estimate without a spread of its own is uncertain."""

T = TypeVar("T", bound=StrictModel)
Factor = Annotated[float, Field(ge=1, allow_inf_nan=False, strict=True)]
Number = float | tuple[float, ...]


def is_estimate(origin: str) -> bool:
    """Whether a value is picchio's own estimate, in memory or written by `picchio start`.

    Args:
        origin: of the value.
    """
    return ESTIMATE in origin


def with_spreads(table: type[T]) -> type[T]:
    """Give every number of a table its keys `KEY_spread` and `KEY_std`, and the table `estimated`.

    Args:
        table: a record of a file; its docstring ends with the section "Attributes".

    Returns:
        the record with the new keys, under the same name.
    """
    fields: dict[str, Any] = {}
    told = inspect.cleandoc(table.__doc__ or "")
    for name, field in table.model_fields.items():
        kind = leaf_types(field.annotation)[0]
        if kind is not float and typing.get_origin(kind) is not tuple:
            continue
        each = "" if kind is float else ", of each component"
        fields[f"{name}_spread"] = (Factor | None, None)
        fields[f"{name}_std"] = (NotNegative | None, None)
        told += (
            f"\n    {name}_spread: 1, a factor that {name} is uncertain by: one standard deviation "
            f"of its logarithm is ln of it; at 1 it has no spread of its own."
            f"\n    {name}_std: {_unit(told, name)}, one standard deviation of {name}{each}."
        )
    if "estimated" not in table.model_fields:
        fields["estimated"] = (bool | None, None)
        told += (
            "\n    estimated: true if the values were not measured: a factor of 2 where no spread "
            "is given."
        )
    checked: Any = model_validator(mode="after")(_one_spread)
    made: Any = create_model(
        table.__name__,
        __base__=table,
        __module__=table.__module__,
        __doc__=told,
        __validators__={"one_spread": checked},
        **fields,
    )
    made.__annotations__ = {**table.__annotations__, **made.__annotations__}  # the keys' order
    return made  # type: ignore[no-any-return]


def _unit(told: str, name: str) -> str:
    """The unit with which a docstring's line on a key begins; 1 where it begins with none."""
    line = re.search(rf"^ {{4}}{name}: ([^,(]{{1,8}}(?: \([^)]*\))?),", told, re.MULTILINE)
    return line[1] if line else "1"


def _one_spread(record: T) -> T:
    for key in numbers_of(type(record)):
        if None not in (getattr(record, f"{key}_spread"), getattr(record, f"{key}_std")):
            raise ValueError(f"give {key}_spread or {key}_std, not both")
    return record


@cache
def numbers_of(table: type[StrictModel]) -> tuple[str, ...]:
    """The keys of a table that may have a spread.

    Args:
        table: any record.
    """
    return tuple(key for key in table.model_fields if f"{key}_std" in table.model_fields)


def value_of(key: str) -> str:
    """The value that a key is about: `stiffness` of `stiffness_std`; of a value's key itself.

    Args:
        key: of a table made by `with_spreads`.
    """
    return key.removesuffix("_spread").removesuffix("_std")


def overlaid(
    table: type[StrictModel], weaker: Mapping[str, Any], stronger: Mapping[str, Any]
) -> dict[str, Any]:
    """A table's values with those of a stronger source over them.

    Where only one source's values are estimates, the other's get a spread of 1: none.

    Args:
        table: the record.
        weaker: by key; a spread whose value the stronger source gives is dropped.
        stronger: by key.
    """
    told = {value_of(key) for key in stronger}
    kept = {k: v for k, v in weaker.items() if value_of(k) not in told or k == "estimated"}
    merged = kept | dict(stronger)
    guess = [source for source in (kept, stronger) if source.get("estimated")]
    if len(guess) != 1:
        return merged
    numbers = [key for key in numbers_of(table) if key in merged]
    for key in numbers:
        if key not in guess[0] and not {f"{key}_spread", f"{key}_std"} & merged.keys():
            merged[f"{key}_spread"] = 1.0
    return merged | {"estimated": any(key in guess[0] for key in numbers)}


@dataclass(frozen=True)
class Spread:
    """One value of a robot that is not known exactly.

    Attributes:
        table: "joint", "tool", "gun", "base" or another table of the sidecar.
        owner: the joint's name; empty for tables that exist once.
        path: keys within the owner's table, such as ("shaft", "radius").
        value: the stated value, in its own unit: the median.
        size: one standard deviation: of the natural logarithm, or of the value if not `log`.
        log: whether the logarithm is normal; otherwise the value is.
        source: where it is from.
        estimated: the value is an estimate, within a factor of `ESTIMATED` if not said otherwise.
        component: which number of a vector varies; None for all of it.
    """

    table: str
    owner: str
    path: tuple[str, ...]
    value: Number
    size: float
    log: bool
    source: str = ""
    estimated: bool = False
    component: int | None = None

    @property
    def name(self) -> str:
        """As `[posterior]` and results call it: "stiffness.joint_1", "mass.tool"."""
        part = "" if self.component is None else f"[{self.component}]"
        owner = self.table if not self.owner else self.owner
        owner = owner if self.table == "joint" or not self.owner else f"{self.table}.{self.owner}"
        return ".".join((*self.path, owner)) + part

    def at(self, score: float) -> Number:
        """The value so many standard deviations above the stated one.

        Args:
            score: of a standard normal distribution.
        """
        if self.log:
            factor = math.exp(self.size * score)
            if isinstance(self.value, tuple):
                return tuple(factor * part for part in self.value)
            return factor * self.value
        step = self.size * score
        if not isinstance(self.value, tuple):
            return self.value + step
        return tuple(
            part + (step if k == self.component else 0.0) for k, part in enumerate(self.value)
        )

    def describe(self) -> str:
        """The spread in words."""
        text = f"a factor of {math.exp(self.size):.3g}" if self.log else f"+- {self.size:.3g}"
        return f"{text} (an estimate)" if self.estimated else text


def spreads_in(
    model: type[StrictModel],
    values: Mapping[str, Any],
    guessed: Collection[str] = (),
    *,
    table: str,
    owner: str = "",
    path: tuple[str, ...] = (),
    source: str = "",
    elsewhere: bool = False,
) -> Iterator[Spread]:
    """The spreads that the keys of one table state.

    Args:
        model: the table's record.
        values: what is given, by key.
        guessed: values that are estimates.
        table: see `Spread`; likewise the rest.
        owner: see `Spread`.
        path: of the table within the owner's.
        source: see `Spread`.
        elsewhere: a value that is not here may stand in another file: it counts as 1.

    Raises:
        InputError: a spread of a value that is not there, a factor on zero.
    """
    for key in numbers_of(model):
        factor, std = values.get(f"{key}_spread"), values.get(f"{key}_std")
        if factor is None and std is None and key not in guessed:
            continue
        said = f"{key}_std" if std is not None else f"{key}_spread"
        where = ".".join(part for part in (table, owner, *path, said) if part)
        value = values.get(key, model.model_fields[key].get_default())
        if value is None and elsewhere:
            value = (
                1.0 if leaf_types(model.model_fields[key].annotation)[0] is float else (1.0,) * 3
            )
        if value is None:
            raise InputError(f"is the spread of {key}, which is not given", key=where,
                             value=factor if std is None else std)  # fmt: skip
        if factor == 1.0:
            continue
        number = tuple(value) if isinstance(value, tuple | list) else float(value)
        zero = not any(number) if isinstance(number, tuple) else number == 0.0
        if zero and std is None:
            if factor is None:
                continue  # an estimate of zero says nothing
            raise InputError("a factor on zero changes nothing", key=where, value=factor,
                             hint=f"give {key}_std")  # fmt: skip
        place = (table, owner, (*path, key), number)
        if std is None:
            size = math.log(factor if factor is not None else ESTIMATED)
            yield Spread(*place, size, True, source, key in guessed)
        elif isinstance(number, tuple):
            for k in range(len(number)):
                yield Spread(*place, float(std), False, source, component=k)
        elif number > 0.0:
            # The log-normal distribution with this deviation: no stiffness turns negative.
            size = math.sqrt(math.log1p((std / number) ** 2))
            yield Spread(*place, size, True, source)
        else:
            yield Spread(*place, float(std), False, source)


class Posterior(StrictModel):
    """How values that were found from the same data are correlated.

    Attributes:
        names: values with a spread, such as "stiffness.joint_1", "damping_ratio.joint_2",
            "shaft.radius.joint_1" or "mass.tool".
        correlation: 1, of their logarithms (of the values, where those are normal): one row for
            each name.
    """

    names: tuple[str, ...] = Field(min_length=1)
    correlation: tuple[tuple[Finite, ...], ...]

    @model_validator(mode="before")
    @classmethod
    def _square(cls, data: Any) -> Any:
        """An annotation has the rows one after another."""
        if isinstance(data, dict):
            rows, count = data.get("correlation"), len(data.get("names") or ())
            flat = isinstance(rows, list) and all(isinstance(x, int | float) for x in rows)
            if isinstance(rows, list) and flat and count and len(rows) == count**2:
                split = [rows[k : k + count] for k in range(0, len(rows), count)]
                return {**data, "correlation": split}
        return data

    @model_validator(mode="after")
    def _can_be(self) -> Self:
        count = len(self.names)
        if len(set(self.names)) < count:
            raise ValueError("names one value twice")
        if [len(row) for row in self.correlation] != [count] * count:
            raise ValueError(f"correlation must be {count} rows of {count} numbers")
        matrix = np.array(self.correlation)
        if not np.array_equal(np.diag(matrix), np.ones(count)):
            raise ValueError("correlation must have ones on its diagonal")
        if not np.allclose(matrix, matrix.T, rtol=0.0, atol=1e-9):
            raise ValueError("correlation must be symmetric")
        if float(np.linalg.eigvalsh(matrix)[0]) < -1e-6:
            raise ValueError("correlation must be positive semidefinite")
        return self

    def among(self, names: Collection[str]) -> Posterior | None:
        """The part about some of the values; None for none of them.

        Args:
            names: the values.
        """
        kept = [k for k, name in enumerate(self.names) if name in names]
        if not kept:
            return None
        return Posterior(
            names=tuple(self.names[k] for k in kept),
            correlation=tuple(tuple(self.correlation[k][m] for m in kept) for k in kept),
        )


def root_of(names: Collection[str], posterior: Posterior | None) -> np.ndarray:
    """The symmetric square root of the correlation matrix of some values, (n, n).

    Times independent standard normals it gives correlated ones; unlike Cholesky's it depends on
    no order of the values, and each independent one is as near to its value as can be.

    Args:
        names: n values.
        posterior: their correlation; None: not at all.
    """
    every = list(names)
    matrix = np.eye(len(every))
    part = posterior.among(every) if posterior is not None else None
    if part is not None:
        index = [every.index(name) for name in part.names]
        matrix[np.ix_(index, index)] = np.array(part.correlation)
    sizes, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return np.asarray((vectors * np.sqrt(np.clip(sizes, 0.0, None))) @ vectors.T)
