"""Public functions say what they take, give back and raise; what is still to do only shrinks."""

import json
import re

import docstrings
import pytest

import picchio


@pytest.fixture(scope="module")
def missing():
    return docstrings.missing()


def _imported_by_guides():
    """(module, name) of all that README, guides and notebooks import."""
    pages = [docstrings.ROOT / "README.md", docstrings.ROOT / "CONTRIBUTING.md"]
    pages += [*(docstrings.ROOT / "docs").rglob("*.md")]
    texts = [page.read_text(encoding="utf-8") for page in pages]
    for path in (docstrings.ROOT / "notebooks").glob("*.ipynb"):
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        texts += ["".join(cell["source"]) for cell in cells]
    for text in texts:
        for module, names in re.findall(r"from (picchio[\w.]*) import (\([^)]*\)|[^\n]*)", text):
            yield from ((module, name) for name in re.findall(r"\w+", names))


def test_all_that_a_user_meets_is_documented_in_full(missing):
    start = {(f"picchio.{home}", name) for name, home in picchio._HOME.items()}
    met = docstrings.reached(start | set(_imported_by_guides()))
    assert ("picchio.studies.assessment.result", "JointLife") in met  # what `assess` leads to
    lacking = [
        f"{module}.{line}"
        for module, lines in missing.items()
        for line in lines
        if (module, line.split(":")[0].split(".")[0]) in met
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
