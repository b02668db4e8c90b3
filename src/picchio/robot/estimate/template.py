"""An estimated sidecar as a file to edit: every number with its range, every joint with its why."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import tomlkit

from picchio.core import spoken
from picchio.core.toml import StrictModel
from picchio.robot.annotations.sidecar import FORMAT, JointEntry, Sidecar, given
from picchio.robot.link import LinkEntry
from picchio.robot.spread import ESTIMATE, Posterior, value_of

WIDTH = 79
NINE_IN_TEN = 1.645
"""Standard deviations either side of the middle that hold 90 % of a normal distribution."""

_COLUMN = 31  # where the comment beside a value begins
_UNIT = {"stiffness": "N m/rad", "damping_ratio": "", "repeated_peak_torque": "N m",
         "rated_torque": "N m", "momentary_peak_torque": "N m"}  # fmt: skip
_EXACT = {"momentary_peak_torque": "goes with the repeated one"}
_HEAD = """\
{name}: its drives, estimated. Nothing was measured but what the robot's own files say.

{origin}

Each number is the middle of what is likely: the truth is as often above as below. The key
beside it that ends in _spread is a factor: in two cases of three the truth lies between
the number divided by it and the number times it. The comment has the range that holds
nine cases of ten. Above each joint stands what its stiffness and torques rest on; the
damping ratio is that of the few robots of which it is known.

To enter what you know, change the number and its spread: 1.05 says that you know it to 5 %.
Say in `source` where it is from. `picchio formats sidecar` lists all that may stand here."""
_POSTERIOR = """\
How the estimates are correlated: where one joint is stiffer than estimated, its neighbours
probably are, too. One row for each name. There is no need to edit it; without it the
estimates count as independent. A name whose spread you delete must go, with its row and
its column."""


def sidecar_text(
    sidecar: Sidecar, *, origin: str, notes: Mapping[str, str], rigid: Mapping[str, Sequence[str]]
) -> str:
    """The file, commented.

    Its joints, tool and posterior are written.

    Args:
        sidecar: estimated.
        origin: what it was made from, a sentence.
        notes: a remark on a joint, by its name.
        rigid: joints without a spring, by the reason in words.

    Returns:
        TOML, which `read_sidecar` reads as the same record; what is a joint's source there
        stands in a comment here.
    """
    name = sidecar.robot or "robot"
    lines = [*comment(_HEAD.format(name=name, origin=origin)), f'format = "{FORMAT}"']
    lines += [f"{key} = {literal(getattr(sidecar, key))}" for key in ("robot", "description")
              if getattr(sidecar, key) is not None]  # fmt: skip
    if sidecar.tool is not None:
        lines += ["", *comment("Where the tool's force acts. Its mass, `mass` in kg with `com` in "
                               "m, adds to the URDF's."), "[tool]"]  # fmt: skip
        lines += [f"{key} = {literal(value)}" for key, value in given(sidecar.tool).items()]
    for link, body in sidecar.link.items():
        lines += ["", *comment(f"{body.source}." if body.source else ""),
                  f"[link.{_key(link)}]", *_link(body)]  # fmt: skip
    for joint, entry in sidecar.joint.items():
        why = notes.get(joint, entry.source or "")
        lines += ["", *comment(why), f"[joint.{_key(joint)}]",
                  *_joint(joint, entry, own=joint in notes)]  # fmt: skip
    for reason, joints in rigid.items():
        lines += ["", *comment(f"Left rigid: {', '.join(joints)}: it {reason}.")]
    if sidecar.posterior is not None:
        lines += ["", *comment(_POSTERIOR), "[posterior]", *_posterior(sidecar.posterior)]
    return "\n".join(lines) + "\n"


def comment(text: str) -> list[str]:
    """A text as lines of comment; an empty line stays one.

    Args:
        text: paragraphs, wrapped already or not.

    Returns:
        the lines, none of them too wide.
    """
    lines: list[str] = []
    for paragraph in text.split("\n\n") if text else ():
        lines += ["#"] if lines else []
        lines += textwrap.wrap(
            paragraph, WIDTH, initial_indent="# ", subsequent_indent="# ",
            break_long_words=False, break_on_hyphens=False,
        )  # fmt: skip
    return lines


def beside(text: str, remark: str) -> str:
    """A line with a comment at its end.

    Args:
        text: key and value.
        remark: what the comment says.

    Returns:
        the line; comments stand under one another.
    """
    return f"{text:<{_COLUMN - 1}} # {remark}"


def literal(value: Any) -> str:
    """A value as TOML has it, numbers as short as they are exact.

    Args:
        value: text, number, list, table or record.

    Returns:
        one line.
    """
    if isinstance(value, StrictModel):
        value = given(value)
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{_key(k)} = {literal(v)}' for k, v in value.items())} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(literal, value))}]"
    if isinstance(value, float):
        short = f"{value:g}"
        text = short if float(short) == value else repr(value)
        text = text.replace("e+0", "e").replace("e+", "e").replace("e-0", "e-")
        return text if any(mark in text for mark in ".en") else f"{text}.0"
    return tomlkit.item(value).as_string()


def likely(value: float, spread: float) -> tuple[float, float]:
    """The ends between which nine cases of ten lie.

    Args:
        value: the middle.
        spread: a factor: one standard deviation of the logarithm is ln of it.

    Returns:
        the lower and the upper end.
    """
    factor = spread**NINE_IN_TEN
    return value / factor, value * factor


def told_range(ends: tuple[float, float], digits: int = 2) -> str:
    """A range in few digits, such as "15,000 to 75,000".

    Args:
        ends: of the range.
        digits: that count.

    Returns:
        the words.
    """
    return spoken.between(ends, lambda end: spoken.number(end, digits))


def _key(name: str) -> str:
    return tomlkit.item({name: 1}).as_string().partition("=")[0].strip()


def _joint(name: str, entry: JointEntry, *, own: bool) -> Iterator[str]:
    values = given(entry)
    yield from _keys(
        {key: value for key, value in values.items() if key not in ("source", "strength")},
        "as its own files have it" if own else "its reducer's",
    )
    yield f"source = {literal((entry.source or '') if own else ESTIMATE)}"
    if entry.strength is not None:
        yield f"[joint.{_key(name)}.strength]"
        yield from _keys(given(entry.strength))


def _link(entry: LinkEntry) -> Iterator[str]:
    values = given(entry)
    for key, unit in (("mass", "kg"), ("com", "m"), ("inertia", "kg m^2, about com")):
        yield beside(f"{key} = {literal(values[key])}", unit)
    yield f"source = {literal(ESTIMATE)}"


def _keys(values: Mapping[str, Any], exact: str = "its reducer's") -> Iterator[str]:
    """A key a line, its spread below it; beside a number of a drive its unit and range."""
    for key, value in values.items():
        if value_of(key) != key:
            continue
        spread = values.get(f"{key}_spread")
        text, unit = f"{key} = {literal(value)}", _UNIT.get(key)
        if unit is not None:
            known = told_range(likely(value, spread)) if spread else _EXACT.get(key, exact)
            text = beside(text, f"{unit}; {known}" if unit else known)
        yield text
        if spread is not None:
            yield f"{key}_spread = {literal(spread)}"


def _posterior(posterior: Posterior) -> Iterator[str]:
    yield "names = ["
    yield from (f"    {literal(name)}," for name in posterior.names)
    yield "]"
    yield "correlation = ["
    yield from (f"    [{', '.join(f'{part:g}' for part in row)}]," for row in posterior.correlation)
    yield "]"
