"""Every output under every fault: one line, the old or the new one whole, no litter."""

import os

import faults
import pytest

import picchio


def cells():
    for output in faults.OUTPUTS:
        for fault, tried in faults.FAULTS.items():
            # A disk of its own, and outputs that take seconds again and again, are the script's.
            if tried is faults.full_disk or (output.slow and tried is not faults.size_limit):
                continue
            slow = output.slow or (output.threads and tried is not faults.read_only)
            marks = [pytest.mark.slow] if slow else []
            # The paper is reproduced twice for it: before a release.
            marks += [pytest.mark.minutes] * output.typed.startswith("reproduce")
            yield pytest.param(output, tried, marks=marks, id=f"{output.title}-{fault}")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("faults")
    faults.inputs(made)
    with pytest.MonkeyPatch.context() as patch:
        for name in ("diagnose", "identify"):
            patch.setattr(picchio, name, once(getattr(picchio, name)))
        yield made


def once(compute):
    """Every row reads the same campaign: the first finds what each then writes, forks as well."""
    found = []

    def remembered(*given, **options):
        if not found:
            found.append(compute(*given, **options))
        return found[0]

    return remembered


@pytest.mark.parametrize(("output", "tried"), list(cells()))
def test_an_output_withstands_a_fault(output, tried, folder):
    assert tried(output, folder)


def test_the_limit_is_felt(tmp_path):
    """And is a process's own: here a file may grow."""
    if (child := os.fork()) == 0:
        faults.limited()
        try:
            (tmp_path / "x").write_bytes(bytes(800))
        except OSError:
            os._exit(0)
        os._exit(1)
    assert os.waitpid(child, 0)[1] == 0
    (tmp_path / "x").write_bytes(bytes(800))
