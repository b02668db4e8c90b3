"""`picchio explore`: the numbers are assess's, the gestures do what they say, the server is shy."""

from __future__ import annotations

import asyncio
import json
import tomllib
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import picchio
from picchio.model.model import Model
from picchio.robot.ik.follow import Follower
from picchio.studies.instant import InstantStudy, Place
from picchio.studies.task_file import add_place
from picchio.visuals.live.explore import _models
from picchio.visuals.live.session import COARSE, Session, half_ball

pytestmark = pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")

HARD = picchio.HalfSineTrain(2400.0, 0.031, 0.006, 120.0)
ALONG = np.array([0.48, -0.6, 0.64])
PAYLOAD = {"effect": "payload", "target": "tool", "parameters": {"mass": 6.0}}


def place_of(robot: picchio.load_robot, bend: float = 0.4) -> Place:
    pose = np.clip(np.full(len(robot.joint_names), bend), robot.lower, robot.upper)
    return Place(pose, ALONG, HARD, 7)


@pytest.fixture(scope="module", params=["fanuc_like_3dof", "ur10", "panda"])
def robot(request: pytest.FixtureRequest) -> Any:
    return picchio.load_robot(request.param)


def test_the_numbers_are_those_of_assess(robot) -> None:
    """Another path: the closed form, pose by pose, its turning points counted in Python."""
    place = place_of(robot)
    found = InstantStudy(Model(robot), place).values(place)
    stated = picchio.assess(robot, place.task, uncertainty=False, steady_check=False).operations[0]
    for mine, theirs in (
        ("natural_frequencies", "natural_frequencies"),
        ("peak_deflection", "peak_deflection"),
        ("stress", "peak_shear_stress"),
        ("utilisation", "utilisation"),
        ("drive_utilisation", "reducer_utilisation"),
        ("damage", "damage_per_rivet"),
    ):
        np.testing.assert_allclose(
            getattr(found, mine), getattr(stated, theirs)[0], rtol=2e-6, err_msg=mine
        )
    assert (found.damage > 0.0).any() == np.isfinite(found.life).any()


def test_the_worst_direction_is_that_of_the_envelope(robot) -> None:
    place = place_of(robot)
    study = InstantStudy(Model(robot), place)
    found = study.values(place)
    stated = picchio.envelope(robot, place.pose, HARD, hits=7)
    np.testing.assert_allclose(found.worst_deflection, stated.peak_deflection, rtol=1e-6)
    assert np.abs((found.worst_direction * stated.worst_direction).sum(axis=1)).min() > 1 - 1e-6
    half, which = half_ball(COARSE)
    radii = np.concatenate(list(study.envelope(place, half)), axis=1)
    np.testing.assert_allclose(radii, stated.support(half), rtol=1e-5)
    assert len(which) == 162 and (radii.max(axis=1) <= found.worst_deflection * (1 + 1e-9)).all()


def test_the_interval_is_that_of_uncertain_life() -> None:
    robot = picchio.load_robot("ur10")
    place = place_of(robot)
    hard = Place(place.pose, ALONG, picchio.PulseTrain(9000.0, 0.05, 0.005), 12)
    study = InstantStudy(Model(robot), place)  # first asked elsewhere
    ends = study.life_intervals(hard, 512)
    stated = picchio.uncertain_life(robot, hard.task, samples=2048, totals=False)
    compared = 0
    for row, name in zip(ends, robot.flexible_names, strict=True):
        life = stated.joints.get(name)
        if life is None or not np.isfinite([life.p10, life.p90]).all():
            continue
        compared += 1
        # 512 cases against 2048: the ends of a life over decades are known within some tenths.
        assert np.abs(np.log10(row / [life.p10, life.p90])).max() < 0.5, name
    assert compared >= 1


def test_the_arm_follows_the_tool_within_its_limits(robot) -> None:
    """Held against Pinocchio's kinematics: the search has its own."""
    follower = Follower(robot)
    pose = place_of(robot).pose
    rng = np.random.default_rng(3)
    for _ in range(40):
        target = robot.tool_position(pose) + rng.normal(0.0, 0.02, 3)
        moved, missed = follower.follow(pose, target)
        assert (moved >= robot.lower - 1e-12).all() and (moved <= robot.upper + 1e-12).all()
        assert np.linalg.norm(robot.tool_position(moved) - target) == pytest.approx(
            missed, abs=1e-9
        )
        assert np.abs(moved - pose).max() < 1.0  # it does not jump to another branch
        if missed < 1e-6:
            pose = moved
    far, missed = follower.follow(pose, [50.0, 0.0, 0.0])
    assert missed > 40.0 and np.isfinite(far).all()


def test_the_tool_keeps_pointing_where_it_did() -> None:
    robot = picchio.load_robot("ur10")
    session = Session({"nominal": Model(robot)}, place_of(robot), Path("x.toml"))
    before = session._axis(session.place.pose)
    start = np.array(session.values()["tool"])
    there = start + np.array([0.05, -0.03, 0.04])
    session.take({"tool": there.tolist()})
    np.testing.assert_allclose(session.values()["tool"], there, atol=1e-6)
    np.testing.assert_allclose(session._axis(session.place.pose), before, atol=1e-6)
    session.take({"keeps_axis": False})
    session.take({"tool": start.tolist()})
    assert not session.keeps_axis


def test_gestures_do_what_they_say_and_bad_ones_change_nothing() -> None:
    robot = picchio.load_robot("fanuc_like_3dof")
    task = picchio.load_task(robot.task_path, robot).operations[0]
    place = Place(task.poses[0], task.direction, task.excitation, 12)
    session = Session({"nominal": Model(robot)}, place, Path("x.toml"))
    session.take({"joints": {"1": 0.2}, "blows": {"force": 500.0, "rate": 20.0, "hits": 3}})
    told = session.values()
    assert told["pose"][1] == 0.2 and told["blows"]["period"] == pytest.approx(0.05)
    assert told["blows"]["hits"] == 3 and told["blows"]["force"] == 500.0
    session.take({"joints": {"1": 99.0}})
    assert session.values()["at_limit"] == ["joint_2"]
    kept = session.place
    for bad in ({"blows": {"width": 1.0}}, {"joints": {"7": 0.0}}, {"tool": [1.0]},
                {"direction": [0.0, 0.0, 0.0]}, {"blows": {"force": float("nan")}},
                {"joint": "elbow"}, {"blows": {"mass": 1.0}}):  # fmt: skip
        with pytest.raises(picchio.InputError):
            session.take(bad)
        assert session.place is kept
    session.take({"home": True})
    session.take({"worst": 0})
    worst = session.last["nominal"]
    np.testing.assert_allclose(worst.peak_deflection[0], worst.worst_deflection[0], rtol=1e-7)
    json.dumps(session.values(), allow_nan=False)


def test_touching_links_are_named() -> None:
    robot = picchio.load_robot("panda")
    session = Session({"nominal": Model(robot)}, place_of(robot), Path("x.toml"))
    folded = np.clip([0.0, 1.7, 0.0, -3.0, 0.0, 3.7, 0.0, 0.0], robot.lower[:8], robot.upper[:8])
    session.take({"joints": {str(k): float(q) for k, q in enumerate(folded)}})
    touching = session.values()["touching"]
    assert touching and all(name.startswith("panda") for pair in touching for name in pair)


def test_nominal_and_extended_stand_side_by_side(tmp_path: Path) -> None:
    nominal = Model(picchio.load_robot("fanuc_like_3dof"))
    from picchio.model.effects.registry import from_dict

    heavy = nominal.with_effects([from_dict(PAYLOAD, nominal.robot)])
    models = _models(heavy, None)
    session = Session(models, place_of(nominal.robot), tmp_path / "x.toml")
    told = session.values()["models"]
    assert list(told) == ["nominal", "extended"]
    a, b = (told[name]["natural_frequencies"] for name in told)
    assert a[0] > 1.01 * b[0]
    with pytest.raises(picchio.InputError, match="another robot"):
        _models(nominal, Model(picchio.load_robot("ur10")))


def test_a_pose_goes_into_a_task_file_once_per_click(tmp_path: Path) -> None:
    robot = picchio.load_robot("ur10")
    file = tmp_path / "kept.toml"
    file.write_text(
        '# mine\nformat = "picchio-task/1"\n[excitation]\nforce = 300.0\nperiod = 0.04\n'
        'width = 0.004\n[[operation]]\nname = "own"  # keep\ndirection = [1.0, 0.0, 0.0]\n'
        "poses = [[0.0, -1.0, 1.0, 0.0, 0.0, 0.0]]\n"
    )
    place = place_of(robot)
    assert [add_place(file, robot, place) for _ in range(2)] == [2, 3]
    text = file.read_text()
    assert text.startswith("# mine") and "# keep" in text
    task = picchio.load_task(file, robot)
    assert [op.name for op in task.operations] == ["own", "explored_1"]
    added = task.operations[1]
    np.testing.assert_allclose(added.poses, [place.pose, place.pose], atol=1e-9)
    np.testing.assert_allclose(added.direction, ALONG, atol=1e-9)
    assert added.excitation == HARD and added.hits_per_rivet == 7
    assert task.operations[0].excitation == picchio.PulseTrain(300.0, 0.04, 0.004)
    assert list(tomllib.loads(text)["operation"][1])[:2] == ["name", "direction"]
    file.write_text("format = 'picchio-plan/1'\n")
    with pytest.raises(picchio.InputError, match=r"kept\.toml"):
        add_place(file, robot, place)
    assert file.read_text() == "format = 'picchio-plan/1'\n"


def test_the_server_answers_its_own_page_alone(tmp_path: Path) -> None:
    from tornado.websocket import websocket_connect

    live = picchio.explore("fanuc_like_3dof", save=tmp_path / "kept.toml")
    try:
        assert live.url.startswith("http://127.0.0.1:") and live.url in live._repr_html_()
        page = urllib.request.urlopen(live.url)
        assert page.headers["X-Content-Type-Options"] == "nosniff"
        assert "default-src 'none'" in page.headers["Content-Security-Policy"]
        assert b"fanuc_like_3dof" in page.read()
        port = live.url.split("/")[2]
        with pytest.raises(urllib.error.HTTPError, match="404"):
            urllib.request.urlopen(f"http://{port}/")
        stranger = urllib.request.Request(live.url, headers={"Host": "evil.example"})
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(stranger)

        async def talk(origin: str) -> list[dict[str, Any]]:
            from tornado.httpclient import HTTPRequest

            request = HTTPRequest(live.url.replace("http", "ws") + "live",
                                  headers={"Origin": origin})  # fmt: skip
            socket = await websocket_connect(request)
            await socket.write_message(json.dumps({"id": 1, "joints": {"0": 0.25}}))
            await socket.write_message("no json")
            await socket.write_message(json.dumps({"id": 2, "blows": {"width": 5.0}}))
            await socket.write_message(json.dumps({"write": True}))
            heard: list[dict[str, Any]] = []
            while not any("file" in m for m in heard) or not any(
                m.get("values", {}).get("answers") == 2 for m in heard
            ):
                heard.append(json.loads(str(await asyncio.wait_for(socket.read_message(), 20))))
            socket.close()
            return heard

        heard = asyncio.run(talk(f"http://{port}"))
        values = [m["values"] for m in heard if "values" in m]
        first = next(v for v in values if v["answers"] == 1)
        assert first["pose"][0] == 0.25 and first["problem"] is None
        assert "shorter than its period" in next(v for v in values if v["answers"] == 2)["problem"]
        assert (tmp_path / "kept.toml").exists()
        assert live.task.operations[0].poses[0, 0] == 0.25
        with pytest.raises(Exception, match="403"):
            asyncio.run(talk("http://evil.example"))
    finally:
        live.close()
    assert not live.alive


WRONG = {
    "no object": "5",
    "no JSON": "no json",
    "no text": b"\xff\xfe",
    "joints that are none": '{"id": 7, "joints": 5}',
    "blows that are none": '{"id": 7, "blows": null}',
    "a number of 5000 digits": '{"id": 7, "joints": {"0": ' + "9" * 5000 + "}}",
    "a number beyond all floats": '{"id": 7, "joints": {"0": ' + "9" * 400 + "}}",
    "an id of 5000 digits": '{"id": ' + "9" * 5000 + "}",
    "deep": "[" * 50_000,
    "deep in a key": '{"joints":' * 900 + "1" + "}" * 900,
    "not a number": '{"id": 7, "tool": [NaN, 0, 0]}',
    "infinite": '{"id": 7, "tool": [1e999, 0, 0]}',
    "text for a number": '{"id": 7, "tool": ["1", 0, 0]}',
    "two numbers": '{"id": 7, "direction": [1, 0]}',
    "no direction": '{"id": 7, "direction": [0, 0, 0]}',
    "no such joint": '{"id": 7, "joints": {"99": 0.1}}',
    "a joint below none": '{"id": 7, "joint": -1}',
    "a key that is none": '{"id": 7, "speed": 3}',
    "no blows a second": '{"id": 7, "blows": {"rate": 0}}',
    "too many hits": '{"id": 7, "blows": {"hits": 100000}}',
}


def test_every_message_is_answered_and_the_session_lives(tmp_path: Path) -> None:
    from tornado.httpclient import HTTPRequest
    from tornado.websocket import websocket_connect

    live = picchio.explore("fanuc_like_3dof", save=tmp_path / "kept.toml")

    async def talk() -> dict[str, tuple[str, float]]:
        origin = live.url.rsplit("/", 2)[0]
        address = live.url.replace("http", "ws") + "live"
        socket = await websocket_connect(HTTPRequest(address, headers={"Origin": origin}))

        async def answer(**wanted: Any) -> dict[str, Any]:
            while True:
                text = await asyncio.wait_for(socket.read_message(), 20)
                told = json.loads(str(text)).get("values", {})
                if (
                    (told.get("problem") is not None)
                    if not wanted
                    else (told.get("answers") == wanted["id"])
                ):
                    return told

        heard = {}
        for k, (name, message) in enumerate(WRONG.items(), start=100):
            await socket.write_message(message, binary=isinstance(message, bytes))
            problem = (await answer())["problem"]
            await socket.write_message(json.dumps({"id": k, "joints": {"0": 0.001 * k}}))
            heard[name] = problem, (await answer(id=k))["pose"][0] - 0.001 * k
        socket.close()
        return heard

    try:
        heard = asyncio.run(talk())
    finally:
        live.close()
    for name, (problem, off) in heard.items():
        assert len(problem) < 400 and "\n" not in problem and "Error(" not in problem, name
        assert abs(off) < 1e-12, name


@pytest.mark.parametrize(
    "origin", [None, "", "null", "https://{host}", "ftp://{host}", "http://{host}/", "{host}",
               "http://localhost:{port}", "http://evil.example", "http://{host}.evil.example"],
)  # fmt: skip
def test_no_other_page_opens_the_socket(live_page: str, origin: str | None) -> None:
    import http.client

    host = live_page.split("/")[2]
    sent = {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13",
            "Sec-WebSocket-Key": "x3JJHMbDL1EzLkh9GBhXDw=="}  # fmt: skip
    if origin is not None:
        sent["Origin"] = origin.format(host=host, port=host.split(":")[1])
    connection = http.client.HTTPConnection(host, timeout=10)
    connection.request("GET", "/" + live_page.split("/")[3] + "/live", headers=sent)
    assert connection.getresponse().status == 403
    connection.close()


def test_a_jupyterhub_leads_to_it_under_its_own_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import http.client

    monkeypatch.setenv("JUPYTERHUB_SERVICE_PREFIX", "/user/ann/")
    live = picchio.explore("fanuc_like_3dof", save=tmp_path / "x.toml")
    try:
        *_, host, word, _ = live.url.split("/")
        port = host.split(":")[1]
        assert f'data="/user/ann/proxy/{port}/{word}/"' in live._repr_html_()
        asked = urllib.request.Request(live.url, headers={"Host": "hub.example"})
        policy = urllib.request.urlopen(asked).headers["Content-Security-Policy"]
        assert "wss://hub.example" in policy and "frame-ancestors 'self'" in policy
        upgrade = {
            "Upgrade": "websocket",
            "Connection": "Upgrade",
            "Sec-WebSocket-Version": "13",
            "Sec-WebSocket-Key": "x3JJHMbDL1EzLkh9GBhXDw==",
            "Host": "hub.example",
        }
        for origin, status in {
            "https://hub.example": 101, "http://hub.example": 101, "https://evil.example": 403,
            "https://hub.example.evil.example": 403, "null": 403,
        }.items():  # fmt: skip
            connection = http.client.HTTPConnection(host, timeout=10)
            connection.request("GET", f"/{word}/live", headers=upgrade | {"Origin": origin})
            assert connection.getresponse().status == status, origin
            connection.close()
    finally:
        live.close()


@pytest.fixture(scope="module")
def live_page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    live = picchio.explore("fanuc_like_3dof", save=tmp_path_factory.mktemp("x") / "x.toml")
    page = urllib.request.urlopen(live.url)
    assert page.headers["X-Frame-Options"] == "DENY"
    assert "frame-ancestors 'none'" in page.headers["Content-Security-Policy"]
    yield live.url
    live._repr_html_()
    page = urllib.request.urlopen(live.url)
    assert page.headers["X-Frame-Options"] is None
    assert "frame-ancestors http://127.0.0.1:*" in page.headers["Content-Security-Policy"]
    live.close()
