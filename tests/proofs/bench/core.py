"""One field to its points, beside what OpenCV needs to label it: processor time of one thread, medians."""

import time
from collections.abc import Callable

import cv2
import numpy as np

from grabberd.config import default_config_file, load_config
from grabberd.core.chain.measure import MeasureSetup, measure_fields
from grabberd.core.field import Field, NumberedField, double_lines, quantise, unpack
from grabberd.core.kernel import in_use
from grabberd.instrument.acquisition.device import GRABBERS
from grabberd.instrument.setup import set_up

FIELDS = 100
PASSES = 3
"""Ours and the peer's by turns, so that both have the same of what else the machine does."""
THRESHOLD = 60


def table() -> str:
    """Medians in microseconds and the ratio to the fastest variant of cv2.connectedComponentsWithStats."""
    cv2.setNumThreads(1)
    by = f"By the {in_use()}; medians of {PASSES} passes, ours and the peer's by turns.\n"
    setup = measuring_setup()
    grabbed = _grabbed()
    rows = [_row(name, grabbed, bits, lines, setup) for name, bits, lines in VARIANTS]
    head = "| field | µs, field → points | µs, cv2 labelling alone | ratio | points a field |"
    return "\n".join([by, head, "|---|---|---|---|---|", *rows])


VARIANTS = (
    ("1 bit, 288 lines", 1, "field"),
    ("1 bit, doubled", 1, "doubled"),
    ("8 bit, 288 lines", 8, "field"),
)


def measuring_setup() -> MeasureSetup:
    file = default_config_file()
    measuring = next(iter(set_up(load_config(file), file).values())).measuring
    assert measuring
    return measuring


def _grabbed() -> list[tuple[int, Field]]:
    grabber = GRABBERS.create("fake", {"pace": "free"})
    grabber.open()
    fields = []
    for _ in range(FIELDS):
        with grabber.dequeue(1.0) as some:
            fields += [(one.time_ns, Field.intact(one.field.luma.copy(), one.field.parity)) for one in some]
    grabber.close()
    return fields


def _row(name: str, grabbed: list[tuple[int, Field]], bits: int, lines: str, setup: MeasureSetup) -> str:
    fields = [
        NumberedField(
            n, time_ns, n, quantise(double_lines(field) if lines == "doubled" else field, bits, THRESHOLD)
        )
        for n, (time_ns, field) in enumerate(grabbed)
    ]
    took, peer, points = in_turns(fields, setup)
    return f"| {name} | {took:.0f} | {peer:.0f} | {took / peer:.2f} | {points:.1f} |"


def in_turns(fields: list[NumberedField], setup: MeasureSetup) -> tuple[float, float, float]:
    """Medians in microseconds of ours and of the fastest labelling, taken by turns, and points a field."""
    masks = [(unpack(one.packed).luma > THRESHOLD).astype(np.uint8) for one in fields]
    ours: list[float] = []
    peers: list[list[float]] = [[], []]
    for _ in range(PASSES):
        times, points = _measured(fields, setup)
        ours += times
        for taken, variant in zip(peers, (_default, _fastest), strict=True):
            taken.extend(_times_us([lambda m=m, v=variant: v(m) for m in masks]))
    return float(np.median(ours)), min(float(np.median(one)) for one in peers), points


def _measured(fields: list[NumberedField], setup: MeasureSetup) -> tuple[list[float], float]:
    """Of the fields after the first ten (identification), in microseconds; and points a field."""
    times, points = [], 0
    results = measure_fields(iter(fields), setup)
    for _ in fields:
        before = time.thread_time_ns()
        points += len(next(results).points)
        times.append(time.thread_time_ns() - before)
    return [one / 1000 for one in times[10:]], points / len(fields)


def _times_us(calls: list[Callable[[], object]]) -> list[float]:
    times = []
    for call in calls:
        before = time.thread_time_ns()
        call()
        times.append((time.thread_time_ns() - before) / 1000)
    return times


def _default(mask: np.ndarray) -> object:
    return cv2.connectedComponentsWithStats(mask)


def _fastest(mask: np.ndarray) -> object:
    return cv2.connectedComponentsWithStatsWithAlgorithm(mask, 8, cv2.CV_16U, cv2.CCL_BOLELLI)
