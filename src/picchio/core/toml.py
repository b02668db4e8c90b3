"""TOML files: read with the standard library, checked by pydantic, errors in one line."""

from __future__ import annotations

import tomllib
import types
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from picchio.core.errors import InputError
from picchio.core.files import read_text

T = TypeVar("T", bound=BaseModel)


if TYPE_CHECKING:
    from pydantic._internal._model_construction import ModelMetaclass
else:
    ModelMetaclass = type(BaseModel)


class _Checked(ModelMetaclass):
    """Values given in Python are refused as those of a file are: by an InputError."""

    def __call__(cls, *args: Any, **kwargs: Any) -> Any:
        try:
            return super().__call__(*args, **kwargs)
        except ValidationError as error:
            raise as_input_error(error, cls, None) from None  # type: ignore[arg-type]


class StrictModel(BaseModel, metaclass=_Checked):
    """Base of every record in a file that users edit: frozen; unknown keys, NaN and inf refused."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, populate_by_name=True, strict=False
    )


# Strict: strings and booleans are not taken for numbers.
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False, strict=True)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False, strict=True)]
Finite = Annotated[float, Field(allow_inf_nan=False, strict=True)]
Name = Annotated[str, Field(min_length=1)]
FiniteVector = tuple[Finite, Finite, Finite]


def read_toml(path: str | Path) -> dict[str, Any]:
    """The content of a TOML file.

    Args:
        path: the file.

    Raises:
        InputError: missing, not UTF-8, or a syntax error (with its line).
    """
    text = read_text(path)
    try:
        content = tomllib.loads(text)
        beyond = next(_beyond(content, ()), None)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"is not valid TOML: {error}", file=path) from None
    except ValueError:  # an integer of thousands of digits
        raise InputError("is not valid TOML: an integer of more than 64 bits", file=path) from None
    except RecursionError:
        raise InputError("is nested too deeply", file=path) from None
    if beyond is not None:
        raise InputError("is an integer of more than 64 bits", file=path, key=_dotted(beyond))
    return content


def _beyond(value: Any, place: tuple[int | str, ...]) -> Iterator[tuple[int | str, ...]]:
    """Where integers stand that TOML does not have; as a float they would overflow."""
    if isinstance(value, int) and not -(2**63) <= value < 2**63:
        yield place
    if isinstance(value, dict | list):
        for name, part in value.items() if isinstance(value, dict) else enumerate(value):
            yield from _beyond(part, (*place, name))


def parse_toml(path: str | Path, model: type[T], *, format: str) -> T:
    """Read a TOML file and validate it against a pydantic model.

    Args:
        path: the file.
        model: what it must look like, the `format` key left out.
        format: the version to accept, such as "picchio-task/1".

    Returns:
        the model.

    Raises:
        InputError: syntax, missing or unknown format, misspelt keys, wrong values.
    """
    return validate(read_toml(path), model, format=format, file=path)


def validate(
    data: dict[str, Any], model: type[T], *, format: str, file: str | Path | None = None
) -> T:
    """Validate a dictionary as `parse_toml` does.

    Args:
        data: the file's content.
        model: the pydantic class it must fit.
        format: the version to accept.
        file: named in errors.

    Returns:
        an instance of `model`.

    Raises:
        InputError: missing or unknown format, misspelt keys, wrong values.
    """
    content = dict(data)
    found = content.pop("format", None)
    if found is None:
        raise InputError(
            f'the key is missing; write format = "{format}"',
            file=file,
            key="format",
        )
    if found != format:
        raise InputError("unknown format", file=file, key="format", value=found, choices=[format])
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise as_input_error(error, model, file) from None
    except RecursionError:
        raise InputError("is nested too deeply", file=file) from None


def as_input_error(
    error: ValidationError, model: type[BaseModel], file: str | Path | None
) -> InputError:
    """The most telling of pydantic's errors: a misspelt key explains a missing one.

    Args:
        error: what pydantic raised.
        model: that was wanted.
        file: which the data came from.
    """
    errors = error.errors(include_url=False, include_context=True)
    errors.sort(key=lambda e: 0 if e["type"] == "extra_forbidden" else 1)
    first = errors[0]
    more = f"and {len(errors) - 1} more" if len(errors) > 1 else None
    # Tagged unions put the tag's name into the path; it is no key of the file.
    key = _dotted(first["loc"])
    if first["type"] == "extra_forbidden":
        return InputError(
            "unknown key",
            file=file,
            key=_dotted(first["loc"][:-1]) or None,
            value=str(first["loc"][-1]),
            choices=_field_names(model, first["loc"][:-1]),
            hint=more,
        )
    if first["type"] == "missing":
        return InputError("the key is missing", file=file, key=key, hint=more)
    inner = first.get("ctx", {}).get("error")
    if isinstance(inner, InputError):
        return InputError(str(inner), file=file, key=key, hint=more)
    problem = first["msg"].removeprefix("Value error, ")
    problem = problem[:1].lower() + problem[1:]
    return InputError(problem, file=file, key=key, value=first["input"], hint=more)


def _dotted(loc: tuple[int | str, ...]) -> str:
    text = ""
    for part in loc:
        if isinstance(part, str) and not part.replace("_", "").replace("-", "").isalnum():
            continue  # pydantic's name for one arm of a union, no key of the file
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            text += f".{part}" if text else part
    return text


def _field_names(model: type[BaseModel], loc: tuple[int | str, ...]) -> list[str]:
    """The keys that the record at `loc` may have."""
    here: list[Any] = [model]
    for part in loc:
        here = [step for kind in here for step in _step(kind, part)]
    tables = [kind for kind in here if _is_table(kind)]
    return sorted({f.alias or name for kind in tables for name, f in kind.model_fields.items()})


def _is_table(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, BaseModel)


def _step(kind: Any, part: int | str) -> list[Any]:
    """The types reached from `kind` by one key or index."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if _is_table(kind):
        for name, field in kind.model_fields.items():
            if part in (name, field.alias):
                return leaf_types(field.annotation)
    elif origin in (list, tuple, dict):
        return leaf_types(arguments[-1 if origin is dict else 0])
    # A union's tag in the path: stay where we are.
    return [kind]


def leaf_types(kind: Any) -> list[Any]:
    """The types that an annotation allows, without what is said about them.

    Args:
        kind: the annotation of a table's key.
    """
    origin = typing.get_origin(kind)
    if origin is typing.Annotated:
        return leaf_types(typing.get_args(kind)[0])
    if origin in (typing.Union, types.UnionType):
        return [leaf for arm in typing.get_args(kind) for leaf in leaf_types(arm)]
    return [kind]
