"""Profiles of a liner, a pulsator, a cup and a cow, and whether what they state can be used.

A profile's quantities are those of the analysis' inputs, under the same names and read by the same readers.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from grabberd.core.geometry.document_reader import is_number
from grabberd.errors import InputError
from grabberd_liner.analysis import Material
from grabberd_liner.analysis.wall.material_document import read_parts
from grabberd_liner.chain.analysis.inputs import input_problems
from grabberd_liner.chain.analysis.vacuum_inputs import read_constant, read_wave

CHOICES = ("reference", "plane", "heights_mm", "phases", "sought_kpa", "unseen")
"""Inputs that say how captures of a liner are analysed, rather than what the liner is."""
OBTAINED = ("E_mpa", "wall_mm", "radius_mm", "F0_n")
"""Values of a material that are worth nothing where nobody knows how they were obtained."""
_SIGMAS = ("E_sigma_mpa", "wall_sigma_mm", "F0_sigma_n")
_MATERIAL_KEYS = tuple(field.name for field in fields(Material))
_OF_A_CAPTURE = ("start_s", "start_sigma_s")


@dataclass(frozen=True, slots=True)
class Profile:
    """One version of a profile.

    Attributes:
        kind: `liner`, `pulsator`, `cup` or `cow`: the key of the label that finds it.
        name: Value of that label.
        version: Number from 1; a version never changes.
        sha256: SHA-256 of its content, in hexadecimal.
        content: Its document.
    """

    kind: str
    name: str
    version: int
    sha256: str
    content: Mapping[str, Any]

    def __str__(self) -> str:
        return f"{self.kind} profile {self.name}, version {self.version}"


def quantity_problems(content: Mapping[str, Any]) -> list[str]:
    """Problems of the quantities in a profile's document, all of them, each with its key."""
    if content.get("kind") == "liner":
        return list(_of_liner(content))
    if content.get("kind") == "pulsator":
        return list(_of_pulsator(content))
    return []


def _of_liner(content: Mapping[str, Any]) -> Iterator[str]:
    material, choices, obtained = (_mapping(content, key) for key in ("material", "analysis", "obtained"))
    if material is not None:
        yield from _of_material(material, obtained or {})
    for key in obtained or {}:
        if key not in _MATERIAL_KEYS:
            yield f"obtained.{key}: unknown key; known keys are {', '.join(_MATERIAL_KEYS)}"
    unknown = [key for key in choices or {} if key not in CHOICES]
    for key in unknown:
        yield f"analysis.{key}: unknown key; known keys are {', '.join(CHOICES)}"
    known = {key: value for key, value in (choices or {}).items() if key not in unknown}
    yield from (f"analysis.{problem}" for problem in input_problems(known))


def _of_material(material: Mapping[str, Any], obtained: Mapping[str, Any]) -> Iterator[str]:
    try:
        read_parts(material)
    except InputError as error:
        yield error.message
    for where, entry in _entries(material):
        yield from _lacking_sigmas(where, entry, _SIGMAS)
    for key in OBTAINED:
        if key not in obtained:
            yield f"obtained.{key}: is missing, expected how it was obtained: data sheet, calliper, ramp, …"


def _mapping(content: Mapping[str, Any], key: str) -> Mapping[str, Any] | None:
    value = content.get(key)
    return value if isinstance(value, Mapping) else None


def _of_pulsator(content: Mapping[str, Any]) -> Iterator[str]:
    pulsation, liner = content.get("pulsation"), content.get("liner")
    if isinstance(pulsation, Mapping):
        for key in _OF_A_CAPTURE:
            if key in pulsation:
                yield f"pulsation.{key}: belongs to a capture, not to a pulsator"
        try:
            read_wave({key: value for key, value in pulsation.items() if key not in _OF_A_CAPTURE})
        except InputError as error:
            yield error.message
        yield from _lacking_sigmas("pulsation.", pulsation, ("sigma_kpa",))
    if isinstance(liner, Mapping):
        try:
            read_constant("liner", liner)
        except InputError as error:
            yield error.message
        yield from _lacking_sigmas("liner.", liner, ("sigma_kpa",))


def _entries(material: Mapping[str, Any]) -> list[tuple[str, Mapping[str, Any]]]:
    """The parts of a material, each with the beginning of its keys."""
    zones = material.get("zones")
    if zones is None:
        return [("material.", material)]
    if isinstance(zones, str) or not isinstance(zones, Sequence):
        return []
    return [(f"material.zones[{at}].", one) for at, one in enumerate(zones) if isinstance(one, Mapping)]


def _lacking_sigmas(where: str, entry: Mapping[str, Any], names: Sequence[str]) -> Iterator[str]:
    """Problems of σ: no value is known exactly, and a pressure from values without σ claims to be."""
    for name in names:
        value = entry.get(name)
        if value is None:
            yield f"{where}{name}: is missing, expected a σ above 0"
        elif is_number(value) and value <= 0:
            yield f"{where}{name}: is {value!r}, expected a σ above 0"
