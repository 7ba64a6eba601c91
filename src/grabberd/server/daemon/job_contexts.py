"""Surroundings of jobs in a running daemon."""

from dataclasses import dataclass

from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.state.calibration_store import CalibrationStore
from grabberd.library.jobs.calibrator import Calibrator, calibrate_captures
from grabberd.work.job_spec import JobContext, JobSpec
from grabberd_liner.analyses.store import AnalysisStore
from grabberd_liner.guided_tests.store import LinerTestStore


@dataclass(slots=True)
class JobContexts:
    """Tells a job that begins where its captures are now, and where its results belong.

    Attributes:
        archive: The captures.
        analyses: The analyses.
        calibrations: The calibrations.
        tests: The guided tests.
        calibrator: Function that calibrates.
    """

    archive: Archive
    analyses: AnalysisStore
    calibrations: CalibrationStore
    tests: LinerTestStore
    calibrator: Calibrator = calibrate_captures

    def of(self, job_id: str, spec: JobSpec) -> JobContext:
        """The surroundings of a job.

        Raises:
            NotFound: One of its captures was deleted since it was queued.
            Conflict: One of its captures is running, or armed.
            StorageError: The folder of captures is gone.
        """
        return JobContext(
            job=job_id,
            files={capture: self.archive.sealed_path(capture) for capture in spec.captures},
            captures=self.archive.directory,
            analyses=self.analyses.directory,
            calibrations=self.calibrations.directory,
            tests=self.tests.directory,
            calibrator=self.calibrator,
        )
