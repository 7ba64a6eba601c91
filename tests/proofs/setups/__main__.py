"""`make setups`: tries every wrong set-up with every kind of frame, and writes what the user is told."""

import argparse
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from multiprocessing import get_context
from pathlib import Path

from proofs.setups.cases import SETUPS, UNREMARKED, Setup, Told, tried_by_number
from proofs.setups.pictures import FRAMES

BITS = (8, 1)
PROCESSES = 2
HEAD = """# Wrong calibration set-ups and their messages

Made by `make setups`; do not edit. Pictures of calibration frames are rendered with OpenCV's camera model,
which shares no formula with this program, and calibrated as `grabberd calibrate` does it. *Refused*: nothing
is written. *Failed*: the calibration is written, the exit code is 3, and only an admin can activate it. What
each reason means: [acceptance](acceptance.md).

Three frames of the paper's 108 targets: *irregular*, whose depths tell how it stands; *regular*, which looks
the same turned by half and mirrored; *marked*, the regular one with the one target more that the program asks
for. A calibration of the regular one is told how it stands (`--turn 0`), except where the picture is
mirrored: a person who looks finds no answer then, and reads what that means. Each at 8 bits in 288 lines and
at 1 bit in doubled ones. *Other cause*: something else is said than what is wrong.

"""
COLUMNS = ("what was wrong", *(f"{frame}, 8 / 1 bit" for frame in FRAMES), "what the user is told, 8 bits")


def outcome(setup: Setup, frame: str, told: Told) -> str:
    """A cell of the table."""
    said = told.verdict.replace("passed_with_remarks", "remark")
    if told.says(setup.told_of(frame)) or setup.told_of(frame) == told.verdict:
        return said
    return "**silent**" if told.verdict == UNREMARKED else f"{said} (other cause)"


def page() -> str:
    """The page, with the number of cells and of what they lack."""
    cases = [case for case in product(range(len(SETUPS)), FRAMES, BITS) if case[1] in SETUPS[case[0]].frames]
    with ProcessPoolExecutor(PROCESSES, get_context("spawn")) as pool:
        told = dict(zip(cases, pool.map(tried_by_number, *zip(*cases, strict=True)), strict=True))
    cells = {case: outcome(SETUPS[case[0]], case[1], one) for case, one in told.items()}
    silent = sum("silent" in one for one in cells.values())
    other = sum("other cause" in one for one in cells.values())
    counted = f"{len(SETUPS)} set-ups, {len(cells)} cells: {silent} silent, {other} with another cause.\n\n"
    rows = [COLUMNS, ("---",) * len(COLUMNS)]
    for index, setup in enumerate(SETUPS):
        by_frame = (" / ".join(cells.get((index, frame, bits), "") for bits in BITS) for frame in FRAMES)
        lines = told[index, setup.frames[0], 8].lines
        said = "<br>".join(line.replace("|", "\\|") for line in lines)
        rows.append((setup.wrong, *("–" if one == " / " else one for one in by_frame), said))
    return HEAD + counted + "".join(f"| {' | '.join(row)} |\n" for row in rows)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--write", type=Path)
    written = parser.parse_args().write
    if written:
        written.write_text(page(), "utf-8")
    else:
        print(page())


if __name__ == "__main__":
    main()
