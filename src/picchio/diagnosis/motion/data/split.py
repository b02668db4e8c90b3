"""Which records a model is fitted to, and which it is judged on."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from picchio.core.errors import InputError
from picchio.prediction.motion.log import MotionLog

_COVERED = 0.9
_LEAST_SHARE = 3


def split(
    logs: Sequence[MotionLog], train: Collection[str] = (), held_out: Collection[str] = ()
) -> tuple[list[MotionLog], list[MotionLog]]:
    """Training and held-out records.

    Those that are named, if any are: where one side is, the other is all the rest; what neither
    side names is left aside.

    Else records in which the fewest joints move come first (so that joints are known one by one
    before they move together), in the campaign's order. They are taken until every joint that ever
    moves has moved and a third of the records is in. Then, as long as two records would be left,
    the fastest is added while the others are faster by more than a tenth in some joint than what
    is in: a model is not to be judged where it was never fitted. At least one record is held out
    where there are two.

    Args:
        logs: all motion records.
        train: names of records to fit to.
        held_out: names of records to judge by.

    Raises:
        InputError: a name that no record has, or that is on both sides; nothing left to fit to.
    """
    if train or held_out:
        return _named(logs, train, held_out)
    order = sorted(range(len(logs)), key=lambda i: (len(logs[i].moving), i))
    every = {joint for log in logs for joint in log.moving}
    inside: list[int] = []
    for i in order:
        known = {joint for k in inside for joint in logs[k].moving}
        if known >= every and len(inside) * _LEAST_SHARE >= len(logs):
            break
        if len(logs) - len(inside) <= 1 and inside:
            break
        inside.append(i)
    speed = [_speeds(log) for log in logs]
    while len(logs) - len(inside) > 2:
        rest = [i for i in order if i not in inside]
        covered: dict[str, float] = {}
        for k in inside:
            covered |= {j: max(v, covered.get(j, 0.0)) for j, v in speed[k].items()}
        uncovered = [
            i for i in rest
            if any(_COVERED * v > covered.get(joint, 0.0) for joint, v in speed[i].items())
        ]  # fmt: skip
        if not uncovered:
            break
        inside.append(max(uncovered, key=lambda i: max(speed[i].values())))
    return [logs[i] for i in sorted(inside)], [
        logs[i] for i in range(len(logs)) if i not in inside
    ]  # fmt: skip


def _named(
    logs: Sequence[MotionLog], train: Collection[str], held_out: Collection[str]
) -> tuple[list[MotionLog], list[MotionLog]]:
    files = [log.file for log in logs]
    for key, names in (("train", train), ("held_out", held_out)):
        for name in names:
            if name not in files:
                raise InputError("no motion record has this name", key=key, value=name,
                                 choices=files)  # fmt: skip
    if both := sorted(set(train) & set(held_out)):
        raise InputError("a record cannot be fitted to and held out", key="held_out", value=both[0])
    inside = [log for log in logs if (log.file in train if train else log.file not in held_out)]
    outside = [log for log in logs if (log.file in held_out if held_out else log.file not in train)]
    if not inside:
        raise InputError("no record is left to fit to", key="held_out", value=", ".join(held_out))
    return inside, outside


def _speeds(log: MotionLog) -> dict[str, float]:
    """Joint -> the fastest, over a fiftieth of the record: noise counts for nothing."""
    width = max(1, log.samples // 50)
    return {
        joint: float(np.abs(log.angle[joint][width:] - log.angle[joint][:-width]).max())
        * log.rate / width
        for joint in log.moving
    }  # fmt: skip
