"""Other sets of causes, told by what they have in place of what."""

from __future__ import annotations

from picchio.diagnosis.result import Diagnosis

Pairs = tuple[tuple[str, str], ...]


def differences(diagnosis: Diagnosis) -> list[tuple[Pairs, Pairs]]:
    """What each alternative set has that the causes lack, and the other way round.

    Returns:
        (effect, target) that come, and those that go; each difference once.
    """
    mine = tuple(dict.fromkeys((c.effect, c.target) for c in diagnosis.causes))
    found = []
    for other in diagnosis.alternatives:
        come = tuple(dict.fromkeys(pair for pair in other if pair not in mine))
        gone = tuple(pair for pair in mine if pair not in other)
        if come or gone:
            found.append((come, gone))
    return list(dict.fromkeys(found))


def in_words(difference: tuple[Pairs, Pairs]) -> str:
    """A difference as a phrase."""
    come, gone = (
        " and ".join(f"{effect.replace('_', ' ')} of {target}" for effect, target in pairs)
        for pairs in difference
    )
    if come and gone:
        return f"{come} in place of {gone}"
    return f"{come} as well" if come else f"all but {gone}"
