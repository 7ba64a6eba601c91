"""Measuring a sealed capture again: a job."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from grabberd import __version__
from grabberd.errors import MeasurementError, NotReady
from grabberd.field import NumberedField
from grabberd.processes.measure import measure_fields
from grabberd.service.clock import SystemClock, iso_utc
from grabberd.service.jobs import Progress
from grabberd.service.setup import measure_setup
from grabberd.storage import CaptureReader, append_run


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
    with CaptureReader(path) as reader:
        fields = _counted(reader.received(), reader.field_count, progress)
        results = [(measured.n, measured.points) for measured in measure_fields(fields, setup)]
    if not any(len(points) for _, points in results):
        raise MeasurementError(
            f"no target of the object model was found in any of {len(results)} fields; no run was added",
            "check that calibration and object model belong to this capture's rig and object",
        )
    created = iso_utc(SystemClock().utc_now())
    run = append_run(path, "measure", created, __version__, made_with, results)
    return {"run": run, "fields": len(results), "points": sum(len(points) for _, points in results)}


def _counted(fields: Iterator[NumberedField], count: int, progress: Progress) -> Iterator[NumberedField]:
    for done, field in enumerate(fields):
        if done % 50 == 0:
            progress(done / max(count, 1))
        yield field
