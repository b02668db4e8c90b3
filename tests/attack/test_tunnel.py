"""meshcat brings pyngrok along, which opens tunnels into a machine: nothing of ours reaches it."""

import importlib
import pkgutil
import sys
from pathlib import Path
from types import SimpleNamespace

import picchio
from picchio.visuals.scene.scene import Scene


def test_no_module_imports_it():
    """Nor does any command: `in_process` in tests/conftest.py looks after each."""
    for found in pkgutil.walk_packages(picchio.__path__, "picchio."):
        importlib.import_module(found.name)
    assert "pyngrok" not in sys.modules


def test_no_code_names_it():
    sources = list(Path(picchio.__file__).parent.rglob("*.py"))
    assert len(sources) > 200
    naming = {path.name for path in sources if "ngrok" in path.read_text("utf-8")}
    assert naming == {"scene.py"}  # a comment that says why it is safe


def test_the_live_viewers_server_is_not_asked_for_a_tunnel(tmp_path, monkeypatch):
    """And it takes no code from the current folder, as `python -m` would."""
    for name in ("tornado", "zmq", "pyngrok", "json"):
        (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'RAN')!r}, 'w')\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("picchio.visuals.scene.scene.send", lambda *_: None)
    server = Scene.show(SimpleNamespace()).window.server_proc
    try:
        given = Path(f"/proc/{server.pid}/cmdline").read_bytes()
    finally:
        server.kill()
        server.wait()
    assert b"zmqserver" in given and b"ngrok" not in given
    assert not (tmp_path / "RAN").exists()
