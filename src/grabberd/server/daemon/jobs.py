"""Jobs in a running daemon: the known kinds, by which a stored queue is read, and the context of each job."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.state.calibration_store import CalibrationStore
from grabberd.extension import extensions, load
from grabberd.library.jobs.calibration_jobs import CalibrationJob, IdentificationJob
from grabberd.library.jobs.measurement import MeasurementJob
from grabberd.server.daemon.check_job import CheckJob
from grabberd.work.job_rows import Kinds
from grabberd.work.job_spec import JobContext, JobSpec

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
