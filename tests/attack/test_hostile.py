"""Hostile values: each is refused in one line that names the file or option, the key and why."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import pytest
from held import MAPPING, one_line

ARM = "fanuc_like_3dof"
LONG = "1" * 200_000  # Python's reader of CSV gives up at 131,072
HUGE = "9" * 400  # no float is that large
SIDECAR = """format = "picchio-sidecar/1"
[joint.joint_1]
stiffness = 2.4e5
damping_ratio = 0.03
[tool]
frame = "tool"
"""
PLAN = """format = "picchio-plan/1"
poses = [[0.3, 0.5, -0.8]]
directions = [[0.6, 0.0, 0.8]]
hits = 2
sample_rate = 1000.0
quiet = 0.1
length = 0.2
seed = 1
[excitation]
kind = "pulse_train"
force = 300.0
period = 0.04
width = 0.004
[[sensor]]
channels = "accelerometer.tool"
"""
TASK = """format = "picchio-task/1"
[[operation]]
name = "a"
direction = [1.0, 0.0, 0.0]
poses = [[0.0, 0.5, -0.8]]
[excitation]
kind = "pulse_train"
force = 300.0
period = 0.04
width = 0.004
"""
CAMPAIGN = """format = "picchio-campaign/1"
robot = "fanuc_like_3dof"
[[record]]
file = "r.csv"
kind = "motion"
"""
MODEL = """format = "picchio-model/1"
robot = "fanuc_like_3dof"
[[effect]]
effect = "payload"
target = "tool"
"""
TESTS = "stress [MPa],cycles,failed\n" + "".join(
    f"{500 * n**-0.08:.2f},{n:.0f},1\n" for n in (2e4, 5e4, 1e5, 3e5, 1e6, 2e6)
)
POINTS = "x [m],y [m],z [m]\n1.0,0.0,1.0\n"


def rows(step=1, start=0, count=50, header="t,F"):
    """A table of a time and a channel."""
    return f"{header}\n" + "".join(f"{start + i * step},{i * 0.25}\n" for i in range(count))


@dataclass(frozen=True)
class Case:
    """A file with a passage replaced, what is typed, and what the line must name."""

    typed: str
    words: tuple[str, ...]
    files: dict[str, str] = field(default_factory=dict)


def sidecar(value, *words):
    text = SIDECAR.replace("0.03", value)
    return Case(
        f"assess {ARM} --flex s.toml", ("s.toml", "joint.joint_1.damping_ratio", *words),
        {"s.toml": text},
    )  # fmt: skip


def plan(key, value, *words):
    line = next(line for line in PLAN.splitlines() if line.startswith(f"{key} ="))
    text = PLAN.replace(line, f"{key} = {value}")
    return Case(f"simulate {ARM} --plan p.toml --to c", ("p.toml", key, *words), {"p.toml": text})


def blows(key, value):
    text = TASK + f"{key} = {value}\n" if key == "preload" else "".join(
        f"{key} = {value}\n" if line.startswith(f"{key} =") else line
        for line in TASK.splitlines(keepends=True)
    )  # fmt: skip
    return Case(f"assess {ARM} --task t.toml", ("t.toml", f"excitation.{key}"), {"t.toml": text})


def imported(table, *words, mapping=MAPPING):
    return Case("import r.csv --mapping m.toml --to c", words, {"r.csv": table, "m.toml": mapping})


def timed(unit, extra=""):
    return MAPPING.replace('unit = "ms"', f'unit = "{unit}"\n{extra}')


def recorded(table, *words):
    return Case("check c", ("r.csv", *words), {"c/campaign.toml": CAMPAIGN, "c/r.csv": table})


def model(effect, target, *words):
    text = MODEL.replace("payload", effect).replace('"tool"', f'"{target}"')
    return Case(
        "assess m.toml", ("m.toml", f"{effect}.target", f"got '{target}'", *words), {"m.toml": text}
    )


def typed(text, *words, **files):
    return Case(text, words, {name.replace("_", "."): content for name, content in files.items()})


RESAMPLED = 'rate = 1000.0\nresample = "linear"'
DAY = 1_772_352_000  # 2026-03-01, s
CASES = {
    # tables
    "tests-cell": Case("fit-sn t.csv", ("t.csv", "line 8"), {"t.csv": TESTS + f"{LONG},1,1\n"}),
    "points-cell": Case(
        f"map {ARM} --points p.csv --out m.nc", ("p.csv", "line 3"),
        {"p.csv": POINTS + f"{LONG},1,1\n"},
    ),
    "points-cr": Case(
        f"map {ARM} --points p.csv --out m.nc", ("p.csv", "must name one column"),
        {"p.csv": POINTS.replace("1.0,0.0", "1.0,0\r.0")},
    ),
    "import-cr": imported(rows().replace("7,", "7\r,"), "r.csv", "clock is not even", "line 9"),
    "record-cell": recorded(rows(header="time [s],position.joint_1 [rad]") + f"{LONG},1\n",
                            "record[0]", "line 52"),
    "record-cr": recorded(rows(header="time [s],position.joint_1 [rad]").replace("7,", "7\r,"),
                          "record[0]", "line 9"),
    # stamps
    "ns-as-s": imported(rows(10**6, DAY * 10**9), "r.csv: t:", "probably in ns, not s",
                        mapping=timed("s", RESAMPLED)),
    "ns-as-ms": imported(rows(10**6, DAY * 10**9), "r.csv: t:", "probably in ns, not ms",
                         mapping=timed("ms")),
    "us-as-s": imported(rows(10**3, DAY * 10**6), "r.csv: t:", "probably in us, not s",
                        mapping=timed("s", RESAMPLED)),
    "ms-as-s": imported(rows(1, DAY * 10**3), "r.csv: t:", "probably in ms, not s",
                        mapping=timed("s")),
    "ns-from-zero": imported(rows(10**6), "r.csv: t:", "probably in ns, not s",
                             mapping=timed("s", RESAMPLED)),
    "ns-as-ms-from-zero": imported(rows(5 * 10**6), "r.csv: t:", "probably in ns, not ms",
                                   mapping=timed("ms", RESAMPLED)),
    "record-in-ns": recorded(rows(10**6, header="time [s],position.joint_1 [rad]"),
                             "channel time", "probably in ns, not s"),
    "record-in-us": recorded(
        rows(10**3, DAY * 10**6, header="time [ms],position.joint_1 [rad]"),
        "channel time", "probably in us, not ms",
    ),
    "zero": imported(rows(), "r.csv: t:", "first stamp", mapping=timed("ms", "zero = 1e308")),
    # rates, durations and counts
    "rate-high": imported(rows(), "m.toml", "time.rate", "20 times",
                          mapping=timed("ms", 'rate = 1e8\nresample = "linear"')),
    "rate-highest": imported(rows(), "m.toml", "time.rate", mapping=timed("ms", "rate = 1e300")),
    "rate-low": imported(rows(), "m.toml", "time.rate", mapping=timed("ms", "rate = 1e-300")),
    "quiet": plan("quiet", "1e308", "inf samples"),
    "length": plan("length", "1e308", "inf samples"),
    "sample_rate-low": plan("sample_rate", "1e-300"),
    "sample_rate-high": plan("sample_rate", "1e300"),
    "hits": plan("hits", "1000000000", "1000000"),
    "hits-digits": plan("hits", HUGE, "64 bits"),
    "hits-thousands": Case(f"simulate {ARM} --plan p.toml --to c", ("p.toml", "64 bits"),
                           {"p.toml": PLAN.replace("hits = 2", f"hits = {'9' * 5000}")}),
    "quiet-digits": plan("quiet", HUGE, "64 bits"),
    "seed-digits": plan("seed", HUGE, "64 bits"),
    "pose-digits": plan("poses", f"[[{HUGE}, 0, 0]]", "poses[0][0]", "64 bits"),
    "damping-digits": sidecar(HUGE, "64 bits"),
    "damping-tiny": sidecar("1e-320", "1e-320"),
    "damping-small": sidecar("1e-9"),
    "damping-large": sidecar("1e300"),
    "joint-grid": typed(f"map {ARM} --joint-grid nan --out m.nc", "--joint-grid", "whole", "nan"),
    "joint-grid-inf": typed(f"map {ARM} --joint-grid 3,inf,2 --out m.nc", "--joint-grid", "whole"),
    "workers": typed(f"map {ARM} --joint-grid 3 --workers {HUGE} --out m.nc", "--workers", "1024"),
    "level": typed("fit-sn t.csv --level 0.9999999999999999", "--level", "0.9999", t_csv=TESTS),
    "level-low": typed("fit-sn t.csv --level 1e-320", "--level", "0.01", t_csv=TESTS),
    # targets
    "payload": model("payload", "nope", "valid: tool"),
    "modal_damping": model("modal_damping", "nope", "valid: robot"),
    "joint_stiffness": model("joint_stiffness", "nope", "joint_2"),
    "viscous_friction": model("viscous_friction", "nope", "joint_2"),
    "link_mass": model("link_mass", "nope", "link_2"),
    "cable": model("cable", "nope", "link_2"),
    "base_compliance": model("base_compliance", "nope", "rz"),
    "transverse_compliance": model("transverse_compliance", "nope", "joint_2"),
    "sensor_gain": model("sensor_gain", "accelerometer.nope", "tool"),
    "force_amplitude": model("force_amplitude", "joint_1", "valid: tool"),
    "plan-target": typed(
        f"simulate {ARM} --plan p.toml --to c", "p.toml", "payload.target", "valid: tool",
        p_toml=PLAN + '[[effect]]\neffect = "payload"\ntarget = "nope"\n',
    ),
    "model-robot": typed("assess m.toml", "m.toml: robot: no such robot", "got 'x'",
                         m_toml=MODEL.replace("fanuc_like_3dof", "x")),
    "direction": plan("directions", "[[1e308, 0.0, 0.8]]", "directions[0]", "length 1"),
    "recoil": typed(
        f"envelope {ARM} --pose=0,0,0 --flex s.toml", "s.toml", "gun.recoil_stiffness",
        s_toml=SIDECAR + "[gun]\nmass = 1.0\nrecoil_stiffness = 1e-320\n",
    ),
    "plan-sensor": typed(
        f"simulate {ARM} --plan p.toml --to c", "p.toml", "sensor_gain.target", "'deflection'",
        "valid: accelerometer.tool",
        p_toml=PLAN + '[[effect]]\neffect = "sensor_gain"\ntarget = "deflection"\n'
        "parameters = { gain = 1.2 }\n",
    ),
    "xacro": typed("assess no/such.urdf.xacro", "no/such.urdf.xacro: no such file"),
    **{f"excitation-{key}-{value}": blows(key, value) for key, value in (
        ("period", "1e308"), ("width", "1e-320"), ("force", "1e308"), ("preload", "-1e308"),
    )},
    **{f"gun-{value}": typed(
        f"envelope {ARM} --pose=0,0,0 --flex s.toml", "s.toml", "gun.mass", "kg",
        s_toml=SIDECAR + f"[gun]\nmass = {value}\n",
    ) for value in ("1e308", "1e-320", "1e12")},
    # what is empty
    "sn-curve": Case(f"assess {ARM} --sn-curve  --json -", ("--sn-curve: is empty",)),
    "sn-curve=": typed(f"assess {ARM} --sn-curve=", "--sn-curve: is empty"),
    "robot": Case("assess ", ("assess: is empty",)),
    "tool": Case(f"envelope {ARM} --pose=0,0,0 --tool ", ("--tool: is empty",)),
    "shaft-curve": typed(
        f"assess {ARM} --flex s.toml", "s.toml", "joint.joint_1.shaft.sn_curve", "at least 1",
        s_toml=SIDECAR.replace("damping_ratio = 0.03", "shaft = { radius = 0.02, length = 0.05, "
                               'shear_modulus = 79.3e9, sn_curve = "" }'),
    ),
    # poses
    "pose-empty": plan("poses", "[{}]", "names no joint"),
    "pose-list": plan("poses", "[[]]", "names no joint"),
    "import-pose": imported(rows(), "m.toml", "pose", "names no joint",
                            mapping=MAPPING.replace("{ joint_1 = 0.3 }", "{}")),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_refused_in_one_line(name, tmp_path, in_process):
    case = CASES[name]
    for file, text in case.files.items():
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_text(text, newline="")
    before = sorted(tmp_path.rglob("*"))
    done = in_process(*case.typed.split(" "), cwd=tmp_path)
    one_line(done, 2, *case.words)
    assert len(done.stderr) < 400, done.stderr
    assert sorted(tmp_path.rglob("*")) == before


def test_a_cell_without_end_is_left_out_and_told(tmp_path, in_process):
    (tmp_path / "r.csv").write_text(rows() + f"{LONG},1\n")
    (tmp_path / "m.toml").write_text(MAPPING)
    done = in_process("import", "r.csv", "--mapping", "m.toml", "--to", "c", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "50 samples" in done.stdout
    assert re.search(r"left out: t, '1+\.\.\.' in line 52: no number", done.stdout)
    assert len(done.stdout) < 4000
