"""Pushes four minutes of 83 targets at once: 24 MB, more than sockets and LSL keep for a slow inlet.

It waits for a line on its input, and prints how many samples it has pushed and the longest that one took.
"""

import os
import sys
import time

import numpy as np

from grabberd.client.points_stream import StreamedPoints
from grabberd.documents.points_frame import PointsDescription, PointsFrame
from grabberd_lsl.outlets import LslClock, Outlets, PointsLayout, lsl

SAMPLES, TARGETS = 12_000, 83


def streamed() -> StreamedPoints:
    """A field of which every target was found."""
    described = PointsDescription(number=1, device="north", rate_hz=50, calibration_id="c", object_name="o")
    now_ns, utc_us = time.monotonic_ns(), time.time_ns() // 1000
    columns = np.arange(TARGETS, dtype=np.uint32), np.ones((TARGETS, 3))
    covariances = np.ones((TARGETS, 6), np.float32), np.ones((TARGETS, 6), np.float32)
    residual_px = np.ones(TARGETS, np.float32)
    frame = PointsFrame(0, now_ns, utc_us, now_ns, 0, 1, *columns, *covariances, residual_px)
    return StreamedPoints(frame, described, 0)


def main() -> None:
    layout = PointsLayout("o", tuple((k, 0, k) for k in range(TARGETS)))
    north, one = Outlets("north", lambda: layout, LslClock(lsl().local_clock)), streamed()
    north.push(one)
    sys.stdin.readline()
    assert north.is_heard
    longest_s = 0.0
    for _ in range(SAMPLES):
        before_s = time.monotonic()
        north.push(one)
        longest_s = max(longest_s, time.monotonic() - before_s)
    print(SAMPLES, f"{longest_s:.6f}", flush=True)
    os._exit(0)  # an outlet's end waits for what is still to be sent


if __name__ == "__main__":
    main()
