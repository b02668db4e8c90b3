"""Outputs are whole or not there."""

import hashlib
import os

import pytest

from picchio.core.errors import InputError
from picchio.core.files import atomic_write, read_text, sha256


def test_a_failed_write_leaves_the_old_file_and_no_litter(tmp_path):
    path = tmp_path / "out.json"
    path.write_text("old")
    with pytest.raises(ZeroDivisionError), atomic_write(path) as stream:
        stream.write("half")
        raise ZeroDivisionError
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["out.json"]


def test_a_good_write_replaces_the_file_with_ordinary_permissions(tmp_path):
    path, plain = tmp_path / "out.bin", tmp_path / "plain"
    plain.write_bytes(b"")
    with atomic_write(path, "wb") as stream:
        stream.write(b"new")
    assert path.read_bytes() == b"new"
    assert path.stat().st_mode == plain.stat().st_mode
    assert sha256(path) == hashlib.sha256(b"new").hexdigest()


def test_a_folder_that_is_not_there_is_named(tmp_path):
    with pytest.raises(InputError, match="nowhere"), atomic_write(tmp_path / "nowhere" / "a.json"):
        pass


def test_a_file_above_the_limit_is_not_read(tmp_path):
    path = tmp_path / "big"
    path.write_bytes(b"x" * 100)
    with pytest.raises(InputError, match="too large"):
        read_text(path, limit=99)
