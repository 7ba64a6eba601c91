"""What is live, what is in the file and what is measured again agree: numbers, times and points."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from running import live, sealed

from grabberd.archive.capture.encodings import quantised
from grabberd.archive.capture.reader import CaptureReader
from grabberd.config import RingConfig
from grabberd.core.chain.measure import MeasuredField, MeasureSetup
from grabberd.instrument.capture.capture_request import CaptureRequest
from grabberd.instrument.capture.recording import Recording
from grabberd.instrument.device.worker import Worker
from grabberd.library.jobs.measurement import measure_file

FAULTS = {
    "nothing": [],
    "losses": [
        {"kind": "lose", "at_field": 20, "count": 3},
        {"kind": "lose_silently", "at_field": 35, "count": 1},
        {"kind": "damage", "at_field": 50, "count": 2},
        {"kind": "no_signal", "at_field": 60, "duration_s": 0.2, "told": False},
    ],
    "another clock beside a loss": [
        {"kind": "lose", "at_field": 30, "count": 2},
        {"kind": "clock_step", "at_field": 32, "by_s": 3600.0},
        {"kind": "turn", "at_field": 60},
    ],
}


class Known(NamedTuple):
    """A field as somebody knows it."""

    n: int
    time_ns: int
    target: bytes
    xyz_mm: bytes


def of_run(path: Path, run: int) -> list[Known]:
    with CaptureReader(path) as reader:
        return [
            Known(n, time_ns, points.target.astype(np.int32).tobytes(), points.xyz_mm.tobytes())
            for n, time_ns, points in reader.timed_points(run)
        ]


@pytest.mark.parametrize("faults", FAULTS)
def test_live_numbers_are_those_of_the_file_and_of_measuring_again(
    tmp_path: Path, faults: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    published: list[tuple[int, MeasuredField]] = []
    recorded: list[MeasuredField] = []
    publish, add = Worker._publish, Recording.add

    def seen(worker: Worker, measured: MeasuredField, setup: MeasureSetup, first_n: int) -> None:
        published.append((first_n, measured))
        publish(worker, measured, setup, first_n)

    def added(recording: Recording, measured: MeasuredField) -> None:
        recorded.append(measured)
        add(recording, measured)

    monkeypatch.setattr(Worker, "_publish", seen)
    monkeypatch.setattr(Recording, "add", added)
    with live(tmp_path, {"faults": FAULTS[faults]}, ring=RingConfig(slots=256)) as service:
        service.capture_control.start(None, CaptureRequest(fields=100, pre_trigger_fields=200))
        recording = sealed(service)
        path, first_n = recording.path, recording.first_n
    shown = [
        Known(
            one.n,
            one.time_ns,
            one.points.target.astype(np.int32).tobytes(),
            quantised(one.points).xyz_mm.tobytes(),  # live, they are as they were computed
        )
        for _, one in published
        if any(one is another for another in recorded)
    ]
    in_stream = {one.n: one.time_ns for first, one in published if first == 0}
    in_the_file = of_run(path, 1)
    assert len(in_the_file) > 80
    assert shown == in_the_file
    with CaptureReader(path) as reader:
        assert {known.n: known.time_ns for known in in_the_file} == {
            field.n: field.time_ns for field in reader.received()
        }
        made_with = reader.run(1).made_with
    # Before the capture fields are numbered from the stream's first one: another name for the same field.
    assert all(in_stream.get(one.n + first_n, one.time_ns) == one.time_ns for one in in_the_file)
    again = measure_file(lambda _: None, path=path, made_with=made_with)
    assert of_run(path, again.run) == in_the_file
    with CaptureReader(path) as reader:
        first, second = reader.runs
    assert first.coverage is not None
    assert first.coverage == second.coverage
