"""CSV files that people give: true positions of targets, identifications made by hand, vacuum logs."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

import numpy as np

from grabberd.bounded_documents import LARGEST_TABLE, csv_records, read_text
from grabberd.core.calibration import Mark
from grabberd.core.reconstruction.accuracy import Truth
from grabberd.errors import InputError

POSITION = ("x_mm", "y_mm", "z_mm")
TRUTH_COLUMNS = ("target", *POSITION)
WHOLE = ("n", "target")
MARK_COLUMNS = ("view", "target", "x_px", "y_px")
_TRUTH_HINT = f"it needs {', '.join(TRUTH_COLUMNS)}; n is optional"
_MARK_HINT = "a header view,target,x_px,y_px, then lines such as left,17,123.5,240"

_Row = dict[str, str]


def read_truth(path: Path) -> Truth:
    """Reads the true positions of targets.

    Columns are target, x_mm, y_mm, z_mm. With a column n a row holds for that field, without it for every
    field. A column `visible` (1 or 0) tells if the target can be seen in both views; without it all can.

    Raises:
        InputError: A column is missing or a value is not a number; the message names the line.
    """
    with _rows(path, TRUTH_COLUMNS, _TRUTH_HINT) as lines:
        rows = [_numbers(row, line, path) for line, row in lines]
    if not rows:
        raise InputError(f"{path} has no rows", "give a row for each target")
    _check_unique(rows, path)
    return Truth(
        n=np.array([row["n"] for row in rows], np.int64) if "n" in rows[0] else None,
        target=np.array([row["target"] for row in rows], np.int32),
        xyz_mm=np.array([[row[name] for name in POSITION] for row in rows]),
        expected=np.array([row.get("visible", 1) != 0 for row in rows]),
    )


def read_vacuum_log(path: Path) -> str:
    """Reads the text of a vacuum logger's file.

    Raises:
        InputError: It cannot be read.
    """
    try:
        return read_text(path, LARGEST_TABLE)
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be read: {error}", "give the logger's CSV file") from error


def read_identifications(path: Path) -> list[Mark]:
    """Reads identifications made by hand: which target is at which position of which view.

    Raises:
        InputError: The file cannot be read, or a line is invalid; the message names the first such line.
    """
    with _rows(path, MARK_COLUMNS, _MARK_HINT) as lines:
        return [_mark(row, line, path) for line, row in lines]


@contextmanager
def _rows(path: Path, columns: Sequence[str], hint: str) -> Iterator[Iterator[tuple[int, _Row]]]:
    """The rows of a file with the numbers of their lines."""
    try:
        yield csv_records(read_text(path, LARGEST_TABLE), columns)
    except KeyError as error:
        raise InputError(f"{path} has no column {error.args[0]}", hint) from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be read: {error}", hint) from error


def _numbers(row: _Row, line: int, path: Path) -> dict[str, float]:
    wanted = [name for name in ("n", *TRUTH_COLUMNS, "visible") if name in row]
    try:
        numbers = {name: float(row[name]) for name in wanted}
    except ValueError as error:
        raise InputError(f"{path}, line {line}: {error}", "every value has to be a number") from error
    for name, value in numbers.items():
        if not math.isfinite(value) or (name in WHOLE and not _is_whole(value)):
            kind = "a whole number" if name in WHOLE else "a number"
            raise InputError(f"{path}, line {line}: {name} {row[name]} is not {kind}", "fix this line")
    if numbers.get("visible", 1) not in (0, 1):
        raise InputError(f"{path}, line {line}: visible {row['visible']} is neither 1 nor 0", "fix this line")
    return numbers


def _is_whole(value: float) -> bool:
    """True for a whole number that arrays of int32 hold."""
    return value == int(value) and abs(value) < 1 << 31


def _check_unique(rows: list[dict[str, float]], path: Path) -> None:
    count = Counter((row.get("n"), row["target"]) for row in rows)
    (n, target), most = count.most_common(1)[0]
    if most > 1:
        where = f"target {target:.0f}" + ("" if n is None else f" in field {n:.0f}")
        raise InputError(f"{path} has {most} rows of {where}", "keep one of them")


def _mark(row: _Row, line: int, path: Path) -> Mark:
    view: Literal["left", "right"] = "left" if row["view"] == "left" else "right"
    if row["view"] != view:
        raise InputError(f"{path}, line {line}: view {row['view']!r} is neither left nor right", _MARK_HINT)
    try:
        mark = Mark(view, int(row["target"]), float(row["x_px"]), float(row["y_px"]))
    except ValueError as error:
        raise InputError(f"{path}, line {line}: {error}", _MARK_HINT) from None
    if not (math.isfinite(mark.x_px) and math.isfinite(mark.y_px) and _is_whole(mark.target)):
        raise InputError(f"{path}, line {line}: {', '.join(row.values())} is out of range", _MARK_HINT)
    return mark
