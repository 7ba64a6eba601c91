"""A recording as the program reads and measures it, beside the points of the camera that made it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import grabberd
from grabberd.archive.capture.meta import CaptureMeta
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.archive.catalogue.capture_documents import describe
from grabberd.config import load_config, shipped_configs
from grabberd.core.ledger import Ledger, Outcome, Slot
from grabberd.errors import GrabberdError, MeasurementError, StreamEnded
from grabberd.instrument.acquisition import Grabber, Signal
from grabberd.instrument.device.field_pipeline import FieldPipeline
from grabberd_fake import FakeGrabber, JumpingClock
from grabberd_replay import ReplayGrabber

BITS = 8
CONFIGS = shipped_configs()
_AXES = ("x_mm", "y_mm", "z_mm")
Points = Mapping[tuple[int, int], NDArray[np.float64]]
"""Place (3,) in mm, by number of the field and target."""


class Camera(NamedTuple):
    """What the simulated camera saw, from its first top field on.

    Attributes:
        fields: Its fields, each (lines, columns).
        points: What was measured in them while they were taken.
    """

    fields: Sequence[NDArray[np.uint8]]
    points: Points


@dataclass(frozen=True, slots=True)
class Reading:
    """What came of a recording.

    Attributes:
        refusal: Why it was refused, or ended early; empty if it was read to its end.
        fields, lost, repeated: Numbers of fields: measured ones, and those that are not.
        complete: True if the ledger has nothing lost or damaged.
        remarks: Of the stream, of the order of the fields, and of the coverage.
        ledger: The account of its fields in words.
        compared: Number of points that the camera has as well.
        worst_mm: Largest distance of a point from that of the camera.
    """

    refusal: str = ""
    fields: int = 0
    lost: int = 0
    repeated: int = 0
    complete: bool = False
    remarks: tuple[str, ...] = ()
    ledger: str = ""
    compared: int = 0
    worst_mm: float = 0.0

    @property
    def said(self) -> tuple[str, ...]:
        """All that a user is told."""
        return (*self.remarks, self.ledger)


def camera(folder: Path, fields: int) -> Camera:
    """A capture of the simulated liner, without the number in its pictures' corner.

    Args:
        folder: Where its file goes.
        fields: Number of fields at least.
    """
    clock = JumpingClock()
    grabber = FakeGrabber(pace="free", clock=clock, scene="liner", picture={"stamp": False})
    path = folder / "camera.grab"
    assert _capture(grabber, path, fields + 1) == ""
    with grabberd.open(path) as capture:
        points = _measured(capture)
        seen = list(capture.fields)
    path.unlink()
    first = next(one.n for one in seen if one.packed.parity == 0)
    ours = {(n - first, target): place for (n, target), place in points.items()}
    return Camera([one.picture for one in seen if one.n >= first], ours)


def read(path: Path, options: Mapping[str, str], truth: Points, out: Path) -> Reading:
    """Captures and measures a recording.

    Args:
        path: The recording.
        options: Options of the replay driver.
        truth: Points of the camera, by the numbers that the recording's fields have.
        out: File of the capture; removed afterwards.
    """
    try:
        refusal = _capture(ReplayGrabber(path, **options), out)  # type: ignore[arg-type]
    except GrabberdError as error:
        return Reading(_words(error, path))
    try:
        with grabberd.open(out) as capture:
            return _reading(capture, truth, refusal.replace(f"{path.parent}/", ""))
    finally:
        out.unlink()


def _words(error: GrabberdError, path: Path) -> str:
    return error.message.replace(f"{path.parent}/", "")


def _capture(grabber: Grabber, path: Path, most: int | None = None) -> str:
    """Takes fields through numbering and ring into a file; says what ended it too early.

    All of it in this thread: those of an instrument would let the result depend on a busy computer.

    Raises:
        GrabberdError: It could not be opened.
    """
    stream = grabber.open()
    config = next(iter(load_config(CONFIGS / "fake.yaml").devices.values()))
    pipeline = FieldPipeline(config)
    pipeline.configure_ring(BITS, None)
    pipeline.opened(stream)
    slots: list[Slot] = []
    because = ""
    while most is None or len(slots) < most:
        try:
            with grabber.dequeue(1.0) as fields:
                slots += [
                    slot for one in fields for slot in pipeline.take(one, Signal.UNKNOWN, one.time_ns or 0)
                ]
        except StreamEnded:
            break
        except GrabberdError as error:
            because = error.message
            break
    slots += pipeline.settle()
    grabber.close()
    ledger = Ledger()
    for slot in slots:
        ledger.enter(slot.n, slot.outcome, slot.reason, slot.lost_before)
    meta = CaptureMeta(
        id=path.stem,
        created_utc="2026-01-01T00:00:00.000Z",
        start_ns=0,
        device={"name": "recorded", "driver": stream.driver, "options": {}, "stream": asdict(stream)},
        config={},
        site={},
        labels={},
        note="",
        bits=BITS,
        lines=pipeline.ring.lines,
        rate_hz=pipeline.rate_hz,
        version="",
    )
    writer = CaptureWriter.create(path.with_suffix(".grab.part"), meta)
    writer.append(slots)
    writer.seal(ledger, complete=ledger.complete, ended_because=because or "the recording has ended")
    return because


def _measured(capture: grabberd.Capture) -> Points:
    """Places of run 1.

    Raises:
        MeasurementError: No target was found.
    """
    capture.measure(CONFIGS / "fake.calibration.json", CONFIGS / "objects" / "liner.yaml")
    table = capture.points()
    places = np.stack([table[axis] for axis in _AXES], axis=1)
    keys = zip(table["n"].tolist(), table["target"].tolist(), strict=True)
    return dict(zip(keys, places, strict=True))


def _reading(capture: grabberd.Capture, truth: Points, refusal: str) -> Reading:
    try:
        points, ledger = _measured(capture), capture.ledger
    except MeasurementError as error:
        return Reading(refusal or error.message)
    common = points.keys() & truth.keys()
    far = [float(np.linalg.norm(points[one] - truth[one])) for one in common]
    return Reading(
        refusal=refusal,
        fields=ledger.received,
        lost=sum(one.count for one in ledger.entries if one.outcome is Outcome.LOST),
        repeated=sum(one.count for one in ledger.entries if one.reason.startswith("repeated")),
        complete=ledger.complete,
        remarks=tuple(_remarks(capture)),
        ledger=ledger.in_words(capture.rate_hz),
        compared=len(common),
        worst_mm=max(far, default=0.0),
    )


def _remarks(capture: grabberd.Capture) -> Iterator[str]:
    yield from capture.meta.device["stream"]["remarks"]
    document = describe(capture.path)
    if document.field_order and document.field_order.order == "wrong":
        yield "The order of the fields is wrong."
    if document.coverage and document.coverage.verdict == "not_measured":
        yield f"Coverage: {document.coverage.in_words}."
