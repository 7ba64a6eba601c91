"""The command line: one file a command; what they do stands in the rooms below.

Exit codes: 0 done; 1 it failed, the message says why; 2 the command line is wrong; 78 the configuration is
wrong.
"""

import os
import sys

from grabberd.errors import ConfigError, GrabberdError

EX_CONFIG = 78


def main() -> None:
    """The entry point `grabberd`."""
    # Threads for matrices as small as ours cost more than they give, and disturb the capture thread.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from grabberd.cli.app import app  # noqa: PLC0415 - `import grabberd.cli` stays cheap

    try:
        app()
    except GrabberdError as error:
        print(f"grabberd: {error.message}\nhint: {error.hint}", file=sys.stderr)
        sys.exit(EX_CONFIG if isinstance(error, ConfigError) else 1)
