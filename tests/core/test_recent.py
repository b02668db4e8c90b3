"""What was made lately is kept, the rest is made anew."""

import pytest

from picchio.core.recent import Recent


def test_what_was_not_asked_for_longest_goes_first():
    made = []
    kept = Recent(2)

    def get(key, value="x"):
        return kept.get(key, lambda: made.append(key) or value)

    assert get("a", 1) == 1 and get("b", None) is None
    assert get("a", 2) == 1 and get("b", 3) is None
    assert made == ["a", "b"]
    assert get("a", 3) == 1
    get("c")
    assert get("a", 4) == 1  # was made first, and asked for since
    assert get("b", 5) == 5  # had gone
    assert made == ["a", "b", "c", "b"]


def test_what_fails_is_not_kept():
    kept = Recent(2)
    with pytest.raises(ZeroDivisionError):
        kept.get("a", lambda: 1 / 0)
    assert kept.get("a", lambda: 1) == 1
