"""Which other effects would do as well as one that was found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from picchio.diagnosis.motion.criteria.necessity import (
    contribution,
    indistinguishable,
    necessity,
    passes,
)
from picchio.diagnosis.motion.criteria.score import Scorer
from picchio.diagnosis.motion.data.system import System
from picchio.diagnosis.motion.fit.least_squares import Fit
from picchio.diagnosis.motion.search.candidates import candidates
from picchio.model.effects.effect import Effect


def alternatives(
    system: System, current: Fit, kinds: Mapping[str, type[Effect]]
) -> dict[int, list[tuple[str, str]]]:
    """Number of an effect of the fit -> those that the training records can't tell from it.

    A rival takes the effect's place beside all others. It can't be told apart where it is
    nearly as likely, or where its losses are not of one sign over the stretches held out.
    """
    slow = {name: kind for name, kind in kinds.items() if not kind.periodic}
    scorer = Scorer(system, current)
    found: dict[int, list[tuple[str, str]]] = {}
    for index, effect in enumerate(current.state.effects):
        if effect.periodic:
            continue
        score = necessity(scorer, index)
        own, part = contribution(current, index)
        if score is None:
            continue
        back = current.columns[:, own] @ part
        # Derivatives are those without the effect: a gain would else scale its rival with it.
        state = current.state.without(index)
        residual = system.measured - system.predict(state.every, state.scales)
        without = replace(current, state=state, residual=residual)
        near = effect.target if effect.target_kind == "joint" else None
        for candidate in candidates(system, without, slow, near):
            other = scorer.score(candidate.columns, candidate.coordinates, candidate.neutral,
                                 searched=candidate.searched, without=own, back=back)  # fmt: skip
            if other is None or not passes(other) or not set(other.groups) & set(score.groups):
                continue
            same = candidate.label == (effect.name, effect.target)
            if not same and indistinguishable(score, other):
                known = found.setdefault(index, [])
                if candidate.label not in known:
                    known.append(candidate.label)
    return found
