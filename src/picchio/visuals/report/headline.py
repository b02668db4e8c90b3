"""The verdict of a diagnosis in a sentence or two."""

from __future__ import annotations

from collections.abc import Sequence

from picchio.diagnosis.result import Cause, Diagnosis, Value
from picchio.model.effects.registry import catalogue
from picchio.visuals.report.page import percent, spread, words

_DETAILED = 3  # causes of one kind whose numbers a headline gives


def headline(diagnosis: Diagnosis) -> str:
    """The verdict in a sentence or two; many causes of a kind are counted."""
    named = "; and ".join(_phrase(kind, causes) for kind, causes in by_kind(diagnosis).items())
    gain = diagnosis.gain
    effect = ""
    if gain is not None and diagnosis.causes:
        seen = "held out" if gain.held_out_records != gain.train_records else "fitted"
        effect = (
            f" On records {seen} the error falls from {percent(gain.baseline_nrmse)} % of the "
            f"signal to {percent(gain.extended_nrmse)} %; noise alone leaves "
            f"{percent(gain.noise_floor_nrmse)} %."
        )
    match diagnosis.verdict:
        case "nothing-wrong":
            return (
                "Nothing wrong: within its stated tolerance the simulation leaves nothing but "
                "noise."
            )
        case "named":
            return f"What is wrong: {named}.{effect}"
        case "ambiguous":
            return (
                f"What is wrong: {named}; or something that these data cannot tell from it.{effect}"
            )
        case "partial":
            share = gain.explained if gain is not None else None
            most = "most" if share is None else f"{percent(min(share, 1.0))} %"
            return (
                f"Part of what is wrong: {named}; or something that acts much like it. It explains "
                f"{most} of the error; more than noise is left, and nothing known explains "
                f"that.{effect}"
            )
    if diagnosis.note:
        return f"The simulation is wrong. {diagnosis.note[:1].upper()}{diagnosis.note[1:]}."
    lead = f" What helped stands below: {len(diagnosis.leads)} leads, no more."
    return "The simulation is wrong, and no known cause explains most of it: none is claimed." + (
        lead if len(diagnosis.leads) > 1 else ""
    )


def by_kind(diagnosis: Diagnosis) -> dict[str, list[Cause]]:
    """Effect -> its causes."""
    found: dict[str, list[Cause]] = {}
    for cause in diagnosis.causes:
        found.setdefault(cause.effect, []).append(cause)
    return found


def _phrase(kind: str, causes: Sequence[Cause]) -> str:
    if len(causes) >= _DETAILED:
        places = len({c.target for c in causes})
        what = f"{words(kind)} in {places} joint{'s' if places > 1 else ''}"
        if catalogue()[kind].periodic:
            return f"{what}, {len(causes)} harmonics"
        return what
    said = []
    for cause in causes:
        parts = ", ".join(_named(name, v) for name, v in shown(cause).items())
        where = "" if cause.target in ("robot", "tool") else f" of {cause.target}"
        said.append(f"{words(kind)}{where}, {parts}" if parts else f"{words(kind)}{where}")
    return "; ".join(said)


def shown(cause: Cause) -> dict[str, Value]:
    """Without the two parts of a wave, whose amplitude is given."""
    parts = dict(cause.parameters)
    if "amplitude" in parts:
        parts = {k: v for k, v in parts.items() if k not in ("cosine", "sine")}
    return parts


def _named(name: str, v: Value) -> str:
    return f"{words(name)} {value_text(v)}"


def value_text(v: Value) -> str:
    """Value and standard deviation."""
    # Delays are told in milliseconds.
    if v.unit == "s":
        return spread(1e3 * v.value, 1e3 * v.std, "ms")
    return spread(v.value, v.std, v.unit)
