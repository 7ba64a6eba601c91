"""Months in minutes.

python -m tests.proofs.months run [--minutes N] [--every S] [--seed N] [--log FILE] [--write FILE]
python -m tests.proofs.months summary LOG [--write FILE]
"""

import argparse
import sys
import tempfile
from pathlib import Path

from .log import Lived, Played, broken, read_lines, summary, write_line
from .plan import lives
from .simulated import Months

EVERY_S, OF_A_LIFE = 10.0, 16
HEADER = """# Months in minutes: all faults in one run

Made by `make soak FAULTS=1`; do not edit. Every few seconds a fault is drawn at random from the lists of
[faults](faults.md): the grabber's within one long capture, those of the computer and of clients beside it.
Then the daemon is killed in mid-capture, or told to stop, and the next one continues in the same folder.
Every field of every file must be accounted for, and every alarm must have cleared before the daemon is
stopped. Of repeated faults, the occurrence that took longest is shown.

"""


def main() -> int:
    """Runs it or reads its log; 1 where a promise was broken."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=["run", "summary"])
    parser.add_argument("read", nargs="?", type=Path, help="the log to be summed up")
    parser.add_argument("--log", type=Path, help="the log to be written, a line for each fault")
    parser.add_argument("--minutes", type=float, default=20.0)
    parser.add_argument(
        "--every", type=float, default=EVERY_S, help="seconds between two faults of the grabber"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--write", type=Path, help="the page of the documentation")
    options = parser.parse_args()
    entries = read_lines(options.read) if options.what == "summary" else _run(options)
    text = summary(entries)
    print(text)
    if options.write:
        options.write.write_text(HEADER + text, encoding="utf-8")
    return int(any(broken(entries)))


def _run(options: argparse.Namespace) -> list[Played | Lived]:
    entries: list[Played | Lived] = []

    def tell(entry: Played | Lived) -> None:
        entries.append(entry)
        print(entry, flush=True)
        if options.log:
            write_line(options.log, entry)

    faults = max(2, round(options.minutes * 60 / options.every))
    with tempfile.TemporaryDirectory() as folder:
        months = Months(Path(folder), tell)
        for number, life in enumerate(lives(options.seed, faults, options.every, OF_A_LIFE)):
            months.live(number, life)
    return entries


if __name__ == "__main__":
    sys.exit(main())
