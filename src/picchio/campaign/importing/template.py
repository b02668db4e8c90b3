"""A mapping to start from: every series of a file, to be given its channel."""

from __future__ import annotations

import json
from pathlib import Path

from picchio.campaign.channels import patterns
from picchio.campaign.importing.importer import read_raw
from picchio.campaign.importing.mapping import FORMAT
from picchio.campaign.importing.raw import RawChannel, RawFile
from picchio.core.errors import InputError
from picchio.core.files import write_text

_TIMES = ("t", "time", "time [s]", "time_s", "timestamp", "zeit")


def write_mapping(file: str | Path, out: str | Path) -> None:
    """Write a mapping to start from, for a file that is to be imported.

    Args:
        file: to be imported.
        out: where the mapping goes; a file that stands there is left alone.

    Raises:
        InputError: the file cannot be read, or `out` exists or cannot be written.
    """
    if Path(out).exists():
        raise InputError("exists already and is left alone", file=out)
    write_text(out, mapping_template(read_raw(file)))


def mapping_template(raw: RawFile) -> str:
    """The text of a `picchio-mapping/1` file that lists the series, each commented out.

    Args:
        raw: as `read_raw` gives it.
    """
    lines = [
        f"# What the series of {raw.path.name} become; see picchio import --help.",
        f'format = "{FORMAT}"',
        "",
        "[source]",
        f'kind = "{raw.kind}"',
        *(_csv_layout(raw) if raw.kind == "csv" else ()),
        "",
        "[time]",
        *_time(raw),
        "# zero = 0.0               # s: this time becomes t = 0, the first edge of the first blow",
        "",
        "[record]                   # the keys of a campaign's [[record]]",
        'kind = "percussion"        # or "motion"',
        "# pose = { joint_1 = 0.0 }  # rad",
        "# direction = [1.0, 0.0, 0.0]",
        "# hits = 12",
        "",
        "[campaign]                 # the keys of campaign.toml",
        '# robot = "fanuc_like_3dof"',
        "# excitation = { kind = 'pulse_train', force = 300.0, period = 0.040, width = 0.004 }",
        "",
        "# Channels: " + ", ".join(patterns()),
        "# value = sign * (scale * stored + offset), in unit",
    ]
    for channel in raw.channels.values():
        lines += ["", *_channel(channel)]
    return "\n".join(lines) + "\n"


def _csv_layout(raw: RawFile) -> list[str]:
    from picchio.campaign.importing.read_csv import _guess

    layout = _guess(raw.path)
    return [f"delimiter = {_quoted(layout.delimiter)}", f'decimal = "{layout.decimal}"']


def _time(raw: RawFile) -> list[str]:
    if any(channel.time is not None for channel in raw.channels.values()):
        return ["# the file's own stamps are used",
                '# resample = "linear"      # where they are uneven; then a rate, in Hz',
                "# rate = 500.0"]  # fmt: skip
    named = [n for n in raw.channels if n.rpartition(".")[2].lower() in _TIMES]
    if named:
        return [f"series = {_quoted(named[0])}", 'unit = "s"']
    return [
        '# series = "..."           # which holds the time; or',
        "rate = 1000.0              # Hz",
    ]


def _channel(channel: RawChannel) -> list[str]:
    low, high = channel.values.min(), channel.values.max()
    about = f"# {channel.values.size} samples, {low:.6g} to {high:.6g}"
    note = f" ({channel.note})" if channel.note else ""
    unit = channel.unit or "..."
    return [
        about + note,
        "# [[channel]]",
        f"# from = {_quoted(channel.name)}",
        f"# to = {_quoted(channel.suggestion or '...')}",
        f"# unit = {_quoted(unit)}",
    ]


def _quoted(text: str) -> str:
    """A TOML basic string."""
    return json.dumps(text, ensure_ascii=False)
