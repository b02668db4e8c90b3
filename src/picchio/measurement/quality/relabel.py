"""Which labels fit what is seen: of a sensor's axes, in any order and sign; of joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from picchio.campaign.channels import AXES
from picchio.core.arrays import ComplexArray, FloatArray
from picchio.model.effects.sensors.sensor_axes import CHOICES


@dataclass(frozen=True)
class Relabelling:
    """How the axes fit best.

    Attributes:
        as_labelled: mean cosine between what is seen and what must be, axes as labelled.
        best: the same with the axes that fit best.
        rivals: how many other ways fit as well.
        words: what each axis shows that is not its own; empty where the labels fit best.
    """

    as_labelled: float
    best: float
    rivals: int
    words: str


def relabel(seen: Sequence[ComplexArray], must: Sequence[ComplexArray]) -> Relabelling:
    """The signed order of the axes that fits best.

    Args:
        seen: (3, ...) each, what the axes show; real or complex.
        must: the same, what they must show.
    """
    unit = [a / max(float(np.linalg.norm(a)), 1e-300) for a in seen]
    right = [b / max(float(np.linalg.norm(b)), 1e-300) for b in must]
    # products[a, b]: what axis a shows, times what axis b must show
    products = np.mean(
        [np.real(a.reshape(3, -1) @ b.reshape(3, -1).conj().T)
         for a, b in zip(unit, right, strict=True)], axis=0,
    )  # fmt: skip
    scores = {
        (order, signs): float(sum(signs[a] * products[a, order[a]] for a in range(3)))
        for order, signs in CHOICES
    }
    labelled = scores[(0, 1, 2), (1, 1, 1)]
    (order, signs), best = max(scores.items(), key=lambda item: item[1])
    words = ", ".join(
        f"{AXES[a]} shows {'-' if signs[a] < 0 else ''}{AXES[order[a]]}"
        for a in range(3)
        if order[a] != a or signs[a] < 0
    )
    rivals = sum(score > best - 0.02 for score in scores.values()) - 1
    return Relabelling(labelled, best, rivals, words)


def cosines(seen: FloatArray, must: FloatArray) -> FloatArray:
    """(n,) between what one joint shows and what each must; 0 where there is nothing to show.

    Args:
        seen: (m,).
        must: (n, m), a joint each.
    """
    size = np.linalg.norm(must, axis=1) * np.linalg.norm(seen)
    return np.where(size > 0.0, must @ seen / np.where(size > 0.0, size, 1.0), 0.0)
