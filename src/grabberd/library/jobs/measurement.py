"""Re-measures a sealed capture: the points become a further run in its file."""

from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

from grabberd import __version__
from grabberd.archive import CaptureReader, append_run
from grabberd.archive.capture.digests import Damage, left_out_in_words
from grabberd.archive.catalogue.coverage_documents import whole_coverage
from grabberd.archive.measure_setups import INCLUDE_DAMAGED, measure_setup
from grabberd.clock import SystemClock, iso_utc
from grabberd.core.chain.measure import FIELDS_AT_ONCE, MeasuredField, measure_fields
from grabberd.core.reconstruction import CoverageTally
from grabberd.core.reconstruction.accuracy.field_order import FieldOrderCheck
from grabberd.core.reconstruction.coverage.document import coverage_document
from grabberd.core.reconstruction.points import Points
from grabberd.documents.field_order import FieldOrderDocument
from grabberd.documents.named_types import JsonObject
from grabberd.documents.results import MeasurementResult
from grabberd.errors import MeasurementError, NotReady
from grabberd.work.job_spec import JobContext, JobSpec
from grabberd.work.progress import Progress, counted

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
        tally = CoverageTally.of(setup.calibration, setup.object_model)
        points = _counted_points(measure_fields(fields, setup, tally, FIELDS_AT_ONCE), counts, order)
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
