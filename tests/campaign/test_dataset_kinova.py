"""Kinova Gen3: units and signs that nobody documented, held against physics."""

import gzip

import numpy as np
import pinocchio as pin
import pytest

import picchio.datasets

JOINTS = [f"joint_{joint}" for joint in range(1, 8)]


@pytest.fixture(scope="module")
def kinova(measured_data):
    return picchio.datasets.load("kinova-gen3", measured_data)


def test_what_the_campaign_holds(kinova):
    assert len(kinova) == 10
    kinds = {"position", "velocity", "torque", "temperature"}
    for record in kinova:
        assert set(record.channels) == {f"{kind}.{joint}" for kind in kinds for joint in JOINTS}
        assert record.clock.rate == pytest.approx(1000.0)


def test_position_is_the_integral_of_velocity_in_radians_and_milliseconds(kinova):
    for joint in JOINTS:
        record = kinova[f"{joint}_trapez.csv"]
        read = record.read([f"position.{joint}", f"velocity.{joint}"])
        travelled = np.ptp(read[f"position.{joint}"])
        integral = np.trapezoid(read[f"velocity.{joint}"], read["time"])
        assert travelled > 1.0
        # Upstream's clock is a count of samples; a few of them seem to be lost.
        assert abs(integral) == pytest.approx(travelled, rel=0.015)


def test_the_torque_is_the_currents_and_not_the_models(kinova, measured_data):
    path = measured_data / "kinova-gen3" / "joint_2_trapez.csv.gz"
    with gzip.open(path, "rt") as stream:
        names = stream.readline().strip().split(",")
        table = np.loadtxt(stream, delimiter=",")
    record = kinova["joint_2_trapez.csv"]
    for number, constant in ((2, 9.13), (6, 5.852)):
        torque = record[f"torque.joint_{number}"]
        current = table[:, names.index(f"Cur{number}")]
        np.testing.assert_allclose(torque, constant * current, atol=1e-4)
        model = table[:, names.index(f"Torque{number}")]
        # A sensor has noise; the model's output has none.
        assert np.median(np.abs(np.diff(torque))) > 20.0 * np.median(np.abs(np.diff(model)))


def test_friction_takes_energy_in_every_joint(kinova):
    """Joint 2 and 4 swing symmetrically, so that gravity gives nothing on the whole."""
    for joint in JOINTS:
        read = kinova[f"{joint}_trapez.csv"].read()
        assert np.trapezoid(read[f"torque.{joint}"], read[f"position.{joint}"]) > 0.5


def test_gravity_is_where_pinocchio_says(kinova, measured_data):
    """Joints 2 and 4 of the authors' URDF: the same sign and shape, more than the bare arm."""
    model = pin.buildModelFromUrdf(str(measured_data / "kinova-gen3" / "gen3.urdf"))
    data = model.createData()
    for number in (2, 4):
        read = kinova[f"joint_{number}_trapez.csv"].read()
        pose = np.array([read[f"position.{joint}"] for joint in JOINTS]).T
        gravity = [pin.computeGeneralizedGravity(model, data, q)[number - 1] for q in pose]
        correlation = np.corrcoef(gravity, read[f"torque.joint_{number}"])[0, 1]
        assert correlation > 0.9


def test_joints_warm_by_a_few_degrees(kinova):
    for record in kinova:
        read = record.read()
        for joint in JOINTS:
            temperature = read[f"temperature.{joint}"]
            assert temperature.min() > 15.0
            assert temperature.max() < 50.0


def test_the_robot_stands_where_the_authors_urdf_does(kinova, measured_data, repository):
    """The shipped kinova_gen3 stands in for the URDF of the data: same joint origins."""
    assert kinova.robot == "kinova_gen3"
    theirs = pin.buildModelFromUrdf(str(measured_data / "kinova-gen3" / "gen3.urdf"))
    ours = pin.buildModelFromUrdf(str(repository / "robots" / "kinova_gen3" / "robot.urdf"))
    data, own = theirs.createData(), ours.createData()
    rng = np.random.default_rng(0)
    for _ in range(20):
        pose = rng.uniform(-2.0, 2.0, 7)
        pin.forwardKinematics(theirs, data, pose)
        pin.forwardKinematics(ours, own, pin.integrate(ours, pin.neutral(ours), pose))
        assert np.abs(data.oMi[7].translation - own.oMi[7].translation).max() < 2e-5
