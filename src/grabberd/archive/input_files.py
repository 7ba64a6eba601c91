"""Tables that people give: true positions of targets, identifications made by hand, vacuum logs."""

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Literal, cast

import numpy as np

from grabberd.bounded_documents import LARGEST_TABLE, read_text
from grabberd.core.calibration.identification.manual_identification import Mark
from grabberd.core.reconstruction.accuracy import Truth
from grabberd.errors import InputError
from grabberd.tables import Cells, TableError, keyed_cells

POSITION = ("x_mm", "y_mm", "z_mm")
TRUTH_COLUMNS = ("target", *POSITION)
OPTIONAL = ("n", "visible")
WHOLE = ("n", "target", "visible")
VIEWS = ("left", "right")
MARK_COLUMNS = ("view", "target", "x_px", "y_px")
_TRUTH_HINT = f"it needs {', '.join(TRUTH_COLUMNS)}; n and visible are optional"
_MARK_HINT = "a header view,target,x_px,y_px, then lines such as left,17,123.5,240"


def read_truth(path: Path) -> Truth:
    """Reads the true positions of targets.

    Columns are target, x_mm, y_mm, z_mm. With a column n a row holds for that field, without it for every
    field. A column `visible` (1 or 0) tells if the target can be seen in both views; without it all can.

    Raises:
        InputError: A column is missing or a value is not a number; the message names the line.
    """
    cells = _cells(path, TRUTH_COLUMNS, _TRUTH_HINT, OPTIONAL)
    columns = _numbers(path, cells, cells.columns)
    if not cells.lines:
        raise InputError(f"{path} has no rows", "give a row for each target")
    _check_unique(columns, path)
    return Truth(
        n=np.array(columns["n"], np.int64) if "n" in columns else None,
        target=np.array(columns["target"], np.int32),
        xyz_mm=np.column_stack([columns[name] for name in POSITION]),
        expected=np.array(columns.get("visible", np.ones(len(cells.lines)))) != 0,
    )


def read_table_text(path: Path) -> str:
    """Reads the text of a table, such as a vacuum logger's file.

    Raises:
        InputError: It cannot be read.
    """
    try:
        return read_text(path, LARGEST_TABLE)
    except (OSError, ValueError) as error:
        hint = "give the table as text; Excel saves it as 'CSV UTF-8'"
        raise InputError(f"{path} cannot be read: {error}", hint) from error


def read_identifications(path: Path) -> list[Mark]:
    """Reads identifications made by hand: which target is at which position of which view.

    Raises:
        InputError: The file cannot be read, or a line is invalid; the message names the first such line.
    """
    cells = _cells(path, MARK_COLUMNS, _MARK_HINT)
    for line, view in zip(cells.lines, cells.columns["view"], strict=True):
        if view not in VIEWS:
            raise InputError(f"{path}, line {line}: view {view!r} is neither left nor right", _MARK_HINT)
    views = cast("list[Literal['left', 'right']]", cells.columns["view"])
    numbers = _numbers(path, cells, MARK_COLUMNS[1:])
    return [
        Mark(view, int(target), x_px, y_px)
        for view, target, x_px, y_px in zip(views, *(numbers[name] for name in MARK_COLUMNS[1:]), strict=True)
    ]


def _cells(path: Path, columns: Sequence[str], hint: str, optional: Sequence[str] = ()) -> Cells:
    try:
        return keyed_cells(read_text(path, LARGEST_TABLE), columns, optional, hint=hint)
    except OSError as error:
        raise InputError(
            f"{path} cannot be read: {error.strerror or error}", "name a file that is there"
        ) from error
    except ValueError as error:
        raise InputError(f"{path} cannot be read: {error}", getattr(error, "hint", hint)) from error


def _numbers(path: Path, cells: Cells, names: Iterable[str]) -> dict[str, list[float]]:
    try:
        numbers = cells.numbers(names, WHOLE)
    except TableError as error:
        raise InputError(f"{path} cannot be read: {error}", error.hint) from error
    for name in WHOLE:
        for line, value in zip(cells.lines, numbers.get(name, ()), strict=False):
            if value != int(value) or abs(value) >= 1 << 31:
                why = f"{name} {value:g} is not a whole number"
            elif name == "visible" and value not in (0, 1):
                why = f"visible {value:g} is neither 1 nor 0"
            else:
                continue
            raise InputError(f"{path}, line {line}: {why}", "fix this line")
    return numbers


def _check_unique(columns: dict[str, list[float]], path: Path) -> None:
    fields = columns.get("n", [None] * len(columns["target"]))
    count = Counter(zip(fields, columns["target"], strict=True))
    (n, target), most = count.most_common(1)[0]
    if most > 1:
        where = f"target {target:.0f}" + ("" if n is None else f" in field {n:.0f}")
        raise InputError(f"{path} has {most} rows of {where}", "keep one of them")
