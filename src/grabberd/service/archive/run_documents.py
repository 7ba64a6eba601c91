"""How a run is shown."""

from pathlib import Path
from typing import Any

from grabberd.storage import CaptureReader, RunInfo

MADE_WITH = ("calibration", "object", "settings")


def run_document(run: RunInfo) -> dict[str, Any]:
    """A run in short."""
    return {
        "run": run.run,
        "kind": run.kind,
        "created_utc": run.created_utc,
        "version": run.version,
        "state": run.state,
    }


def whole_run(path: Path, run: int) -> dict[str, Any]:
    """A run with the documents that its points were made with.

    Raises:
        CaptureFileError: the file cannot be read.
        NotFound: there is no such run.
    """
    with CaptureReader(path) as reader:
        found = reader.run(run)
        known = {key: found.made_with.get(key) for key in MADE_WITH}
        return run_document(found) | {"made_with": known}
