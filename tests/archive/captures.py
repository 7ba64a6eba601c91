"""Captures made up for the tests: slots with noise in them, points with numbers in them."""

from dataclasses import replace

import numpy as np

from grabberd.archive.capture.encodings import quantised
from grabberd.archive.capture.meta import CaptureMeta
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.core.field import Field, NumberedField, double_lines, quantise
from grabberd.core.ledger import LedgerEntry, Outcome, Slot
from grabberd.core.reconstruction.points import Points

START_NS = 5_000_000_000_000
PERIOD_NS = 20_000_000
ROWS, COLUMNS = 24, 40

META = CaptureMeta(
    id="20260301-093000-liner",
    created_utc="2026-03-01T09:30:00.000Z",
    start_ns=START_NS,
    device={
        "name": "teatcup",
        "driver": "fake",
        "options": {"scene": "liner"},
        "stream": {"live": True, "field_order": "alternate", "counts_losses": True},
    },
    config={"rate_hz": 50.0},
    site={"barn": "Ås"},
    labels={"cow": "1807", "teat": "front left"},
    note="first milking",
    bits=1,
    lines="field",
    rate_hz=50.0,
    version="0.1.0",
    boot_id="7f9c2ba4e88f827d616045507605853e",
)
MADE_WITH = {
    "calibration": {"schema": "grabberd/calibration/1", "id": "rig-7"},
    "object": {"name": "liner"},
    "settings": {"line_jitter_px": 0.12},
}


def meta(**changes):
    return replace(META, **changes)


def luma(n, rows=ROWS, columns=COLUMNS):
    return np.random.default_rng(n).integers(0, 256, (rows, columns), np.uint8)


def packed(n, bits=1, doubled=False):
    field = Field.intact(luma(n), n % 2)
    return quantise(double_lines(field) if doubled else field, bits, 100 + n % 50)


def slot(n, outcome=Outcome.RECEIVED, reason=None, lost=0, lost_reason="time gap", **how):
    before = (LedgerEntry(n - lost, lost, Outcome.LOST, lost_reason),) if lost else ()
    numbered = NumberedField(n, START_NS + n * PERIOD_NS + n % 7, 1000 + n, packed(n, **how))
    return Slot(
        None if outcome is Outcome.NO_SIGNAL else numbered, n, outcome, reason, before, numbered.time_ns
    )


def slots(count, **how):
    return [slot(n, **how) for n in range(count)]


def points(n, count=5):
    """Points as a capture gives them back."""
    return quantised(computed_points(n, count))


def computed_points(n, count=5):
    rng = np.random.default_rng(1000 + n)
    spread = rng.normal(size=(2, count, 3, 3))
    covariance = spread @ spread.swapaxes(2, 3) * 1e-3
    return Points(
        target=np.sort(rng.choice(108, count, replace=False)).astype(np.int32),
        xyz_mm=rng.normal(0, 30, (count, 3)),
        covariance_mm2=covariance[0],
        calibration_covariance_mm2=covariance[1],
        image_px=rng.uniform(0, 576, (count, 2, 2)),
        residual_px=rng.uniform(0, 0.3, count),
    )


def ledger_of(taken):
    from grabberd.core.ledger import Ledger  # noqa: PLC0415

    ledger = Ledger()
    for one in taken:
        ledger.enter(one.n, one.outcome, one.reason, one.lost_before)
    return ledger


def write(
    directory,
    taken,
    *,
    measured=(),
    name="liner",
    coverage=None,
    fields_a_commit=10**9,
    made_with=MADE_WITH,
    **changes,
):
    """A sealed capture; what is committed together is a group."""
    writer = CaptureWriter.create(directory / f"{name}.grab.part", meta(**changes))
    if measured:
        writer.begin_run(1, "live", META.created_utc, "0.1.0", made_with)
    measured = set(measured)
    for some in batches(taken, fields_a_commit):
        writer.append(some)
        for n in sorted(measured & {one.n for one in some}):
            writer.append_points(1, n, points(n))
        writer.commit()
    for n in sorted(measured - {one.n for one in taken}):
        writer.append_points(1, n, points(n))
    writer.commit()
    ledger = ledger_of(taken)
    return writer.seal(ledger, complete=ledger.complete, ended_because="length reached", coverage=coverage)


def batches(taken, size):
    return [taken[first : first + size] for first in range(0, len(taken), size)]


def regrouped(path, fields_a_commit):
    """Writes a capture again, in groups of so many fields; without its points."""
    with CaptureReader(path) as reader:
        taken = [
            Slot(one.numbered, one.numbered.n, one.outcome, one.reason, (), one.numbered.time_ns)
            for one in reader.fields()
        ]
        part = path.with_name(f"regrouped-{path.name}.part")
        writer = CaptureWriter.create(part, replace(reader.meta, state="recording", complete=None))
        for some in batches(taken, fields_a_commit):
            writer.append(some)
            writer.commit()
        ended = {"complete": reader.meta.complete, "ended_because": reader.meta.ended_because or ""}
        sealed = writer.seal(reader.ledger, **ended)
    return sealed.replace(path)


def same_field(one, other):
    assert one._replace(packed=None) == other._replace(packed=None)
    for name in ("bits", "columns", "parity", "y0", "y_step", "threshold"):
        assert getattr(one.packed, name) == getattr(other.packed, name)
    np.testing.assert_array_equal(one.packed.data, other.packed.data)
    assert one.packed.data.dtype == np.uint8


def numbers(path):
    """Of the fields in a capture file."""
    with CaptureReader(path) as reader:
        return [field.numbered.n for field in reader.fields()]
