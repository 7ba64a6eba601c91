"""`make setups`: tries every wrong set-up and writes what the user is told."""

import argparse
from pathlib import Path

from proofs.setups.cases import SETUPS, tried

HEAD = """# Wrong calibration set-ups and their messages

Made by `make setups`; do not edit. Pictures of the calibration frame are rendered with OpenCV's camera model,
which shares no formula with this program, and calibrated as `grabberd calibrate` does it. *Refused*: nothing
is written. *Failed*: the calibration is written, the exit code is 3, and only an admin can activate it. None
of these set-ups passes unnoticed. What each reason means: [acceptance](acceptance.md).

| what was wrong | outcome | what the user is told |
|---|---|---|
"""


def table() -> str:
    """The page."""
    rows = []
    for setup in SETUPS:
        told = tried(setup)
        said = "<br>".join(line.replace("|", "\\|") for line in told.lines)
        rows.append(f"| {setup.wrong} | {told.verdict.replace('_', ' ')} | {said} |\n")
    return HEAD + "".join(rows)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--write", type=Path)
    written = parser.parse_args().write
    if written:
        written.write_text(table(), "utf-8")
    else:
        print(table())


if __name__ == "__main__":
    main()
