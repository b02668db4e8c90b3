"""Every way to break a campaign: one clear line, nothing lost, nothing half-written."""

import hashlib

import pytest

from picchio.campaign.campaign import load_campaign
from picchio.core.errors import InputError

from .conftest import write_good

POSE = "pose = { joint_1 = 0.3, joint_2 = 0.5, joint_3 = -0.8 }"
DIRECTION = "direction = [1.0, 0.0, 0.0]"
# name: (old text, new text, words of the message), in campaign.toml
TABLE = {
    "no format": ('format = "picchio-campaign/1"\n', "", ["format", "missing"]),
    "a later format": ("campaign/1", "campaign/2", ["format", "picchio-campaign/2"]),
    "another format": ("picchio-campaign/1", "picchio-task/1", ["picchio-task/1"]),
    "broken TOML": ("[excitation]", "[excitation", ["TOML", "line"]),
    "a duplicate key": ("force = 300.0", "force = 300.0\nforce = 1.0", ["TOML", "line"]),
    "a misspelt table": ("[excitation]", "[excitaton]", ["excitaton", "excitation"]),
    "a misspelt key": ("width = 0.004", "widht = 0.004", ["widht", "width"]),
    "a misspelt record key": ("temperature =", "temprature =", ["record[0]", "temprature"]),
    "no records": ("[[record]]", "[[recrod]]", ["recrod", "record"]),
    "no file": ('file = "r01.csv"\n', "", ["record[0].file", "missing"]),
    "an empty file name": ('"r01.csv"', '""', ["record[0].file"]),
    "a file that is not there": ('"r01.csv"', '"r09.csv"', ["r09.csv", "no such file"]),
    "a file of another kind": ('"r01.csv"', '"r01.xlsx"', ["r01.xlsx", ".csv", ".parquet"]),
    "a file outside": ('"r01.csv"', '"../r01.csv"', ["inside the campaign"]),
    "an absolute file": ('"r01.csv"', '"/etc/r01.csv"', ["inside the campaign"]),
    "a Windows path": ('"r01.csv"', "'C:\\r01.csv'", ["inside the campaign"]),
    "backslashes": ('"r01.csv"', "'sub\\r01.csv'", ["inside the campaign"]),
    "a file named twice": ('"r02.csv"', '"r01.csv"', ["record[1].file", "record[0]"]),
    "a file twice by another spelling": ('"r02.csv"', '"./r01.csv"', ["record[1].file"]),
    "an unknown kind": ('kind = "motion"', 'kind = "moving"', ["record[1].kind", "motion"]),
    "a blow's kind as the record's": ('"percussion"', '"half_sine_train"', ["percussion"]),
    "an unknown blow": ("pulse_train", "pulse", ["excitation.kind", "half_sine_train"]),
    "no pose": (POSE + "\n", "", ["record[0].pose", "r01.csv"]),
    "a pose of text": (POSE, 'pose = "home"', ["record[0].pose", "home"]),
    "a pose with text": ("joint_2 = 0.5", 'joint_2 = "0.5"', ["pose", "joint_2"]),
    "a pose with a truth": ("joint_2 = 0.5", "joint_2 = true", ["pose", "joint_2"]),
    "a pose with NaN": ("joint_2 = 0.5", "joint_2 = nan", ["pose", "joint_2", "finite"]),
    "a pose with infinity": ("joint_2 = 0.5", "joint_2 = inf", ["pose", "joint_2", "finite"]),
    "a joint twice": ("joint_2 = 0.5", "joint_1 = 0.5", ["TOML", "line"]),
    "a nameless joint": ("joint_2 = 0.5", '"" = 0.5', ["pose", "no name"]),
    "no direction": (DIRECTION + "\n", "", ["record[0].direction"]),
    "a flat direction": (DIRECTION, "direction = [1.0, 0.0]", ["record[0].direction", "3"]),
    "a long direction": (DIRECTION, "direction = [1.0, 0.0, 0.0, 0.0]", ["direction", "3"]),
    "a zero direction": (DIRECTION, "direction = [0.0, 0.0, 0.0]", ["direction", "zero"]),
    "a direction with NaN": (DIRECTION, "direction = [nan, 0.0, 0.0]", ["direction"]),
    "a direction in words": (DIRECTION, 'direction = "x"', ["direction"]),
    "no hits": ("hits = 12", "hits = 0", ["excitation.hits", "0"]),
    "negative hits": ("hits = 12", "hits = -3", ["excitation.hits", "-3"]),
    "half a hit": ("hits = 12", "hits = 12.5", ["excitation.hits", "12.5"]),
    "hits in words": ("hits = 12", 'hits = "12"', ["excitation.hits"]),
    "a period of zero": ("period = 0.040", "period = 0.0", ["excitation.period"]),
    "a negative width": ("width = 0.004", "width = -0.004", ["excitation.width"]),
    "a blow longer than its period": ("width = 0.004", "width = 0.05", ["width", "shorter"]),
    "no width": ("width = 0.004\n", "", ["record[0].excitation.width"]),
    "an infinite force": ("force = 250.0", "force = inf", ["record[0].force"]),
    "a force of NaN": ("force = 300.0", "force = nan", ["excitation.force"]),
    "a force in words": ("force = 250.0", 'force = "much"', ["record[0].force", "much"]),
    "a blow file outside": ("hits = 12", 'hits = 12\nfile = "../f.csv"', ["inside"]),
    "a blow file without use": ("hits = 12", 'hits = 12\nfile = "f.csv"', ["no use", "file"]),
    "a time of text": ("2026-03-01T08:00:00Z", '"yesterday"', ["record[0].time", "yesterday"]),
    "a time as a number": ("2026-03-01T08:00:00Z", "12345", ["record[0].time"]),
    "a day that is none": ("2026-03-01", "2026-02-31", ["TOML"]),
    "colder than can be": ("temperature = 22.0", "temperature = -300.0", ["temperature"]),
    "a temperature of NaN": ("temperature = 22.0", "temperature = nan", ["temperature"]),
    "a negative tolerance": ("[excitation]", "[tolerance]\nforce = -0.1\n[excitation]", ["force"]),
    "an unknown tolerance": ("[excitation]", "[tolerance]\nmass = 0.1\n[excitation]", ["mass"]),
    "a controller with NaN": ("[excitation]", "[controller]\nkp = nan\n[excitation]", ["finite"]),
    "an empty robot": ('"fanuc_like_3dof"', '""', ["robot"]),
    "a robot that is a number": ('"fanuc_like_3dof"', "3", ["robot", "3"]),
}
HEAD = "time [s],force [N],deflection.joint_1 [rad],accelerometer.tool.x [m/s^2]"


def header(old, new):
    return lambda lines: [lines[0].replace(old, new), *lines[1:]]


def line(number, change):
    """Change the line of this number (1 is the header)."""

    def edit(lines):
        cells = lines[number - 1].split(",")
        return [*lines[: number - 1], ",".join(change(cells)), *lines[number:]]

    return edit


def cell(number, column, value):
    return line(number, lambda cells: [*cells[:column], value, *cells[column + 1 :]])


# name: (what happens to the lines of r01.csv, words of the message)
SAMPLES = {
    "an empty file": (lambda lines: [], ["is empty"]),
    "a blank header": (lambda lines: ["", *lines[1:]], ["header"]),
    "no header": (lambda lines: lines[1:], ["channel [unit]", "column 1"]),
    "a header alone": (lambda lines: lines[:1], ["is empty"]),
    "one sample": (lambda lines: lines[:2], ["one sample"]),
    "semicolons and a short row": (
        lambda lines: [x.replace(",", ";") for x in line(40, lambda c: c[:-1])(lines)],
        ["line 40", "4 cells"],
    ),
    "semicolons and a word": (
        lambda lines: [x.replace(",", ";") for x in cell(40, 1, "high")(lines)],
        ["line 40", "'high'"],
    ),
    "no time": (header("time [s],", "velocity.tool.x [m/s],"), ["first column"]),
    "time not first": (
        lambda lines: [",".join(reversed(x.split(","))) for x in lines],
        ["first column"],
    ),
    "time alone": (lambda lines: [x.split(",")[0] for x in lines], ["no channel beside"]),
    "a unit missing": (header("force [N]", "force"), ["column 2", "channel [unit]"]),
    "an unclosed unit": (header("force [N]", "force [N"), ["column 2", "channel [unit]"]),
    "an empty unit": (header("[N]", "[]"), ["force", "not a unit"]),
    "a unit of another dimension": (header("[N]", "[mm]"), ["force", "'mm'", "N"]),
    "time in metres": (header("[s]", "[m]"), ["time", "'m'"]),
    "an unknown unit": (header("[rad]", "[grad?]"), ["deflection.joint_1", "not a unit"]),
    "an unknown channel": (header("force", "farce"), ["farce", "force"]),
    "no joint": (header("deflection.joint_1", "deflection"), ["deflection.<joint>"]),
    "no axis": (header("tool.x", "tool"), ["accelerometer.<frame>.x"]),
    "a channel twice": (header("force [N]", "deflection.joint_1 [deg]"), ["columns 2 and 3"]),
    "an empty column name": (header("force [N]", ""), ["column 2"]),
    "a trailing comma in the header": (lambda x: [x[0] + ",", *x[1:]], ["column 5"]),
    "a quote left open": (header("force [N]", '"force [N]'), ["header"]),
    "a row too short": (line(40, lambda c: c[:-1]), ["line 40", "4 values"]),
    "a row too long": (line(40, lambda c: [*c, "1.0"]), ["line 40", "4 values"]),
    "trailing commas": (lambda x: [x[0], *(y + "," for y in x[1:])], ["line 2", "4 values"]),
    "a row cut short at the end": (lambda x: [*x[:-1], x[-1][:10]], ["line 101"]),
    "a decimal comma": (line(12, lambda c: [c[0], "1,5", *c[2:]]), ["line 12", "4 values"]),
    "a value missing": (cell(33, 2, ""), ["deflection.joint_1", "line 33", "missing"]),
    "a word": (cell(33, 1, "high"), ["force", "line 33", "high"]),
    "NaN": (cell(50, 3, "nan"), ["accelerometer.tool.x", "line 50", "nan"]),
    "infinity": (cell(50, 3, "-inf"), ["accelerometer.tool.x", "line 50", "inf"]),
    "too large for a float": (cell(50, 1, "1e999"), ["force", "line 50", "inf"]),
    "an underscore": (cell(9, 1, "1_000"), ["force", "line 9", "1_000"]),
    "a hexadecimal number": (cell(9, 1, "0x10"), ["force", "line 9", "0x10"]),
    "a unit in the cell": (cell(9, 1, "3.0 N"), ["force", "line 9"]),
    "a time that is no number": (cell(9, 0, "08:00:01"), ["time", "line 9"]),
    "a time of NaN": (cell(60, 0, "nan"), ["time", "line 60"]),
    "a time that stands still": (
        lambda x: [*x[:60], x[59].split(",")[0] + ",1.0,1.0,1.0", *x[60:]],
        ["time", "line 61", "ascend"],
    ),
    "a time that runs back": (lambda x: [*x[:50], x[51], x[50], *x[52:]], ["time", "line 51"]),
    "a time backwards": (lambda x: [x[0], *reversed(x[1:])], ["time", "line 3", "ascend"]),
    "a lost sample": (lambda x: [*x[:70], *x[71:]], ["time", "line 71", "not even"]),
    "a lost second": (
        lambda x: [*x[:70], *(",".join([str(float(y.split(",")[0]) + 1.0), *y.split(",")[1:]])
                              for y in x[70:])],
        ["time", "line 71", "not even"],
    ),
    "a time typed wrong": (cell(80, 0, "0.5"), ["time", "line 80"]),
    "two runs in one file": (lambda x: [*x, *x[1:]], ["time", "line 102", "ascend"]),
    "two files in one": (lambda x: [*x, *x], ["line 102", "time"]),
    "an empty line between": (lambda x: [*x[:30], "", *x[30:]], ["line 31", "empty line"]),
    "a comment": (lambda x: [*x[:30], "# dropped", *x[30:]], ["line 31"]),
}  # fmt: skip


def fingerprint(folder):
    return {p: hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.rglob("*") if p.is_file()}


def refused(folder, words):
    """The campaign can neither be read through nor copied, and nothing changes."""
    before = fingerprint(folder)
    with pytest.raises(InputError) as caught:
        load_campaign(folder).check_samples()
    text = str(caught.value)
    assert "\n" not in text
    assert len(text) < 600
    for word in words:
        assert word in text, text
    with pytest.raises(InputError):
        load_campaign(folder).save(folder.parent / "copy")
    assert [p.name for p in folder.parent.iterdir()] == [folder.name]
    assert fingerprint(folder) == before
    return text


def test_there_are_enough_of_them():
    assert len(TABLE) + len(SAMPLES) + len(BYTES) >= 80


@pytest.mark.parametrize("name", TABLE)
def test_a_broken_table(campaign_folder, name):
    old, new, words = TABLE[name]
    file = campaign_folder / "campaign.toml"
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))
    assert str(campaign_folder) in refused(campaign_folder, words)


@pytest.mark.parametrize("name", SAMPLES)
def test_broken_samples(campaign_folder, name):
    edit, words = SAMPLES[name]
    file = campaign_folder / "r01.csv"
    lines = edit(file.read_text().splitlines())
    file.write_text("".join(x + "\n" for x in lines))
    text = refused(campaign_folder, words)
    assert "r01.csv" in text
    assert "record[0]" in text


BYTES = {
    "Latin-1 in the header": (lambda b: b.replace(b"[rad]", b"[\xb2]"), ["column 3", "'²'"]),
    "Latin-1 in a line": (lambda b: b[:-3] + b"\xff\n", ["line 101", "UTF-8"]),
    "UTF-16, cut": (lambda b: b[:-30].decode().encode("utf-16"), ["line 101"]),
    "zeros": (lambda b: bytes(len(b)), ["no header"]),
    "zeros at the end": (lambda b: b + bytes(100), ["line 102"]),
    "a gzip": (lambda b: b"\x1f\x8b\x08\x00" + b, ["UTF-8"]),
    "a Parquet file named .csv": (lambda b: b"PAR1" + bytes(40) + b"PAR1", ["no header"]),
}


@pytest.mark.parametrize("name", BYTES)
def test_broken_bytes(campaign_folder, name):
    change, words = BYTES[name]
    file = campaign_folder / "r01.csv"
    file.write_bytes(change(file.read_bytes()))
    assert "r01.csv" in refused(campaign_folder, words)


def test_a_measured_blow_whose_file_is_missing(campaign_folder):
    file = campaign_folder / "campaign.toml"
    blow = 'kind = "pulse_train"\nforce = 300.0\nperiod = 0.040\nwidth = 0.004'
    text = file.read_text().replace(blow, 'kind = "measured"\nfile = "f.csv"\nperiod = 0.040')
    file.write_text(text.replace("force = 250.0\n", ""))
    refused(campaign_folder, ["f.csv", "no such file"])


def test_what_is_no_campaign(tmp_path):
    for path, word in ((tmp_path / "none", "no such campaign"), (tmp_path, "campaign.toml")):
        with pytest.raises(InputError, match=word):
            load_campaign(path)


def test_a_record_that_is_a_folder_or_leads_out(campaign_folder, tmp_path):
    file = campaign_folder / "r01.csv"
    elsewhere = tmp_path / "elsewhere.csv"
    file.rename(elsewhere)
    file.symlink_to(elsewhere)
    with pytest.raises(InputError, match="is outside"):
        load_campaign(campaign_folder)
    file.unlink()
    file.mkdir()
    with pytest.raises(InputError, match=r"r01\.csv.*is a folder"):
        load_campaign(campaign_folder)


def test_the_unbroken_campaign_is_sound(tmp_path):
    load_campaign(write_good(tmp_path / "good")).check_samples()
