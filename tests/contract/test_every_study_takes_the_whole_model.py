"""Every study and view, with every effect and every excitation: honoured, told, or refused.

What is asked is found, not listed: the effects of the catalogue, the excitations of the catalogue,
and the public functions whose first argument is a robot or a model. A new one of either is covered
as it is registered.

For each combination the answer must change if and only if the load that `assess` finds changes. An
effect that leaves the load alone must be named in the answer; one that a study cannot take must be
refused in one line that names it, and only a nonlinear effect, or one that declares the question to
be without meaning (`Effect.refused`), may be.
"""

from __future__ import annotations

import inspect
import itertools
import json
import warnings
import zlib

import numpy as np
import pytest

import picchio
from picchio.core.errors import InputError
from picchio.excitation.excitation import Excitation
from picchio.excitation.table import ExcitationTable
from picchio.excitation.table import catalogue as excitations
from picchio.fatigue.sn.curve import SNCurve
from picchio.model.effects.effect import Effect
from picchio.model.effects.registry import catalogue as effects
from picchio.model.effects.scales import Scales
from picchio.model.model import Model
from picchio.studies.maps.places import Listed
from picchio.studies.tasks import Operation, Task
from picchio.visuals.worst_rivet import worst_rivet

POSE = [0.3, 0.9, -0.7]
DIRECTION = np.array([0.6, 0.48, 0.64])
HITS = 12
# One in so many of the combinations is tried in the fast tier.
SAMPLE = 17
# Arguments that keep a study small; those with a default that are not here are left alone.
SMALL = {
    "samples": 8, "poses": 1, "placements": 2, "move": [0.0, 0.0, 0.0, 0.0],
    "self_collision": False, "hits": HITS, "steady_check": False,
    # A line without an endurance limit, so that every life is a number.
    "sn_curve": SNCurve(name="straight", strength=60e6, cycles=1e6, slopes=(5.0,)),
}  # fmt: skip


def blows(kind: str, folder) -> Excitation:
    """Blows of a kind: of the keys that it needs, these."""
    file = folder / "force.csv"
    file.write_text("time [s],force [N]\n0,0\n0.001,290\n0.003,310\n0.004,0\n")
    known = {"force": 300.0, "period": 0.04, "width": 0.004, "file": str(file)}
    table = {key: known[key] for key in ("period", *excitations()[kind].needed)}
    return ExcitationTable(kind=kind, preload=20.0, **table).build()


def scales(robot) -> Scales:
    """Sizes on this arm under these blows, for effects to say at what size they matter."""
    names, links = robot.flexible_names, list(robot.tree.links)
    return Scales(
        stiffness=dict(zip(names, robot.stiffness, strict=True)),
        inertia=dict.fromkeys(names, 60.0),
        deflection=dict.fromkeys(names, 4e-4),
        rate=dict.fromkeys(names, 2e-2),
        gravity=dict.fromkeys(names, 300.0),
        mass=200.0, compliance=1e-5, travel=1e-3, force=300.0, period=0.04, width=0.004,
        days=10.0, kelvin=10.0, reading={"accelerometer.tool": (2.0, 10.0)}, step=1e-3,
        link_stiffness=dict.fromkeys(links, 1e5),
    )  # fmt: skip


def an_effect(name: str, robot) -> Effect:
    """The effect at a size that matters, drawn for a record without a name where it is drawn."""
    kind = effects()[name]
    links = [link for link, inertial in robot.tree.links.items() if inertial]
    target = {
        "joint": "joint_2", "joint pair": "joint_2", "joint or link": "joint_2",
        "link": links[-1], "tool": "tool", "robot": "robot", "axis": "ry",
        "channel group": "accelerometer.tool",
    }[kind.target_kind]  # fmt: skip
    tried = kind(target).trials(scales(robot))
    values = dict(tried[0]) if tried else {}
    if not values:
        for parameter in kind.parameters:
            low, high = np.nan_to_num([parameter.lower, parameter.upper], posinf=0.1, neginf=-0.1)
            values[parameter.name] = low + (0.002 if parameter.unit == "s" else 0.2) * (high - low)
    effect = kind(target, **values)
    if kind.latent is not None:
        drawn = effect.draw(np.random.default_rng(3), HITS)
        effect = effect.with_hidden({"": tuple(drawn)})
    return effect


def studies() -> list[str]:
    """The public functions that ask something of a robot or a model."""
    found = []
    for name in picchio.__all__:
        function = getattr(picchio, name)
        if not inspect.isfunction(function):
            continue
        first = next(iter(inspect.signature(function).parameters), None)
        known = function.__annotations__
        if first == "robot" and known["robot"] == "ModelLike" and "tuple" not in known["return"]:
            found.append(name)
    return found


def ask(study: str, model: Model, excitation: Excitation, folder) -> dict[str, float | str]:
    """Every number of a study's answer by its path, and all its text under ""."""
    given = {
        "robot": model, "task": a_task(excitation), "pose": POSE, "excitation": excitation,
        "direction": DIRECTION, "rivets": 2e6,
        "places": Listed("pose", np.array([POSE])), "out": folder / f"{study}.nc", "restart": True,
        "log": a_log(folder), "ledger": folder / "ledger",
        # Total shares take most of the time: every effect is asked for them under one kind of blow.
        "totals": isinstance(excitation, picchio.PulseTrain),
    }  # fmt: skip
    parameters = inspect.signature(getattr(picchio, study)).parameters
    if "pose" in parameters and "task" in parameters:  # blows at a pose, instead of a task
        given["task"] = None
    chosen = {key: value for key, value in (given | SMALL).items() if key in parameters}
    missing = [key for key, p in parameters.items() if p.default is p.empty and key not in chosen]
    assert not missing, f"{study} needs {missing}: say in `ask` what to give"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        answer = getattr(picchio, study)(**chosen)
    content = answer.to_dict()
    if hasattr(answer, "close"):
        answer.close()
    for key in ("provenance", "file"):
        content.pop(key, None)
    numbers: dict[str, float | str] = {}
    _flatten(content, "", numbers)
    numbers[""] = json.dumps(content, default=str)
    return numbers


def _flatten(value, path: str, out: dict) -> None:
    if isinstance(value, dict):
        for key, entry in value.items():
            _flatten(entry, f"{path}/{key}", out)
    elif isinstance(value, list | tuple):
        for k, entry in enumerate(value):
            _flatten(entry, f"{path}[{k}]", out)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        out[path] = float(value)


def a_log(folder):
    """The tool's trigger over one rivet at the pose: the blows themselves are not seen."""
    file = folder / "logs" / "shift.csv"
    file.parent.mkdir(exist_ok=True)
    angles = ",".join(map(str, POSE))
    rows = [f"{1772352000 + i / 250:.3f},{int(125 <= i < 240)},{angles}" for i in range(500)]
    file.write_text("\n".join(["time,on,1,2,3", *rows]) + "\n")
    channels = [f'{{ from = "{k}", to = "position.joint_{k}" }}' for k in (1, 2, 3)]
    channels.append('{ from = "on", to = "trigger" }')
    text = f'format = "picchio-mapping/1"\nchannel = [{", ".join(channels)}]\n'
    (file.parent / "mapping.toml").write_text(text)
    return file


def a_task(excitation: Excitation) -> Task:

    return Task((Operation("one", DIRECTION, excitation, HITS, np.array([POSE])),))


def differs(one: dict, other: dict) -> bool:
    """Whether any number is another one, beyond what two exact paths differ by."""
    size = {path: max(abs(one[path]), abs(other.get(path, np.nan))) for path in one if path}
    return any(
        path not in other or abs(one[path] - other[path]) > 1e-5 * size[path] + 1e-12
        for path in size
    )


@pytest.fixture(scope="module")
def robot():
    return picchio.load_robot("fanuc_like_3dof")


@pytest.fixture(scope="module")
def nominal(robot, tmp_path_factory):
    """The answers without an effect, asked for once."""
    known = {}

    def get(study: str, kind: str):
        if (study, kind) not in known:
            folder = tmp_path_factory.mktemp("nominal")
            known[study, kind] = ask(study, Model(robot), blows(kind, folder), folder)
        return known[study, kind]

    return get


REFUSALS: dict[tuple[str, str, str], str] = {}


def check(study: str, name: str, kind: str, robot, nominal, folder, loaded=None) -> None:
    """One combination; what `assess` finds with the effect is asked for once where it is kept."""
    excitation = blows(kind, folder)
    effect = an_effect(name, robot)
    loaded = {} if loaded is None else loaded
    try:
        model = Model(robot).with_effects([effect])
        if kind not in loaded:
            loaded[kind] = ask("assess", model, excitation, folder)
        loads = loaded[kind]
    except InputError as error:
        # What has no meaning for these blows is refused by every study alike.
        reason = str(error)
        REFUSALS[study, name, kind] = reason
        assert "\n" not in reason and effect.name in reason, reason
        with pytest.raises(InputError, match=effect.name):
            ask(study, model, excitation, folder)
        return
    moves = differs(nominal("assess", kind), loads)
    try:
        answer = loads if study == "assess" else ask(study, model, excitation, folder)
    except InputError as error:
        reason = str(error)
        REFUSALS[study, name, kind] = reason
        assert "\n" not in reason and effect.label in reason, reason
        assert effect.where == "nonlinear" or effect.refused, reason
        return
    assert differs(nominal(study, kind), answer) == moves
    if not moves:
        assert effect.label in answer[""], f"{study} does not say that {effect.label} does nothing"


ALL = list(itertools.product(studies(), effects(), excitations()))


def chosen(combination) -> bool:
    return zlib.crc32("/".join(combination).encode()) % SAMPLE == 0


def names(combination) -> str:
    return "-".join(combination)


@pytest.mark.parametrize("combination", [one for one in ALL if chosen(one)], ids=names)
def test_a_sample(combination, robot, nominal, tmp_path):
    check(*combination, robot, nominal, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", effects())
def test_every_pair(name, robot, nominal, tmp_path):
    """Every study with every effect, and either of them with every kind of blows."""
    kinds, asked = list(excitations()), studies()
    assert len(asked) >= len(kinds)
    first, loaded = list(effects()).index(name), {}
    for k, study in enumerate(asked):
        check(study, name, kinds[(first + k) % len(kinds)], robot, nominal, tmp_path, loaded)


@pytest.mark.slow
@pytest.mark.minutes
@pytest.mark.parametrize("name", effects())
def test_everything(name, robot, nominal, tmp_path):
    loaded: dict[str, dict] = {}
    for study, kind in itertools.product(studies(), excitations()):
        check(study, name, kind, robot, nominal, tmp_path, loaded)
    for (study, asked, kind), reason in REFUSALS.items():
        if asked == name:
            print(f"{study:15} {name:22} {kind:16} {reason}")


def test_all_studies_are_found():
    # What the command line asks of a model is here, and nothing is left out by a signature.
    wanted = {"allowable", "assess", "envelope", "place", "uncertain_life", "view", "workspace_map"}
    assert wanted <= set(studies())


@pytest.mark.parametrize(
    "name", ["joint_stiffness", "payload", "base_compliance", "force_direction", "pulse_width"]
)
def test_one_rivet_is_the_same_everywhere(name, robot, tmp_path):
    excitation = blows("pulse_train", tmp_path)
    model = Model(robot).with_effects([an_effect(name, robot)])
    told = picchio.assess(model, a_task(excitation))
    peaks = told.operations[0].peak_deflection[0]
    envelope = picchio.envelope(model, POSE, excitation, hits=HITS)
    np.testing.assert_allclose(envelope.support(DIRECTION[None])[:, 0], peaks, rtol=1e-6)
    torque = envelope.support(DIRECTION[None], "torque")[:, 0]
    np.testing.assert_allclose(torque, told.operations[0].peak_torque[0], rtol=1e-6)
    places = Listed("pose", np.array([POSE]))
    with picchio.workspace_map(
        model, places, excitation, tmp_path / "map.nc", direction=DIRECTION, hits=HITS
    ) as found:
        mapped = found.to_xarray()["peak_deflection"].values[0]
        np.testing.assert_allclose(mapped, peaks, rtol=1e-6)
    worst = worst_rivet(told, model, a_task(excitation))
    drawn = [abs(peak.value) for peak in worst.rest.peaks(DIRECTION)]
    np.testing.assert_allclose(drawn, peaks, rtol=1e-6)
    scene = picchio.view(model, pose=POSE, excitation=excitation, hits=HITS)
    samples = np.abs(np.einsum("ndk,d->nk", scene.motion["samples"], DIRECTION)).max(axis=1)
    assert (samples <= peaks * (1 + 1e-6)).all() and (samples > 0.9 * peaks).all()
