"""The job that finds out which targets of the calibration frame a capture shows."""

from dataclasses import dataclass
from pathlib import Path

from grabberd.documents.named_types import JsonObject
from grabberd.documents.results import IdentificationResult
from grabberd.service.jobs.progress import Progress
from grabberd.service.jobs.runner import JobSpec


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentificationJob(JobSpec):
    """Finds the targets of a calibration frame in a sealed capture of it."""

    kind = "identify"
    path: Path
    calibration_frame: JsonObject

    def run(self, progress: Progress) -> IdentificationResult:
        """Identifies them; see `identify_file`."""
        from grabberd.service.jobs.identification import identify_file  # noqa: PLC0415 - the daemon does without it

        return identify_file(progress, self.path, self.calibration_frame)
