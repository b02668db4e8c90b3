"""The whole reproduction: everything that the page shows and the JSON holds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np

from picchio.core.errors import InputError
from picchio.core.html import sheet
from picchio.core.processes import one_thread
from picchio.core.provenance import provenance
from picchio.core.results import TableResult
from picchio.paper.claims import Finding, Verdict, try_claims
from picchio.paper.equations import equations
from picchio.paper.figures import PaperFigure, all_figures, number
from picchio.paper.printed import paper_file, trials
from picchio.paper.study import WORLDS, Study
from picchio.paper.table2.by_arm import FREE
from picchio.paper.table2.by_curve import OTHER_CURVE, one_digit_off
from picchio.paper.world import Assumptions, World, parse_assumptions

FORMAT = "picchio-reproduction/1"


@dataclass(frozen=True)
class Conflict:
    """Two statements of the paper that cannot both be true.

    Attributes:
        name: unique.
        says: what the paper says, with its pages.
        but: what follows from its own numbers.
        number: that decides.
        figure: name of the figure that shows it.
    """

    name: str
    says: str
    but: str
    number: float
    figure: str


@dataclass(frozen=True, eq=False, repr=False)
class Reproduction(TableResult):
    """All that was found; its table is the claims with their verdicts.

    Attributes:
        study: what it was found with.
        claims: every claim with its verdict, as the paper makes them.
        conflicts: what does not fit together.
        equations: eqs. 1 to 22.
        figures: by name.
        answer: what explains Table 2.
        origin: provenance.
    """

    LACKS: ClassVar = {
        "plot": "it has many: `.figures[name].plot()`",
        "show": "it is about a paper's sentences",
    }

    PAGE = "paper.page:reproduction_page"

    study: Study
    claims: tuple[Finding, ...]
    conflicts: tuple[Conflict, ...]
    equations: list[dict[str, Any]]
    figures: dict[str, PaperFigure]
    answer: dict[str, Any]
    origin: dict[str, Any]

    @property
    def counts(self) -> dict[str, int]:
        """How many claims got each verdict."""
        return {str(v): sum(found.verdict is v for found in self.claims) for v in Verdict}

    def world(self, **assume: float | str) -> World:
        """The paper's figures in a world of other assumptions.

        Args:
            **assume: in place of picchio's own, such as `period=0.05`.
        """
        return World(Assumptions(**assume))  # type: ignore[arg-type]

    def _headline(self) -> str:
        counts = ", ".join(f"{n} {verdict}" for verdict, n in self.counts.items())
        return f"{len(self.claims)} claims: {counts}"

    def _rows(self) -> list[dict[str, Any]]:
        return [{**asdict(found), "verdict": str(found.verdict)} for found in self.claims]

    def _repr_html_(self) -> str:
        rows = [(c.page, c.quote, f"{c.verdict} {c.condition or ''}") for c in self.claims]
        columns = ("p.", "claim", "verdict")
        return sheet(self.study.printed.title, None, columns, rows, head=self._headline())

    def _content(self) -> dict[str, Any]:
        printed = self.study.printed
        assumed = {}
        for name, entry in trials().inputs.items():
            kept = {key: getattr(entry, key) for key in ("unit", "low", "high", "why")}
            own = {"value": getattr(self.study.given, name), "choices": list(entry.choices) or None}
            assumed[name] = {**own, **kept}
        arm = printed.arm
        links = {"mass": arm.masses, "centre_of_gravity": arm.centres_of_gravity}
        return {
            "format": FORMAT,
            "paper": {key: getattr(printed, key) for key in ("title", "journal", "doi")},
            "assumptions": assumed,
            "worlds": len(self.study.worlds),
            "counts": self.counts,
            "claims": self._rows(),
            "conflicts": self.conflicts,
            "slips": [{"page": slip.page, "says": slip.says} for slip in printed.slips],
            "equations": self.equations,
            "table1": {**links, "inertia": arm.inertias},
            "table2": self.answer,
            "life": self.study.steps,
            "influence": {entry.name: entry for entry in self.study.influences},
            "figures": list(self.figures.values()),
            "provenance": self.origin,
        }


@one_thread()
def reproduce(
    assume: Assumptions | Mapping[str, float | str] | None = None,
    *,
    worlds: int = WORLDS,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> Reproduction:
    """Recompute the figures, tables and claims of Nie et al. 2016, and say which hold.

    Args:
        assume: what the paper leaves open, for the base world: `{"period": 0.1}`, or all of it.
        worlds: how many other sets of assumptions a claim is tried in, at least 8.
        seed: of their draw.
        progress: called with (steps done, steps in all).

    Returns:
        every claim with its verdict, the tables and the figures.

    Raises:
        InputError: an unknown assumption, or assumptions that put the rivets out of reach.
    """
    if worlds < 8:
        raise InputError("must be at least 8", key="worlds", value=worlds)
    if not isinstance(assume, Assumptions):
        assume = parse_assumptions(f"{name}={value}" for name, value in (assume or {}).items())
    study = Study(assume, worlds, seed, progress)
    _ = study.base.rivet_poses, study.base.path_poses  # what is out of reach is said at once
    figures = all_figures(study)
    return Reproduction(
        study=study,
        claims=try_claims(study),
        conflicts=conflicts(figures),
        equations=equations(study),
        figures=figures,
        answer=answer(study),
        origin=provenance([paper_file()], seed=seed),
    )


def conflicts(figures: Mapping[str, PaperFigure]) -> tuple[Conflict, ...]:
    """What does not fit together, by the numbers of the figures that show it."""
    found = []
    for name, entry in trials().conflicts.items():
        words = {**figures[entry["figure"]].words, **figures[entry["figure"]].data}
        says, but = entry["says"].format(**words), entry["but"].format(**words)
        decides = float(number(words, entry["number"]))
        found.append(Conflict(name, says, but, decides, entry["figure"]))
    return tuple(found)


def answer(study: Study) -> dict[str, Any]:
    """What explains Table 2, how certainly, and what remains unknown.

    `lead` is how much better, in the criterion, the best is than the best that keeps the printed
    curve; `crossing` is where the two curves meet; `shared_variance` is b of the one over that of
    the other: r^2 of a scatter of points of which they would be the two regression lines; `alike`
    are the ranges of the inputs among worlds that fit the means about as well.
    """
    table, comparison, printed = study.curve_of_table, study.comparison, study.printed.sn_curve
    a, b = table.other.values["a"], table.other.values["b"]
    cycles = (a / printed.a) ** (1.0 / (printed.b - b))
    base = study.base.rivet_stress.mean(axis=1)
    keeps = min(f.bic for f in table.fits if f.name != OTHER_CURVE)
    kept = next(h for h in comparison.hypotheses if not h.fit.rule.free_exponent)
    misprint = {"entry": table.misprint, "factor": table.misprint_factor}
    lead = {"entries_alone": keeps - table.other.bic}
    lead["with_the_arm"] = kept.bic - comparison.hypotheses[0].bic
    worlds = [f.world for f in comparison.alike if f.cost < 2.0 * comparison.alike[0].cost]
    ranges = {n: [float(w[n]) for w in worlds] for n in (*FREE, "stress_per_twist")}
    return {
        "base_mean_stress": base,
        "base_cycles": printed.cycles(base),
        "fitted_mean_stress": np.asarray(study.fitted.rivet_stress.mean(axis=1)),
        "curve": table.other,
        "misprint": {**misprint, "nearest_digit": one_digit_off(table)},
        "lead": lead,
        "crossing": {"cycles": cycles, "stress": printed.a * cycles**printed.b},
        "shared_variance": printed.b / b,
        "hypotheses": comparison.hypotheses,
        "alike": {name: (min(values), max(values)) for name, values in ranges.items()},
    }
