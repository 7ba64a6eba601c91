"""Measurement of a sealed capture: the points become a further run in its file.

What it shows of targets that are off their nominal places becomes, on request, a proposed object file.
"""

from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from grabberd import __version__
from grabberd.archive.capture.digests import Damage, left_out_in_words
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.runs import append_run
from grabberd.archive.catalogue.capture_documents import whole_coverage
from grabberd.archive.measure_setups import INCLUDE_DAMAGED, measure_setup
from grabberd.bounded_documents import parse_yaml, yaml_text
from grabberd.core.chain.measure import FIELDS_AT_ONCE, MeasuredField, measure_fields
from grabberd.core.chain.nominal_places import NominalPlaces, nominal_places
from grabberd.core.reconstruction import CoverageTally, ObjectModel
from grabberd.core.reconstruction.coverage import coverage_document
from grabberd.core.reconstruction.field_order import FieldOrderCheck
from grabberd.core.reconstruction.points import Points
from grabberd.documents.devices import FieldOrderDocument
from grabberd.documents.document import JsonObject
from grabberd.documents.jobs import MeasurementResult
from grabberd.errors import MeasurementError, NotReady, StorageError
from grabberd.files.disk import storage_errors, write_synced
from grabberd.runtime import SystemClock, iso_utc
from grabberd.work.job_spec import JobContext, JobSpec, Progress, counted

JOB = "job"
"""Setting of a run: id of the job that measured it."""


class MeasurementJob(JobSpec):
    """Re-measures a capture; result and `made_with` are those of `measure_file`."""

    kind = "measure"
    made_with: JsonObject

    def run(self, progress: Progress, context: JobContext) -> MeasurementResult:
        """Runs `measure_file`, unless an earlier attempt has added the run already."""
        path = context.file(self.subject)
        if (result := _made_before(path, context.job)) is not None:
            return result
        settings = {**(self.made_with.get("settings") or {}), JOB: context.job}
        return measure_file(progress, path=path, made_with={**self.made_with, "settings": settings})


def _made_before(path: Path, job: str) -> MeasurementResult | None:
    """Result of an attempt that had added its run before it could say so, as far as the file has it."""
    with CaptureReader(path) as reader:
        for run in reader.runs:
            if (run.made_with.get("settings") or {}).get(JOB) == job:
                covered = whole_coverage(run.coverage)
                return MeasurementResult(
                    run=run.run,
                    fields=covered.fields if covered else 0,
                    points=reader.point_count(run.run),
                    coverage=covered,
                )
    return None


def measure_file(progress: Progress, *, path: Path, made_with: JsonObject) -> MeasurementResult:
    """Measures every good field and appends the points as a new run, whole or not at all.

    Fields that the disk has changed are left out, with a warning. Those that came damaged are measured only
    where `settings` have `include_damaged`, fields without a signal never.

    Args:
        progress: Called with the share that is done.
        path: A sealed capture.
        made_with: The documents `calibration`, `object` and `settings`.

    Raises:
        NotReady: The calibration or the object model is missing.
        MeasurementError: No field has a point.
        CaptureFileError: The file cannot be read.
    """
    if not made_with.get("calibration") or not made_with.get("object"):
        raise NotReady("measuring needs a calibration and an object model", "name both in the configuration")
    setup = measure_setup(made_with, made_with["settings"])
    counts = Counter({"fields": 0, "points": 0})
    left_out: list[Damage] = []
    with CaptureReader(path, left_out) as reader:
        reader.check_unchanged(runs=())
        order = FieldOrderCheck(setup.object_model.target) if reader.meta.is_interlaced else None
        received = reader.received(and_damaged=made_with["settings"].get(INCLUDE_DAMAGED, False))
        fields = counted(received, reader.field_count, progress)
        tally = CoverageTally(setup.calibration, setup.object_model)
        measured = measure_fields(fields, setup, tally, FIELDS_AT_ONCE, lambda _: reader.marks_before())
        points = _counted_points(measured, counts, order)
        created = iso_utc(SystemClock().utc_now())

        def coverage() -> JsonObject:
            return coverage_document(tally.result(), reader.missing_fields(counts["fields"]))

        run = append_run(path, "measure", created, __version__, made_with, points, coverage)
        covered = whole_coverage(reader.run(run).coverage)
    found = None if order is None else FieldOrderDocument.of(order.finish())
    warnings = [*left_out_in_words(left_out), *([found.warning] if found and found.warning else [])]
    return MeasurementResult(run=run, **counts, field_order=found, warnings=warnings, coverage=covered)


def _counted_points(
    measured: Iterable[MeasuredField], counts: Counter[str], order: FieldOrderCheck | None
) -> Iterator[tuple[int, Points]]:
    """Yields each field's points, counts them, and adds them to the check of the field order.

    Raises:
        MeasurementError: There were none; raised at the end, when `append_run` can still drop the run.
    """
    for one in measured:
        counts.update(fields=1, points=len(one.points))
        if order is not None:
            order.add(one.n, one.points)
        yield one.n, one.points
    if not counts["points"]:
        raise MeasurementError(
            f"no target of the object model was found in any of {counts['fields']} fields; no run was added",
            "check that calibration and object model belong to this capture's rig and object",
        )


PUBLIC = 0o644


class MovedTarget(NamedTuple):
    """A target that the proposed file has elsewhere.

    Attributes:
        id: The target's id.
        offset_mm: From its nominal place to the proposed one.
        sigma_mm: Standard deviation of each coordinate.
        significance: Length of the offset in units of σ.
        fields: Number of fields that it was found in, of those that counted.
    """

    id: int
    offset_mm: tuple[float, float, float]
    sigma_mm: float
    significance: float
    fields: int

    @property
    def length_mm(self) -> float:
        """Length of the offset."""
        return float(np.linalg.norm(self.offset_mm))


class ObjectProposal(NamedTuple):
    """A proposed object file; `moved` is empty, and nothing was written, if every target is in its place."""

    moved: list[MovedTarget]
    fields: int

    @property
    def in_words(self) -> str:
        """The proposal in a sentence."""
        if not self.moved:
            return (
                f"no target is significantly off its nominal place in {self.fields} fields; nothing written"
            )
        farthest = max(self.moved, key=lambda one: one.length_mm)
        return (
            f"{len(self.moved)} targets moved by up to {farthest.length_mm:.2f} mm (target {farthest.id}, "
            f"σ {farthest.sigma_mm:.2f} mm), from {self.fields} fields"
        )


def propose_object(progress: Progress, *, path: Path, made_with: JsonObject, out: Path) -> ObjectProposal:
    """Writes an object file with corrected nominal places, if any target is significantly off its own.

    Args:
        progress: Called with the share that is done.
        path: A sealed capture, best of the object at rest or with open wall.
        made_with: The documents `calibration`, `object` and `settings`.
        out: The new file; it is never one that exists.

    Raises:
        NotReady: The calibration or the object model is missing.
        CaptureFileError: The capture cannot be read.
        StorageError: The file exists, or cannot be written.
    """
    if not made_with.get("calibration") or not made_with.get("object"):
        raise NotReady("measuring needs a calibration and an object model", "name both")
    setup = measure_setup(made_with, made_with["settings"])
    with CaptureReader(path) as reader:
        received = reader.received(and_damaged=made_with["settings"].get(INCLUDE_DAMAGED, False))
        found = nominal_places(counted(received, reader.field_count, progress), setup)
        capture = reader.meta.id
    moved = list(_moved(found))
    if moved:
        _write(out, made_with["object"], found.proposed, _provenance(capture, made_with, found), moved)
    return ObjectProposal(moved, found.fields)


def _moved(found: NominalPlaces) -> Iterator[MovedTarget]:
    for index in np.flatnonzero(found.misplaced):
        x_mm, y_mm, z_mm = (round(float(one), 4) for one in found.offset_mm[index])
        yield MovedTarget(
            int(found.model.target[index]),
            (x_mm, y_mm, z_mm),
            round(float(found.sigma_mm[index]), 4),
            round(float(found.significance[index]), 1),
            int(found.seen[index]),
        )


def _provenance(capture: str, made_with: JsonObject, found: NominalPlaces) -> list[str]:
    calibration, name = made_with["calibration"].get("id"), made_with["object"].get("name")
    return [
        f"Nominal places of {name!r} as capture {capture} shows them in {found.fields} fields, measured with",
        f"calibration {calibration} by grabberd {__version__} on {iso_utc(SystemClock().utc_now())}.",
        "Targets that moved have their offset, σ and significance beside them; all others stand as before.",
    ]


def _write(
    out: Path, document: JsonObject, model: ObjectModel, provenance: list[str], moved: list[MovedTarget]
) -> None:
    text = "".join(f"{line}\n" for line in _lines(document, model, provenance, moved))
    again = ObjectModel.from_document(parse_yaml(text))
    if not np.allclose(again.xyz_mm, model.xyz_mm, atol=1e-4):
        raise StorageError(f"{out.name} would not hold the places proposed", "please report this")
    with storage_errors(out):
        write_synced(out, text.encode(), PUBLIC)


def _lines(
    document: JsonObject, model: ObjectModel, provenance: Iterable[str], moved: Iterable[MovedTarget]
) -> Iterator[str]:
    yield from (f"# {line}" for line in provenance)
    head = {key: value for key, value in document.items() if key != "targets"}
    yield yaml_text(head).rstrip("\n")
    yield "targets:"
    notes = {one.id: one for one in moved}
    places = dict(zip(model.target.tolist(), model.xyz_mm.tolist(), strict=True))
    for target in document["targets"]:
        note, entry = notes.get(target["id"]), dict(target)
        if note is not None:
            xyz_mm = (round(one, 4) for one in places[note.id])
            entry |= dict(zip(("x_mm", "y_mm", "z_mm"), xyz_mm, strict=True))
            entry["sigma_mm"] = note.sigma_mm
        text = yaml_text(entry, default_flow_style=True, width=1000).strip()
        yield f"  - {text}{_comment(note)}"


def _comment(note: MovedTarget | None) -> str:
    if note is None:
        return ""
    offset = " ".join(f"{one:+.3f}" for one in note.offset_mm)
    return f"  # moved by {offset} mm, σ {note.sigma_mm:.3f}, {note.significance:.0f} σ, {note.fields} fields"
