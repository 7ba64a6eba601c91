"""Object model: nominal positions of an object's targets, and their grid."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array, Indices
from grabberd.core.geometry import Reading
from grabberd.core.geometry.document_reader import is_integer, told_once


class FileKey(NamedTuple):
    """Key of an object file.

    Attributes:
        kind: What its value is, with the values that are allowed.
        unit: Unit of its value; empty for none.
        default: Value that it has when it is left out; None if it is required.
        meaning: What it stands for.
    """

    kind: str
    unit: str
    default: str | None
    meaning: str


KEYS: Mapping[str, FileKey] = MappingProxyType(
    {
        "name": FileKey("text", "", None, "Name used in reports and messages."),
        "target_diameter_mm": FileKey(
            "number above 0",
            "mm",
            None,
            "Diameter of the discs. Together with the rig it gives the size of a target in the picture.",
        ),
        "sigma_mm": FileKey(
            "number from 0",
            "mm",
            None,
            "Standard deviation of each nominal coordinate: from the certificate (.01), or that of "
            "targets placed by hand (.3).",
        ),
        "homologous": FileKey(
            "`true` or `false`",
            "",
            "true",
            "Whether a target marks the same point of the surface in all fields; `false` for projected ones.",
        ),
        "normal": FileKey(
            "three numbers",
            "",
            "that of the surface which the grid forms; a calibration frame's: [0, 0, 1]",
            "Direction in which all discs face, X, Y and Z, where they do not lie flat in their grid's "
            "surface, as on a stepped frame: no view sees a disc's centre in the middle of its picture.",
        ),
        "targets": FileKey("list", "", None, "The targets, one or more, in any order."),
    }
)
"""Keys of an object file."""
TARGET_KEYS: Mapping[str, FileKey] = MappingProxyType(
    {
        "id": FileKey("whole number from 0", "", None, "Number of the target, unique in the file."),
        "x_mm": FileKey("number", "mm", None, "Nominal position in the object's frame: X, down the picture."),
        "y_mm": FileKey("number", "mm", None, "Y, to the right, along the base."),
        "z_mm": FileKey("number", "mm", None, "Z, toward the cameras."),
        "row": FileKey(
            "whole number",
            "",
            None,
            "Row of the target in the grid: neighbours differ by one in row or column, holes are allowed.",
        ),
        "column": FileKey("whole number", "", None, "Column of the target; no two share row and column."),
        "sigma_mm": FileKey(
            "number from 0",
            "mm",
            "the file's `sigma_mm`",
            "Standard deviation of this target's position, if it differs from the others'.",
        ),
    }
)
"""Keys of a target."""
FACING = (0.0, 0.0, 1.0)
"""Normal of a calibration frame's discs that states none: they face the cameras."""
_OWN_SIGMA = "sigma_mm"
_PLACE_KEYS = tuple(key for key in TARGET_KEYS if key != _OWN_SIGMA)
_HINT = "fix the file; every target needs its own id and its own grid position"


class _Target(NamedTuple):
    """Target entry of the file."""

    id: int
    x_mm: float
    y_mm: float
    z_mm: float
    row: int
    column: int
    sigma_mm: float = math.nan


@dataclass(frozen=True, slots=True, eq=False)
class ObjectModel:
    """Model of N targets; the file of a calibration frame has the same form.

    Attributes:
        name: Name of the object.
        target: (N,) int32, ids, ascending.
        xyz_mm: (N, 3) float64, nominal positions in the object's frame.
        row: (N,) int32, row of the target grid; neighbours differ by one in row or column.
        column: (N,) int32, column of the target grid.
        target_diameter_mm: Diameter of the discs.
        sigma_mm: Standard deviation of the nominal positions, in each coordinate.
        homologous: True if a target is the same material point in every field; False for a projected pattern,
            or if ids are reassigned.
        own_sigma_mm: (N,) standard deviations of the targets that have one of their own, NaN for the others;
            None if no target has.
        normal: Direction in which all discs face, in the object's frame; None where it is not stated.
    """

    name: str
    target: NDArray[np.int32]
    xyz_mm: Array
    row: NDArray[np.int32]
    column: NDArray[np.int32]
    target_diameter_mm: float
    sigma_mm: float
    homologous: bool = True
    own_sigma_mm: Array | None = None
    normal: tuple[float, float, float] | None = None

    def __len__(self) -> int:
        return len(self.target)

    @classmethod
    def from_document(cls, document: Mapping[str, object], what: str = "the object file") -> "ObjectModel":
        """Read the model from a YAML file's content.

        Args:
            document: The content.
            what: How a refusal calls the file.

        Raises:
            InputError: A key is missing, unknown or of the wrong type, or an id or grid position is given
                twice; the message lists every problem, and one that many targets have only once.
        """
        reading = Reading(what)
        reading.keys("", document, tuple(KEYS))
        name = reading.text(document, "name")
        diameter = reading.number(document, "target_diameter_mm", positive=True)
        sigma = reading.number(document, "sigma_mm")
        if sigma < 0:
            reading.refuse("sigma_mm", sigma, "a number from 0")
        homologous = document.get("homologous", True)
        if not isinstance(homologous, bool):
            reading.refuse("homologous", homologous, "true or false")
        targets = _targets(reading, document.get("targets"))
        _check_unique(reading, "id", targets, lambda target: (target.id,))
        _check_unique(reading, "row, column", targets, lambda target: (target.row, target.column))
        normal = _normal(reading, document.get("normal"))
        reading.finish(_HINT)
        columns = tuple(zip(*sorted(targets), strict=True))
        return cls(
            name=name,
            target=np.array(columns[0], np.int32),
            xyz_mm=np.array(columns[1:4], np.float64).T.copy(),
            row=np.array(columns[4], np.int32),
            column=np.array(columns[5], np.int32),
            target_diameter_mm=diameter,
            sigma_mm=sigma,
            homologous=bool(homologous),
            own_sigma_mm=None if np.isnan(columns[6]).all() else np.array(columns[6], np.float64),
            normal=normal,
        )

    @property
    def target_sigma_mm(self) -> Array:
        """(N,) standard deviation of each nominal position: its own, or else that of all."""
        if self.own_sigma_mm is None:
            return np.full(len(self), self.sigma_mm)
        return np.where(np.isnan(self.own_sigma_mm), self.sigma_mm, self.own_sigma_mm)

    def select(self, index: Indices) -> "ObjectModel":
        """Some of the targets, by their indices, ascending."""
        own = None if self.own_sigma_mm is None else self.own_sigma_mm[index]
        return replace(
            self,
            target=self.target[index],
            xyz_mm=self.xyz_mm[index],
            row=self.row[index],
            column=self.column[index],
            own_sigma_mm=own,
        )

    def with_target(self, xyz_mm: Array) -> "ObjectModel":
        """Add a target at a place (3,), with a row and column of its own."""
        own = None if self.own_sigma_mm is None else np.append(self.own_sigma_mm, np.nan)
        target, row, column = (
            np.append(one, one.max() + 1).astype(np.int32) for one in (self.target, self.row, self.column)
        )
        places = np.vstack([self.xyz_mm, xyz_mm])
        return replace(self, target=target, xyz_mm=places, row=row, column=column, own_sigma_mm=own)

    def neighbours(self) -> Indices:
        """(K, 2) indices of pairs of neighbours on the grid, each pair once, sorted.

        Neighbours are targets of the same row in adjacent columns, or of the same column in adjacent rows.
        """
        index_at = {(int(r), int(c)): i for i, (r, c) in enumerate(zip(self.row, self.column, strict=True))}
        pairs = [
            sorted((index, index_at[beside]))
            for (row, column), index in index_at.items()
            for beside in ((row + 1, column), (row, column + 1))
            if beside in index_at
        ]
        return np.array(sorted(pairs), np.intp).reshape(-1, 2)


def _normal(reading: Reading, value: object) -> tuple[float, float, float] | None:
    if value is None:
        return None
    x, y, z = reading.numbers(value, "normal", (3,)).tolist()
    if not (x or y or z) and not reading.problems:
        reading.refuse("normal", value, "three numbers that are not all 0")
    return x, y, z


def _targets(reading: Reading, entries: object) -> list[_Target]:
    if isinstance(entries, str) or not isinstance(entries, Sequence) or not entries:
        reading.refuse("targets", entries, "a list of targets")
        return []
    each = [Reading("") for _ in entries]
    targets = [_target(own, entry) for own, entry in zip(each, entries, strict=True)]
    reading.problems += told_once("targets", _labels(entries), [own.problems for own in each])
    return targets


def _labels(entries: Sequence[object]) -> list[str]:
    """Ids of the entries, or their places where they have none."""
    ids = [entry.get("id") if isinstance(entry, Mapping) else None for entry in entries]
    return [str(one) if is_integer(one) else f"targets[{index}]" for index, one in enumerate(ids)]


def _target(reading: Reading, entry: object) -> _Target:
    if not isinstance(entry, Mapping):
        reading.refuse("", entry, f"a mapping of {', '.join(_PLACE_KEYS)}")
        return _Target(-1, 0.0, 0.0, 0.0, 0, 0)
    where = "."
    reading.keys(where, entry, tuple(TARGET_KEYS))
    own_sigma_mm = reading.number(entry, _OWN_SIGMA, where) if _OWN_SIGMA in entry else math.nan
    if own_sigma_mm < 0:
        reading.refuse(where + _OWN_SIGMA, own_sigma_mm, "a number from 0")
    return _Target(
        reading.integer(entry, "id", where, least=0),
        reading.number(entry, "x_mm", where),
        reading.number(entry, "y_mm", where),
        reading.number(entry, "z_mm", where),
        reading.integer(entry, "row", where),
        reading.integer(entry, "column", where),
        own_sigma_mm,
    )


def _check_unique(
    reading: Reading, key: str, targets: Sequence[_Target], value_of: Callable[[_Target], tuple[int, ...]]
) -> None:
    """Check that values are unique; skipped after problems, since placeholders prove nothing."""
    if reading.problems:
        return
    seen: set[tuple[int, ...]] = set()
    each: list[list[str]] = []
    for value in map(value_of, targets):
        each.append([f".{key}: {', '.join(map(str, value))} is given twice"] if value in seen else [])
        seen.add(value)
    reading.problems += told_once("targets", [str(target.id) for target in targets], each)
