"""Jobs of a running daemon: the known kinds with their context, and the check of a calibration."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grabberd import runtime
from grabberd.archive.capture.schema import SUFFIX
from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.state.calibration_store import CalibrationStore
from grabberd.documents.document import JsonObject
from grabberd.documents.jobs import CheckResult
from grabberd.documents.requests import CHECK_S, CaptureRequest
from grabberd.errors import NotReady
from grabberd.extension import extensions, load
from grabberd.library.jobs.calibration_jobs import CalibrationJob, IdentificationJob
from grabberd.library.jobs.measurement import MeasurementJob
from grabberd.work.job_rows import Kinds
from grabberd.work.job_spec import JobContext, JobSpec, Progress, portion

if TYPE_CHECKING:  # the job process carries values, not the daemon's own objects
    from grabberd.instrument.capture.capture_control import CaptureControl
    from grabberd.instrument.instrument import Instrument


SEALING_S = 60.0
"""Time allowed for sealing the capture after its end."""
POLL_S = 0.1
_CAPTURED = 0.5
"""Progress when the capture is complete."""
NOTE = "check of the calibration"


class CheckJob(JobSpec):
    """Checks a calibration once its capture is sealed; see `check_file` for the result.

    Attributes:
        seconds: Length of the capture.
        calibration_frame: Document of the calibration frame.
        calibration: Document of the calibration to check.
        in_place: True if the calibration frame stands exactly where it stood during the calibration.
    """

    kind = "check"
    seconds: float
    calibration_frame: JsonObject
    calibration: JsonObject
    in_place: bool

    @property
    def captures(self) -> tuple[str, ...]:
        """Empty: the capture may still be recording when the job is queued."""
        return ()

    @classmethod
    def start(
        cls,
        captures: "CaptureControl",
        instrument: "Instrument",
        calibration_frame: JsonObject,
        *,
        in_place: bool = False,
        seconds: float = CHECK_S,
    ) -> "CheckJob":
        """Starts a capture of the calibration frame and returns the job that checks the device's calibration.

        Raises:
            NotReady: The device is not streaming, or has no calibration.
            CaptureRunning: A capture is already running.
        """
        calibration = instrument.setup.documents.get("calibration")
        if not calibration:
            raise NotReady(
                f"device {instrument.name} has no calibration to check", "calibrate it, or activate one"
            )
        request = CaptureRequest(
            fields=round(seconds * instrument.pipeline.rate_hz),
            bits=8,
            lines="field",
            note=NOTE,
            labels={"purpose": NOTE},
        )
        capture_id = captures.start(instrument.name, request).id
        return cls(
            subject=capture_id,
            seconds=seconds,
            calibration_frame=calibration_frame,
            calibration=calibration,
            in_place=in_place,
        )

    def run(self, progress: Progress, context: JobContext) -> CheckResult:
        """Waits until the capture has its final name, then runs `check_file`.

        Raises:
            NotReady: The capture was not sealed in time.
        """
        from grabberd.library.jobs.calibration_frame import check_file  # noqa: PLC0415 - the daemon does without it

        path = context.captures / f"{self.subject}{SUFFIX}"
        self._wait_until_sealed(path, portion(progress, 0.0, _CAPTURED))
        return check_file(
            portion(progress, _CAPTURED, 1.0),
            path=path,
            calibration_frame=self.calibration_frame,
            calibration=self.calibration,
            in_place=self.in_place,
        )

    def _wait_until_sealed(self, path: Path, progress: Progress) -> None:
        # The job process cannot see the daemon's captures; the file gets its final name when it is sealed.
        began_s = runtime.monotonic()
        while not path.exists():
            waited_s = runtime.monotonic() - began_s
            if waited_s > self.seconds + SEALING_S:
                raise NotReady(
                    f"capture {self.subject} was not sealed within {waited_s:.0f} s",
                    "see the device's state, and try again",
                )
            progress(min(waited_s / self.seconds, 1.0))
            runtime.sleep(POLL_S)


_OF_EXTENSIONS = (load(job) for extension in extensions() for job in extension.jobs)

KINDS: Kinds = {
    one.kind: one for one in (CalibrationJob, CheckJob, IdentificationJob, MeasurementJob, *_OF_EXTENSIONS)
}


@dataclass(slots=True)
class JobContexts:
    """Provides a starting job with the paths of its captures and the folders for its results.

    Attributes:
        archive: The captures.
        calibrations: The calibrations.
        folders: Folders for results of extensions' jobs, by name.
        calibrator: Function that calibrates; None: the built-in one.
    """

    archive: Archive
    calibrations: CalibrationStore
    folders: Mapping[str, Path]
    calibrator: Callable[..., Any] | None = None

    def of(self, job_id: str, spec: JobSpec) -> JobContext:
        """The context of a job.

        Raises:
            NotFound: One of its captures was deleted since the job was queued.
            Conflict: One of its captures is running or armed.
            StorageError: The captures folder is missing.
        """
        return JobContext(
            job=job_id,
            files={capture: self.archive.sealed_path(capture) for capture in spec.captures},
            captures=self.archive.directory,
            calibrations=self.calibrations.directory,
            folders=self.folders,
            calibrator=self.calibrator,
        )
