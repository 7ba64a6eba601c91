"""`make setups`: tries every wrong set-up and writes what the user is told."""

import argparse
from pathlib import Path

from setups.cases import SETUPS, tried

HEAD = """# What was wrong → what the user is told

Written by `make setups`, from pictures of the calibration frame by OpenCV's camera model, without any formula
of this program: every set-up below is calibrated as `grabberd calibrate` does it. *Refused* means: nothing
is written; a calibration that *failed* is written, exits with 3, and needs an admin to be used. None of them
passes without a word. What each reason means: [acceptance](acceptance.md).

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
