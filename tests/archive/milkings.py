"""Capture files with the points of the simulated milking, so that none has to be measured."""

from archive.captures import MADE_WITH, ledger_of, meta, slot
from core.chain.milking import model
from core.geometry.rigs import calibration
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.core.ledger import Outcome


def object_document(of=None, **changes):
    """An object model as its file has it."""
    of = of or model()
    targets = zip(of.target.tolist(), of.xyz_mm.tolist(), of.row.tolist(), of.column.tolist(), strict=True)
    return {
        "name": of.name,
        "target_diameter_mm": of.target_diameter_mm,
        "sigma_mm": of.sigma_mm,
        "targets": [
            {"id": one, "x_mm": x, "y_mm": y, "z_mm": z, "row": row, "column": column}
            for one, (x, y, z), row, column in targets
        ],
    } | changes


def milking(directory, fields, name="milking", made_with=None, **changes):
    """A sealed capture file with these fields' points; numbers between them that lack are lost."""
    writer = CaptureWriter.create(directory / f"{name}.grab.part", meta(id=name, **changes))
    known = {**calibration().to_document(), "id": MADE_WITH["calibration"]["id"]}
    made_with = {**MADE_WITH, "calibration": known, "object": object_document(), **(made_with or {})}
    writer.begin_run(1, "live", changes.get("created_utc", "2026-03-01T09:30:00.000Z"), "0.1.0", made_with)
    numbers = [one.n for one in fields]
    before = [-1, *numbers[:-1]]
    taken = [slot(n, lost=n - last - 1) for last, n in zip(before, numbers, strict=True)]
    writer.append(taken)
    for one in fields:
        writer.append_points(1, one.n, one.timed.points)
    writer.commit()
    ledger = ledger_of(taken)
    assert all(one.outcome is Outcome.RECEIVED for one in taken)
    return writer.seal(ledger, complete=ledger.complete, ended_because="length reached")
