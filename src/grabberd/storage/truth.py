"""A CSV file that says where targets really are."""

import csv
import math
from collections import Counter
from pathlib import Path

import numpy as np

from grabberd.errors import InputError
from grabberd.reconstruction.accuracy.ground_truth import Truth

PLACE = ("x_mm", "y_mm", "z_mm")
REQUIRED = ("target", *PLACE)
WHOLE = ("n", "target")


def read_truth(path: Path) -> Truth:
    """Columns target, x_mm, y_mm, z_mm; with a column n a row holds for that field, without for every field.

    A column `visible` (1 or 0) says whether the target can be seen in both views; without it all can.

    Raises:
        InputError: a column is missing or a value is no number; the message names the line.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            return _read(csv.DictReader(file), path)
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path} cannot be read: {error}", "name a CSV file") from error


def _read(reader: "csv.DictReader[str]", path: Path) -> Truth:
    names = reader.fieldnames or []
    if missing := [name for name in REQUIRED if name not in names]:
        raise InputError(
            f"{path} has no column {', '.join(missing)}", f"it needs {', '.join(REQUIRED)}; n is optional"
        )
    rows = [_numbers(row, reader.line_num, path) for row in reader]
    if not rows:
        raise InputError(f"{path} has no rows", "give a row for each target")
    _check_unique(rows, path)
    return Truth(
        n=np.array([row["n"] for row in rows], np.int64) if "n" in names else None,
        target=np.array([row["target"] for row in rows], np.int32),
        xyz_mm=np.array([[row[name] for name in PLACE] for row in rows]),
        expected=np.array([row.get("visible", 1) != 0 for row in rows]),
    )


def _numbers(row: dict[str, str], line: int, path: Path) -> dict[str, float]:
    wanted = [name for name in ("n", *REQUIRED, "visible") if name in row]
    try:
        numbers = {name: float(row[name]) for name in wanted}
    except (TypeError, ValueError) as error:
        raise InputError(f"{path}, line {line}: {error}", "every value has to be a number") from error
    for name, value in numbers.items():
        if not math.isfinite(value) or (name in WHOLE and value != int(value)):
            kind = "a whole number" if name in WHOLE else "a number"
            raise InputError(f"{path}, line {line}: {name} {row[name]} is not {kind}", "mend this line")
    return numbers


def _check_unique(rows: list[dict[str, float]], path: Path) -> None:
    count = Counter((row.get("n"), row["target"]) for row in rows)
    (n, target), most = count.most_common(1)[0]
    if most > 1:
        where = f"target {target:.0f}" + ("" if n is None else f" in field {n:.0f}")
        raise InputError(f"{path} has {most} rows of {where}", "keep one of them")
