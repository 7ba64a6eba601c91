"""Function that a calibration job runs: the program's own, or another one."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from grabberd.documents.named_types import JsonObject
from grabberd.documents.requests import CalibrationOptions
from grabberd.work.progress import Progress

if TYPE_CHECKING:  # what calibrates is imported where a job runs: the daemon does without its memory
    from grabberd.library.jobs.calibration import CalibrationOutput


class Calibrator(Protocol):
    """A function at module level that calibrates from captures, such as `calibrate_captures`."""

    def __call__(
        self,
        progress: Progress,
        *,
        paths: Sequence[Path],
        calibration_frame: JsonObject,
        options: CalibrationOptions,
        note: str | None,
        previous: JsonObject | None,
    ) -> "CalibrationOutput":
        """Calibrates; nothing is written."""
        ...


def calibrate_captures(progress: Progress, **given: Any) -> "CalibrationOutput":
    """Calibrates as `calibrate_files` does, which takes whatever is given."""
    from grabberd.library.jobs.calibration import calibrate_files  # noqa: PLC0415

    return calibrate_files(progress, **given)
