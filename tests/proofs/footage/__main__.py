"""`make footage`: reads what people bring, writes what comes of it, fails where anything is wrong."""

import argparse
import logging
import shutil
import sys
from collections.abc import Sequence
from functools import partial
from multiprocessing import Pool
from pathlib import Path
from tempfile import TemporaryDirectory

from proofs.footage import false_alarms
from proofs.footage.containers import CONTAINERS, Container
from proofs.footage.faults import COUNT, FAULTS
from proofs.footage.reading import Camera, camera
from proofs.footage.table import ALLOWED_MM, Cell, cells, failures, rows

HEAD = """# Recordings of every kind, and what comes of them

Made by `make footage`; do not edit. The simulated liner is captured, {frames} of its frames are written by
OpenCV and FFmpeg into every kind of file and folder with every fault, and each goes through the program's own
driver, numbering, ring, capture file and measurement. Its points are compared with those of the intact
capture. {cells} recordings were read, with FFmpeg and without.

*Silently wrong* is a recording that is read to its end, is off by more than {allowed:g} mm (with a codec that
changes pixels: by so much more than without a fault), and has no remark that explains it. There are
**{silent}**. Every container without a fault, and with dropped or repeated pictures, drift, jitter and either
order of the fields, has to be read, unless it needs FFmpeg and that is missing: **{unread}** were not.

What has been made of 24 pictures a second by repeating one is compared at the numbers that it has: its own
moments are up to a picture off, which only a remark can say. *What tells it* leaves out what is said of the
same container without the fault.
"""

ALARMS = """
## False alarms

Fields that the judgement of repetitions (`core/chain/repeats.py`) calls repeated. Every fifth frame of each
recording repeats the one before. A field that is called repeated is left out only where something moved: at
rest it shows what was there.

With H.264 the judgement errs both ways. Where a camera's noise is low, the codec itself repeats what hardly
changes: fields at rest are called repeated, and left out once something moves. Of usual noise at crf 23 it
leaves so little that a repeated frame, coded anew, changes by as much as one at rest: most are not found.

"""


def main() -> int:
    """Reads everything; the page goes to the terminal, or into a file."""
    parser = argparse.ArgumentParser(description="Recordings of every kind, and what comes of them.")
    parser.add_argument("--write", type=Path, help="the page of the documentation")
    given = parser.parse_args()
    if not (shutil.which("ffmpeg") and shutil.which("ffprobe")):
        print("FFmpeg is missing: sudo apt-get install ffmpeg", file=sys.stderr)
        return 2
    logging.disable()  # every fault is logged as it should be
    with TemporaryDirectory() as name, Pool(2) as pool:
        alarms = pool.apply_async(false_alarms.rows)
        seen = camera(Path(name), 2 * COUNT + 1)
        found = pool.map(partial(_cells, seen, Path(name)), CONTAINERS, chunksize=1)
        page = document(found, alarms.get())
    wrong = failures([one for read in found for one in read])
    if given.write is None:
        print(page)
    else:
        given.write.write_text(page, encoding="utf-8")
    print("\n".join(wrong), file=sys.stderr)
    return bool(wrong)


def _cells(seen: Camera, folder: Path, container: Container) -> list[Cell]:
    return list(cells(seen, folder, container, FAULTS))


def document(found: Sequence[Sequence[Cell]], alarms: Sequence[str]) -> str:
    """The whole page: of every container its cells, and the rows of the false alarms."""
    every = [one for read in found for one in read]
    wrong = failures(every)
    head = HEAD.format(
        frames=COUNT,
        cells=len(every),
        allowed=ALLOWED_MM,
        silent=sum("silently wrong" in one for one in wrong),
        unread=sum("not read" in one for one in wrong),
    )
    sections = (
        f"\n## {container.title}\n\n" + "".join(rows(read, container))
        for container, read in zip(CONTAINERS, found, strict=True)
    )
    return head + "".join(sections) + ALARMS + "".join(alarms)


if __name__ == "__main__":
    sys.exit(main())
