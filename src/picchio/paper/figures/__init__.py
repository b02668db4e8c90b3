"""The paper's figures and those that show where it errs, in the order of the page."""

from __future__ import annotations

from picchio.paper.figures import blows, envelope, life, reach, rivets, table2
from picchio.paper.figures.base import PaperFigure
from picchio.paper.study import Study
from picchio.paper.waterfall import Step


def all_figures(study: Study, steps: tuple[Step, ...]) -> tuple[PaperFigure, ...]:
    """Every figure."""
    return (
        blows.figure_4(study),
        blows.figure_8(study),
        envelope.figure_9(study),
        reach.figure_10(study),
        life.figure_11(study),
        rivets.figure_12(study),
        rivets.figures_13_to_15(study),
        table2.lives(study),
        table2.hypotheses(study),
        *envelope.dominance(study),
        *life.gravity(study),
        envelope.reach_of_path(study),
        reach.rings(study),
        *reach.axis_forces(study),
        blows.steady_state(study),
        life.shaft(study),
        blows.phase(study),
        rivets.influence(study),
        life.corrections(steps),
    )
