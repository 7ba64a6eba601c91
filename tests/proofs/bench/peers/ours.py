"""Our side: the whole way from packed fields to points, location alone, and the way into the ring."""

import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from tests.proofs.bench.peers.buffers import in_buffers
from tests.proofs.bench.peers.given import SETTLED, Given

from grabberd.core.chain.measure import measure_fields
from grabberd.core.field import Field, PackedField, Packing
from grabberd.core.measurement import LocationSettings, measure
from grabberd.instrument.acquisition import ContentCheck, GrabbedField

Array = NDArray[np.float64]
PERIOD_NS = 20_000_000


class Points(NamedTuple):
    """Of one field: the targets' ids (N,), where both views see them, (N, 2), and where they are, (N, 3)."""

    target: NDArray[np.int32]
    left_px: Array
    right_px: Array
    xyz_mm: Array


def turn_us(given: Given, way: str) -> list[float]:
    """Processor time of each settled field, from packed bits to points, as the worker does it."""
    fields, times = given.packed[way], []
    results = measure_fields(iter(fields), given.setup)
    for _ in fields:
        before = time.thread_time_ns()
        next(results)
        times.append((time.thread_time_ns() - before) / 1000)
    return times[SETTLED:]


def taking_us(given: Given, lines: str) -> list[float]:
    """Processor time of taking in each settled field, from a driver's buffer to packed bits and findings, as
    the capture thread does it.
    """
    check, packing, times = ContentCheck(), Packing(1, lines == "doubled", given.level), []
    views = in_buffers(given.luma, given.parities)
    for n, (view, parity) in enumerate(zip(views, given.parities, strict=True)):
        grabbed = GrabbedField(Field.intact(view, parity), n * PERIOD_NS, n, None)
        before = time.thread_time_ns()
        check.take(grabbed, packing)
        times.append((time.thread_time_ns() - before) / 1000)
    return times[SETTLED:]


def found(given: Given, way: str) -> tuple[list[Array], list[Points]]:
    """Of each settled field the places (N, 2) in frame pixels, and the points."""
    results = list(measure_fields(iter(given.packed[way]), given.setup))[SETTLED:]
    places = [one.blobs.xy_px for one in results]
    points = [one.points for one in results]
    return places, [Points(of.target, of.image_px[:, 0], of.image_px[:, 1], of.xyz_mm) for of in points]


def locating_us(packed: PackedField, times: int) -> list[float]:
    """Processor time of location alone, so many times."""
    return calls_us(lambda: measure(packed, None, LocationSettings()), times)


def calls_us(call: Callable[[], object], times: int) -> list[float]:
    """Processor time of each of so many calls."""
    taken = []
    for _ in range(times):
        before = time.thread_time_ns()
        call()
        taken.append((time.thread_time_ns() - before) / 1000)
    return taken
