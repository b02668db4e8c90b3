"""A folder of data is no place to run code from, whichever process reads it."""

import numpy as np
import pytest
from held import one_line
from scipy.io import savemat

NAMES = ("numpy", "json", "pickle", "numba", "pinocchio", "distributed", "picchio")


@pytest.fixture
def trapped(tmp_path):
    """A folder whose modules, were they imported, would leave a file behind."""
    for name in NAMES:
        text = f"open({str(tmp_path / 'RAN')!r}, 'a').write('{name}\\n')\nraise SystemExit(99)\n"
        (tmp_path / f"{name}.py").write_text(text)
    return tmp_path


def test_a_mat_file_beside_a_numpy(trapped, picchio_process):
    time = np.arange(100) / 100.0
    savemat(trapped / "x.mat", {"t": time, "a": np.sin(time)})
    done = picchio_process("import", "x.mat", "--write-mapping", "m.toml")
    assert done.returncode == 0, done.stderr
    assert not (trapped / "RAN").exists()


@pytest.mark.parametrize("ending", ["mcap", "uff"])
def test_other_foreign_files_beside_a_numpy(ending, trapped, picchio_process):
    (trapped / f"x.{ending}").write_bytes(b"none of its kind")
    done = picchio_process("import", f"x.{ending}", "--write-mapping", "m.toml")
    one_line(done, 2, f"x.{ending}")
    assert not (trapped / "RAN").exists()


def test_the_workers_of_a_map(trapped, picchio_process):
    done = picchio_process(
        "map", "fanuc_like_3dof", "--joint-grid", "4", "--workers", "2", "--chunk", "16",
        "--out", "m.nc",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert not (trapped / "RAN").exists()


def test_the_trap_works(trapped, start):
    """Started as Python starts by itself, with the current folder first."""
    import subprocess
    import sys

    done = subprocess.run([sys.executable, "-c", "import numpy"], cwd=trapped, check=False)
    assert done.returncode == 99 and (trapped / "RAN").read_text() == "numpy\n"
