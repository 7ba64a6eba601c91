"""What it costs to identify the targets of both views, in a first field and after a gap, beside numpy."""

import time
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from tests.proofs.bench.accuracy import Scene

from grabberd.core.chain import measure as process
from grabberd.core.chain.accuracy import requantised
from grabberd.core.chain.measure import MeasureSetup, measure_fields
from grabberd.core.field import NumberedField
from grabberd.core.kernel import KERNEL, in_use
from grabberd.core.reconstruction import Points, Track, Tracker, ViewBlobs
from grabberd.core.reconstruction.correspondence.correspondence import Correspondence

FIELDS = 130
GAPS = (5, 25, 100)
"""In fields, all longer than targets are followed over."""
STARTS = range(3, 28, 3)
"""Fields of half a pulsation and more, from which a gap begins: open, closing and closed."""
REPEATED = 5
FIELD_S = 0.02
VARIANTS = (("1 bit, doubled", 1, True), ("8 bit, 288 lines", 8, False))


class Step(NamedTuple):
    """A field's blobs, and the track after it."""

    left: ViewBlobs
    right: ViewBlobs
    track: Track


def table() -> str:
    """Milliseconds of processor time of a field: median and greatest over fields, the least of several."""
    scene = Scene({"scene": "liner"}, FIELDS)
    by = (
        f"Simulated liner of 108 targets, mirror error .06 px; by the {in_use()}. Each field the "
        f"least of {REPEATED}, ours and numpy's by turns; median and greatest over {len(STARTS)} phases of a "
        "pulsation.\n"
    )
    head = (
        "| field | identified | ms, median / greatest | numpy alone | ratio of the medians | points a field |"
    )
    rows = [
        row
        for name, bits, doubled in VARIANTS
        for row in _rows(name, list(requantised(scene.fields, bits, doubled=doubled)), scene.setup)
    ]
    return "\n".join([by, head, "|---|---|---|---|---|---|", *rows])


def _rows(name: str, fields: list[NumberedField], setup: MeasureSetup) -> Iterator[str]:
    ours, steps = _tracked(fields, setup)
    numpy_alone = Tracker(ours.rig, ours.model, ours.noise, ours.settings)
    numpy_alone.correspondence = Correspondence(
        ours.rig, ours.model, ours.noise, ours.settings.correspondence, kernel=None
    )
    both = ours, numpy_alone
    first = [[_call(one, one.start(), steps[at], 0.0) for one in both] for at in STARTS]
    yield _row(f"{name} | 2 × 108, first field", first)
    for gap in GAPS:
        after = [
            [_call(one, steps[at].track, steps[at + gap], gap * FIELD_S) for one in both] for at in STARTS
        ]
        yield _row(f"{name} | 2 × 108, after a gap of {gap * FIELD_S:.1f} s", after)


def _tracked(fields: list[NumberedField], setup: MeasureSetup) -> tuple[Tracker, list[Step]]:
    """The tracker of a measurement, and what it was given and made of every field."""
    trackers, steps = [], []
    original = Tracker.step

    def step(self: Tracker, track: Track, left: ViewBlobs, right: ViewBlobs, dt_s: float) -> object:
        after, points = original(self, track, left, right, dt_s)
        trackers.append(self)
        steps.append(Step(left, right, after))
        return after, points

    Tracker.step = step  # type: ignore[method-assign,assignment]
    # The engine takes these steps in its own call; without it they are taken one by one, by the same kernel.
    process.KERNEL = None  # type: ignore[misc]
    try:
        for _ in measure_fields(iter(fields), setup):
            pass
    finally:
        Tracker.step = original  # type: ignore[method-assign]
        process.KERNEL = KERNEL  # type: ignore[misc]
    return trackers[0], steps


def _call(tracker: Tracker, track: Track, seen: Step, dt_s: float) -> Callable[[], tuple[Track, Points]]:
    return lambda: tracker.step(track, seen.left, seen.right, dt_s)


def _row(name: str, pairs: list[list[Callable[[], tuple[Track, Points]]]]) -> str:
    least = np.array([_least_ms(pair) for pair in pairs])
    ours, alone = np.median(least, axis=0)
    worst, worst_alone = least.max(axis=0)
    points = np.mean([len(pair[0]()[1]) for pair in pairs])
    return (
        f"| {name} | {ours:.2f} / {worst:.2f} | {alone:.1f} / {worst_alone:.1f} | {ours / alone:.2f} "
        f"| {points:.1f} |"
    )


def _least_ms(calls: list[Callable[[], tuple[Track, Points]]]) -> list[float]:
    """Of each call, by turns."""
    taken = np.empty((REPEATED, len(calls)))
    for turn in taken:
        for i, call in enumerate(calls):
            before = time.thread_time_ns()
            call()
            turn[i] = (time.thread_time_ns() - before) / 1e6
    return [float(one) for one in taken.min(axis=0)]
