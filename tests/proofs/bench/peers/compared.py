"""Everything that is compared, and with whom; a run of it gives the document that is kept."""

import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import cv2
import numpy as np
from tests.proofs.bench.adjustment import cases
from tests.proofs.bench.peers import machine
from tests.proofs.bench.peers.asking import Peers
from tests.proofs.bench.peers.given import LINES, NUMBERS, Given, given
from tests.proofs.bench.peers.ours import calls_us, found, locating_us, taking_us, turn_us
from tests.proofs.bench.peers.truth import UNNAMED, Pairs, point_errors, pointing
from tests.proofs.bench.peers.turns import ratio, take_turns

from grabberd.core.kernel import KERNEL

SCHEMA = "grabberd/benchmark/1"
LABELLING = "1 bit: all our work compared with labelling alone"
GREY = "8 bits: all our work compared with optv and others"
TAKEN = "Field intake: from the driver's buffer (YUYV, woven) to packed bits, content checked"
NUMBERED = "1 bit: location alone, by number of discs"
ADJUSTED = "Bundle adjustment with full covariance"
TAKEN_IN = {lines: f"a field taken in, {lines}" for lines in LINES}
TAKEN_GOALS = {"288": 1.0, "doubled": 0.75}
"""The check may take what a peer takes longer for packing alone; .75 of that is 150 µs."""
LABELLING_GOALS = {("cv2 fastest", "288"): 0.4, ("cv2 fastest", "doubled"): 0.25}
GREY_GOALS = {"optv": 0.4}
NUMBERED_GOAL = 1.0
PACKING = "packing"
OURS = ("1 bit, 288", "1 bit, doubled", "8 bit, 288")
WITH_POINTS = "optv"
GREY_PICTURE = "8 bit, 288"
AGREEMENT = "optv agreement"
DISCS_TIMES = 20
GOALS_PX = {"1 bit, 288": (0.125, 0.130), "8 bit, 288": (0.055, 0.030)}
"""RMS in x and y to reach at this noise and line jitter."""
RIGHT = 0.99
"""Of the points that there are to be; and none wrong."""
ADJUSTMENTS = 3


class Comparison(NamedTuple):
    """Our way beside a peer's, by the names that turns are taken under; `goal` is the ratio to reach."""

    group: str
    ours: str
    peer: str
    goal: float | None = None


def comparisons() -> list[Comparison]:
    """On the fields of the scene."""
    goals = LABELLING_GOALS if KERNEL else dict.fromkeys(LABELLING_GOALS, 1.0)
    labelling = [
        Comparison(LABELLING, f"1 bit, {lines}", f"{name}, {lines}", goals.get((name, lines)))
        for lines in LINES
        for name in ("cv2 fastest", "cv2", "scipy", "skimage")
    ]
    grey = [
        Comparison(GREY, GREY_PICTURE, name, GREY_GOALS.get(name))
        for name in ("optv", "optv recognition", "skimage weighted", "trackpy")
    ]
    numbered = [
        Comparison(NUMBERED, f"{count} discs, {area} × the area", f"discs_{count}_{area}", NUMBERED_GOAL)
        for count, area in NUMBERS
    ]
    taken = [
        Comparison(TAKEN, name, f"{PACKING}, {lines}", TAKEN_GOALS[lines]) for lines, name in TAKEN_IN.items()
    ]
    return taken + labelling + grey + numbered


def run(fields: int, turns: int) -> dict[str, Any]:
    """Takes its minutes; says on the way what it does."""
    cv2.setNumThreads(1)
    before, began = machine.load(), time.monotonic()
    print(f"rendering {fields} fields", flush=True)
    scene = given(fields)
    with TemporaryDirectory() as folder:
        scene.save(Path(folder) / "fields.npz")
        with Peers(Path(folder) / "fields.npz") as peers:
            document = _document(peers, fields, turns)
            print("places and points beside the truth", flush=True)
            document |= _accuracy(scene, peers)
            print(f"{turns} turns", flush=True)
            document["compared"] = _timed(scene, peers, turns)
    print(f"{turns} turns of the adjustment", flush=True)
    document["compared"] += _adjusted(turns)
    took_s = round(time.monotonic() - began)
    return document | {"load": {"before": before, "after": machine.load()}, "took_s": took_s}


def _document(peers: Peers, fields: int, turns: int) -> dict[str, Any]:
    return {
        "schema": SCHEMA,
        "at_utc": datetime.now(UTC).isoformat(timespec="seconds").replace("+00:00", "Z"),
        "commit": machine.commit(),
        "machine": machine.machine(),
        "versions": {"ours": machine.versions(), "peers": peers.about()["versions"]},
        "fields": fields,
        "turns": turns,
    }


def _timed(scene: Given, peers: Peers, turns: int) -> list[dict[str, Any]]:
    """By turns; a way that several are compared with takes its turn once."""
    chosen = comparisons()
    ways: dict[str, Callable[[], Sequence[float]]] = {}
    for way in OURS:
        ways[way] = lambda way=way: turn_us(scene, way)
    for lines, name in TAKEN_IN.items():
        ways[name] = lambda lines=lines: taking_us(scene, lines)
    for which, (count, area) in zip([one for one in chosen if one.group == NUMBERED], NUMBERS, strict=True):
        packed = scene.numbers[count, area]
        ways[which.ours] = lambda packed=packed: locating_us(packed, DISCS_TIMES)
    for one in chosen:
        ways[one.peer] = lambda peer=one.peer: peers.turn_us(peer)
    medians = take_turns(ways, turns)
    return [_compared(*one, medians[one.ours], medians[one.peer]) for one in chosen]


def _adjusted(turns: int) -> list[dict[str, Any]]:
    rows = []
    for case, goal in zip(cases(), (0.7, 0.25), strict=True):
        ways = {
            "ours": lambda case=case: calls_us(case.ours, ADJUSTMENTS),
            "peer": lambda case=case: calls_us(case.peer, ADJUSTMENTS),
        }
        medians = take_turns(ways, turns)
        peer = f"scipy least_squares, {case.way}"
        rows.append(_compared(ADJUSTED, f"{case.name}", peer, goal, medians["ours"], medians["peer"]))
    return rows


def _compared(
    group: str, ours: str, peer: str, goal: float | None, ours_us: list[float], peer_us: list[float]
) -> dict[str, Any]:
    figures = {name: float(f"{value:.4g}") for name, value in ratio(ours_us, peer_us)._asdict().items()}
    return {"group": group, "ours": ours, "peer": peer, "goal": goal, **figures}


def _accuracy(scene: Given, peers: Peers) -> dict[str, Any]:
    truth_px = np.concatenate(scene.truth_px)
    located, points = [], []
    for way in OURS:
        places, results = found(scene, way)
        located.append(_ours(way, GOALS_PX.get(way), pointing(places, truth_px)))
        index = [np.searchsorted(scene.ids, one.target) for one in results]
        pairs = [
            Pairs(one.left_px, one.right_px, one.xyz_mm, of) for one, of in zip(results, index, strict=True)
        ]
        points.append(_ours(way, RIGHT, _errors(pairs, scene)))
    for way in peers.about()["ways"]:
        if not way.startswith(("discs", PACKING)) and way not in (WITH_POINTS, AGREEMENT):
            places = _frame_places(scene, way, [one["places"] for one in peers.found(way)])
            located.append(
                {"by": "peer", "way": way, "picture": _picture(way), **_figures(pointing(places, truth_px))}
            )
    pairs = _pairs(scene, peers.found(WITH_POINTS))
    points.append(
        {"by": "peer", "way": WITH_POINTS, "picture": GREY_PICTURE, **_figures(_errors(pairs, scene))}
    )
    disagreement_px = peers.found(AGREEMENT)[0]["disagreement_px"]
    return {"located": located, "points": points, "optv_disagreement_px": round(disagreement_px, 4)}


def _pairs(scene: Given, answers: list[Any]) -> list[Pairs]:
    left = _frame_places(scene, WITH_POINTS, [one["left"] for one in answers])
    right = _frame_places(scene, WITH_POINTS, [one["right"] for one in answers])
    xyz_mm = [np.array(one["xyz_mm"]).reshape(-1, 3) for one in answers]
    unnamed = [np.full(len(one), UNNAMED) for one in xyz_mm]
    return [Pairs(*four) for four in zip(left, right, xyz_mm, unnamed, strict=True)]


def _frame_places(scene: Given, way: str, answers: list[Any]) -> list[Any]:
    """Columns and rows of the settled fields' pictures as frame pixels."""
    of = [one.packed for one in scene.packed[_picture(way)][-len(answers) :]]
    return [
        np.array(places).reshape(-1, 2) * (1, field.y_step) + (0, field.y0)
        for places, field in zip(answers, of, strict=True)
    ]


def _picture(way: str) -> str:
    """What a peer's way looks at."""
    lines = way.rsplit(", ", 1)[-1]
    return f"1 bit, {lines}" if lines in LINES else GREY_PICTURE


def _errors(pairs: list[Pairs], scene: Given) -> Any:
    return point_errors(pairs, scene.truth_px, scene.truth_mm)


def _ours(way: str, goal: Any, figures: Any) -> dict[str, Any]:
    return {"by": "ours", "way": way, "picture": way, "goal": goal, **_figures(figures)}


def _figures(figures: Any) -> dict[str, float | int]:
    return {
        name: round(value, 4) if isinstance(value, float) else value
        for name, value in figures._asdict().items()
    }
