"""MCAP logs written by mcap-ros2-support with the messages' full definitions."""

import numpy as np
import pytest

from picchio.campaign.importing.importer import read_mapped, read_raw
from picchio.campaign.importing.mapping import read_mapping
from picchio.campaign.importing.readers import read_mcap
from picchio.campaign.importing.template import mapping_template
from picchio.core.errors import InputError, PicchioWarning

STAMP = "int32 sec\nuint32 nanosec"
HEADER = "builtin_interfaces/Time stamp\nstring frame_id"
LINE = "=" * 80
COMMON = f"""{LINE}
MSG: std_msgs/Header
{HEADER}
{LINE}
MSG: builtin_interfaces/Time
{STAMP}
"""
VECTOR = f"{LINE}\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
JOINT_STATE = (
    "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n"
    "float64[] effort\n" + COMMON
)
IMU = (
    "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\n"
    "float64[9] orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\n"
    "float64[9] angular_velocity_covariance\ngeometry_msgs/Vector3 linear_acceleration\n"
    "float64[9] linear_acceleration_covariance\n"
    + COMMON
    + VECTOR
    + f"{LINE}\nMSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
)
WRENCH = (
    "std_msgs/Header header\ngeometry_msgs/Wrench wrench\n"
    + COMMON
    + f"{LINE}\nMSG: geometry_msgs/Wrench\n"
    + "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n"
    + VECTOR
)
BEGIN = 1_772_352_000_000_000_000  # 2026-03-01T08:00:00Z, ns
COVARIANCE = [0.0] * 9


def header(nanoseconds, frame=""):
    sec, nanosec = divmod(nanoseconds, 1_000_000_000)
    return {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": frame}


def vector(values):
    return dict(zip("xyz", map(float, values), strict=True))


def write_log(path, stamps, signals, *, imu_stamps=None, skip=()):
    """JointState, Imu and WrenchStamped at these stamps (ns since BEGIN)."""
    from mcap_ros2.writer import Writer

    imu_stamps = stamps if imu_stamps is None else imu_stamps
    with open(path, "wb") as stream:
        writer = Writer(stream)
        schemas = {
            name: writer.register_msgdef(f"{package}/msg/{name}", text)
            for package, name, text in (
                ("sensor_msgs", "JointState", JOINT_STATE),
                ("sensor_msgs", "Imu", IMU),
                ("geometry_msgs", "WrenchStamped", WRENCH),
                ("std_msgs", "String", "string data"),
            )
        }
        quaternion = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
        for i, (t, t_imu) in enumerate(zip(stamps, imu_stamps, strict=True)):
            now, now_imu = BEGIN + int(t), BEGIN + int(t_imu)
            log = now + 5_000_000

            def put(topic, kind, message, log=log, i=i):
                writer.write_message(topic, schemas[kind], message, log, log, i)

            if i not in skip:
                joint = {
                    "header": header(now),
                    "name": ["a", "b"],
                    "position": signals[:2, i].tolist(),
                }
                effort = [float(signals[2, i]), float("nan")]
                put("/joint_states", "JointState", {**joint, "velocity": [], "effort": effort})
            put("/imu", "Imu", {
                "header": header(now_imu, "tool"), "orientation": quaternion,
                "angular_velocity": vector([0, 0, 0]),
                "linear_acceleration": vector([signals[3, i], 0.0, 9.81]),
                "orientation_covariance": COVARIANCE, "angular_velocity_covariance": COVARIANCE,
                "linear_acceleration_covariance": COVARIANCE})  # fmt: skip
            force = {"force": vector([0.0, 0.0, signals[4, i]]), "torque": vector([0, 0, 0])}
            put("/wrench", "WrenchStamped", {"header": header(now, "tool"), "wrench": force})
            put("/chat", "String", {"data": "hello"})
        writer.finish()
    return path


@pytest.fixture
def signals():
    return np.random.default_rng(5).normal(size=(5, 200))


def mapped(tmp_path, time=""):
    path = tmp_path / "mapping.toml"
    path.write_text(f"""format = "picchio-mapping/1"
[time]
{time}
[[channel]]
from = "/joint_states:position.b"
to = "position.b"
[[channel]]
from = "/joint_states:effort.a"
to = "torque.a"
[[channel]]
from = "/imu:linear_acceleration.x"
to = "accelerometer.tool.x"
[[channel]]
from = "/wrench:wrench.force.z"
to = "force"
sign = -1
[record]
kind = "motion"
""")
    return read_mapping(path)


def test_even_stamps_come_in_bit_for_bit(tmp_path, signals):
    stamps = np.arange(200) * 2_000_000
    path = write_log(tmp_path / "run.mcap", stamps, signals)
    raw = read_raw(path)
    assert "/joint_states:effort.b" not in raw.channels  # NaN: no such reading
    assert "/joint_states:velocity.a" not in raw.channels
    assert not any(name.startswith("/chat") for name in raw.channels)  # it holds no number
    record = read_mapped(path, mapped(tmp_path)).records[0]
    read = record.read()
    np.testing.assert_allclose(read["time"], np.arange(200) / 500.0, rtol=1e-15)
    assert (read["position.b"] == signals[1]).all()
    assert (read["torque.a"] == signals[2]).all()
    assert (read["accelerometer.tool.x"] == signals[3]).all()
    assert (read["force"] == -signals[4]).all()
    assert record.taken.isoformat() == "2026-03-01T08:00:00+00:00"


def test_uneven_stamps_are_refused_and_resampled_on_request(tmp_path, signals):
    rng = np.random.default_rng(1)
    ideal = np.arange(200) * 2e6
    stamps, imu = ideal + rng.uniform(0, 5e5, 200), ideal + rng.uniform(0, 5e5, 200)
    tone = np.sin(2 * np.pi * 5.0 * stamps * 1e-9)
    path = write_log(tmp_path / "run.mcap", stamps, np.tile(tone, (5, 1)), imu_stamps=imu)
    with pytest.raises(InputError, match=r"stamps of their own.*resample.*rate.*\d Hz"):
        read_mapped(path, mapped(tmp_path))
    with pytest.raises(InputError, match=r"time\.rate"):
        read_mapped(path, mapped(tmp_path, 'resample = "linear"'))
    time = 'resample = "linear"\nrate = 250.0'
    read = read_mapped(path, mapped(tmp_path, time)).records[0].read()
    assert np.diff(read["time"]) == pytest.approx(0.004, rel=1e-9)
    # The first stamp of all is the file's zero; linear interpolation errs by (w dt)^2 / 8.
    origin = min(stamps.astype(int).min(), imu.astype(int).min()) * 1e-9
    exact = np.sin(2 * np.pi * 5.0 * (read["time"] + origin))
    bound = (2 * np.pi * 5.0 * 2.5e-3) ** 2 / 8
    assert np.abs(read["position.b"] - exact).max() < bound
    assert np.abs(read["force"] + exact).max() < bound


def test_a_dropout_is_not_drawn_over(tmp_path, signals):
    stamps = np.arange(200) * 2_000_000
    path = write_log(tmp_path / "run.mcap", stamps, signals, skip=range(50, 70))
    with pytest.raises(
        InputError, match=r"/joint_states:position\.b.*missing for 0\.042 s.*0\.098"
    ):
        read_mapped(path, mapped(tmp_path, 'resample = "linear"\nrate = 500.0\ngaps = "refuse"'))
    found = read_mapped(path, mapped(tmp_path, 'resample = "linear"\nrate = 500.0'))
    assert [record.file for record in found] == ["run.csv", "run-2.csv"]
    assert [record.clock.samples for record in found] == [50, 130]
    np.testing.assert_allclose(found["run-2.csv"].time[[0, -1]], [0.140, 0.398], rtol=1e-12)
    np.testing.assert_allclose(found["run-2.csv"]["position.b"], signals[1][70:], rtol=1e-9)


def test_the_logs_own_time_may_be_taken(tmp_path, signals):
    stamps = np.arange(200) * 2_000_000 + np.random.default_rng(2).integers(0, 900_000, 200)
    path = write_log(tmp_path / "run.mcap", stamps, signals, imu_stamps=np.arange(200) * 2_000_000)
    raw = read_raw(path, mapped(tmp_path, 'stamp = "log"'))
    times = [channel.time for channel in raw.channels.values()]
    assert all((t == times[0]).all() for t in times)


def test_a_log_cut_short_and_one_without_such_messages(tmp_path, signals):
    path = write_log(tmp_path / "run.mcap", np.arange(200) * 2_000_000, signals)
    whole = path.read_bytes()
    path.write_bytes(whole[:-200])  # its recorder was killed: no index, no footer
    with pytest.warns(PicchioWarning, match=r"run\.mcap.*without a footer"):
        raw = read_raw(path)
    assert (raw.channels["/imu:linear_acceleration.x"].values == signals[3]).all()
    # One bit is found by a checksum, or was in what the samples do not need.
    sound = {"/imu:linear_acceleration.x": signals[3], "/wrench:wrench.force.z": signals[4]}
    refusals = 0
    for place in range(len(whole) // 4, len(whole) // 2, 197):
        damaged = bytearray(whole)
        damaged[place] ^= 16
        path.write_bytes(damaged)
        try:
            raw = read_mcap.read(path, {})
        except InputError:
            refusals += 1
            continue
        assert all((raw.channels[name].values == values).all() for name, values in sound.items())
    assert refusals > 0
    empty = write_log(tmp_path / "empty.mcap", [], signals)
    with pytest.raises(InputError, match=r"empty\.mcap.*JointState, Imu or WrenchStamped"):
        read_raw(empty)


def test_the_template_suggests_channels(tmp_path, signals):
    path = write_log(tmp_path / "run.mcap", np.arange(200) * 2_000_000, signals)
    text = mapping_template(read_raw(path))
    for line in ('from = "/joint_states:effort.a"', 'to = "torque.a"', 'unit = "N*m"',
                 'to = "accelerometer.tool.x"'):  # fmt: skip
        assert f"# {line}" in text
