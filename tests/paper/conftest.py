"""A paper that says something else, and a study that is quick."""

from __future__ import annotations

import pytest

from picchio.paper.printed import printed
from picchio.paper.study import Study
from picchio.paper.world import Assumptions


@pytest.fixture(scope="session")
def study():
    """The base world and 40 others."""
    return Study(Assumptions(), count=40)


@pytest.fixture
def altered():
    """A study of a paper with other values: altered(arm={...}, table2=...)."""

    def make(given=None, count=8, **changes):
        paper = printed()
        for part, values in changes.items():
            if isinstance(values, dict):
                values = getattr(paper, part).model_copy(update=values)
            paper = paper.model_copy(update={part: values})
        return Study(given or Assumptions(), count=count, printed=paper)

    return make
