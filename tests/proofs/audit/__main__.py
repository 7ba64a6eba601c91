"""`python -m tests.proofs.audit [--seeds N] [--write FILE]`: audits many runs; fails on a single lie."""

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

HEAD = """# Audit of field numbers, times and ledgers

Made by `make audit`; do not edit. {runs} runs in simulated time, {fields} fields, with a camera whose
pictures show their own number in a corner. Camera, driver, computer and up to three kinds of faults at a time
are drawn at random. Capture thread, content checks, numbering, ring, recorder and capture file are the
program's own. Each capture starts and ends at a random time, with or without a pre-trigger. Then every field
in the file is compared with the number in its picture and with the camera's clock, and the start and end of
the ledger with the request. One case is left out: on a busy computer, a timestamp clock that is set by a few
fields. While every field is delayed and some are lost, that cannot be told from losing more or fewer fields,
until one arrives on time.

An error is a wrong number or time that the file does not declare, either as uncertain by that much in this
field, or as off by that many from an earlier field on; a ledger that starts or ends at the wrong field; or a
loss blamed on something that did not go wrong. There are **{lies} errors**. {uncertain} of all fields are
declared uncertain, and therefore damaged.
To audit a capture, also one made by a daemon: `python -m grabberd_fake audit CAPTURE`.

| fault, alone or with others | runs | captures complete | fields | uncertain | errors |
|---|---|---|---|---|---|
"""


REAL_TIME = """
## In real time

A daemon as a separate process, which measures one device at 50 Hz. Frozen: SIGSTOP, then SIGCONT. The file
that a killed daemon leaves is recovered by the next one in the same folder.

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
