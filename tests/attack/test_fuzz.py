"""Every reader's spoiled files for a second; `python tests/attack/fuzz.py` goes on for longer."""

import fuzz
import pytest


@pytest.mark.parametrize("reader", fuzz.READERS)
def test_a_spoiled_file_is_read_or_refused_in_one_line(reader, tmp_path):
    told = fuzz.fuzz(reader, tmp_path, 1.0, seed=1)
    assert not told["found"], "\n".join(told["found"])
    # It must have got somewhere: further than one good file leads.
    assert told["tries"] >= fuzz.LEAST and told["lines"] > 30


def test_what_is_wrong_is_found(tmp_path, monkeypatch):
    """A reader that raises, one that asks for too much memory, one that crashes."""

    def numbers(folder):
        int((folder / "a.txt").read_text())

    def hoards(folder):
        bytearray(1 << int((folder / "a.txt").read_bytes()[0] > 0x39) * 40)

    def crashes(folder):
        if (folder / "a.txt").read_bytes()[:2] != b"12":
            fuzz.os.kill(fuzz.os.getpid(), 11)

    for name, read, word in (
        ("numbers", numbers, "ValueError"),
        ("hoards", hoards, "MemoryError"),
        ("crashes", crashes, "died: -11"),
    ):
        (tmp_path / name).mkdir()
        monkeypatch.setitem(fuzz.READERS, name, fuzz.Reader(fuzz.texts(a__txt="12"), read))
        assert word in "".join(fuzz.fuzz(name, tmp_path / name, 2.0)["found"])
