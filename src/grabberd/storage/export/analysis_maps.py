"""The maps of an analysis in a file, from which one is read without the others."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grabberd.errors import NotFound
from grabberd.storage.disk import storage_errors

if TYPE_CHECKING:
    from grabberd.processes.analysis.maps import TargetMap

MAPS, PLACES = "maps.jsonl", "maps.json"


def write_maps(folder: Path, maps: Iterable["TargetMap"], units: Mapping[str, str]) -> None:
    """A line for each map, and beside them where it begins and how long it is.

    Raises:
        StorageError: the files cannot be written.
    """
    places: dict[str, list[tuple[float, int, int]]] = {"field": [], "phase": []}
    with storage_errors(folder / MAPS), (folder / MAPS).open("xb") as file:
        for one in maps:
            line = json.dumps(_document(one, units), ensure_ascii=False, allow_nan=False).encode() + b"\n"
            places[one.kind].append((one.value, file.tell(), len(line)))
            file.write(line)
    with storage_errors(folder / PLACES):
        (folder / PLACES).write_text(json.dumps(places), encoding="utf-8")


def read_map(folder: Path, kind: str, value: float) -> bytes:
    """One map as JSON: of that field, or of the phase that is nearest.

    Raises:
        NotFound: there is none.
        StorageError: the files cannot be read.
    """
    with storage_errors(folder / PLACES):
        places = json.loads((folder / PLACES).read_bytes())[kind]
    apart = [_apart(kind, place[0], value) for place in places]
    if not places or (kind == "field" and min(apart) > 0):
        raise NotFound(f"the analysis has no {kind} {value:g}", _hint(kind, [place[0] for place in places]))
    _, first, length = places[apart.index(min(apart))]
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
    """Phases go round."""
    return abs(known - value) if kind == "field" else abs((known - value + 0.5) % 1 - 0.5)


def _hint(kind: str, known: list[float]) -> str:
    return f"choose from {min(known):g} to {max(known):g}" if known else f"it has no {kind} at all"
