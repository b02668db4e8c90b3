"""How much of what is wrong on records held out the extended model takes away, without noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from worlds import campaign as worlds
from worlds import robots


def share(found, truth):
    """Share of the held-out excess that is removed, of what the true model removes (which is all).

    Both models, fitted to the records of the search, are held against what the world gave before
    noise was added; samples that count as unknown are left out.

    Args:
        found: a `PercussionDiagnosis`.
        truth: of the campaign.

    Returns:
        1 - (extended excess) / (baseline excess); None where nothing was held out or claimed, or
        where a cause draws numbers anew in every record, which those held out have not told.
    """
    best, baseline = found.search.best.hypothesis, found.search.baseline.hypothesis
    kept = set(found.diagnosis.gain.held_out_records)
    if not best.labels or any(cause.latent is not None for cause in best.causes):
        return None
    if kept == {record.name for record in found.problem.records}:
        return None
    robot = robots.load(truth["robot"])
    records = []
    for record in found.problem.records:
        if record.name not in kept:
            continue
        number = int(record.name.removeprefix("r").removesuffix(".csv")) - 1
        values = {}
        for group, rows in truth["clean"][number].items():
            values |= dict(zip(worlds.channels(group, robot), rows.T, strict=True))
        nothing = {name: np.zeros(record.setup.samples.count) for name in record.values}
        records.append(
            replace(
                record,
                values={name: np.ascontiguousarray(values[name]) for name in record.values},
                _fillers=nothing,
            )
        )

    def excess(hypothesis):
        rows = found.problem.own_residuals(hypothesis.effects, records, None)
        return sum(float((row**2).sum()) for row in rows)

    return 1.0 - excess(best) / excess(baseline)
