"""Bad files give one line that names the file, the key, the value and the choices."""

from typing import Literal

import pytest
from pydantic import Field

from picchio.core.errors import InputError
from picchio.core.toml import Positive, StrictModel, parse_toml


class Inner(StrictModel):
    width: Positive
    kind: Literal["pulse", "sine"] = "pulse"


class Outer(StrictModel):
    inner: Inner
    more: list[Inner] = Field(default_factory=list)
    named: dict[str, Inner] = Field(default_factory=dict)


def read(tmp_path, text):
    path = tmp_path / "file.toml"
    path.write_text(text)
    return parse_toml(path, Outer, format="thing/1")


GOOD = 'format = "thing/1"\n[inner]\nwidth = 1.0\n'


def test_a_good_file_is_read(tmp_path):
    assert read(tmp_path, GOOD).inner.width == 1.0


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("[inner]\nwidth = 1.0\n", ["format", "missing", "thing/1"]),
        (GOOD.replace("thing/1", "thing/9"), ["format", "'thing/9'", "valid: thing/1"]),
        (GOOD + "widht = 2.0\n", ["inner", "'widht'", "did you mean 'width'", "kind"]),
        (GOOD.replace("1.0", "-1.0"), ["inner.width", "greater than 0", "-1.0"]),
        (GOOD.replace("1.0", "nan"), ["inner.width", "nan"]),
        (GOOD.replace("1.0", '"wide"'), ["inner.width", "'wide'"]),
        (GOOD + 'kind = "square"\n', ["inner.kind", "'pulse' or 'sine'", "'square'"]),
        (GOOD + "[[more]]\n", ["more[0].width", "missing"]),
        (GOOD + "[[more]]\nwidth = 1\nkin = 2\n", ["more[0]", "'kin'", "did you mean 'kind'"]),
        (GOOD + "[named.a]\nwidth = 1\nwdth = 2\n", ["named.a", "'wdth'", "'width'"]),
        ("a = 1\nformat = =\n", ["not valid TOML", "line 2"]),
        ('format = "thing/1"\n', ["inner", "missing"]),
        ('format = "thing/1"\ninner = 3\n', ["inner", "3"]),
    ],
)
def test_a_bad_file_is_refused_in_one_line(tmp_path, text, parts):
    with pytest.raises(InputError) as caught:
        read(tmp_path, text)
    message = str(caught.value)
    assert "\n" not in message
    assert str(tmp_path / "file.toml") in message
    for part in parts:
        assert part in message


def test_a_missing_file_a_folder_and_bytes_that_are_no_text(tmp_path):
    for path, part in ((tmp_path / "none.toml", "no such file"), (tmp_path, "is a folder")):
        with pytest.raises(InputError, match=part):
            parse_toml(path, Outer, format="thing/1")
    (tmp_path / "latin.toml").write_bytes(b'format = "\xe9"')
    with pytest.raises(InputError, match="not UTF-8"):
        parse_toml(tmp_path / "latin.toml", Outer, format="thing/1")


def test_deep_nesting_ends_in_an_error_not_in_a_crash(tmp_path):
    with pytest.raises(InputError):
        read(tmp_path, 'format = "thing/1"\nx = ' + "[" * 100_000)
