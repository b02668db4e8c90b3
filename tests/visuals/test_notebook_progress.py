"""The bar below a running cell."""

from __future__ import annotations

import pytest

from picchio.visuals import notebook


class Handle:
    """What IPython's `display` returns."""

    def __init__(self) -> None:
        self.shown: list[str] = []

    def update(self, page: object) -> None:
        self.shown.append(page.data)


@pytest.fixture
def handle(monkeypatch: pytest.MonkeyPatch) -> Handle:
    display = pytest.importorskip("IPython.display")
    found = Handle()

    def show(page: object, display_id: bool) -> Handle:
        assert display_id
        found.shown.append(page.data)
        return found

    monkeypatch.setattr(display, "display", show)
    monkeypatch.setattr(notebook, "in_notebook", lambda: True)
    return found


def test_slow_work_shows_a_bar_that_goes(handle, monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(notebook.time, "monotonic", lambda: now[0])
    with notebook.progress("poses <b>") as report:
        for done in range(1, 11):
            now[0] += 0.5
            report(done, 10)
    assert 'value="2" max="10"' in handle.shown[0]  # the first second passes in silence
    assert "poses &lt;b&gt;" in handle.shown[0]
    assert "4 s left" in handle.shown[0]
    assert 'value="10"' in handle.shown[-2]
    assert handle.shown[-1] == ""


def test_quick_work_shows_none(handle) -> None:
    with notebook.progress("poses") as report:
        for done in range(5):
            report(done, 5)
    assert handle.shown == []


def test_a_script_shows_none(capsys: pytest.CaptureFixture[str]) -> None:
    assert not notebook.in_notebook()
    with notebook.progress("poses") as report:
        report(1, 2)
    said = capsys.readouterr()
    assert said.out == said.err == ""
