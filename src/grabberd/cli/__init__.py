"""The command line: one file per command; the work is done in the rooms below.

Exit codes: 0 success; 1 failure, explained by the message; 2 invalid command line; 74 the daemon cannot
write to its disk; 78 invalid configuration.
"""

import os
import sys

from grabberd.errors import ConfigError, GrabberdError

# From sysexits.h. The systemd unit does not restart on 78: restarting cannot fix a bad configuration.
EX_IOERR = 74
EX_CONFIG = 78


def main() -> None:
    """Entry point of the command `grabberd`."""
    # OpenBLAS threads cost more than they gain on matrices this small, and disturb the capture thread.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from grabberd.cli.app import app  # noqa: PLC0415 - `import grabberd.cli` stays cheap

    try:
        app()
    except GrabberdError as error:
        complain(error)
        sys.exit(EX_CONFIG if isinstance(error, ConfigError) else 1)


def complain(error: GrabberdError) -> None:
    """Print what failed and what to do about it, to the terminal or the journal."""
    print(f"grabberd: {error.message}\nhint: {error.hint}", file=sys.stderr)
