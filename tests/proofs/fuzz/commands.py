"""Commands of the program, run in this process as from a shell, silently."""

import contextlib
import io
import os
import sys
from unittest import mock

from grabberd.cli import EX_SOFTWARE, main


class Traceback(Exception):
    """A command ended by an error of the program itself."""


def run_command(*words: str) -> int:
    """Runs a command and returns its exit code.

    Raises:
        Traceback: The command met an error of the program itself.
    """
    said = io.StringIO()
    with (
        mock.patch.object(sys, "argv", ["grabberd", *words]),
        contextlib.redirect_stdout(said),
        contextlib.redirect_stderr(said),
        mock.patch.dict(os.environ, {"COLUMNS": "200", "TERM": "dumb"}),
        mock.patch("grabberd.cli.explain", _explain),
    ):
        try:
            main()
        except SystemExit as ended:
            code = ended.code
        else:
            code = 0
    if code == EX_SOFTWARE:
        raise Traceback(said.getvalue())
    return code if isinstance(code, int) else int(code is not None)


def _explain(error: Exception) -> None:
    raise Traceback(f"{type(error).__name__}: {error}") from error
