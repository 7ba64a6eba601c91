"""The wall's material from a document: one for the whole liner, or one for each zone of rows."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import NamedTuple

from grabberd.core.geometry import Reading
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.wall.material import Material, Zone

_KEYS = tuple(field.name for field in fields(Material))
_ZONE_KEYS = ("rows", *_KEYS)
_OPTIONAL = tuple(name for name in _KEYS if any(part in name for part in ("sigma", "end", "correlation")))
_HINT = "give the values of the very liner in the teatcup; none of them is assumed"


class Part(NamedTuple):
    """A material as a document gives it, for the first to the last of its rows; None: for all of them."""

    rows: tuple[int, int] | None
    material: Material


def read_zones(document: Mapping[str, object], grid: Grid) -> tuple[Zone, ...]:
    """The zones of a document on the grid of an object model, as `read_parts` takes it.

    Raises:
        InputError: See `read_parts`.
    """
    whole = 0, int(grid.row.max())
    return tuple(Zone.of_rows(*(rows or whole), grid.u_pitch_mm, one) for rows, one in read_parts(document))


def read_parts(document: Mapping[str, object]) -> tuple[Part, ...]:
    """The materials of a document: the keys of `Material`, or `zones`, a list with the same keys and `rows`.

    Args:
        document: {E_mpa: …, wall_mm: …, …}, or {zones: [{rows: [first, last], E_mpa: …, …}, …]}, rows counted
            from 0 as in the grid, both included.

    Raises:
        InputError: a key is missing, unknown or of a wrong type (all are named), or values are impossible.
    """
    reading = Reading("the wall's material")
    if "zones" not in document:
        material = _material(reading, document, "", _KEYS)
        reading.finish(_HINT)
        return (Part(None, Material(**material)),)  # type: ignore[arg-type]
    reading.keys("", document, ("zones",))
    entries = _entries(reading, document["zones"])
    found = [_zone(reading, entry, f"zones[{at}].") for at, entry in enumerate(entries)]
    reading.finish(_HINT)
    return tuple(Part((first, last), Material(**material)) for first, last, material in found)  # type: ignore[arg-type]


def _entries(reading: Reading, zones: object) -> list[Mapping[str, object]]:
    if isinstance(zones, str) or not isinstance(zones, Sequence) or not zones:
        reading.refuse("zones", zones, "a list of zones")
        return []
    wrong = [zone for zone in zones if not isinstance(zone, Mapping)]
    for zone in wrong:
        reading.refuse("zones", zone, f"a mapping of {', '.join(_ZONE_KEYS)}")
    return [] if wrong else list(zones)


def _zone(reading: Reading, entry: Mapping[str, object], where: str) -> tuple[int, int, dict[str, object]]:
    first, last = reading.numbers(entry.get("rows"), where + "rows", (2,))
    if not (0 <= first <= last and float(first).is_integer() and float(last).is_integer()):
        reading.refuse(where + "rows", entry.get("rows"), "first and last row, counted from 0")
    return int(first), int(last), _material(reading, entry, where, _ZONE_KEYS)


def _material(
    reading: Reading, entry: Mapping[str, object], where: str, known: Sequence[str]
) -> dict[str, object]:
    reading.keys(where, entry, known)
    values: dict[str, object] = {"law": reading.text(entry, "law", where)}
    for name in _KEYS:
        if name != "law" and not (name in _OPTIONAL and name not in entry):
            values[name] = reading.number(entry, name, where)
    return values
