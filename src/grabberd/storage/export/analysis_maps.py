"""The maps of an analysis in one file, from which each is read without the others."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grabberd.errors import NotFound
from grabberd.storage.disk import storage_errors

if TYPE_CHECKING:
    from grabberd.processes.analysis.maps import TargetMap

MAPS, OFFSETS = "maps.jsonl", "maps.json"


def write_maps(folder: Path, maps: Iterable["TargetMap"], units: Mapping[str, str]) -> None:
    """Writes a line for each map, and a second file with the value, offset and length of each.

    Raises:
        StorageError: The files cannot be written.
    """
    offsets: dict[str, list[tuple[float, int, int]]] = {"field": [], "phase": []}
    with storage_errors(folder / MAPS), (folder / MAPS).open("xb") as file:
        for one in maps:
            line = json.dumps(_document(one, units), ensure_ascii=False, allow_nan=False).encode() + b"\n"
            offsets[one.kind].append((one.value, file.tell(), len(line)))
            file.write(line)
    with storage_errors(folder / OFFSETS):
        (folder / OFFSETS).write_text(json.dumps(offsets), encoding="utf-8")


def read_map(folder: Path, kind: str, value: float) -> bytes:
    """One map as JSON: of that field, or of the nearest phase.

    Raises:
        NotFound: There is none.
        StorageError: The files cannot be read.
    """
    with storage_errors(folder / OFFSETS):
        offsets = json.loads((folder / OFFSETS).read_bytes())[kind]
    apart = [_apart(kind, known, value) for known, _, _ in offsets]
    if not offsets or (kind == "field" and min(apart) > 0):
        raise NotFound(
            f"the analysis has no {kind} {value:g}", _hint(kind, [known for known, _, _ in offsets])
        )
    _, first, length = offsets[apart.index(min(apart))]
    with storage_errors(folder / MAPS), (folder / MAPS).open("rb") as file:
        file.seek(first)
        return file.read(length)


def _document(one: "TargetMap", units: Mapping[str, str]) -> dict[str, Any]:
    known = {name: unit for name, unit in units.items() if name in one.columns}
    which = (
        {"field": int(one.value), "phase": None}
        if one.kind == "field"
        else {"field": None, "phase": one.value}
    )
    return {**which, "units": known, "columns": one.columns}


def _apart(kind: str, known: float, value: float) -> float:
    """The difference of two fields or phases; phases wrap around at 1."""
    return abs(known - value) if kind == "field" else abs((known - value + 0.5) % 1 - 0.5)


def _hint(kind: str, known: list[float]) -> str:
    return f"choose from {min(known):g} to {max(known):g}" if known else f"it has no {kind} at all"
