"""A process that reads hostile files, one after the other; the parent watches what becomes of it.

    python -m proofs.fuzz.child SAMPLES TARGET SEED COUNT FILE

The file that is read stands in FILE, and its number on a line of the output, before it is read.
"""

import faulthandler
import resource
import signal
import sys
import traceback
import warnings
from pathlib import Path
from random import Random

from proofs.fuzz.targets import TARGETS, attempt, prepare

MEMORY_GROWTH = 400 << 20
"""Bytes of resident memory beyond the first file's, which imports what is needed."""
DEADLINE_S = 30
"""Processor time for one file."""
FINDING = 99


class TooSlow(BaseException):
    """The deadline is over."""


def main(samples: str, name: str, seed: str, count: str, file: str) -> None:
    """Reads files until there is a finding, or all have been read."""
    faulthandler.enable()
    warnings.simplefilter("ignore")
    signal.signal(signal.SIGPROF, _end)
    target, path, random = TARGETS[name], Path(file), Random(int(seed))
    most = 0
    for number in range(int(count)):
        prepare(random, Path(samples), target.kind, path)
        kept = path.with_suffix(".kept")
        kept.write_bytes(path.read_bytes())  # commands may write into a capture
        print(number, flush=True)
        signal.setitimer(signal.ITIMER_PROF, DEADLINE_S)
        try:
            attempt(target, path)
        except TooSlow:
            traceback.print_exc()
            sys.exit(FINDING)
        except Exception:
            traceback.print_exc()
            sys.exit(FINDING)
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        most = most or peak + MEMORY_GROWTH
        if peak > most:
            print(f"memory: {peak >> 20} MB", file=sys.stderr)
            sys.exit(FINDING)


def _end(*_: object) -> None:
    raise TooSlow


if __name__ == "__main__":
    main(*sys.argv[1:])
