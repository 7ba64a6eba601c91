"""The command line: one file a command; what they do stands in the rooms below.

Exit codes: 0 done; 1 it failed, the message says why; 2 the command line is wrong; 74 the daemon cannot
write its disk; 78 the configuration is wrong.
"""

import os
import sys

from grabberd.errors import ConfigError, GrabberdError

EX_IOERR = 74
EX_CONFIG = 78


def main() -> None:
    """The entry point `grabberd`."""
    # Threads for matrices as small as ours cost more than they give, and disturb the capture thread.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from grabberd.cli.app import app  # noqa: PLC0415 - `import grabberd.cli` stays cheap

    try:
        app()
    except GrabberdError as error:
        complain(error)
        sys.exit(EX_CONFIG if isinstance(error, ConfigError) else 1)


def complain(error: GrabberdError) -> None:
    """Says on the terminal, or in the journal, what failed and what to do."""
    print(f"grabberd: {error.message}\nhint: {error.hint}", file=sys.stderr)
