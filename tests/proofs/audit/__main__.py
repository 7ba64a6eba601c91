"""`python -m tests.proofs.audit [--seeds N] [--only SEED …] [--write FILE]`: fails on a single lie."""

import argparse
import logging
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from multiprocessing import Pool
from pathlib import Path

from .judging import Verdict, judged
from .real_time import Row, all_rows, table
from .weather import PAIRS, ROWS

HEAD = """# Audit of field numbers, times and ledgers

Made by `make audit`; do not edit. {runs} runs in simulated time, {fields} fields: {hours:.0f} hours of
cameras in {minutes:.0f} minutes of processor time, {speed:.0f} fields a second and {faster:.0f} × real time.

The weather is drawn from the kernel's documentation of V4L2 buffers, flags, field orders and streaming, and
from the faults that grabbers show, not from the code. Every pair of the rows below comes in turn ({pairs}
pairs), half of them with a third one, at random times and for random lengths, before a random stream, camera,
driver and capture. A seed gives the same run for ever; `python -m tests.proofs.audit --only SEED` shows it.
The conversion of V4L2 stamps and counts, capture thread, content checks, numbering, ring and recorder are
the program's own; pictures are numbers. What is true is kept apart. What is said is judged by these rules:

- A number that is not said to be uncertain is the camera's, counted from the begin that was asked for, ± 1
  for all of them, and less what events say. So as many fields are lost between two as it says. Fields that
  the ring no longer had, or not yet, belong to no pre-trigger.
- A number that is uncertain by up to N is off by no more than N.
- The account ends with the field that was exposed last before the stop, ± 1, or after the length asked for.
  Where stamps tick, begin and end may be off by the fields of a tick more.
- A time lies within one period, and one tick of the clock of the stamps, of the middle of the exposure, and
  within N periods more if the number is uncertain by N. Before an event says that the first timestamps were
  late, it may be late by that.
- A loss is blamed on what has cost fields there. A driver needs a free buffer when a field begins; one that
  is lost less than .4 periods after all were full may be blamed on that, too. Only its length tells silence
  of the grabber, of a camera that is away for less than the time in which it is asked for, or of a computer
  that stands for less than three fields, from losses on the bus.
- Events say only what has happened: the count has restarted, the clock was set, the phase has changed.
- An old or damaged picture does not pass for intact, nor an intact one for damaged.

What breaks one of them is a lie. A doubt is needless if the program took every field in time, and nothing but
losses, rates and grids of stamps was wrong. One case is left out: on a busy computer, a timestamp clock that
is set by a few fields. While every field is delayed and some are lost, that cannot be told from losing
more or fewer fields, until one arrives on time.

There are **{lies} lies**, in {liars} runs. {uncertain} fields are declared uncertain, and therefore damaged,
{needless} of them needlessly. To audit a capture of the simulated grabber, also one made by a daemon:
`python -m grabberd_fake audit CAPTURE`.

| weather, alone or with others | runs | captures complete | fields | uncertain | needlessly | lies |
|---|---|---|---|---|---|---|
"""


REAL_TIME = """
## In real time

A daemon as a separate process, which measures one device at 50 Hz. Frozen: SIGSTOP, then SIGCONT. The file
that a killed daemon leaves is recovered by the next one in the same folder.

"""


_FEW = 0.01
"""Share of runs in which the capture may have no field, since none came."""


def main() -> int:
    """Audits as many seeds as asked for; the table goes to the terminal, or into a file."""
    parser = argparse.ArgumentParser(description="The account of fields, in every weather.")
    parser.add_argument("--seeds", type=int, default=1000, help="how many runs")
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--only", type=int, nargs="+", help="these seeds, and what they are")
    parser.add_argument("--real-time", action="store_true", help="the daemon as well: five minutes more")
    parser.add_argument("--write", type=Path, help="the page of the documentation")
    given = parser.parse_args()
    logging.disable()  # every fault is logged as it should be, thousands of times
    seeds = given.only or range(given.first, given.first + given.seeds)
    with Pool() as pool:
        verdicts, took_s = zip(*pool.imap(_timed, seeds, chunksize=4), strict=True)
    page, rows = document(verdicts, sum(took_s)), list[Row]()
    if given.real_time:
        with tempfile.TemporaryDirectory() as folder:
            rows = list(all_rows(Path(folder)))
        page += REAL_TIME + table(rows)
    if given.only:
        print(*(one.case for one in verdicts), sep="\n\n")
    elif given.write is None:
        print(page)
    else:
        given.write.write_text(page, encoding="utf-8")
    lies = list(_lies(verdicts, rows))
    print("\n".join(lies), file=sys.stderr)
    if empty := [one.case.seed for one in verdicts if not one.fields]:
        print(f"{len(empty)} runs without a field: {empty[:9]} …", file=sys.stderr)
    return bool(lies) or len(empty) > _FEW * len(verdicts)


def _timed(seed: int) -> tuple[Verdict, float]:
    begin_s = time.process_time()
    return judged(seed), time.process_time() - begin_s


def _lies(verdicts: Sequence[Verdict], rows: Sequence[Row]) -> Iterator[str]:
    for one in verdicts:
        said = f"seed {one.case.seed} ({', '.join(one.case.names)}; {one.case.weather.order})"
        yield from (f"{said}: {lie}" for lie in one.lies)
    yield from (f"{row.fault}: {lie}" for row in rows for lie in row.lies)


def document(verdicts: Sequence[Verdict], took_s: float) -> str:
    """The whole page, of runs that took so much of a processor's time."""
    fields, camera_s = sum(one.fields for one in verdicts), sum(one.camera_s for one in verdicts)
    head = HEAD.format(
        runs=len(verdicts),
        fields=fields,
        hours=camera_s / 3600,
        minutes=took_s / 60,
        speed=fields / took_s,
        faster=camera_s / took_s,
        pairs=len(PAIRS),
        lies=sum(len(one.lies) for one in verdicts),
        liars=sum(bool(one.lies) for one in verdicts),
        uncertain=sum(one.uncertain for one in verdicts),
        needless=sum(one.needless for one in verdicts),
    )
    return head + "".join(_row(name, [one for one in verdicts if name in one.case.names]) for name in ROWS)


def _row(name: str, verdicts: Sequence[Verdict]) -> str:
    cells = (
        name,
        len(verdicts),
        sum(one.complete for one in verdicts),
        sum(one.fields for one in verdicts),
        sum(one.uncertain for one in verdicts),
        sum(one.needless for one in verdicts),
        sum(len(one.lies) for one in verdicts),
    )
    return "| " + " | ".join(map(str, cells)) + " |\n"


if __name__ == "__main__":
    sys.exit(main())
