"""`python -m tests.audit [--seeds N] [--write FILE]`: the audit of many runs; fails on a single lie."""

import argparse
import logging
import sys
import tempfile
from collections.abc import Sequence
from multiprocessing import Pool
from pathlib import Path

from .cases import KINDS
from .judging import Verdict, judged
from .real_time import Row, all_rows, table

HEAD = """# Audit of the account of fields

Made by `make audit`; do not edit. A camera whose pictures have their own number in the corner, a driver, a
computer and what goes wrong with them are drawn at random, up to three kinds of faults at a time: {runs} runs
in simulated time, {fields} fields. Capture thread, content checks, numbering, ring, recorder and capture file
are the program's own. Each capture begins and ends at random, with or without a pre-trigger. Then every field
in the file is compared with the number in its picture and with the camera's clock, and the account's begin
and end with what was asked for. Left out is a clock of the stamps that is set by a few fields on a busy
computer: while every field waits and some are lost, nothing tells that from as many lost ones more or less,
until a field arrives in time.

A lie is a number or a time that is wrong, unless this very field is said to be uncertain by as much, or the
numbers from one before it on to be off by as many; an account that begins or ends elsewhere; or a loss whose
cause is none of what went wrong. There are **{lies} lies**. Of all fields {uncertain} are said to be
uncertain, and therefore damaged.
One capture, also of a daemon: `python -m grabberd_fake audit CAPTURE`.

| what goes wrong, alone or with others | runs | captures complete | fields | uncertain | lies |
|---|---|---|---|---|---|
"""


REAL_TIME = """
## In real time

A daemon with one device at 50 Hz that is measured, a process of its own. Frozen: SIGSTOP, then SIGCONT. What
a killed one leaves is found by the next one in the same folder.

"""


def main() -> int:
    """Audits as many seeds as asked for; the table goes to the terminal, or into a file."""
    parser = argparse.ArgumentParser(description="The account of fields, while everything goes wrong.")
    parser.add_argument("--seeds", type=int, default=1000, help="how many runs")
    parser.add_argument("--real-time", action="store_true", help="the daemon as well: five minutes more")
    parser.add_argument("--write", type=Path, help="the page of the documentation")
    given = parser.parse_args()
    logging.disable()  # every fault is logged as it should be, thousands of times
    with Pool() as pool:
        verdicts = list(pool.imap(judged, range(given.seeds)))
    page, rows = document(verdicts), list[Row]()
    if given.real_time:
        with tempfile.TemporaryDirectory() as folder:
            rows = list(all_rows(Path(folder)))
        page += REAL_TIME + table(rows)
    if given.write is None:
        print(page)
    else:
        given.write.write_text(page, encoding="utf-8")
    lies = [
        f"seed {one.case.seed} ({', '.join(one.case.kinds)}): {lie}" for one in verdicts for lie in one.lies
    ]
    lies += [f"{row.fault}: {lie}" for row in rows for lie in row.lies]
    print("\n".join(lies), file=sys.stderr)
    return bool(lies)


def document(verdicts: Sequence[Verdict]) -> str:
    """The whole page."""
    head = HEAD.format(
        runs=len(verdicts),
        fields=sum(one.found.fields for one in verdicts),
        lies=sum(len(one.lies) for one in verdicts),
        uncertain=sum(one.found.uncertain for one in verdicts),
    )
    return head + "".join(_row(kind, [one for one in verdicts if kind in one.case.kinds]) for kind in KINDS)


def _row(kind: str, verdicts: Sequence[Verdict]) -> str:
    cells = (
        kind,
        len(verdicts),
        sum(one.complete for one in verdicts),
        sum(one.found.fields for one in verdicts),
        sum(one.found.uncertain for one in verdicts),
        sum(len(one.lies) for one in verdicts),
    )
    return "| " + " | ".join(map(str, cells)) + " |\n"


if __name__ == "__main__":
    sys.exit(main())
