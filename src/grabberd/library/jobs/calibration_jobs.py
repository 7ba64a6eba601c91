"""Jobs on captures of the calibration frame: calibrate and store what was made, identify the targets shown.

What calibrates is imported where a job runs: the daemon does without it.
"""

from dataclasses import replace

from grabberd.archive.state.calibration_store import CalibrationRecord, CalibrationStore
from grabberd.documents.document import JsonObject, Turn
from grabberd.documents.jobs import CalibrationResult, IdentificationResult
from grabberd.documents.requests import CalibrationOptions, CaptureName, TargetMark
from grabberd.errors import ExtraMissing
from grabberd.runtime import SystemClock, iso_utc
from grabberd.work.job_spec import JobContext, JobSpec, Progress


class CalibrationJob(JobSpec):
    """Calibrates from captures, draws the report and stores all of it at once, or nothing.

    Attributes:
        subject: The first capture, whose pose defines the coordinates.
        further: Captures of further poses of the calibration frame.
        calibration_frame: Document of the calibration frame, as `calibrate_files` takes it and the options.
        device: Name of the device the calibration will belong to.
        note: Free text, kept with the calibration.
        previous: Document of the calibration that the device measures with; None if it has none.
    """

    kind = "calibrate"
    further: tuple[CaptureName, ...] = ()
    calibration_frame: JsonObject
    options: CalibrationOptions
    device: str
    note: str = ""
    previous: JsonObject | None = None

    @property
    def captures(self) -> tuple[str, ...]:
        """All captures, that of the first pose before those of the others."""
        return (self.subject, *self.further)

    def run(self, progress: Progress, context: JobContext) -> CalibrationResult:
        """Calibrates and stores.

        Raises:
            Conflict: The id is taken.
            GrabberdError: The calibrator refuses the captures.
        """
        store = CalibrationStore(context.calibrations)
        if (stored := store.made_by(context.job)) is not None:
            return CalibrationResult(calibration=stored)
        if (calibrate := context.calibrator) is None:
            from grabberd.library.jobs.calibration import calibrate_files  # noqa: PLC0415

            calibrate = calibrate_files
        made = calibrate(
            progress,
            paths=[context.file(one) for one in self.captures],
            calibration_frame=self.calibration_frame,
            options=self.options,
            note=self.note or None,
            previous=self.previous,
        )
        report = made.report.model_dump(mode="json", by_alias=True)
        record = CalibrationRecord(
            self.device, "capture", note=self.note, capture=self.subject, job=context.job
        )
        page, record = _drawn(report, record)
        record = replace(record, stored_utc=iso_utc(SystemClock().utc_now()))
        added = store.add(made.calibration.to_document(), record, report=report, page=page)
        return CalibrationResult(calibration=added.id)


def _drawn(report: JsonObject, record: CalibrationRecord) -> tuple[str | None, CalibrationRecord]:
    """Draws the report as a page; where that fails, the record says why.

    A bug in a picture must not cost the calibration.
    """
    try:
        from grabberd.reports import calibration_html  # noqa: PLC0415 - the daemon never draws

        return calibration_html(report), record
    except ExtraMissing as error:
        return None, replace(record, missing_extra=error.extra)
    except Exception as error:
        return None, replace(record, page_problem=f"{type(error).__name__}: {error}")


class IdentificationJob(JobSpec):
    """Finds the targets of a calibration frame in a sealed capture of it."""

    kind = "identify"
    calibration_frame: JsonObject
    turn_deg: Turn | None = None
    marks: tuple[TargetMark, ...] = ()

    def run(self, progress: Progress, context: JobContext) -> IdentificationResult:
        """Identifies them; see `identify_file`."""
        from grabberd.library.jobs.calibration_frame import identify_file  # noqa: PLC0415 - the daemon does without it

        path = context.file(self.subject)
        return identify_file(progress, path, self.calibration_frame, self.turn_deg, self.marks)
