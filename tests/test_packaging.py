"""The package as it is shipped: built, installed elsewhere, run in an empty folder."""

import os
import subprocess
import sys
import zipfile

import pytest


@pytest.mark.slow
def test_an_installed_wheel_assesses_the_shipped_robot_in_an_empty_folder(tmp_path, repository):
    wheels, site, empty = tmp_path / "wheels", tmp_path / "site", tmp_path / "empty"
    empty.mkdir()
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    subprocess.run(
        [*pip, "wheel", "--no-deps", "--wheel-dir", wheels, repository], check=True, timeout=300
    )
    (wheel,) = wheels.glob("picchio-*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    assert "picchio/py.typed" in names
    assert "picchio/_robots/fanuc_like_3dof/robot.urdf" in names
    assert not [name for name in names if name.startswith(("tests/", "robots/"))]
    subprocess.run([*pip, "install", "--no-deps", "--target", site, wheel], check=True, timeout=300)
    code = (
        "import picchio; print(picchio.__file__)\n"
        "from picchio.cli.main import main; main(['assess', 'fanuc_like_3dof'])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=empty,
        env={**os.environ, "PYTHONPATH": str(site)},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    where, _, rest = done.stdout.partition("\n")
    assert where.startswith(str(site))
    assert "of joint_2 comes closest" in rest
    assert list(empty.iterdir()) == []
