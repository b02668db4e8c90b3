"""The whole reproduction: everything that the page shows and the JSON holds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

from picchio.core.errors import InputError
from picchio.core.html import sheet
from picchio.core.processes import one_thread
from picchio.core.provenance import provenance
from picchio.core.results import TableResult
from picchio.paper.assumptions import INPUTS, Assumptions, parse_assumptions
from picchio.paper.claims import Tried, try_claims
from picchio.paper.conflicts import Conflict, conflicts
from picchio.paper.equations import Equation, equations
from picchio.paper.figures import all_figures
from picchio.paper.figures.base import PaperFigure
from picchio.paper.influence import Influence, influences
from picchio.paper.printed import paper_file
from picchio.paper.study import WORLDS, Study
from picchio.paper.table2.answer import Answer, answer
from picchio.paper.verdict import Verdict
from picchio.paper.waterfall import Step, waterfall
from picchio.paper.world import World

FORMAT = "picchio-reproduction/1"


@dataclass(frozen=True, eq=False, repr=False)
class Reproduction(TableResult):
    """All that was found; its table is the claims with their verdicts.

    Attributes:
        study: what it was found with.
        claims: every claim with its verdict, as the paper makes them.
        conflicts: what does not fit together.
        equations: eqs. 1 to 22.
        figures: by name.
        steps: the life by each correction.
        influences: of every unreported input.
        answer: what explains Table 2.
        origin: provenance.
    """

    LACKS: ClassVar = {
        "plot": "it has many: `.figures[name].plot()`",
        "show": "it is about a paper's sentences",
    }

    PAGE = "paper.page:reproduction_page"

    study: Study
    claims: tuple[Tried, ...]
    conflicts: tuple[Conflict, ...]
    equations: tuple[Equation, ...]
    figures: dict[str, PaperFigure]
    steps: tuple[Step, ...]
    influences: tuple[Influence, ...]
    answer: Answer
    origin: dict[str, Any]

    @property
    def counts(self) -> dict[str, int]:
        """How many claims got each verdict."""
        return {str(v): sum(tried.finding.verdict is v for tried in self.claims) for v in Verdict}

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
        return [tried.to_dict() for tried in self.claims]

    def _repr_html_(self) -> str:
        rows = [
            (t.sentence.page, t.sentence.quote, f"{t.finding.verdict} {t.finding.condition}")
            for t in self.claims
        ]
        columns = ("p.", "claim", "verdict")
        return sheet(self.study.printed.title, None, columns, rows, head=self._headline())

    def _content(self) -> dict[str, Any]:
        printed = self.study.printed
        return {
            "format": FORMAT,
            "paper": {"title": printed.title, "journal": printed.journal, "doi": printed.doi},
            "assumptions": {
                entry.name: {
                    "value": getattr(self.study.given, entry.name),
                    "unit": entry.unit,
                    "low": entry.low,
                    "high": entry.high,
                    "choices": list(entry.choices) or None,
                    "why": entry.why,
                }
                for entry in INPUTS
            },
            "worlds": len(self.study.worlds),
            "counts": self.counts,
            "claims": self._rows(),
            "conflicts": [asdict(found) for found in self.conflicts],
            "slips": [slip.model_dump() for slip in printed.slips],
            "equations": [asdict(equation) for equation in self.equations],
            "table1": {
                "mass": printed.arm.masses,
                "centre_of_gravity": printed.arm.centres_of_gravity,
                "inertia": printed.arm.inertias,
            },
            "table2": self.answer.to_dict(),
            "life": [step.to_dict() for step in self.steps],
            "influence": {entry.name: entry.to_dict() for entry in self.influences},
            "figures": [figure.to_dict() for figure in self.figures.values()],
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
    steps = waterfall(study.base)
    claims = try_claims(study)
    figures = {figure.name: figure for figure in all_figures(study, steps)}
    return Reproduction(
        study=study,
        claims=claims,
        conflicts=tuple(conflicts(study, figures)),
        equations=equations(study),
        figures=figures,
        steps=steps,
        influences=influences(study),
        answer=answer(study),
        origin=provenance([paper_file()], seed=seed),
    )
