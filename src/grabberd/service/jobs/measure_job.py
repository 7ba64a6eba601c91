"""Measuring a sealed capture again: a job."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grabberd import __version__
from grabberd.errors import MeasurementError, NotReady
from grabberd.field import NumberedField
from grabberd.processes.measure import MeasuredField, measure_fields
from grabberd.reconstruction.points import Points
from grabberd.service.clock import SystemClock, iso_utc
from grabberd.service.jobs.job_runner import Job, Progress
from grabberd.service.setup import measure_setup
from grabberd.storage import CaptureReader, append_run

if TYPE_CHECKING:
    from grabberd.service.service import Service


def order_measuring(service: "Service", capture_id: str) -> Job:
    """Queues the measuring of a sealed capture with its device's present calibration.

    Raises:
        NotFound, Conflict: there is none of that id, or it is still running.
    """
    path = service.archive.sealed_path(capture_id)
    device = service.archive.document(capture_id).device
    made_with = service.instrument(device).made_with
    return service.jobs.submit("measure", capture_id, measure_file, path=path, made_with=made_with)


def measure_file(progress: Progress, *, path: Path, made_with: Mapping[str, Any]) -> dict[str, int]:
    """Measures every good field and appends the points as a new run, whole or not at all.

    Args:
        progress: is told the share that is done.
        path: a sealed capture.
        made_with: the documents `calibration`, `object` and `settings`.

    Returns:
        The number of the run, of its fields and of its points.

    Raises:
        NotReady: the calibration or the object model is missing.
        MeasurementError: there is not one point.
        CaptureFileError: the file cannot be read.
    """
    if not made_with.get("calibration") or not made_with.get("object"):
        raise NotReady(
            "there is no calibration or no object model to measure with", "name both in the configuration"
        )
    setup = measure_setup(made_with, made_with["settings"])
    counts = Counter({"fields": 0, "points": 0})
    with CaptureReader(path) as reader:
        fields = _counted(reader.received(), reader.field_count, progress)
        results = _some_points(measure_fields(fields, setup), counts)
        created = iso_utc(SystemClock().utc_now())
        run = append_run(path, "measure", created, __version__, made_with, results)
    return {"run": run, **counts}


def _some_points(measured: Iterable[MeasuredField], counts: Counter[str]) -> Iterator[tuple[int, Points]]:
    """The points of each field, counted; that there is not one is found out at the end."""
    for one in measured:
        counts.update(fields=1, points=len(one.points))
        yield one.n, one.points
    if not counts["points"]:
        raise MeasurementError(
            f"no target of the object model was found in any of {counts['fields']} fields; no run was added",
            "check that calibration and object model belong to this capture's rig and object",
        )


def _counted(fields: Iterator[NumberedField], count: int, progress: Progress) -> Iterator[NumberedField]:
    for done, field in enumerate(fields):
        if done % 50 == 0:
            progress(done / max(count, 1))
        yield field
