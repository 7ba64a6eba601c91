"""`python -m tests.house.locks [--write] [NAME …]`: this program compared with what is kept."""

import os
import sys

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from .differences import told
from .register import LOCKS, keep
from .state import make


def main() -> int:
    """Compares or, with `--write`, keeps; the exit status is 1 if a lock does not hold."""
    named = [word for word in sys.argv[1:] if word in LOCKS] or list(LOCKS)
    if "--write" in sys.argv:
        if "state" in named:
            make()
        for name in named:
            keep(name)
        return 0
    broken = {name: found for name in named if (found := LOCKS[name].compared(name))}
    for name, found in broken.items():
        print(f"{name}: {len(found)} differences\n{told(found)}\n")
    print(f"{len(named) - len(broken)} of {len(named)} locks hold")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
