"""The maps of an analysis in one file, from which each is read without the others."""

import json
import zlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grabberd.errors import NotFound
from grabberd.files.checked_file import Check, checked_file, write_checked
from grabberd.files.disk import storage_errors
from grabberd.files.text_check import text_check

if TYPE_CHECKING:
    from grabberd_liner.chain.analysis.maps import TargetMap

MAPS, OFFSETS = "maps.jsonl", "maps.json"


def write_maps(folder: Path, maps: Iterable["TargetMap"], units: Mapping[str, str]) -> None:
    """Writes a line for each map, and a second file with the value, offset and length of each.

    Raises:
        StorageError: The files cannot be written, or do not read back as they were written.
    """
    offsets: dict[str, list[tuple[float, int, int]]] = {"field": [], "phase": []}
    sums: list[int] = []
    with checked_file(folder / MAPS, _lines_check(sums)) as file:
        for one in maps:
            line = json.dumps(_document(one, units), ensure_ascii=False, allow_nan=False).encode() + b"\n"
            offsets[one.kind].append((one.value, file.tell(), len(line)))
            sums.append(zlib.crc32(line))
            file.write(line)
    text = json.dumps(offsets)
    write_checked(folder / OFFSETS, [text.encode()], text_check(text))


def _lines_check(sums: Sequence[int]) -> Check:
    """Lines of JSON with these checksums, which are asked for once all have been written."""

    def check(path: Path) -> str | None:
        count = 0
        with path.open("rb") as file:
            for count, line in enumerate(file, 1):
                if count > len(sums) or zlib.crc32(line) != sums[count - 1]:
                    return f"line {count} is another one"
                json.loads(line)
        return None if count == len(sums) else f"it has {count} lines, expected {len(sums)}"

    return check


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
