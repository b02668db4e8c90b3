"""The tables of the blind trial: what docs/validation/blind_trial.md prints."""

from __future__ import annotations

import json
import math
from collections import Counter, defaultdict
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

from picchio.core.files import atomic_write

ARM = "fanuc_like_3dof"
UNNAMEABLE = {"outside": "out of the catalogue", "left-out": "true cause taken out"}
BEGIN, END = "<!-- tables: printed, not written -->", "<!-- end of the tables -->"
BESIDE = "<!-- {}: printed, not written -->", "<!-- end of {} -->"
# Worlds that are a little wrong everywhere: the rows, the draws and mismatches that the page tells.
WRONG = "data/wrong.jsonl"
LAST_DRAWS = range(90000, 92000), (1.0, 2.0)
IN_WRONG = "<!-- wrong everywhere: printed -->", "<!-- end of wrong everywhere -->"
SIMPLER = "data/score_test.jsonl", "data/plain_bic.jsonl"
# What the tables need of a row: of exact worlds, and of those that are a little wrong.
NEEDED = ("case", "robot", "kind", "snr", "truth", "verdict", "claimed", "right", "errors", "salt",
          "commit")  # fmt: skip
NEEDED_EXACT = "explained", "removed", "burst", "follow_up", "cpu_seconds"
NEEDED_WRONG = "mismatch", "sensors", "outcome", "known", "lives", "seconds"
ENOUGH = 30.0  # chi-square from which a measurement is foretold to tell causes apart
REMOVED = {40: 0.99, 20: 0.95}  # asked for, by SNR
WITHIN = {"peak": 0.01, "life": 0.05}  # of a burst that nobody measured


def summary(rows, cases=False):
    """Print all tables, and every case that was not right where `cases`."""
    rows = [row for row in rows if not _aside(row)]
    print_kinds(rows)
    print_draws(rows)
    print_rates(rows)
    # Where something unknown is left, what is fitted beside it says nothing of these; nor do
    # records that were too few on purpose.
    known = [row for row in rows if row["kind"] not in ("mixed", "sets")]
    print_parameters(known)
    print_gains([row for row in known if row["kind"] != "few"])
    print_bursts(known)
    print_sets(rows)
    print_times(rows)
    if cases:
        print_confusion(rows)
        print_wrong(rows)


def read_rows(path):
    """A file of rows, one line of JSON each."""
    return [json.loads(line) for line in path.read_text().splitlines() if line]


def thinned(rows):
    """What the tables need of each row, numbers to four digits."""

    def short(value):
        if isinstance(value, dict):
            return {key: short(each) for key, each in value.items()}
        if isinstance(value, list):
            return [short(each) for each in value]
        return float(f"{value:.4g}") if isinstance(value, float) else value

    def needed(row):
        return (*NEEDED, *(NEEDED_WRONG if "mismatch" in row else NEEDED_EXACT))

    return [{key: short(row[key]) for key in needed(row) if key in row} for row in rows]


def printed(rows):
    """What `summary` prints, as a block for a page."""
    return _block(BEGIN, END, summary, rows)


def printed_against(rows, others):
    """What `print_against` prints of a file of a simpler method, as a block for a page."""
    begin, end = (mark.format(others.name) for mark in BESIDE)
    return _block(begin, end, print_against, rows, read_rows(others))


def printed_wrong(rows):
    """What `mismatch_summary` prints of the draws that the page is about, as a block for it."""
    return _block(*IN_WRONG, mismatch_summary, of_draws(rows, *LAST_DRAWS))


def of_draws(rows, seeds=None, times=None):
    """Rows of worlds that are a little wrong: of these draws and mismatches, all where None."""
    return [
        row
        for row in rows
        if "mismatch" in row
        and (seeds is None or int(row["case"].split("/")[4]) in seeds)
        and (times is None or row["mismatch"] in times)
    ]


def _block(begin, end, what, *given):
    room = StringIO()
    with redirect_stdout(room):
        what(*given)
    return f"{begin}\n```text\n{room.getvalue().rstrip()}\n```\n{end}"


def into_page(rows, page):
    """Put the tables between a page's marks; those of simpler methods, whose rows lie beside it."""
    blocks = [(BEGIN, END, printed(rows))]
    if (page.parent / WRONG).exists():
        blocks.append((*IN_WRONG, printed_wrong(read_rows(page.parent / WRONG))))
    for name in map(Path, SIMPLER):
        if (page.parent / name).exists():
            marks = (mark.format(name.name) for mark in BESIDE)
            blocks.append((*marks, printed_against(rows, page.parent / name)))
    text = page.read_text()
    for begin, end, block in blocks:
        if begin in text:
            before, rest = text.split(begin)
            text = before + block + rest.split(end)[1]
    with atomic_write(page) as stream:
        stream.write(text)


def _aside(row):
    return row["verdict"] in ("not made", "not detectable")


def wrong(row):
    """Whether a case counts against the method."""
    if row["kind"] in UNNAMEABLE:
        return row["verdict"] == "named" or row["verdict"].startswith("failed")
    if row["kind"] in ("null", "few-null"):
        return row["verdict"] != "nothing-wrong"
    if row["kind"] == "mixed":  # to claim nothing is no error
        return bool(row["claimed"]) and not row["right"]
    return not row["right"]


def print_kinds(rows):
    """Verdicts by robot, kind and noise."""
    kinds = defaultdict(list)
    for row in rows:
        kinds[(row["robot"], row["kind"], row["snr"])].append(row)
    print(f"{'robot':<18}{'kind':<10}{'SNR':>4}{'cases':>7}{'right':>9}  verdicts")
    for (robot, kind, snr), found in sorted(kinds.items()):
        right = f"{sum(not wrong(row) for row in found)}/{len(found)}"
        verdicts = dict(Counter(row["verdict"] for row in found).most_common())
        print(f"{robot:<18}{kind:<10}{snr:>4}{len(found):>7}{right:>9}  {verdicts}")


def print_draws(rows):
    """Draw by draw, which is about the order in which the code came to them."""
    print()
    for kind, snr in (("single", 40), ("weak", 20), ("left-out", 40)):
        draws = defaultdict(list)
        for row in rows:
            if (row["robot"], row["kind"], row["snr"]) == (ARM, kind, snr):
                draws[int(row["case"].rsplit("/", 1)[1])].append(row)
        told = [f"{sum(not wrong(row) for row in r)}/{len(r)}" for _, r in sorted(draws.items())]
        if told:
            print(f"right, draw by draw, {kind}, {snr} dB: {', '.join(told)}")
    weak = [row for row in rows if row["kind"] == "weak" and row["claimed"]]
    if weak:
        print(f"weak: where anything is claimed, it includes the truth in "
              f"{sum(row['right'] for row in weak)} of {len(weak)}")  # fmt: skip


def print_rates(rows):
    """False alarms and wrong names."""
    print()
    for snr in (40, 20):
        nulls = [row for row in rows if row["kind"] == "null" and row["snr"] == snr]
        if nulls:
            alarms = sum(row["verdict"] != "nothing-wrong" for row in nulls)
            bound = f"rate below {100 * upper_bound(alarms, len(nulls)):.2g} % (95 %)"
            print(f"false alarms at {snr} dB: {alarms} in {len(nulls)}; {bound}")
    for kind, what in UNNAMEABLE.items():
        for snr in (40, 20):
            found = [row for row in rows if row["kind"] == kind and row["snr"] == snr]
            if found:
                named = sum(row["verdict"] == "named" for row in found)
                low, high = (100 * x for x in proportion(named, len(found)))
                print(
                    f"{what}, {snr} dB: {named} of {len(found)} named wrongly: "
                    f"{low:.2g} to {high:.2g} % (95 %)"
                )
    mixed = [row for row in rows if row["kind"] == "mixed"]
    if mixed:
        claimed = [row for row in mixed if row["claimed"]]
        print(
            f"a cause beside a little of what no catalogue has: {len(claimed)} of {len(mixed)} "
            f"claimed, {sum(row['right'] for row in claimed)} of them the cause and no other"
        )
    for kind in ("single", "pair", "triple", "weak"):
        found = [row for row in rows if row["kind"] == kind]
        bad = [row for row in found if row["verdict"] == "named" and not row["right"]]
        if found:
            print(f"{kind}: {len(bad)} of {len(found)} named, but not (or not only) what it was")


def print_parameters(rows):
    """Errors of the causes' parameters, and what their intervals cover."""
    right = [row for row in rows if row["right"] and row["snr"] == 40]
    for name, picked in (
        ("18 records", [row for row in right if row["kind"] != "few"]),
        ("3 records", [row for row in right if row["kind"] == "few"]),
    ):
        errors = [(key, *e) for row in picked for key, e in row["errors"].items()]
        if errors:
            _print_errors(name, errors)


def _print_errors(name, errors):
    size = sorted(abs(e[1]) for e in errors)
    print(
        f"\nparameters at 40 dB, {name}: {len(size)}, median error {100 * quantile(size, 0.5):.2g} "
        f"%, 95th percentile {100 * quantile(size, 0.95):.2g} %"
    )
    pulls = [e[2] for e in errors if math.isfinite(e[2])]
    for level, z in ((50, 0.674), (95, 1.960)):
        inside = sum(p <= z for p in pulls)
        low, high = (100 * x for x in proportion(inside, len(pulls)))
        print(f"{level} % intervals cover {inside} of {len(pulls)}: {low:.0f} to {high:.0f} %")
    for key, error, pull in sorted(errors, key=lambda e: -abs(e[1]))[:5]:
        print(f"  largest: {key} {100 * error:+.2g} %, {pull:.1f} standard deviations")


def print_gains(rows):
    """What of the excess in records held out is explained."""
    for snr in (40, 20):
        gains = sorted(
            row["explained"] for row in rows
            if row["right"] and row["snr"] == snr and row["truth"] and row.get("explained")
        )  # fmt: skip
        if gains:
            print(
                f"held-out excess explained at {snr} dB: median {quantile(gains, 0.5):.4f}, "
                f"5th percentile {quantile(gains, 0.05):.4f}, lowest {gains[0]:.4f}, "
                f"of {len(gains)}"
            )
    for snr, least in REMOVED.items():
        shares = sorted(
            row["removed"] for row in rows if row["snr"] == snr and row.get("removed") is not None
        )
        if shares:
            print(
                f"removed of what the true model removes there, at {snr} dB: median "
                f"{quantile(shares, 0.5):.4f}, 5th percentile {quantile(shares, 0.05):.4f}, lowest "
                f"{shares[0]:.4f}; {sum(s >= least for s in shares)} of {len(shares)} at least "
                f"{least:g}"
            )


def print_bursts(rows):
    """Peak and life of a burst that nobody measured, before and after."""
    for snr, few in ((40, False), (20, False), (40, True)):
        found = [
            row["burst"] for row in rows
            if row["snr"] == snr and (row["kind"] == "few") == few and row.get("burst")
        ]  # fmt: skip
        for model in ("baseline", "extended"):
            for what, limit in WITHIN.items():
                size = sorted(abs(e) for told in found for e in told.get(model, {}).get(what, ()))
                if size:
                    inside = sum(e <= limit for e in size)
                    print(
                        f"burst at {snr} dB{', 3 records' if few else ''}, {model}, {what}: median "
                        f"error {100 * quantile(size, 0.5):.2g} %, 95th percentile "
                        f"{100 * quantile(size, 0.95):.2g} %; {inside} of {len(size)} within "
                        f"{100 * limit:g} %"
                    )


def print_sets(rows):
    """Three records of one pose: sets that hold the truth, and what the next measurement tells."""
    few = [row for row in rows if row["kind"] == "few"]
    if not few:
        return
    claimed = [row for row in few if row["claimed"]]
    print(
        f"three records, no deflections: {len(claimed)} of {len(few)} claimed, the truth among "
        f"the sets in {sum(row['right'] for row in claimed)}; "
        f"{sum(row['verdict'] == 'ambiguous' for row in few)} ambiguous"
    )
    poor = [row for row in rows if row["kind"] == "sets"]
    if poor:
        print(
            f"records that leave sets: {len(poor)}, the truth among the sets in "
            f"{sum(row['right'] for row in poor)}; "
            f"{sum(row['verdict'] == 'ambiguous' for row in poor)} ambiguous"
        )
    asked = [row["follow_up"] for row in (*few, *poor) if row.get("follow_up")]
    can = [f for f in asked if _foretold(f)]
    done = sum(f["verdict"] == "named" and f["right"] and not f["alternatives"] for f in can)
    print(
        f"next measurement: predicted to separate all in {len(can)} of {len(asked)}; taken, it "
        f"named the cause alone in {done} of them"
    )
    nulls = [row for row in rows if row["kind"] == "few-null"]
    if nulls:
        alarms = sum(row["verdict"] != "nothing-wrong" for row in nulls)
        bound = f"rate below {100 * upper_bound(alarms, len(nulls)):.2g} % (95 %)"
        print(f"three records, nothing hidden: {alarms} false alarms in {len(nulls)}; {bound}")


def print_against(rows, others):
    """A simpler method beside this one, on the cases that both were given.

    A method that says no more than names is right where it names the causes and no other; with
    nothing hidden, or out of the catalogue, where it names nothing.
    """
    mine = {row["case"]: row for row in rows if not _aside(row)}
    both = [row for row in others if not _aside(row) and row["case"] in mine]
    print("kind       SNR  cases  right  the other: right  the truth among what it names")
    for kind, snr in dict.fromkeys((row["kind"], row["snr"]) for row in both):
        some = [row for row in both if (row["kind"], row["snr"]) == (kind, snr)]
        right = sum(not wrong(mine[row["case"]]) for row in some)
        held = [row for row in some if row["truth"] and kind not in UNNAMEABLE]
        among = sum(all(cause in row["claimed"] for cause in row["truth"]) for row in held)
        print(
            f"{kind:<9} {snr:>4} {len(some):>6} {right:>6} {sum(not wrong(r) for r in some):>17}"
            + (f"  {among}" if held else "")
        )


def print_mismatch(rows):
    """Worlds that are a little wrong everywhere: verdicts, intervals and times by kind."""
    kinds = defaultdict(list)
    for row in rows:
        if "mismatch" in row and not _aside(row):
            kinds[(row["robot"], row["kind"], row["mismatch"], row["sensors"])].append(row)
    print(
        f"{'robot':<18}{'kind':<10}{'times':>6} {'sensors':<14}{'n':>4}{'right':>7}{'wrong':>7}"
        f"{'undecided':>11}{'alarms':>8}{'named':>7}{'in 90 %':>9}{'in 95 %':>9}{'seconds':>9}"
    )
    for (robot, kind, times, sensors), found in sorted(kinds.items()):
        count = Counter(row.get("outcome", "undecided") for row in found)
        nulls = kind in ("null", "few-null")
        alarms = sum(row["verdict"] != "nothing-wrong" for row in found) if nulls else "-"
        named = sum(row["verdict"] == "named" for row in found)
        pulls = [e[1] for row in found for e in row["errors"].values() if math.isfinite(e[1])]
        inside = [f"{sum(p <= z for p in pulls)}/{len(pulls)}" for z in (1.645, 1.960)]
        seconds = sorted(row["seconds"] for row in found if "seconds" in row)
        median = f"{quantile(seconds, 0.5):.1f}" if seconds else "-"
        print(
            f"{robot:<18}{kind:<10}{times:>6g} {sensors:<14}{len(found):>4}{count['right']:>7}"
            f"{count['wrong']:>7}{count['undecided']:>11}{alarms:>8}{named:>7}"
            f"{inside[0]:>9}{inside[1]:>9}{median:>9}"
        )


def print_outcomes(rows):
    """How many were right, by kind, all robots and sensors together."""
    for kind in dict.fromkeys(row["kind"] for row in rows):
        of_kind = [row for row in rows if row["kind"] == kind]
        count = Counter(row.get("outcome", "undecided") for row in of_kind)
        print(f"{kind}: {count['right']} of {len(of_kind)} right, {count['wrong']} wrong")


CURVE = ("right", "undecided", "wrong")


def curve(methods):
    """What every method makes of the same worlds as they get more wrong.

    Args:
        methods: {name: rows}.

    Returns:
        dict: (kind, mismatch, method) -> [right, undecided, wrong], of the cases that all were
        given, those of one kind being the same at every mismatch.
    """
    told = {name: {row["case"]: row for row in rows if not _aside(row)}
            for name, rows in methods.items()}  # fmt: skip
    shared = set.intersection(*(set(each) for each in told.values()))
    sizes = sorted({row["mismatch"] for rows in methods.values() for row in rows})
    table: dict = {}
    for name, each in told.items():
        draws: dict = defaultdict(dict)
        for case in sorted(shared):
            draws[case.rsplit("/", 1)[0]][each[case]["mismatch"]] = each[case]
        for row in (row for own in draws.values() if len(own) == len(sizes)
                    for row in own.values()):  # fmt: skip
            at = (row["kind"], row["mismatch"], name)
            table.setdefault(at, [0, 0, 0])[CURVE.index(row["outcome"])] += 1
    return dict(sorted(table.items(), key=lambda item: item[0][:2]))


def print_curve(methods):
    """`curve` as a table."""
    table = curve(methods)
    width = max(map(len, methods))
    print(f"{'kind':<8}{'times':>6}  {'way':<{width}}  right  undecided  wrong")
    for (kind, size, name), count in table.items():
        print(f"{kind:<8}{size:>6g}  {name:<{width}}  {count[0]:>5}  {count[1]:>9}  {count[2]:>5}")


def draw_curve(methods, path):
    """`curve` as a picture: a column a method, a row a kind, a bar a mismatch."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    table = curve(methods)
    kinds = list(dict.fromkeys(kind for kind, _, _ in table))
    sizes = sorted({size for _, size, _ in table})
    figure, axes = plt.subplots(
        len(kinds), len(methods), figsize=(2.9 * len(methods), 2.3 * len(kinds)),
        sharex=True, sharey="row", squeeze=False, layout="constrained",
    )  # fmt: skip
    for axis, name in zip(axes[0], methods, strict=True):
        axis.set_title(name, fontsize=10)
    for line, kind in zip(axes, kinds, strict=True):
        for axis, name in zip(line, methods, strict=True):
            foot = [0] * len(sizes)
            for k, (what, colour) in enumerate(
                zip(CURVE, ("#2e7d32", "#c9c9c9", "#c62828"), strict=True)
            ):
                height = [table.get((kind, size, name), [0, 0, 0])[k] for size in sizes]
                axis.bar([f"{s:g}" for s in sizes], height, bottom=foot, color=colour, label=what)
                foot = [a + b for a, b in zip(foot, height, strict=True)]
            axis.spines[["top", "right"]].set_visible(False)
            axis.yaxis.get_major_locator().set_params(integer=True)
        line[0].set_ylabel({"null": "nothing hidden", "single": "one cause"}.get(kind, kind))
    figure.supxlabel("how many times its tolerance everything is off", fontsize=10)
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3, frameon=False)
    figure.savefig(path, dpi=150)
    plt.close(figure)


def print_known(rows):
    """How often what is told of stiffness, damping and a life nobody measured holds.

    Where the catalogue lacks the cause, no model is told.
    """
    rows = [row for row in rows if row.get("kind") not in UNNAMEABLE]
    off = [abs(z) for row in rows for z in row.get("known", {}).values()]
    if off:
        count = sum("known" in row for row in rows)
        inside = [f"{100 * sum(z <= k for z in off) / len(off):.1f} %" for k in (1.645, 1.960)]
        print(
            f"stiffness and damping, {len(off)} values of {count} campaigns: {inside[0]} within "
            f"the 90 % interval, {inside[1]} within the 95 % interval"
        )
    for whose in ("robot", "joint"):
        lives = [
            each for row in rows for name, each in row.get("lives", {}).items()
            if (name == "robot") == (whose == "robot")
        ]  # fmt: skip
        if lives:
            inside = sum(low <= true <= high for true, low, high in lives)
            width = quantile(sorted(0.5 * (high - low) for _, low, high in lives), 0.5)
            print(
                f"{whose}'s life under a burst that nobody measured: {inside} of {len(lives)} "
                f"within the 90 % interval ({100 * inside / len(lives):.1f} %), which is "
                f"{100 * width:.2g} % to either side, the median"
            )


def mismatch_summary(rows, cases=False):
    """Worlds that are a little wrong: the tables, and every case not right where `cases`."""
    print_mismatch(rows)
    told = [row for row in rows if not _aside(row)]
    # Intervals are asked to hold where errors are as large as the diagnosis takes them to be.
    sizes = sorted({row["mismatch"] for row in told})
    for size in sizes:
        if len(sizes) > 1:
            print(f"everything off by {size:g} times its tolerance:")
        of_size = [row for row in told if row["mismatch"] == size]
        print_outcomes(of_size)
        print_known(of_size)
    for row in told if cases else ():
        if row.get("outcome", "undecided") != "right":
            said = [row["verdict"], row["claimed"], row.get("leads", [])]
            print(row.get("outcome", "undecided") + ":", row["case"], row["truth"], "->", *said)


def _foretold(follow_up):
    """Whether the measurement was said to tell all apart, at least if it comes out one way."""
    if "told" in follow_up:
        return "no" not in follow_up["told"]
    return min(follow_up["foretold"]) >= ENOUGH


def print_times(rows):
    """CPU time by robot."""
    total = sum(row.get("cpu_seconds", 0.0) for row in rows)
    print(f"CPU time, all {len(rows)} cases that could be made: {total / 3600:.1f} h")
    for robot in dict.fromkeys(row["robot"] for row in rows):
        for kind in dict.fromkeys(row["kind"] for row in rows):
            times = sorted(
                row["cpu_seconds"] for row in rows
                if row["robot"] == robot and row["kind"] == kind and "cpu_seconds" in row
            )  # fmt: skip
            if times:
                print(
                    f"CPU time, {robot}, {kind}: median {quantile(times, 0.5):.0f} s, "
                    f"95th percentile {quantile(times, 0.95):.0f} s"
                )


def print_confusion(rows):
    """Single effects on the arm of three joints: what was hidden, and what was said."""
    table = defaultdict(Counter)
    for row in rows:
        if row["kind"] == "single" and row["robot"] == ARM and row["truth"]:
            table[row["truth"][0][0]][_said(row)] += 1
    if not table:
        return
    print("\nhidden -> said")
    for effect in sorted(table):
        said = ", ".join(f"{what} {count}" for what, count in table[effect].most_common())
        print(f"  {effect:<22}{said}")


def _said(row):
    names = sorted({effect for effect, _ in row["claimed"]})
    true = sorted({effect for effect, _ in row["truth"]})
    if row["right"]:
        return "it" if row["verdict"] == "named" else f"it, {row['verdict']}"
    if names == true:
        return "it, elsewhere"
    return f"{row['verdict']}: {' + '.join(names) or '-'}"


def print_wrong(rows):
    """Every case that counts against the method."""
    for row in rows:
        if wrong(row):
            print("wrong:", row["case"], row["truth"], "->", row["verdict"], row["claimed"])


def quantile(ordered, share):
    """Of an ascending list."""
    return ordered[min(int(share * len(ordered)), len(ordered) - 1)]


def upper_bound(events, cases):
    """Of a rate, 95 %, one-sided (Clopper and Pearson)."""
    from scipy.stats import beta

    return float(beta.ppf(0.95, events + 1, cases - events)) if events < cases else 1.0


def proportion(events, cases):
    """95 % interval of a rate (Clopper and Pearson)."""
    from scipy.stats import beta

    low = float(beta.ppf(0.025, events, cases - events + 1)) if events else 0.0
    high = float(beta.ppf(0.975, events + 1, cases - events)) if events < cases else 1.0
    return low, high
