"""The command line: one file per command; the work is done in the rooms below.

Exit codes: 0 success; 1 failure, explained by the message; 2 invalid command line; 3 a bad verdict; 70 an
error of grabberd itself; 74 the daemon cannot write to its disk, or a command its output; 78 invalid
configuration.
"""

from __future__ import annotations

import errno
import os
import signal
import sys

TYPE_CHECKING = False  # that of `typing`, which takes a while to import
if TYPE_CHECKING:
    from collections.abc import Callable

    from grabberd.errors import GrabberdError

EX_BAD_VERDICT = 3
"""Exit code of a command that judges, if what it judges is bad or cannot be judged."""
# From sysexits.h. The systemd unit does not restart on 78: restarting cannot fix a bad configuration.
EX_SOFTWARE = 70
EX_IOERR = 74
EX_CONFIG = 78
EX_INTERRUPTED = 130
"""128 + SIGINT, as shells report a command ended by Ctrl-C."""
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EIO)


def main() -> None:
    """Entry point of the command `grabberd`."""
    # OpenBLAS threads cost more than they gain on matrices this small, and disturb the capture thread.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    app = _imported_app()
    from grabberd.errors import ConfigError, GrabberdError  # noqa: PLC0415 - imported by now

    try:
        try:
            app()
        finally:
            sys.stdout.flush()  # here, where it can be explained, and not when the interpreter ends
    except GrabberdError as error:
        complain(error)
        sys.exit(EX_CONFIG if isinstance(error, ConfigError) else 1)
    except KeyboardInterrupt:  # where typer has not begun yet, or has ended
        _say_interrupted()
        sys.exit(EX_INTERRUPTED)
    except SystemExit as ended:  # typer has made it of whatever ended the command
        if ended.code == EX_INTERRUPTED and _was_interrupted(ended):
            _say_interrupted()
        raise
    except BrokenPipeError:  # `| head` has seen enough
        _drop_output()
        sys.exit(1)
    except Exception as error:
        sys.exit(_explained(error))


def _explained(error: Exception) -> int:
    """Say what an error means that no part of the program has put into words; return the exit code."""
    from grabberd.errors import NO_PERMISSION, StorageError  # noqa: PLC0415 - imported by now

    if isinstance(error, OSError) and error.errno in _NO_ROOM:
        _drop_output()
        complain(StorageError(f"the output cannot be written: {error.strerror}", "make room on its disk"))
        return EX_IOERR
    if isinstance(error, PermissionError) and error.filename:
        complain(StorageError(f"no permission for {error.filename}", NO_PERMISSION))
        return 1
    explain(error)
    return EX_SOFTWARE


def explain(error: Exception) -> None:
    """Print one sentence about an error that nobody expected, and keep its traceback."""
    import tempfile  # noqa: PLC0415 - rarely needed
    import traceback  # noqa: PLC0415 - rarely needed

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


def _imported_app() -> Callable[[], None]:
    """Import the command that is asked for, or all of them; `import grabberd.cli` stays cheap."""
    # An interrupt ends it without an exception: what is being imported may make another one of it.
    before = signal.getsignal(signal.SIGINT)
    if before is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end_at_once)
    from grabberd.cli.application import application, commands, groups, is_own  # noqa: PLC0415

    first = sys.argv[1] if len(sys.argv) > 1 else ""
    if is_own(first) or first in commands() or first in groups():
        app = application(first)
    else:
        from grabberd.cli.app import app  # noqa: PLC0415
    signal.signal(signal.SIGINT, before)
    return app


def _end_at_once(*_: object) -> None:
    """Handle an interrupt before anything has begun that would have to be ended."""
    _say_interrupted()
    os._exit(EX_INTERRUPTED)


def _say_interrupted() -> None:
    print("grabberd: interrupted", file=sys.stderr, flush=True)


def _was_interrupted(error: BaseException | None) -> bool:
    """Tell whether Ctrl-C is what an error comes from, and not the command's own words."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__context__
    return error is not None


def _drop_output() -> None:
    """Send what is left in the buffer nowhere: the interpreter would complain again at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def complain(error: GrabberdError) -> None:
    """Print what failed and what to do about it, to the terminal or the journal."""
    print(f"grabberd: {error.message}\nhint: {error.hint}", file=sys.stderr)
