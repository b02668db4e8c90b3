"""The paper's figures and those that show where it errs: their numbers, and how they are drawn.

A figure is a function here (its numbers, how it is drawn, what its words need) and a table in
`data/trials.toml` (its words, its size, its axes). The order is the page's.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from picchio.paper.claims import plainly
from picchio.paper.equations import printed_force
from picchio.paper.life import STEEL, shaft_steel
from picchio.paper.printed import trials
from picchio.paper.study import Study
from picchio.paper.table2.by_curve import OTHER_CURVE
from picchio.paper.world import ReachMap, World, poses_at, rivet_points
from picchio.visuals.plots.style import CMAP, COLOURS, GREY, INK, MUTED, STYLE, look

BLUE, VERMILION, GREEN, ORANGE = COLOURS[:4]
JOINTS = ("joint 1", "joint 2", "joint 3")
DASHED: Any = (0, (4, 2))
Built = tuple[dict[str, Any], Callable[..., None], dict[str, Any]]
"""A figure's numbers for JSON, what draws it on its Axes, and what else its words need."""


@dataclass(frozen=True, eq=False)
class PaperFigure:
    """A figure of the page.

    Attributes:
        name: unique on the page: "fig-9".
        title: of the figure; "Fig. 9: ..." where the paper has it.
        caption: what it shows.
        alt: the same for readers who cannot see it.
        data: the numbers behind it, for JSON.
        words: what sentences about it need, its numbers included.
        draw: draws it on its Axes, row by row.
        columns, rows: of Axes; sharex: whether they share their abscissa.
        width, height: of the figure, inches; wide: whether it takes the page's whole width.
        axes: for each of the Axes what is set, its legend, its margins.
    """

    name: str
    title: str
    caption: str
    alt: str
    data: Mapping[str, Any]
    words: Mapping[str, Any]
    draw: Callable[..., None]
    columns: int = 1
    rows: int = 1
    width: float = 6.4
    height: float = 3.0
    sharex: bool = False
    wide: bool = False
    axes: Sequence[Mapping[str, Any]] = field(default_factory=list)

    def plot(self) -> Figure:
        """The figure, in the house style; for notebooks too."""
        with mpl.rc_context(STYLE):
            size = (self.width, self.height)
            figure = Figure(figsize=size, layout="constrained", facecolor="none")
            axes = figure.subplots(self.rows, self.columns, sharex=self.sharex, squeeze=False)
            self.draw(*axes.ravel())
            for ax, how in zip(axes.ravel(), self.axes, strict=False):
                ax.margins(y=how.get("margin", 0.05))
                ax.set(**how.get("set", {}))
                if "legend" in how:
                    ax.legend(**how["legend"])
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
    built = FIGURES[name](study)
    if built is None:
        return None
    numbers, draw, words = built
    data = {key: rounded(value) for key, value in numbers.items()}
    words = {**data, "study": study, "paper": study.printed, **words}
    text = dict(trials().figures[name])
    spoken = {key: text.pop(key).format(**words) for key in ("title", "caption", "alt")}
    return PaperFigure(name, data=data, words=words, draw=draw, **spoken, **text)


def rounded(values: Any, digits: int = 6) -> Any:
    """Arrays as lists of numbers with few digits, so that JSON stays readable; the rest kept."""
    if isinstance(values, dict):
        return {key: rounded(value, digits) for key, value in values.items()}
    if not isinstance(values, np.ndarray):
        return values
    array = np.asarray(values, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.where(array == 0, 1.0, 10.0 ** np.floor(np.log10(np.abs(array))))
        kept = np.round(array / size, digits - 1) * size
    return np.where(np.isfinite(array), kept, array).tolist()


def lines(ax: Axes, x: Any, rows: Any, labels: Any, **options: Any) -> None:
    """Rows over x, told apart by colour and dashes."""
    for k, (row, label) in enumerate(zip(rows, labels, strict=True)):
        ax.plot(x, row, label=label, **{**look(k), **options})


def note(ax: Axes, words: str, at: Any, away: tuple[float, float] = (0, 0), **options: Any) -> None:
    """Small words beside a place of the data."""
    offset = {"xytext": away, "textcoords": "offset points", "fontsize": 8}
    ax.annotate(words, at, **{**offset, **options})


def _fig_4(study: Study) -> Built:
    """The pulse train and its Fourier sum."""
    blows, count = study.base.blows, study.given.harmonics
    time = np.linspace(0.0, 2.0 * blows.period, 1600)
    exact = np.where(np.mod(time, blows.period) < blows.width, blows.force, 0.0)
    sums = {n: printed_force(blows, n, time) for n in sorted({5, count, 10 * count})}
    over = max(float(s.max()) for s in sums.values()) / blows.force - 1.0

    def draw(ax: Axes) -> None:
        lines(ax, 1e3 * time, sums.values(), [f"eq. 12, N = {n}" for n in sums], linewidth=1.2)
        ax.plot(1e3 * time, exact, color=INK, linewidth=1.6, label="exact")

    shown = {"time": time[::8], "force": {str(n): f[::8] for n, f in sums.items()}}
    words = {"period": 1e3 * blows.period, "width": 1e3 * blows.width, "percent": 100 * over}
    return {**shown, "overshoot": over}, draw, words


def _fig_8(study: Study) -> Built:
    """The stress of all joints over time, steady state."""
    world, (at, n, _) = study.base, study.base.at_worst
    time = np.linspace(0.0, 3.0 * world.blows.period, 700)
    stress = world.stress(at.response(world.blows, None).deflection(time, n))

    def draw(ax: Axes) -> None:
        lines(ax, 1e3 * time, stress, JOINTS)
        ax.axhline(0.0, color=MUTED, linewidth=0.7)

    d, k, _ = world.worst
    words = {"direction": world.printed.table2[d].direction, "rivet": k + 1}
    return {"time": time[::5], "stress": stress[:, ::5]}, draw, words


def _steady_state(study: Study) -> Built:
    """A rivet from rest against the band of the steady state."""
    world, hits = study.base, study.printed.task.hits_per_rivet
    at, n, joint = world.at_worst
    lasts = hits * world.blows.period
    time = np.linspace(0.0, (hits + 8) * world.blows.period, 1500)
    burst = world.stress(at.response(world.blows, hits).deflection(time, n)[joint])
    band = world.stress(at.response(world.blows, None).turning_points(n)[joint][1])
    ratio = float(np.abs(burst).max() / np.abs(band).max())

    def draw(ax: Axes) -> None:
        words = "steady state, which the paper takes"
        ax.axhspan(band.min(), band.max(), color=VERMILION, alpha=0.25, linewidth=0, label=words)
        ax.plot(time, burst, color=BLUE, label=f"a rivet of {hits} hits from rest")
        ax.axvline(lasts, color=MUTED, linestyle=DASHED, linewidth=1)
        note(ax, "the rivet is done", (lasts, burst.min()), (4, 0), color=MUTED)

    words = {"joint": joint + 1, "lasts": lasts, "hits": hits}
    slowest = -1.0 / float(at.modes.poles.real.max())
    data = {"time": time[::5], "stress": burst[::5], "steady": band, "time_constant": slowest}
    return {**data, "ratio": ratio}, draw, words


def _phase(study: Study) -> Built:
    """Eq. 13 with two arctangents."""
    found = study.phase
    names = ("exact", "plain", "right")

    def draw(ax: Axes) -> None:
        labels = ("exact", "eq. 13, plain tan⁻¹", "eq. 13, full-circle arctangent")
        lines(ax, 1e3 * found["time"], [found[name] for name in names], labels)

    shown = {name: found[name][::4] for name in ("time", *names)}
    exact, plain = (np.array(rounded(shown[name])) for name in ("exact", "plain"))
    off = float(np.abs(plain - exact).max() / np.abs(exact).max())
    history = 100 * found["plain_history"]
    return shown, draw, {"off": off, "percent": 100 * off, "history": history, **found}


def _envelopes(world: World) -> Built:
    """The four poses of the vertical path, with their envelopes."""
    angle = np.linspace(0.0, np.pi, 60, endpoint=False)
    radii = 1e3 * world.path_radii(angle)
    radii[:, :, 0] = 1e3 * world.path_radii(angle, towards=(0.0, 1.0, 0.0))[:, :, 0]
    peaks = 1e3 * world.path_peaks.peak_deflection
    heights, wanted = world.printed.task.path_heights, world.printed.task.dominant_joints
    turn, leads = np.linspace(0.0, 2.0 * np.pi, 121), [JOINTS[row.argmax()] for row in peaks]
    l1, l2, _ = world.printed.arm.link_lengths

    def draw(*axes: Axes) -> None:
        for k, ax in enumerate(axes):
            q2, tip = world.path_poses[k, 1], np.array([world.given.path_x, heights[k]])
            x, z = [0, 0, l2 * np.cos(q2), tip[0]], [0, l1, l1 + l2 * np.sin(q2), tip[1]]
            ax.plot(x, z, color=GREY, linewidth=5, solid_joinstyle="round", alpha=0.5, zorder=1)
            ax.plot(x[1:3], z[1:3], "o", color=MUTED, markersize=4, zorder=2)
            for j, label in enumerate(JOINTS):
                r = 0.42 * np.resize(radii[:, k, j], turn.size) / peaks.max()
                ring, style = tip[:, None] + r * np.array([np.cos(turn), np.sin(turn)]), look(j)
                ax.plot(*ring, **style, label=label, linewidth=1.4)
                ax.fill(*ring, color=style["color"], alpha=0.12)
                n = world.path_peaks.direction[k, j][[0, 1] if j == 0 else [0, 2]]
                n = 0.42 * peaks[k, j] / peaks.max() * n
                ends = np.stack([tip - n, tip + n]).T
                ax.plot(*ends, color=style["color"], linewidth=0.9)
            ax.set_title(f"z = {heights[k]:g} m: {leads[k]}\n(paper: joint {wanted[k]})")

    data = {"height": list(heights), "peak_mrad": peaks, "lean_deg": world.lean}
    data |= {"waist": world.waist, "worst_direction": world.path_peaks.direction}
    return data, draw, {"leads": ", ".join(leads)}


def _fig_9_found(study: Study) -> Built | None:
    """Envelopes in the clearest world that has the paper's sequence."""
    example = study.sequences.example
    return None if example is None else _envelopes(example)


def _dominance(study: Study) -> Built:
    """Where the sequence is found."""
    found, counts = study.sequences, np.array(study.sequences.counts)
    share = 100 * counts / counts.sum()
    period, x = 1e3 * found.values[:, 0], found.values[:, 3]

    def draw(left: Axes, right: Axes) -> None:
        bars = left.bar(range(5), share, color=[GREY] * 4 + [VERMILION])
        left.bar_label(bars, [f"{value:.2g} %" for value in share], fontsize=8.5)
        right.plot(period[::8], x[::8], ".", color=GREY, markersize=2.5, alpha=0.6)
        full = found.agree == 4
        right.plot(period[full], x[full], "o", color=VERMILION, markersize=4.5)
        right.set_xscale("log")
        ticks = [20, 30, 50, 80, 150]
        right.set_xticks(ticks, map(str, ticks))
        right.set_xticks([], minor=True)

    arm, wanted = study.printed.arm, study.printed.task.dominant_joints
    tried, hits = len(found.agree), found.counts[4]
    words: dict[str, Any] = {"share": hits / tried, "percent": float(share[4])}
    words |= {"wanted": ", ".join(map(str, wanted)), "stiffer": arm.stiffness[0] / arm.stiffness[1]}
    return {"tried": tried, "hits": hits, "agree": found.counts}, draw, words


def _range_of_path(study: Study) -> Built:
    """Joint 3's stated range against the vertical path."""
    arm, heights = study.printed.arm, study.printed.task.path_heights
    limit, (l1, l2, l3) = float(arm.limits[2]), arm.link_lengths
    x = np.linspace(0.2, 1.6, 400)
    bend = np.degrees(np.abs(poses_at([[(at, 0.0, z) for at in x] for z in heights])[..., 2]))
    worst = bend.max(axis=0)
    inner = float(np.sqrt(l2**2 + l3**2 + 2.0 * l2 * l3 * np.cos(limit)))

    def draw(left: Axes, right: Axes) -> None:
        theta = np.linspace(-np.pi / 2, np.pi / 2, 200)
        ring = np.concatenate([(l2 + l3) * np.exp(1j * theta), inner * np.exp(1j * theta[::-1])])
        left.fill(ring.real, l1 + ring.imag, color=BLUE, alpha=0.18, linewidth=0)
        for z in heights:
            left.axhline(z, color=MUTED, linewidth=0.6, linestyle=DASHED)
            ends = [np.sqrt(max(r**2 - (z - l1) ** 2, 0.0)) for r in (inner, l2 + l3)]
            left.plot(ends, [z, z], color=INK, linewidth=3, solid_capstyle="butt")
        left.plot(0, l1, "o", color=MUTED)
        lines(right, x, bend, [f"z = {z:g} m" for z in heights])
        right.axhline(np.degrees(limit), color=VERMILION, linestyle=DASHED, label="stated limit")

    least, k = float(np.nanmin(worst)), int(np.nanargmin(worst))
    data = {"least_bend_deg": least, "at_x": float(x[k]), "limit_deg": float(np.degrees(limit))}
    return {**data, "x": x[::8], "bend_deg": bend[:, ::8]}, draw, {}


def _fig_10(study: Study) -> Built:
    """Three joints by the worst direction, and by forces along x and z."""
    reach = study.base.reach
    names = {"worst": "worst direction", "x": "force along x", "z": "force along z"}

    def draw(*axes: Axes) -> None:
        for ax, (name, j) in zip(axes, ((n, j) for n in names for j in range(3)), strict=True):
            _map(ax, reach, name, j)
            ax.set(title=f"Joint {j + 1}, {names[name]}", xlabel="x [m]", ylabel="z [m]")
            ax.set(xlim=(-1.7, 1.7), ylim=(-1.3, 2.1), aspect="equal")
            ax.label_outer()

    data = {"place": rounded(reach.place[::4, ::4], 4), "bend": reach.bend[::4]}
    data["peak_mrad"] = {n: rounded(reach.peaks[n][::4, ::4], 4) for n in names}
    data["largest_at"] = {n: [rounded(reach.top(n, j)) for j in range(3)] for n in names}
    return data, draw, {}


def _map(ax: Axes, reach: ReachMap, along: str, j: int) -> None:
    x, z, p = reach.place[..., 0], reach.place[..., 2], reach.peaks[along][..., j]
    at, top = reach.top(along, j), float(p.max())
    nothing = top < 1e-9
    levels = np.linspace(0.0, 1.0 if nothing else top, 13)
    for side in (1, -1):
        shown = ax.contourf(side * x, z, p, levels=levels, cmap=CMAP)
        if not nothing:
            ax.plot(side * at[0], at[2], "o", color=VERMILION, markersize=5)
    if nothing:
        ax.text(0, reach.hub, "nothing", ha="center", va="center", color=MUTED)
        return
    bar = ax.figure.colorbar(shown, ax=ax, shrink=0.75, pad=0.01, ticks=levels[::4])
    bar.ax.set_yticklabels([f"{level:.2g}" for level in levels[::4]])


def _rings(study: Study) -> Built:
    """Joints 2 and 3 by the worst direction, over the turn of joint 2."""
    reach, worst = study.base.reach, study.base.reach.peaks["worst"]
    angle = np.degrees(np.linspace(-1.0, 1.0, len(worst)) * study.printed.arm.limits[1])
    bends = [0, len(reach.bend) // 2, len(reach.bend) - 1]

    def draw(ax: Axes) -> None:
        for k, b in enumerate(bends):
            bent = abs(np.degrees(reach.bend[b]))
            for j in (1, 2):
                words = f"{JOINTS[j]}, bent {bent:.0f}°"
                ax.plot(angle, worst[:, b, j], **look(j), linewidth=1.0 + 0.7 * k, label=words)
        ax.set_ylim(bottom=0.0)

    spread = float(np.ptp(worst[:, :, 1:], axis=0).max() / worst[:, :, 1:].max())
    data = {f"joint_{j + 1}": worst[:, bends, j] for j in (1, 2)}
    return {"angle_deg": angle, **data, "spread": spread}, draw, {}


def _straight(study: Study) -> tuple[Any, dict[str, Any]]:
    """Peaks of the arm stretched out, by joint 2's angle (k,) degrees: (k, 3) mrad by force."""
    turn = np.linspace(-1.0, 1.0, 241) * study.printed.arm.limits[1]
    poses = np.stack([0.0 * turn, turn, 0.0 * turn], axis=-1)
    forces = {**dict(zip("xyz", np.eye(3), strict=True)), "worst": None}
    peaks = {a: 1e3 * study.base.peaks(poses, n).peak_deflection for a, n in forces.items()}
    return np.degrees(turn), peaks


def _x_force(study: Study) -> Built:
    """Joint 1 under x with the arm stretched out."""
    angle, peaks = _straight(study)
    data = {"angle_deg": angle, "joint_1": {a: peaks[a][:, 0] for a in "xyz"}}

    def draw(ax: Axes) -> None:
        lines(ax, angle, [peaks[a][:, 0] for a in "yxz"], [f"force along {a}" for a in "yxz"])

    by = {f"by_{a}": max(values) for a, values in rounded(data["joint_1"]).items()}
    return data, draw, {**by, "plain_x": plainly(float(peaks["x"][:, 0].max()))}


def _z_force(study: Study) -> Built:
    """Joint 2 under x and z with the arm stretched out."""
    angle, peaks = _straight(study)
    data = {"angle_deg": angle, "joint_2": {a: peaks[a][:, 1] for a in "xz"}}

    def draw(ax: Axes) -> None:
        names = {"x": "force along x", "z": "force along z", "worst": "worst direction"}
        lines(ax, angle, [peaks[a][:, 1] for a in names], names.values())

    by = {f"by_{a}": values[-1] for a, values in rounded(data["joint_2"]).items()}
    share = plainly(float(peaks["z"][-1, 1] / peaks["x"][-1, 1]))
    return data, draw, {**by, "plain_z": plainly(by["by_z"]), "share": share}


def _fig_11(study: Study) -> Built:
    """The S-N curve, a shaft steel's, and the curve of Table 2."""
    curve, table, steel = study.printed.sn_curve, study.curve_of_table, shaft_steel()
    assert steel.ultimate_shear is not None
    limit, at_1000 = steel.ultimate_shear / 1e6, curve.a * 1000.0**curve.b
    n = np.geomspace(1e2, 1e9, 200)
    strength = curve.a * n**curve.b
    hidden = table.other.values["a"] * n ** table.other.values["b"]
    amplitude = steel.amplitude(n) / 1e6

    def draw(ax: Axes) -> None:
        labels = (f"printed: {curve.a:g} N^{curve.b:g}", f"{STEEL} (FKM)", "through Table 2")
        lines(ax, n, (strength, amplitude, hidden), labels)
        ax.axhline(limit, color=GREEN, linestyle=DASHED, label="shear strength of that steel")
        ax.plot(table.cycles, table.stress, "o", color=ORANGE, label="Table 2: mean stress, N")
        ax.plot(1000.0, at_1000, "s", color=BLUE, markersize=6)
        note(ax, f"{at_1000:,.0f} MPa", (1000.0, at_1000), (7, 5), color=BLUE)

    data = {"cycles": n, "printed": strength, "steel": amplitude, "through_table_2": hidden}
    data = {key: values[::10] for key, values in data.items()}
    return {**data, "at_1000": at_1000, "steel_breaks_at": limit}, draw, {}


def _gravity(study: Study) -> Built:
    """Torque to hold the arm."""
    angle, torque = study.base.sweep
    limits = study.printed.arm.actuator_torques

    def draw(ax: Axes) -> None:
        for j in (1, 2):
            ax.plot(np.degrees(angle), torque[:, j], label=JOINTS[j], **look(j))
            words, colour = f"its actuator: {limits[j]:.0f} N m", look(j)["color"]
            ax.axhline(limits[j], color=colour, linewidth=0.9, linestyle=DASHED)
            note(ax, words, (-88, limits[j]), (0, 3), color=colour)

    largest = torque.max(axis=0)
    data = {"angle_deg": np.degrees(angle[::6]), "torque": torque[::6], "largest": largest}
    data |= {"actuators": list(limits), "share_held": study.base.share_held}
    return data, draw, {"times": largest[1] / limits[1]}


def _gravity_stress(study: Study) -> Built:
    """Gravity's steady stress against the vibration's."""
    stress, printed = study.base.gravity_stress.mean(axis=0), study.printed.stress
    vibration = study.base.rivet_stress.mean(axis=1)

    def draw(ax: Axes) -> None:
        at = np.arange(3)
        ax.bar(at - 0.27, printed.max(axis=0), 0.25, color=ORANGE, label="Table 2, largest mean")
        ax.bar(at, vibration.max(axis=0), 0.25, color=BLUE, label="vibration, base world")
        bars = ax.bar(at + 0.27, stress, 0.25, color=GREY, label="gravity, base world")
        ax.bar_label(bars, fmt="%.0f", fontsize=8.5)
        ax.set_xticks(at, JOINTS)

    largest = printed[:, 1].max()
    words = {"largest": largest, "times": stress[1] / largest}
    return {"gravity": stress, "vibration": vibration, "printed": printed}, draw, words


def _shaft(study: Study) -> Built:
    """Which shafts have the stated stiffness, and what stress they show."""
    modulus, arm = study.given.shear_modulus, study.printed.arm
    radius = np.geomspace(5e-3, 60e-3, 120)
    length = {k: modulus * np.pi * radius**4 / (2.0 * k) for k in sorted(set(arm.stiffness))}
    own = [joint.shaft for joint in study.base.robot.flexible_joints if joint.shaft]
    sizes = np.array([(2e3 * each.radius, 1e3 * each.length) for each in own]).T  # mm

    def draw(ax: Axes) -> None:
        thick, labels = 2e3 * radius, [f"k = {k:.3g} N m/rad" for k in length]
        lines(ax, thick, [1e3 * values for values in length.values()], labels)
        ax.plot(*sizes, "o", color=INK, markersize=5, zorder=4, label="assumed G r / l")
        for stress in (10e9, 100e9):
            line = 1e3 * modulus * radius / stress
            ax.plot(thick, line, color=MUTED, linewidth=0.8, linestyle=DASHED)
            note(ax, f"{stress / 1e9:.0f} MPa a mrad", (thick[0], line[0]), (3, 3), color=MUTED)

    (_, thick, _), (_, long, _) = sizes
    words = {
        "thick": thick,
        "long": long,
        "slender": long / thick,
        "arm": sum(arm.link_lengths[1:]),
    }
    by_spring = {f"{k:g}": 1e3 * v[::6] for k, v in length.items()}
    return {"thickness_mm": 2e3 * radius[::6], "length_mm": by_spring}, draw, words


def _corrections(study: Study) -> Built:
    """The life by the paper's method, by each correction alone, and by all."""
    steps = study.steps[::-1]
    base = study.steps[0].rivets
    ends = np.array([s.without_limit if math.isinf(s.rivets) else s.rivets for s in steps])

    def draw(ax: Axes) -> None:
        colours: Any = [
            (GREEN if end > base else VERMILION, 0.35 if math.isinf(step.rivets) else 0.75)
            for step, end in zip(steps, ends, strict=True)
        ]
        ax.barh(range(len(steps)), ends - base, left=base, height=0.5, color=colours)
        ax.axvline(base, color=INK, linewidth=1)
        for k, (step, end) in enumerate(zip(steps, ends, strict=True)):
            joint = f", joint {step.joint}" if step.joint else ""
            words = f"{step.rivets:.3g}{joint}  (× {step.rivets / base:.2g})"
            if math.isinf(step.rivets):
                words = f"unlimited ({end:.2g} without the limit){joint}"
            away, side = ((-8, 0), "right") if end > 1e3 * base else ((8, 0), "left")
            note(ax, words, (max(base, end), k), away, ha=side, va="center")
        ax.set_yticks(range(len(steps)), [s.name for s in steps])
        ax.set(xscale="log", xlim=(ends.min() / 4, 30 * ends.max()))
        ax.grid(axis="y", visible=False)

    return {"steps": [s.to_dict() for s in study.steps]}, draw, {}


def _fig_12(study: Study) -> Built:
    """The rivet pattern and its path."""
    points = rivet_points(study.given)

    def draw(ax: Axes) -> None:
        ax.plot(points[:, 1], points[:, 2], "o-", color=BLUE, linewidth=1, markersize=6)
        for k, at in enumerate(points):
            note(ax, str(k + 1), at[1:], (4, 4))

    return {"points": points}, draw, {"count": len(points)}


def _fig_13_15(study: Study) -> Built:
    """Peak stresses over the rivets, in the base world and in the fitted one."""
    worlds, printed = {"base": study.base, "fitted": study.fitted}, study.printed

    def draw(*axes: Axes) -> None:
        for k, ax in enumerate(axes):
            (name, world), row = list(worlds.items())[k // 3], printed.table2[k % 3]
            stress, rivet = world.rivet_stress, np.arange(1, 1 + world.rivet_stress.shape[1])
            lines(ax, rivet, stress[k % 3].T, JOINTS, marker="o", markersize=3)
            for j, mean in enumerate(row.stress):
                ax.axhline(mean, color=look(j)["color"], linewidth=0.8, alpha=0.6, linestyle=":")
            top = 1.12 * max(float(stress.max()), float(printed.stress.max()))
            ax.set(ylim=(0.0, top), title=f"{row.direction}, {name} world")
            ax.set(xlabel="rivet", ylabel="peak stress [MPa]")
            ax.label_outer()

    stresses = {name: world.rivet_stress for name, world in worlds.items()}
    data = {k: {"stress": rounded(s, 5), "mean": s.mean(axis=1)} for k, s in stresses.items()}
    return data, draw, {}


def _influence(study: Study) -> Built:
    """One input at a time from its least to its largest value: the effect on the life."""
    rows = study.influences[::-1]

    def draw(ax: Axes) -> None:
        low, high = (np.array([pick(row.lives) for row in rows]) for pick in (min, max))
        ax.barh(range(len(rows)), high - low, left=low, height=0.55, color=BLUE, alpha=0.55)
        ax.plot(low, range(len(rows)), "|", color=BLUE, markersize=12)
        ax.axvline(rows[0].lives[0], color=INK, linewidth=1)
        ax.set_yticks(range(len(rows)), [_range(row.name) for row in rows])
        ax.grid(axis="y", visible=False)

    return {row.name: row.to_dict() for row in study.influences}, draw, {}


def _range(name: str) -> str:
    """An input with its range or its choices."""
    entry, spoken = trials().inputs[name], name.replace("_", " ")
    if entry.choices:
        return f"{spoken}: " + ", ".join(map(str, entry.choices))
    return f"{spoken}: {entry.low:.4g} to {entry.high:.4g} {entry.unit}".rstrip(" –")


def _table_2_lives(study: Study) -> Built:
    """Printed over predicted N: the printed curve, rivets for hits, the other curve."""
    table = study.curve_of_table
    order = np.argsort(table.stress)
    names = {"the curve as printed": "s", "as printed, rivets for hits": "^", OTHER_CURVE: "o"}

    def draw(ax: Axes) -> None:
        for k, (name, marker) in enumerate(names.items()):
            fit, colour = table.fit(name, name == OTHER_CURVE), (GREY, BLUE, VERMILION)[k]
            label = name + (" (one entry aside)" if fit.set_aside is not None else "")
            ax.plot(range(8), np.exp(fit.residuals[order]), marker, color=colour, label=label)
        ax.axhline(1.0, color=INK, linewidth=0.8)
        labels = [table.labels[k].replace(", ", ",\n") for k in order]
        stress = [f"{table.stress[k]:g} MPa" for k in order]
        ax.set_xticks(range(8), [f"{a}\n{b}" for a, b in zip(labels, stress, strict=True)])

    over = table.over_printed
    kept = ("stress", "cycles", "over_printed", "rounding")
    data = {"labels": list(table.labels), "hypotheses": [vars(fit) for fit in table.fits]}
    data |= {key: getattr(table, key) for key in kept}
    return data, draw, {"shortest": float(over.min()), "longest": float(over.max()), "table": table}


def _hypotheses(study: Study) -> Built:
    """Each hypothesis's error on entries left out."""
    found = study.comparison.hypotheses[::-1]

    def draw(ax: Axes) -> None:
        for k, h in enumerate(found):
            means, lives = 100 * np.abs(h.left_out)
            ax.plot(lives.clip(1e-2), np.full(8, k), "o", color=BLUE, alpha=0.45, markersize=4.5)
            for errors, words, colour in ((lives, "lives N", BLUE), (means, "means", ORANGE)):
                style: Any = {"color": colour, "markersize": 15, "markeredgewidth": 2.4}
                label = None if k else f"{words}, median"
                ax.plot(np.nanmedian(errors), k, "|", label=label, **style)
        ax.set_yticks(range(len(found)), [h.fit.rule.name for h in found])

    return {"hypotheses": [h.to_dict() for h in study.comparison.hypotheses]}, draw, {}


FIGURES: dict[str, Callable[[Study], Built | None]] = {
    "fig-4": _fig_4,
    "fig-8": _fig_8,
    "fig-9": lambda study: _envelopes(study.base),
    "fig-10": _fig_10,
    "fig-11": _fig_11,
    "fig-12": _fig_12,
    "fig-13-15": _fig_13_15,
    "table-2-lives": _table_2_lives,
    "hypotheses": _hypotheses,
    "dominance": _dominance,
    "fig-9-found": _fig_9_found,
    "gravity": _gravity,
    "gravity-stress": _gravity_stress,
    "range": _range_of_path,
    "rings": _rings,
    "x-force": _x_force,
    "z-force": _z_force,
    "steady-state": _steady_state,
    "shaft": _shaft,
    "phase": _phase,
    "influence": _influence,
    "corrections": _corrections,
}
