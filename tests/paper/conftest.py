"""A paper that says something else, and a study that is quick."""

from __future__ import annotations

import importlib
import pkgutil

import pytest

import picchio.paper as package
from picchio.paper import printed as printed_module
from picchio.paper.assumptions import Assumptions
from picchio.paper.study import Study


@pytest.fixture(scope="session")
def study():
    """The base world and 40 others."""
    return Study(Assumptions(), count=40)


@pytest.fixture
def altered(monkeypatch):
    """A study of a paper with other values: altered(arm={...}, table2=...)."""
    from picchio.paper import arm

    def make(given=None, count=8, **changes):
        paper = printed_module.printed()
        for part, values in changes.items():
            if isinstance(values, dict):
                values = getattr(paper, part).model_copy(update=values)
            paper = paper.model_copy(update={part: values})
        for found in pkgutil.walk_packages(package.__path__, "picchio.paper."):
            module = importlib.import_module(found.name)
            if callable(getattr(module, "printed", None)):
                monkeypatch.setattr(module, "printed", lambda: paper)
        arm._bare_arm.cache_clear()
        return Study(given or Assumptions(), count=count)

    yield make
    monkeypatch.undo()
    arm._bare_arm.cache_clear()
