"""The V4L2 driver on the kernel's test device: rates, losses, and what its fields show."""

import itertools
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grabberd.core.ledger import Ledger
from grabberd.instrument.acquisition import FieldNumbering, Numbered, StreamInfo
from grabberd_v4l2 import V4l2Grabber
from grabberd_v4l2.discovery import ask
from grabberd_v4l2.node import LinuxKernel
from proofs.vm.guest import vivid

TIMEOUT_S = 1.0
CHECKER_ROWS = 8
"""Field rows of one square of the pattern "16x16 Checkers"; its period is 32 columns."""
CHECKER_COLUMNS = 32


def rate(seconds: float, left_out: int = 0, **options: Any) -> dict[str, Any]:
    """Streams for some of the guest's seconds; what came, and what the ledger says.

    The first buffers can be left out: where a period is no multiple of the kernel's tick, the device fills
    its first one sooner than all others, which then look late.
    """
    grabber = V4l2Grabber(device=vivid.CAPTURE, **options)
    try:
        info = grabber.open()
        for _ in range(left_out):
            with grabber.dequeue(TIMEOUT_S):
                pass
        return {**_granted(info), **_counted(grabber, info, seconds)}
    finally:
        grabber.close()


def pictures_in_order(field_rows: int = 288, **options: Any) -> dict[str, Any]:
    """Whether fields are what they claim to be, by the kernel's own test patterns.

    Alternating lines tell the parity, the squares of a checkerboard the rows, its movement (2 columns from
    one field period to the next) which field is the older.
    """
    vivid.set_controls(test_pattern=15, osd_text_mode=2, horizontal_movement=3)
    lines = [(parity, int(rows[50:60].mean())) for parity, rows in _fields(6, options)]
    vivid.set_controls(test_pattern=10, horizontal_movement=4)
    squares = [(parity, _edge(rows), _starts(rows)) for parity, rows in _fields(12, options)]
    steps = {(b[1] - a[1]) % CHECKER_COLUMNS for a, b in itertools.pairwise(squares[4:])}
    return {
        "parity": all((level > 128) == bool(parity) for parity, level in lines),
        "rows": all(starts == list(range(CHECKER_ROWS, field_rows, CHECKER_ROWS)) for *_, starts in squares),
        "steps": sorted(steps),
        "parities": [parity for parity, *_ in squares],
    }


def whole_pictures(**options: Any) -> dict[str, Any]:
    """Whether progressive pictures are whole, by the squares of a checkerboard and their movement."""
    vivid.set_controls(test_pattern=10, osd_text_mode=2, horizontal_movement=4)
    squares = [
        (parity, _edge(rows, 2 * CHECKER_ROWS), _starts(rows), len(rows))
        for parity, rows in _fields(12, options)
    ]
    steps = {(b[1] - a[1]) % CHECKER_COLUMNS for a, b in itertools.pairwise(squares[4:])}
    return {
        "parities": sorted({parity for parity, *_ in squares}),
        "bands": sorted({row % (2 * CHECKER_ROWS) for _, _, starts, _ in squares for row in starts}),
        "count": sorted({len(starts) for _, _, starts, _ in squares}),
        "lines": squares[0][3],
        "steps": sorted(steps),
    }


def offered() -> dict[str, Any]:
    """What the node tells of itself."""
    told = ask(LinuxKernel(), Path(vivid.CAPTURE))
    return {"pictures": told.pictures, "formats": list(told.formats), "standards": list(told.standards)}


def _fields(count: int, options: dict[str, Any]) -> Iterator[tuple[int, NDArray[np.uint8]]]:
    """Parity and copied rows of the first fields."""
    grabber = V4l2Grabber(device=vivid.CAPTURE, **options)
    try:
        grabber.open()
        while count > 0:
            with grabber.dequeue(TIMEOUT_S) as fields:
                assert fields, "no field came"
                for grabbed in fields[:count]:
                    yield grabbed.field.parity, grabbed.field.luma.copy()
                count -= len(fields)
    finally:
        grabber.close()


def _counted(grabber: V4l2Grabber, info: StreamInfo, seconds: float) -> dict[str, Any]:
    numbering, ledger = FieldNumbering(info), Ledger()
    times: list[int] = []
    parities: Counter[int] = Counter()
    seen_at: list[float] = []
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        with grabber.dequeue(TIMEOUT_S) as fields:
            for grabbed in fields:
                _enter(ledger, numbering.number(grabbed, now_ns=time.monotonic_ns()))
                parities[grabbed.field.parity] += 1
                times.append(grabbed.time_ns)
            seen_at.append(time.monotonic())
    _enter(ledger, numbering.settle())
    period_ns = (times[-1] - times[0]) / (len(times) - 1)
    return {
        "seconds": seconds,
        "fields": len(times),
        "rate_hz": 1e9 / period_ns,
        "lost": ledger.total - ledger.received,
        "ledger": ledger.in_words(info.rate_hz),
        "parities": [parities[0], parities[1]],
        "worst_gap_ms": max(np.diff(times)) / 1e6,
        "lateness_ms": (seen_at[-1] * 1e9 - times[-1]) / 1e6,
    }


def _enter(ledger: Ledger, numbered: list[Numbered]) -> None:
    for one in numbered:
        ledger.enter(one.n, one.outcome, one.reason, one.lost_before)


def _granted(info: StreamInfo) -> dict[str, Any]:
    size = f"{info.columns}×{info.field_rows}"
    return {
        "granted": f"{info.field_order} {info.pixel_format} {size} {info.rate_hz:g} Hz",
        "standard": info.standard,
        "nominal_hz": info.rate_hz,
        "remarks": list(info.remarks),
        "details": dict(info.details),
    }


def _edge(rows: NDArray[np.uint8], band: int = CHECKER_ROWS) -> int:
    """Column, modulo the pattern's period, where its second band of squares turns bright."""
    steps = np.diff((rows[band + 2] > 128).astype(np.int8))
    return int(np.flatnonzero(steps == 1)[0] + 1) % CHECKER_COLUMNS


def _starts(rows: NDArray[np.uint8]) -> list[int]:
    """Rows where a new band of squares begins, looked at right of what the kernel draws into line 23."""
    changed = np.any((rows[1:, 400:] > 128) != (rows[:-1, 400:] > 128), axis=1)
    return [int(row) + 1 for row in np.flatnonzero(changed)]
