"""Public functions say what they take, give back and raise; what is still to do only shrinks."""

import json

import docstrings
import pytest

import picchio


@pytest.fixture(scope="module")
def missing():
    return docstrings.missing()


def test_the_public_surface_is_documented_in_full(missing):
    lacking = [
        f"{module}.{line}"
        for name, home in picchio._HOME.items()
        for module in [f"picchio.{home}"]
        for line in missing.get(module, ())
        if line.split(":")[0].split(".")[0] == name
    ]
    assert not lacking, "\n".join(lacking)


def test_what_is_to_do_only_shrinks(missing):
    to_do = json.loads(docstrings.TO_DO.read_text())
    grown = {name: lines for name, lines in missing.items() if len(lines) > to_do.get(name, 0)}
    assert not grown, f"document these: {json.dumps(grown, indent=2)}"
    done = sorted(to_do.keys() - missing.keys())
    assert not done, f"python tests/docs/docstrings.py --write: no longer to do: {done}"


SAMPLE = '''
def good(a: int) -> int:
    """Add one.

    Args:
        a: a number.

    Returns:
        the next one.

    Raises:
        ValueError: a is negative.
    """
    if a < 0:
        raise ValueError(a)
    return a + 1

def thing() -> int:
    """The number of things."""

def bad(a: int, b: int) -> int:
    """Add them.

    Args:
        a: a number.
    """
    if a < 0:
        raise ValueError(a)
    return a + b

class Base:
    def act(self, a: int) -> None:
        """Act.

        Args:
            a: a number.
        """

class Derived(Base):
    def act(self, a: int) -> None:
        """Act in another way."""
'''


def test_the_checker_sees_what_is_missing_and_nothing_else(tmp_path):
    (tmp_path / "module.py").write_text(SAMPLE)
    found = docstrings.missing(tmp_path)
    assert found == {"picchio.module": ["bad: Args b, Returns, Raises"]}
