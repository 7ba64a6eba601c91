"""The last line of defence of the command line: one sentence, and where the traceback is."""

from __future__ import annotations

import os
import sys
import tempfile
import traceback


def explain(error: Exception) -> None:
    """Print one sentence about an error that nobody expected, and keep its traceback."""
    said = " ".join(str(error).split())[:200]
    print(f"grabberd: internal error: {type(error).__name__}: {said}", file=sys.stderr)
    # The journal keeps what a service prints, while its folder of temporary files ends with it.
    if "JOURNAL_STREAM" in os.environ:
        traceback.print_exception(error)
        return
    try:
        descriptor, path = tempfile.mkstemp(prefix="grabberd-error-", suffix=".txt")
        with os.fdopen(descriptor, "w", encoding="utf-8", errors="backslashreplace") as file:
            traceback.print_exception(error, file=file)
    except OSError:
        traceback.print_exception(error)
        return
    print(f"hint: this is a bug in grabberd; please report it with the file {path}", file=sys.stderr)
