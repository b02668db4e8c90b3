"""The paper's figures and those that show where it errs: their numbers, and how they are drawn.

A figure is a function here (its numbers by name) and a table in `data/trials.toml` (its words,
its size, which numbers the JSON holds, what is drawn of them). The order is the page's.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from string import Formatter
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from picchio.core.arrays import FloatArray
from picchio.paper.claims import plainly
from picchio.paper.equations import printed_force
from picchio.paper.life import shaft_steel
from picchio.paper.printed import trials
from picchio.paper.study import Study
from picchio.paper.world import World, poses_at, rivet_points
from picchio.visuals.plots import style
from picchio.visuals.plots.style import CMAP, GREEN, MUTED, STYLE, VERMILION, look

JOINTS = ("joint 1", "joint 2", "joint 3")
NAMED_COLOURS = ("blue", "vermilion", "green", "orange", "grey", "ink", "muted")
"""Of the house style, as the marks in `data/trials.toml` name them."""
Numbers = dict[str, Any]
"""What a figure shows and what its words need, by name."""


@dataclass(frozen=True, eq=False)
class PaperFigure:
    """A figure of the page.

    Attributes:
        name: unique on the page: "fig-9".
        title: of the figure; "Fig. 9: ..." where the paper has it.
        caption: what it shows.
        alt: the same for readers who cannot see it.
        data: the numbers behind it, for JSON.
        words: what is drawn and what sentences about it need, its numbers included.
        marks: what is drawn, in this order; see `data/trials.toml`.
        columns, rows: of Axes; sharex: whether they share their abscissa.
        width, height: of the figure, inches; wide: whether it takes the page's whole width.
    """

    name: str
    title: str
    caption: str
    alt: str
    data: Mapping[str, Any]
    words: Mapping[str, Any]
    marks: Sequence[Mapping[str, Any]]
    columns: int = 1
    rows: int = 1
    width: float = 6.4
    height: float = 3.0
    sharex: bool = False
    wide: bool = False

    def plot(self) -> Figure:
        """The figure, in the house style; for notebooks too."""
        with mpl.rc_context(STYLE):
            size = (self.width, self.height)
            figure = Figure(figsize=size, layout="constrained", facecolor="none")
            axes = figure.subplots(self.rows, self.columns, sharex=self.sharex, squeeze=False)
            for k, ax in enumerate(axes.ravel()):
                for mark in self.marks:
                    if mark.get("on", k) == k:
                        _draw(ax, mark, {**self.words, "k": k})
        return figure

    def _repr_png_(self) -> bytes:
        stream = io.BytesIO()
        with mpl.rc_context(STYLE):
            self.plot().savefig(stream, format="png", dpi=110, facecolor="white")
        return stream.getvalue()

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {k: getattr(self, k) for k in ("name", "title", "caption", "data")}


def all_figures(study: Study) -> dict[str, PaperFigure]:
    """Every figure, by name."""
    found = ((name, paper_figure(study, name)) for name in FIGURES)
    return {name: figure for name, figure in found if figure is not None}


def paper_figure(study: Study, name: str) -> PaperFigure | None:
    """One of them; None where there is nothing to show."""
    numbers = FIGURES[name](study)
    if numbers is None:
        return None
    table = dict(trials().figures[name])
    table = {**trials().figures.get(table.pop("like", ""), {}), **table}
    kept = table.pop("data", dict.fromkeys(numbers.get("data", ()), 1))
    source = numbers.get("data", numbers)
    data = {key: rounded(source[key], step=step) for key, step in kept.items()}
    words = {"study": study, "paper": study.printed, **numbers}
    spoken = {key: table.pop(key).format(**words) for key in ("title", "caption", "alt")}
    return PaperFigure(name, data=data, words=words, **spoken, **table)


def rounded(values: Any, digits: int = 6, step: int = 1) -> Any:
    """Arrays as lists, so that JSON stays readable: few digits, and every so many of the last axis.

    The rest is kept as it is, arrays in a dictionary not.
    """
    if isinstance(values, dict):
        return {key: rounded(value, digits, step) for key, value in values.items()}
    if not isinstance(values, np.ndarray):
        return values
    array = np.asarray(values[..., ::step], dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.where(array == 0, 1.0, 10.0 ** np.floor(np.log10(np.abs(array))))
        kept = np.round(array / size, digits - 1) * size
    return np.where(np.isfinite(array), kept, array).tolist()


def number(words: Mapping[str, Any], path: str) -> Any:
    """A number by its path as format strings have it: "largest[1]", "table.stress".

    Args:
        words: what a figure found.
        path: the names and indices.
    """
    return Formatter().get_field(path, (), words)[0]


def _draw(ax: Axes, mark: Mapping[str, Any], words: Mapping[str, Any]) -> None:
    """One mark: a method of Axes, or one of ours."""
    options = {key: _meant(value, words) for key, value in mark.items() if key != "on"}
    name, what, texts = options.pop("do"), options.pop("of", []), options.pop("texts", None)
    if "look" in options:
        options |= look(options.pop("look"))
    method: Any = partial(OURS[name], ax) if name in OURS else getattr(ax, name)
    drawn = method(*what, **options)
    if texts is not None:
        ax.bar_label(drawn, texts, fontsize=8.5)


def _meant(value: Any, words: Mapping[str, Any]) -> Any:
    """A number for "@name", a colour for its name in the house style, words for words."""
    if isinstance(value, list):
        return [_meant(each, words) for each in value]
    if not isinstance(value, str):
        return value
    if value in NAMED_COLOURS:
        return getattr(style, value.upper())
    said = value.format(**words)
    return number(words, said[1:]) if said.startswith("@") else said


def _lines(
    ax: Axes, x: Any, rows: Any, labels: Any = JOINTS, first: int = 0, **options: Any
) -> None:
    """Rows over x, told apart by colour and dashes."""
    values = np.array(list(rows.values()) if isinstance(rows, dict) else rows)
    every = zip(np.broadcast_to(x, values.shape), values, labels, strict=True)
    for k, (at, row, label) in enumerate(every, first):
        ax.plot(at, row, label=label, **{**look(k), **options})


def _notes(ax: Axes, x: Any, y: Any, texts: Any, **options: Any) -> None:
    """Small words beside places of the data."""
    for at_x, at_y, text in np.broadcast(x, y, texts):
        ax.annotate(text, (at_x, at_y), textcoords="offset points", fontsize=8, **options)


def _map(ax: Axes, x: FloatArray, z: FloatArray, values: FloatArray, hub: float) -> None:
    """Contours on both sides of joint 1's axis, with a dot where they are highest."""
    top, nothing = values.argmax(), values.max() < 1e-9
    levels = np.linspace(0.0, 1.0 if nothing else values.max(), 13)
    for side in (1, -1):
        shown = ax.contourf(side * x, z, values, levels=levels, cmap=CMAP)
        if not nothing:
            ax.plot(side * x.flat[top], z.flat[top], "o", color=VERMILION, markersize=5)
    if nothing:
        ax.text(0, hub, "nothing", ha="center", va="center", color=MUTED)
        return
    bar = ax.figure.colorbar(shown, ax=ax, shrink=0.75, pad=0.01, ticks=levels[::4])
    bar.ax.set_yticklabels([f"{level:.2g}" for level in levels[::4]])


OURS: dict[str, Callable[..., None]] = {"lines": _lines, "notes": _notes, "map": _map}


# The numbers of each figure: -------------------------------------------------------------------


def _fig_4(study: Study) -> Numbers:
    """The pulse train and its Fourier sum."""
    blows, count = study.base.blows, study.given.harmonics
    time = np.linspace(0.0, 2.0 * blows.period, 1600)
    force = {n: printed_force(blows, n, time) for n in sorted({5, count, 10 * count})}
    over = max(float(s.max()) for s in force.values()) / blows.force - 1.0
    exact = np.where(np.mod(time, blows.period) < blows.width, blows.force, 0.0)
    shown = {"time": time, "ms": 1e3 * time, "force": force, "exact": exact, "overshoot": over}
    sums = [f"eq. 12, N = {n}" for n in force]
    words = {"period": 1e3 * blows.period, "width": 1e3 * blows.width, "percent": 100 * over}
    return {**shown, "sums": sums, **words}


def _fig_8(study: Study) -> Numbers:
    """The stress of all joints over time, steady state."""
    world, (at, n, _), (d, k, _) = study.base, study.base.at_worst, study.base.worst
    time = np.linspace(0.0, 3.0 * world.blows.period, 700)
    stress = world.stress(at.response(world.blows, None).deflection(time, n))
    words = {"direction": world.printed.table2[d].direction, "rivet": k + 1}
    return {"time": time, "ms": 1e3 * time, "stress": stress, **words}


def _steady_state(study: Study) -> Numbers:
    """A rivet from rest against the band of the steady state."""
    world, hits = study.base, study.printed.task.hits_per_rivet
    at, n, joint = world.at_worst
    time = np.linspace(0.0, (hits + 8) * world.blows.period, 1500)
    burst = world.stress(at.response(world.blows, hits).deflection(time, n)[joint])
    band = world.stress(at.response(world.blows, None).turning_points(n)[joint][1])
    slowest = -1.0 / float(at.modes.poles.real.max())
    ratio = float(np.abs(burst).max() / np.abs(band).max())
    shown = {"time": time, "stress": burst, "steady": band, "time_constant": slowest}
    drawn = {"least": burst.min(), "low": band.min(), "high": band.max()}
    words = {"joint": joint + 1, "lasts": hits * world.blows.period, "hits": hits}
    return {**shown, "ratio": ratio, **drawn, **words}


def _phase(study: Study) -> Numbers:
    """Eq. 13 with two arctangents."""
    found = study.phase
    exact, plain = (np.array(rounded(found[name], step=4)) for name in ("exact", "plain"))
    off = float(np.abs(plain - exact).max() / np.abs(exact).max())
    histories = [found[name] for name in ("exact", "plain", "right")]
    words = {"off": off, "percent": 100 * off, "history": 100 * found["plain_history"]}
    return {**found, "ms": 1e3 * found["time"], "histories": histories, **words}


def _fig_9(study: Study) -> Numbers:
    """The four poses of the vertical path, with their envelopes."""
    return _envelopes(study.base)


def _fig_9_found(study: Study) -> Numbers | None:
    """Envelopes in the clearest world that has the paper's sequence."""
    example = study.sequences.example
    return None if example is None else _envelopes(example)


def _envelopes(world: World) -> Numbers:
    """Envelopes on the vertical path, cut and laid into the plane x + i z."""
    angle = np.linspace(0.0, np.pi, 60, endpoint=False)
    radii = world.path_radii(angle)
    # Joint 1's lies across the arm's plane: it is seen from above.
    radii[:, :, 0] = world.path_radii(angle, towards=(0.0, 1.0, 0.0))[:, :, 0]
    radii = np.moveaxis(np.concatenate([radii, radii, radii[:1]]), 0, -1)
    peaks, worst = world.path_peaks.peak_deflection, world.path_peaks.direction
    leaning = worst[..., 0] + 1j * np.where([True, False, False], worst[..., 1], worst[..., 2])
    task, (l1, l2, _) = world.printed.task, world.printed.arm.link_lengths
    heights, size = list(task.path_heights), 0.42 / peaks.max()  # m a rad
    tips = world.given.path_x + 1j * np.array(heights)
    elbows = 1j * l1 + l2 * np.exp(1j * world.path_poses[:, 1])
    bones = np.stack([0.0 * tips, np.full(4, 1j * l1), elbows, tips], axis=-1)
    at, turn = tips[:, None, None], np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 121))
    ends = at + size * (peaks * leaning)[..., None] * [-1.0, 1.0]
    leads = [JOINTS[row.argmax()] for row in peaks]
    said = zip(heights, leads, task.dominant_joints, strict=True)
    titles = [f"z = {z:g} m: {lead}\n(paper: joint {wanted})" for z, lead, wanted in said]
    shown = {"height": heights, "peak_mrad": 1e3 * peaks, "lean_deg": world.lean}
    shown |= {"waist": world.waist, "worst_direction": worst}
    drawn = {"bones": bones, "rings": at + size * radii * turn, "ends": ends, "titles": titles}
    return {**shown, **drawn, "leads": ", ".join(leads)}


def _dominance(study: Study) -> Numbers:
    """Where the sequence is found."""
    found, arm, counts = study.sequences, study.printed.arm, study.sequences.counts
    tried, hits, full = len(found.agree), counts[4], found.agree == 4
    shares = 100 * np.array(counts) / tried
    at = np.array([1e3 * found.values[:, 0], found.values[:, 3]])
    shown = {"tried": tried, "hits": hits, "agree": counts}
    drawn = {"shares": shares, "told": [f"{value:.2g} %" for value in shares]}
    drawn |= {"some": at[:, ::8], "full": at[:, full], "share": hits / tried}
    wanted, stiffer = study.printed.task.dominant_joints, arm.stiffness[0] / arm.stiffness[1]
    return {**shown, **drawn, "wanted": ", ".join(map(str, wanted)), "stiffer": stiffer}


def _range(study: Study) -> Numbers:
    """Joint 3's stated range against the vertical path."""
    arm, heights = study.printed.arm, np.array(study.printed.task.path_heights)
    limit, (l1, l2, l3) = float(arm.limits[2]), arm.link_lengths
    x = np.linspace(0.2, 1.6, 400)
    bend = np.degrees(np.abs(poses_at([[(at, 0.0, z) for at in x] for z in heights])[..., 2]))
    worst = bend.max(axis=0)
    inner, outer = float(np.sqrt(l2**2 + l3**2 + 2.0 * l2 * l3 * np.cos(limit))), l2 + l3
    arc = np.exp(1j * np.linspace(-np.pi / 2, np.pi / 2, 200))
    ring = 1j * l1 + np.concatenate([outer * arc, inner * arc[::-1]])
    ends = [np.sqrt((r**2 - (heights - l1) ** 2).clip(0.0)) for r in (inner, outer)]
    least, at_x = float(np.nanmin(worst)), float(x[np.nanargmin(worst)])
    shown = {"least_bend_deg": least, "at_x": at_x, "limit_deg": float(np.degrees(limit))}
    drawn = {"ring": ring, "ends": ends, "named": [f"z = {z:g} m" for z in heights]}
    return {**shown, "x": x, "bend_deg": bend, **drawn}


def _fig_10(study: Study) -> Numbers:
    """Three joints by the worst direction, and by forces along x and z."""
    reach = study.base.reach
    names = {"worst": "worst direction", "x": "force along x", "z": "force along z"}
    panels = [(name, j) for name in names for j in range(3)]
    place = rounded(reach.place[::4, ::4], 4)
    peaks = {name: rounded(reach.peaks[name][::4, ::4], 4) for name in names}
    largest = {name: [rounded(reach.top(name, j)) for j in range(3)] for name in names}
    maps = [reach.peaks[name][..., j] for name, j in panels]
    titles = [f"Joint {j + 1}, {names[name]}" for name, j in panels]
    shown = {"place": place, "bend": reach.bend[::4], "peak_mrad": peaks, "largest_at": largest}
    return {**shown, "xz": np.moveaxis(reach.place, -1, 0), "maps": maps, "titles": titles}


def _rings(study: Study) -> Numbers:
    """Joints 2 and 3 by the worst direction, over the turn of joint 2."""
    reach, worst = study.base.reach, study.base.reach.peaks["worst"][..., 1:]
    angle = np.degrees(np.linspace(-1.0, 1.0, len(worst)) * study.printed.arm.limits[1])
    some = [0, len(reach.bend) // 2, len(reach.bend) - 1]
    spread = float(np.ptp(worst, axis=0).max() / worst.max())
    shown = {f"joint_{j + 2}": worst[:, some, j] for j in (0, 1)}
    drawn = {
        "bent": np.moveaxis(worst[:, some], 0, -1),
        "bends": np.abs(np.degrees(reach.bend[some])),
    }
    return {"angle_deg": angle, **shown, "spread": spread, **drawn}


def _straight(study: Study, joint: int, forces: str) -> Numbers:
    """The arm stretched out: a joint's peaks, mrad, over joint 2's angle by the forces' axes."""
    turn = np.linspace(-1.0, 1.0, 241) * study.printed.arm.limits[1]
    poses = np.stack([0.0 * turn, turn, 0.0 * turn], axis=-1)
    along = {"worst": None, **dict(zip("xyz", np.eye(3), strict=True))}
    peaks = {a: study.base.peaks(poses, n).peak_deflection[:, joint] for a, n in along.items()}
    shown = {a: 1e3 * peaks[a] for a in forces}
    return {
        "angle_deg": np.degrees(turn),
        f"joint_{joint + 1}": shown,
        "worst": 1e3 * peaks["worst"],
    }


def _x_force(study: Study) -> Numbers:
    """Joint 1 under x with the arm stretched out."""
    found = _straight(study, 0, "xyz")
    by = {f"by_{a}": max(values) for a, values in rounded(found["joint_1"]).items()}
    return {**found, **by, "plain_x": plainly(float(found["joint_1"]["x"].max()))}


def _z_force(study: Study) -> Numbers:
    """Joint 2 under x and z with the arm stretched out."""
    found = _straight(study, 1, "xz")
    peaks = found["joint_2"]
    by = {f"by_{a}": values[-1] for a, values in rounded(peaks).items()}
    share = plainly(float(peaks["z"][-1] / peaks["x"][-1]))
    return {**found, **by, "plain_z": plainly(by["by_z"]), "share": share}


def _fig_11(study: Study) -> Numbers:
    """The S-N curve, a shaft steel's, and the curve of Table 2."""
    curve, other, steel = study.printed.sn_curve, study.curve_of_table.other.values, shaft_steel()
    assert steel.ultimate_shear is not None
    n = np.geomspace(1e2, 1e9, 200)
    curves = {"printed": curve.a * n**curve.b, "steel": steel.amplitude(n) / 1e6}
    curves["through_table_2"] = other["a"] * n ** other["b"]
    words = {"at_1000": curve.a * 1000.0**curve.b, "steel_breaks_at": steel.ultimate_shear / 1e6}
    return {"cycles": n, **curves, "curves": curves, **words}


def _gravity(study: Study) -> Numbers:
    """Torque to hold the arm."""
    angle, torque = study.base.sweep
    limits, largest = list(study.printed.arm.actuator_torques), torque.max(axis=0)
    shown = {"angle_deg": np.degrees(angle[::6]), "torque": torque[::6], "largest": largest}
    drawn = {"turn_deg": np.degrees(angle), "torques": torque.T[1:]}
    words = {"actuators": limits, "share_held": study.base.share_held}
    return {**shown, **drawn, **words, "times": largest[1] / limits[1]}


def _gravity_stress(study: Study) -> Numbers:
    """Gravity's steady stress against the vibration's."""
    stress, printed = study.base.gravity_stress.mean(axis=0), study.printed.stress
    vibration, largest = study.base.rivet_stress.mean(axis=1), printed[:, 1].max()
    shown = {"gravity": stress, "vibration": vibration, "printed": printed}
    drawn = {"most": [values.max(axis=0) for values in (printed, vibration)]}
    told = [f"{value:.0f}" for value in stress]
    return {**shown, **drawn, "told": told, "largest": largest, "times": stress[1] / largest}


def _shaft(study: Study) -> Numbers:
    """Which shafts have the stated stiffness, and what stress they show."""
    modulus, arm = study.given.shear_modulus, study.printed.arm
    radius, springs = np.geomspace(5e-3, 60e-3, 120), sorted(set(arm.stiffness))
    lengths = {f"{k:g}": 1e3 * modulus * np.pi * radius**4 / (2.0 * k) for k in springs}
    own = [joint.shaft for joint in study.base.robot.flexible_joints if joint.shaft]
    sizes = np.array([(2e3 * each.radius, 1e3 * each.length) for each in own]).T  # mm
    drawn = {"springs": [f"k = {k:.3g} N m/rad" for k in springs], "sizes": sizes}
    drawn |= {"by_stress": [1e3 * modulus * radius / stress for stress in (10e9, 100e9)]}
    thick, long = sizes[:, 1]
    words = {
        "thick": thick,
        "long": long,
        "slender": long / thick,
        "arm": sum(arm.link_lengths[1:]),
    }
    return {"thickness_mm": 2e3 * radius, "length_mm": lengths, **drawn, **words}


def _corrections(study: Study) -> Numbers:
    """The life by the paper's method, by each correction alone, and by all."""
    steps, base = study.steps[::-1], study.steps[0].rivets
    ends = np.array([s.without_limit if math.isinf(s.rivets) else s.rivets for s in steps])
    notes: dict[bool, list[tuple[float, int, str]]] = {True: [], False: []}
    colours: list[tuple[str, float]] = []
    for k, (step, end) in enumerate(zip(steps, ends, strict=True)):
        joint = f", joint {step.joint}" if step.joint else ""
        words = f"{step.rivets:.3g}{joint}  (× {step.rivets / base:.2g})"
        if math.isinf(step.rivets):
            words = f"unlimited ({end:.2g} without the limit){joint}"
        notes[bool(end > 1e3 * base)].append((max(base, end), k, words))
        pale = 0.35 if math.isinf(step.rivets) else 0.75
        colours.append((GREEN if end > base else VERMILION, pale))
    within, beside = (list(zip(*notes[far], strict=True)) for far in (True, False))
    drawn = {"base": base, "change": ends - base, "colours": colours, "row": range(len(steps))}
    drawn |= {"within": within, "beside": beside, "window": (ends.min() / 4, 30 * ends.max())}
    return {"steps": [s.to_dict() for s in study.steps], "names": [s.name for s in steps], **drawn}


def _fig_12(study: Study) -> Numbers:
    """The rivet pattern and its path."""
    points = rivet_points(study.given)
    numbers = [str(k + 1) for k in range(len(points))]
    return {"points": points, "numbers": numbers, "count": len(points)}


def _fig_13_15(study: Study) -> Numbers:
    """Peak stresses over the rivets, in the base world and in the fitted one."""
    printed, stresses = study.printed, [w.rivet_stress for w in (study.base, study.fitted)]
    names, panels = ("base", "fitted"), [(w, k) for w in (0, 1) for k in range(3)]
    both = [{"stress": rounded(s, 5), "mean": s.mean(axis=1)} for s in stresses]
    tops = [1.12 * max(float(s.max()), float(printed.stress.max())) for s in stresses]
    titles = [f"{printed.table2[k].direction}, {names[w]} world" for w, k in panels]
    drawn = {"rivets": np.arange(1, 1 + stresses[0].shape[1]), "titles": titles}
    drawn |= {"panels": [stresses[w][k].T for w, k in panels], "tops": [tops[w] for w, _ in panels]}
    return {**dict(zip(names, both, strict=True)), **drawn, "means": [*printed.stress] * 2}


def _influence(study: Study) -> Numbers:
    """One input at a time from its least to its largest value: the effect on the life."""
    rows = study.influences[::-1]
    low, high = (np.array([pick(row.lives) for row in rows]) for pick in (min, max))
    data = {row.name: row.to_dict() for row in study.influences}
    drawn = {"shortest": low, "span": high - low, "base": rows[0].lives[0]}
    ranges = [trials().inputs[row.name].range_of(row.name) for row in rows]
    return {"data": data, "row": range(len(rows)), **drawn, "ranges": ranges}


def _table_2_lives(study: Study) -> Numbers:
    """Printed over predicted N: the printed curve, rivets for hits, the other curve."""
    table, off = study.curve_of_table, study.curve_of_table.over_printed
    names, order = ("the curve as printed", "as printed, rivets for hits"), np.argsort(table.stress)
    fits = [*(table.fit(name) for name in names), table.other]
    said = [(table.labels[k].replace(", ", ",\n"), table.stress[k]) for k in order]
    shown = {"labels": list(table.labels), "hypotheses": [vars(fit) for fit in table.fits]}
    shown |= {k: getattr(table, k) for k in ("stress", "cycles", "over_printed", "rounding")}
    drawn = {"fits": fits, "ratios": [np.exp(fit.residuals[order]) for fit in fits]}
    ticks = [f"{label}\n{stress:g} MPa" for label, stress in said]
    words = {"shortest": float(off.min()), "longest": float(off.max()), "table": table}
    return {**shown, **drawn, "ticks": ticks, **words}


def _hypotheses(study: Study) -> Numbers:
    """Each hypothesis's error on entries left out."""
    found = study.comparison.hypotheses
    means, lives = (100 * np.abs([h.left_out[kind] for h in found[::-1]]) for kind in (0, 1))
    drawn = {"lives": lives.clip(1e-2), "names": [h.fit.rule.name for h in found[::-1]]}
    medians = [np.nanmedian(errors, axis=1) for errors in (lives, means)]
    words = {"medians": medians, "row": range(len(found))}
    return {"hypotheses": [h.to_dict() for h in found], **drawn, **words}


FIGURES: dict[str, Callable[[Study], Numbers | None]] = {
    name: globals()["_" + name.replace("-", "_")] for name in trials().figures
}
"""The function of each figure, in the page's order: that of "fig-4" is `_fig_4`."""
