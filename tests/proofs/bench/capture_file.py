"""The capture file: bytes of a field, and processor time to encode, write and read it, by format."""

import tempfile
import time
import zlib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from grabberd.archive.capture.encodings import ZLIB, decode_field, decode_points, encode_field_points
from grabberd.archive.capture.encodings import decode_field_points as decode_single
from grabberd.archive.capture.encodings import encode_points as encode_group
from grabberd.archive.capture.groups import decode_pictures, encode_pictures
from grabberd.archive.capture.meta import CaptureMeta
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.schema import RESERVE_BYTES
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.archive.measure_setups import measure_setup
from grabberd.config import shipped_configs
from grabberd.core.chain.measure import measure_fields
from grabberd.core.field import Field, NumberedField, PackedField, double_lines, quantise
from grabberd.core.ledger import Ledger, Outcome, Slot
from grabberd.core.reconstruction.points import Points
from grabberd.files.reading import read_documents
from grabberd.instrument.acquisition.device import GRABBERS

FIELDS, GROUP, ROUNDS = 600, 25, 7
PERIOD_NS, THRESHOLD = 20_000_000, 60


def table() -> str:
    """The figures as Markdown."""
    fields = _fields()
    calibration, liner = shipped_configs() / "fake.calibration.json", shipped_configs() / "objects/liner.yaml"
    made_with = read_documents(calibration, liner)
    measured = [one.points for one in measure_fields(fields, measure_setup(made_with, {}))]
    about = f"{FIELDS} fields, 1 bit, doubled, {sum(map(len, measured)) / FIELDS:.0f} points a field."
    head = "| | bytes a field | µs to encode it | µs to decode it |"
    lines = [f"{about} Processor time, least of {ROUNDS} rounds by turns.\n", head, "|---|---|---|---|"]
    lines += _codecs([one.packed for one in fields], measured)
    with tempfile.TemporaryDirectory() as folder:
        return "\n".join([*lines, *_file(Path(folder), fields, measured)])


def _fields() -> list[NumberedField]:
    grabber = GRABBERS.create("fake", {"pace": "free"})
    grabber.open()
    fields: list[NumberedField] = []
    while len(fields) < FIELDS:
        with grabber.dequeue(1.0) as some:
            for one in some:
                n = len(fields)
                intact = Field.intact(one.field.luma.copy(), one.field.parity)
                packed = quantise(double_lines(intact), 1, THRESHOLD)
                fields.append(NumberedField(n, n * PERIOD_NS, n, packed))
    grabber.close()
    return fields[:FIELDS]


def _codecs(packed: Sequence[PackedField], measured: Sequence[Points]) -> Iterable[str]:
    first = packed[0]
    groups = [slice(begin, begin + GROUP) for begin in range(0, FIELDS, GROUP)]
    shape = (first.rows, first.columns, first.bits)
    counts = [sum(map(len, measured[part])) for part in groups]
    singles = [zlib.compress(one.data.tobytes(), 1) for one in packed]
    pictures = [encode_pictures(packed[part]) for part in groups]
    records = [encode_field_points(one) for one in measured]
    columns = [encode_group(measured[part]) for part in groups]
    sized = [b"".join(one[1:]) for one in columns]
    ways: list[tuple[str, Sequence[bytes], Callable[[], Any], Callable[[], Any]]] = [
        (
            "picture, format 1",
            singles,
            lambda: [zlib.compress(one.data.tobytes(), 1) for one in packed],
            lambda: [decode_field(ZLIB, one, *shape) for one in singles],
        ),
        (
            "picture, format 2",
            pictures,
            lambda: [encode_pictures(packed[part]) for part in groups],
            lambda: [decode_pictures(one, GROUP, *shape) for one in pictures],
        ),
        (
            "points, format 1",
            records,
            lambda: [encode_field_points(one) for one in measured],
            lambda: [decode_single(one, len(of)) for one, of in zip(records, measured, strict=True)],
        ),
        (
            "points, format 2",
            sized,
            lambda: [encode_group(measured[part]) for part in groups],
            lambda: [decode_points(one, count) for one, count in zip(columns, counts, strict=True)],
        ),
    ]
    times = _least([run for _, _, *both in ways for run in both])
    for place, (name, data, *_) in enumerate(ways):
        encoding, decoding = times[2 * place : 2 * place + 2]
        yield f"| {name} | {sum(map(len, data)) / FIELDS:.0f} | {encoding:.0f} | {decoding:.0f} |"


def _least(runs: Sequence[Callable[[], Any]]) -> list[float]:
    """Least processor time of each, in µs a field."""
    least = [float("inf")] * len(runs)
    for _ in range(ROUNDS):
        for place, run in enumerate(runs):
            begin = time.process_time()
            run()
            least[place] = min(least[place], (time.process_time() - begin) * 1e6 / FIELDS)
    return least


def _file(folder: Path, fields: Sequence[NumberedField], measured: Sequence[Points]) -> Iterable[str]:
    """A file that is committed every half second, and read whole."""
    written: list[Path] = []

    def write() -> None:
        written.append(_written(folder / f"{len(written)}.grab.part", fields, measured))

    def read() -> None:
        with CaptureReader(written[0]) as reader:
            assert sum(1 for _ in reader.received()) == FIELDS
            assert sum(1 for _ in reader.points()) == FIELDS

    writing, reading = _least([write, read])
    size = (written[0].stat().st_size - RESERVE_BYTES) / FIELDS
    yield f"| file of format 2, written and read back | {size:.0f} | {writing:.0f} | {reading:.0f} |"


def _written(part: Path, fields: Sequence[NumberedField], measured: Sequence[Points]) -> Path:
    device = {"name": "teatcup", "stream": {"live": True}}
    about = {"site": {}, "labels": {}, "note": "", "config": {}, "device": device, "version": "bench"}
    meta = CaptureMeta(
        id=part.name,
        created_utc="2026-03-01T09:30:00.000Z",
        start_ns=0,
        bits=1,
        lines="doubled",
        rate_hz=50.0,
        **about,  # type: ignore[arg-type]
    )
    writer, ledger = CaptureWriter.create(part, meta), Ledger()
    writer.begin_run(1, "live", meta.created_utc, "bench", {})
    for one, points in zip(fields, measured, strict=True):
        writer.append([Slot(one, one.n, Outcome.RECEIVED, None, (), one.time_ns)])
        writer.append_points(1, one.n, points)
        ledger.enter(one.n, Outcome.RECEIVED, None, ())
        if one.n % GROUP == GROUP - 1:
            writer.commit()
    return writer.seal(ledger, complete=True, ended_because="length reached")
