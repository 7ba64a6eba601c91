"""Identifications made by hand: which target is where in which view, a CSV file."""

import csv
from pathlib import Path
from typing import Literal

from grabberd.calibration import Mark
from grabberd.errors import InputError

COLUMNS = ("view", "target", "x_px", "y_px")
_HINT = "a header view,target,x_px,y_px, then lines such as left,17,123.5,240"


def read_identifications(path: Path) -> list[Mark]:
    """The identifications in a CSV file.

    Raises:
        InputError: no such file, or lines that are none; the message names the first of them.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = csv.DictReader(file, skipinitialspace=True)
            if missing := set(COLUMNS) - set(rows.fieldnames or ()):
                raise InputError(f"{path} has no column {', '.join(sorted(missing))}", _HINT)
            return [_identification(path, rows.line_num, row) for row in rows]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path} cannot be read: {error}", _HINT) from error


def _identification(path: Path, line: int, row: dict[str, str]) -> Mark:
    view: Literal["left", "right"] = "left" if row["view"] == "left" else "right"
    if row["view"] != view:
        raise InputError(f"{path}, line {line}: view {row['view']!r} is neither left nor right", _HINT)
    try:
        return Mark(view, int(row["target"]), float(row["x_px"]), float(row["y_px"]))
    except (TypeError, ValueError) as error:
        raise InputError(f"{path}, line {line}: {error}", _HINT) from None
