"""The page of all runs, made from their documents alone."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

Run = Mapping[str, Any]

HEADER = """# Benchmarks: grabberd compared with other programs

Made by `make bench` from the runs in [benchmarks](benchmarks); do not edit.
{about}

Both sides get the same fields from the simulator (two views of 108 targets, 2 % noise, line jitter .12 px)
and the same cameras, run on one thread of the same processor, and take turns. A turn is the median processor
time over the fields. A ratio is our time divided by the peer's in the same turn, so below 1 we are faster;
the column beside it is the range of 80 % of the turns. *Ours* is all the work from the packed field to points
with covariances and identities, after {settled} fields in which the targets are identified. Peers get
unpacked pictures and the best of the settings tried for them. Neither side sees the truth.
"""
ABOUT = "It takes about four minutes on a quiet machine."
SETTLED = 10
PICTURES = {"288": "288 lines", "doubled": "doubled"}
PEERS = {
    "cv2": "cv2.connectedComponentsWithStats",
    "cv2 fastest": "cv2…WithAlgorithm, 16-bit labels, Bolelli",
    "scipy": "scipy.ndimage.label, center_of_mass",
    "skimage": "skimage.measure label, regionprops",
    "skimage weighted": "skimage.measure regionprops, weighted",
    "trackpy": "trackpy.locate, numba",
    "packing": "cv2 and numpy.packbits, without the check",
    "optv recognition": "optv target_recognition",
    "optv": "optv recognition, correspondences, point_positions",
}
FIELD_US = 20_000
"""A field comes every 20 ms."""


def page(runs: Iterable[Run]) -> str:
    """Markdown: the newest run whole, then a line for each earlier one."""
    ordered = sorted(runs, key=lambda one: one["at_utc"], reverse=True)
    header = HEADER.format(about=ABOUT, settled=SETTLED)
    return "\n".join([header, *newest(ordered[0]), *earlier(ordered), ""]) if ordered else header


def newest(run: Run) -> list[str]:
    """A section for each group of comparisons, and the accuracy beside them."""
    lines = [f"## {_day(run)}", "", _made_on(run), ""]
    for group in dict.fromkeys(one["group"] for one in run["compared"]):
        lines += [f"### {group}", "", *_times([one for one in run["compared"] if one["group"] == group]), ""]
    lines += ["### Image positions compared with the truth", "", *_located(run["located"]), ""]
    lines += ["### Points compared with the truth", "", *_points(run["points"]), ""]
    lines += [
        "With a real camera the paper reached .170 / .225 px and .141 mm at 1 bit.",
        "optv uses our rig, converted into its own calibration; the two project the targets to positions "
        f"that differ by {run['optv_disagreement_px']:.3f} px at most. Its points have no target identity.",
    ]
    return lines


def earlier(ordered: Sequence[Run]) -> list[str]:
    """A line for each run but the newest, with the ratios that have a goal."""
    if len(ordered) < 2:
        return []
    keys = [(one["ours"], _peer(one["peer"])) for one in ordered[0]["compared"] if one["goal"] is not None]
    head = ["run", "commit", "machine", "load", *(f"{ours} / {peer}" for ours, peer in keys)]
    rows = [
        [
            _day(run),
            run["commit"],
            run["machine"]["cpu"],
            f"{run['load']['before'][0]:.1f}",
            *_ratios(run, keys),
        ]
        for run in ordered[1:]
    ]
    return ["", "## Earlier runs", "", *_table(head, rows)]


def _ratios(run: Run, keys: Sequence[tuple[str, str]]) -> list[str]:
    known = {(one["ours"], _peer(one["peer"])): f"{one['ratio']:.2f}" for one in run["compared"]}
    return [known.get(key, "–") for key in keys]


def _day(run: Run) -> str:
    return str(run["at_utc"]).replace("T", " ")[:16] + " UTC"


def _made_on(run: Run) -> str:
    on, versions, load = run["machine"], run["versions"], run["load"]
    ours, peers = (", ".join(f"{k} {v}" for k, v in versions[side].items()) for side in ("ours", "peers"))
    before, after = (f"{load[when][0]:.2f}" for when in ("before", "after"))
    return (
        f"Commit {run['commit']}; {on['cpu']}, {on['cores']} cores, {on['system']}; load {before} before, "
        f"{after} after; {run['turns']} turns over {run['fields']} fields in {run['took_s']} s. "
        f"Ours: {ours}. Peers: {peers}."
    )


def _times(compared: Sequence[Run]) -> list[str]:
    head = ["ours", "µs", "real time", "peer", "µs", "ratio", "10 … 90 %", "goal"]
    return _table(head, [_time(one) for one in compared])


def _time(one: Run) -> list[str]:
    in_fields = "bit" in one["ours"] or "field" in one["ours"]
    return [
        one["ours"],
        f"{one['ours_us']:.0f}",
        f"{FIELD_US / one['ours_us']:.0f} ×" if in_fields else "",
        _peer(one["peer"]),
        f"{one['peer_us']:.0f}",
        f"**{one['ratio']:.3g}**",
        f"{one['low']:.3g} … {one['high']:.3g}",
        _goal(one),
    ]


def _goal(one: Run) -> str:
    if one["goal"] is None:
        return ""
    return _reached(f"≤ {one['goal']:g}", one["ratio"] <= one["goal"])


def _goal_px(one: Run) -> str:
    if one.get("goal") is None:
        return ""
    x_px, y_px = one["goal"]
    return _reached(f"≤ {x_px:g} / {y_px:g}", one["x_px"] <= x_px and one["y_px"] <= y_px)


def _goal_right(one: Run) -> str:
    if one.get("goal") is None:
        return ""
    enough = one["right"] >= one["goal"] * one["of"] and not one["wrong"]
    return _reached(f"≥ {one['goal']:.0%}, none wrong", enough)


def _reached(goal: str, is_so: bool) -> str:
    return f"{goal}: {'reached' if is_so else 'not reached'}"


def _peer(name: str) -> str:
    """As a reader knows it; the lines of its picture stand beside ours."""
    if name.startswith("discs"):
        return PEERS["cv2 fastest"]
    bare = name.rsplit(", ", 1)[0] if name.endswith(tuple(PICTURES)) else name
    return PEERS.get(bare, bare)


def _located(located: Sequence[Run]) -> list[str]:
    head = ["by", "picture", "RMS x, px", "RMS y, px", "found", "not a target", "goal"]
    return _table(head, [_accuracy(one, ("x_px", "y_px"), "found", _goal_px(one)) for one in located])


def _points(points: Sequence[Run]) -> list[str]:
    head = ["by", "picture", "RMSE X, mm", "Y", "Z", "XYZ", "right", "wrong", "goal"]
    axes = ("x_mm", "y_mm", "z_mm", "xyz_mm")
    return _table(head, [_accuracy(one, axes, "right", _goal_right(one)) for one in points])


def _accuracy(one: Run, errors: Sequence[str], good: str, goal: str) -> list[str]:
    who = "grabberd" if one["by"] == "ours" else _peer(one["way"])
    bits, lines = one["picture"].split(", ")
    figures = [f"{one[name]:.3f}" for name in errors]
    return [
        who,
        f"{bits}, {PICTURES[lines]}",
        *figures,
        f"{one[good]} of {one['of']}",
        f"{one['wrong']}",
        goal,
    ]


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    return [f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows)]
