"""Two processes at the same output: both are honoured, or one is told."""

from held import MAPPING

from picchio.campaign.campaign import load_campaign
from picchio.core.files import locked


def test_appending_twice_at_once_adds_two_records(tmp_path, start, picchio_process):
    rows = "".join(f"{i},{i * 0.25}\n" for i in range(2000))
    (tmp_path / "m.toml").write_text(MAPPING)
    for name in ("a", "b", "c", "d"):
        (tmp_path / f"{name}.csv").write_text("t,F\n" + rows)
    assert picchio_process("import", "a.csv", "--mapping", "m.toml", "--to", "oc").returncode == 0
    both = [
        start("import", f"{name}.csv", "--mapping", "m.toml", "--to", "oc", "--append")
        for name in ("b", "c", "d")
    ]
    for process in both:
        _, err = process.communicate(timeout=120)
        assert process.returncode == 0, err
    files = {record.file for record in load_campaign(tmp_path / "oc").records}
    assert files == {"a.csv", "b.csv", "c.csv", "d.csv"}
    left = {p.name for p in tmp_path.iterdir()}
    assert left == {"m.toml", "oc", "a.csv", "b.csv", "c.csv", "d.csv"}


def test_a_map_that_another_process_writes_is_not_begun(tmp_path, picchio_process):
    with locked(tmp_path / "m.nc"):
        done = picchio_process("map", "fanuc_like_3dof", "--joint-grid", "3", "--out", "m.nc")
    assert done.returncode == 1
    assert done.stderr == "picchio: error: m.nc: another process is writing it\n"
    done = picchio_process("map", "fanuc_like_3dof", "--joint-grid", "3", "--out", "m.nc")
    assert done.returncode == 0, done.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["m.nc"]
