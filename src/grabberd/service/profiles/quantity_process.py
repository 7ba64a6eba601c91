"""Checks the quantities of a profile in a process of its own: what reads them would stay in the daemon."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from grabberd.documents.named_types import JsonObject
from grabberd.errors import StorageError
from grabberd.storage.disk import storage_errors

PROGRAM = f"from {__name__} import main; main()"
LONGEST_S = 120.0
"""Time for it; it takes a second of processor time, and a busy computer has little."""
_CHECKED = frozenset({"material", "obtained", "analysis", "pulsation", "liner"})
"""Keys under which there are such quantities."""


def problems_in_process(content: JsonObject) -> list[str]:
    """Problems of the quantities in a profile's document.

    Raises:
        StorageError: The process cannot be started, or does not answer in time.
    """
    if not _CHECKED & content.keys():
        return []
    # -P: the current folder may hold a module of any name.
    command = [sys.executable, "-P", "-c", PROGRAM]
    # Dates and the like, which YAML knows and JSON does not, are refused as texts as well.
    text = json.dumps(content, default=str, skipkeys=True)
    with storage_errors(Path(sys.executable)):
        try:
            done = subprocess.run(  # noqa: S603 - our own
                command, input=text, capture_output=True, text=True, timeout=LONGEST_S, check=True
            )
        except subprocess.SubprocessError as error:
            raise StorageError(
                f"the process that checks profiles does not answer: {error}",
                "try again in a moment; memory or processes may have run out",
            ) from error
    found: list[str] = json.loads(done.stdout)
    return found


def main() -> None:
    """Answers the document on standard input with its problems."""
    from grabberd.processes.analysis.profile import quantity_problems  # noqa: PLC0415 - heavy

    content: Any = json.load(sys.stdin)
    print(json.dumps(quantity_problems(content)))
