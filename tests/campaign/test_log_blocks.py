"""Logs of messages in blocks: the same as whole, and as the libraries themselves decode them."""

import functools
import io

import numpy as np
import pytest

from picchio.campaign.importing.readers import read_bag, read_mcap, ros_messages

from .test_import_mcap import BEGIN, write_log
from .test_logs_as_they_come import bag


@pytest.fixture
def signal():
    return np.random.default_rng(3).normal(size=150)


def joined(found):
    """Blocks as {series: (ns, values)}."""
    series = {}
    for raw in found:
        for name, channel in raw.channels.items():
            stamps = raw.epoch + np.rint(channel.time * 1e9).astype(np.int64)
            series.setdefault(name, []).append((stamps, channel.values))
    return {
        name: [np.concatenate(x) for x in zip(*own, strict=True)] for name, own in series.items()
    }


@pytest.mark.parametrize("kind", ["mcap", "bag", "db3"])
def test_blocks_are_the_whole(tmp_path, signal, kind, monkeypatch):
    reader = read_mcap if kind == "mcap" else read_bag
    if kind == "mcap":
        import mcap_ros2.writer

        # A chunk for some messages, so that there are several.
        small = functools.partial(mcap_ros2.writer.Writer, chunk_size=4096)
        monkeypatch.setattr(mcap_ros2.writer, "Writer", small)
        stamps = np.arange(150) * 2_000_000
        path = write_log(tmp_path / "run.mcap", stamps, np.tile(signal, (5, 1)), skip=range(20, 90))
    else:
        path = bag(tmp_path / ("run.bag" if kind == "bag" else "run"), signal, kind)
    whole = reader.read(path, {})
    monkeypatch.setattr(ros_messages, "AT_ONCE", 40)
    monkeypatch.setattr(read_bag, "_SOME", 7)
    blocks = list(reader.blocks(path, {}, None))
    assert kind == "bag" or len(blocks) > 2  # rosbags writes one chunk of this size
    made = joined(blocks)
    assert made.keys() == whole.channels.keys()
    for name, (stamps, values) in made.items():
        assert (stamps == joined([whole])[name][0]).all()
        assert (values == whole.channels[name].values).all()
    some = {next(iter(made))}
    assert {n for raw in reader.blocks(path, {}, some) for n in raw.channels} == some


def test_what_the_library_itself_decodes(tmp_path, signal):
    """mcap-ros2-support on messages whose numbers are at other places in each."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory
    from mcap_ros2.writer import Writer

    text = "string label\nint8 small\nfloat32[] list\nPart[] parts\nbool on\nuint16[2] pair\n"
    text += "=" * 80 + "\nMSG: shop/Part\nint64 number\nstring name\nfloat64 size\n"
    rng, path = np.random.default_rng(5), tmp_path / "x.mcap"
    with open(path, "wb") as stream:
        writer = Writer(stream)
        schema = writer.register_msgdef("shop/msg/Odd", text)
        for i in range(300):
            parts = [{"number": int(rng.integers(-(2**40), 2**40)), "name": "n" * int(n),
                      "size": float(rng.normal())} for n in rng.integers(0, 5, i % 4)]  # fmt: skip
            message = {"label": "l" * int(rng.integers(0, 9)), "small": int(rng.integers(-99, 99)),
                       "list": rng.normal(size=i % 3).tolist(), "parts": parts, "on": i % 2 == 0,
                       "pair": [i, 2 * i]}  # fmt: skip
            writer.write_message("/odd", schema, message, BEGIN + i, BEGIN + i)
        writer.finish()
    expected = {}
    reader = make_reader(io.BytesIO(path.read_bytes()), decoder_factories=[DecoderFactory()])
    for _, _, message, ros in reader.iter_decoded_messages():
        when = message.log_time
        told = {"small": ros.small, "on": float(ros.on), "pair[0]": ros.pair[0],
                "pair[1]": ros.pair[1]}  # fmt: skip
        told |= {f"list[{k}]": x for k, x in enumerate(ros.list)}
        for k, part in enumerate(ros.parts):
            told |= {f"parts[{k}].number": part.number, f"parts[{k}].size": part.size}
        for name, value in told.items():
            expected.setdefault(f"/odd:{name}", []).append((when, value))
    found = joined([read_mcap.read(path, {})])
    assert found.keys() == expected.keys()
    for name, rows in expected.items():
        assert found[name][0].tolist() == [when for when, _ in rows]
        assert found[name][1].tolist() == [float(value) for _, value in rows]
