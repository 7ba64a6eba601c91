"""The job that finds out which targets of the calibration frame a capture shows."""

from grabberd.documents.named_types import JsonObject
from grabberd.documents.results import IdentificationResult
from grabberd.work.job_spec import JobContext, JobSpec
from grabberd.work.progress import Progress


class IdentificationJob(JobSpec):
    """Finds the targets of a calibration frame in a sealed capture of it."""

    kind = "identify"
    calibration_frame: JsonObject

    def run(self, progress: Progress, context: JobContext) -> IdentificationResult:
        """Identifies them; see `identify_file`."""
        from grabberd.library.jobs.identification import identify_file  # noqa: PLC0415 - the daemon does without it

        return identify_file(progress, context.file(self.subject), self.calibration_frame)
