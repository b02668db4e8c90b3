"""Downloading from a server of our own through pooch itself; checksums; local folders."""

import gzip
import hashlib
import http.server
import threading

import pytest

import picchio.datasets
from picchio.core.errors import InputError, PicchioWarning
from picchio.datasets import emps, kinova_gen3, kuka_kr300
from picchio.datasets.fetch import Dataset, RemoteFile, find_files

CONTENT = b"time,value\n0,1\n"
DATASET = Dataset(
    name="toy",
    repository="someone/something",
    commit="0123456789abcdef0123456789abcdef01234567",
    licence="none",
    cite="nobody",
    files={"a.csv": RemoteFile("some folder/a.csv", hashlib.sha256(CONTENT).hexdigest())},
)


@pytest.fixture
def server(monkeypatch, tmp_path):
    """A server that stands for GitHub, and a cache of our own."""
    asked = []
    served = {"content": CONTENT}

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            asked.append(self.path)
            found = served["content"] is not None
            self.send_response(200 if found else 404)
            self.end_headers()
            self.wfile.write(served["content"] or b"")

        def log_message(self, *_):
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as running:
        thread = threading.Thread(target=running.serve_forever, daemon=True)
        thread.start()
        genuine = Dataset.address
        home = f"http://127.0.0.1:{running.server_port}/"
        monkeypatch.setattr(
            Dataset,
            "address",
            lambda self, name: genuine(self, name).replace(
                "https://raw.githubusercontent.com/", home
            ),
        )
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
        monkeypatch.delenv("PICCHIO_DATA", raising=False)
        monkeypatch.setenv("NO_PROXY", "127.0.0.1")
        yield served, asked, tmp_path / "cache"
        running.shutdown()


def kept(cache):
    return [path.name for path in cache.rglob("*") if path.is_file()]


def test_a_file_is_downloaded_once(server):
    _, asked, _ = server
    path = find_files(DATASET, None)["a.csv"]
    assert path.read_bytes() == CONTENT
    assert find_files(DATASET, None)["a.csv"] == path
    assert asked == [f"/someone/something/{DATASET.commit}/some%20folder/a.csv"]


def test_a_wrong_checksum_is_refused_and_nothing_kept(server):
    served, _, cache = server
    served["content"] = CONTENT + b"1,2\n"
    with pytest.raises(InputError, match=r"SHA-256 is wrong.*nothing was kept"):
        find_files(DATASET, None)
    assert kept(cache) == []
    served["content"] = CONTENT
    assert find_files(DATASET, None)["a.csv"].read_bytes() == CONTENT


def test_a_cached_file_that_was_changed_is_fetched_again(server):
    _, asked, _ = server
    path = find_files(DATASET, None)["a.csv"]
    path.write_bytes(b"tampered")
    assert find_files(DATASET, None)["a.csv"].read_bytes() == CONTENT
    assert len(asked) == 2


def test_no_file_and_no_network(server, monkeypatch):
    served, _, cache = server
    served["content"] = None
    with pytest.raises(InputError, match=r"cannot be downloaded.*PICCHIO_DATA"):
        find_files(DATASET, None)
    monkeypatch.setattr(Dataset, "address", lambda self, name: "http://127.0.0.1:9/a.csv")
    with pytest.raises(InputError, match=r"cannot be downloaded.*PICCHIO_DATA"):
        find_files(DATASET, None)
    assert kept(cache) == []


def test_local_folders_come_first(tmp_path, monkeypatch):
    home = tmp_path / "data" / "toy"
    home.mkdir(parents=True)
    (home / "a.csv.gz").write_bytes(gzip.compress(CONTENT))
    monkeypatch.setenv("PICCHIO_DATA", str(tmp_path / "data"))
    for folder in (None, tmp_path / "data", home):
        assert find_files(DATASET, folder)["a.csv"] == home / "a.csv.gz"
    (home / "a.csv").write_bytes(b"something else")
    with pytest.warns(PicchioWarning, match=r"a\.csv.*SHA-256 differs"):
        find_files(DATASET, home)
    with pytest.raises(InputError, match=r"missing.*a\.csv"):
        find_files(DATASET, tmp_path)
    monkeypatch.setenv("PICCHIO_DATA", str(tmp_path / "none"))
    with pytest.raises(InputError, match="PICCHIO_DATA"):
        find_files(DATASET, None)


def test_names():
    with pytest.raises(InputError, match=r"emsp.*did you mean 'emps'"):
        picchio.datasets.load("emsp")


@pytest.mark.parametrize("module", [emps, kinova_gen3, kuka_kr300])
def test_the_pinned_files_are_the_ones_that_source_md_names(module, measured_data):
    dataset = module.DATASET
    home = measured_data / dataset.name
    text = (home / "SOURCE.md").read_text()
    assert dataset.repository in text
    assert dataset.commit in text
    for name, path in find_files(dataset, measured_data).items():
        data = path.read_bytes()
        data = gzip.decompress(data) if path.suffix == ".gz" else data
        assert hashlib.sha256(data).hexdigest() == dataset.files[name].sha256
        assert dataset.commit in dataset.address(name)
