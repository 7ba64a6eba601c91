"""The sound part of a configuration with problems: drivers and files are checked in the same round."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from pydantic import ValidationError

from grabberd.config.daemon import Config
from grabberd.config.reading import problems_of, read_document, validated
from grabberd.errors import Problem

_DRIVEN = ("devices", "loggers")
_OF_DRIVER = ("driver", "options")
"""What is kept of a device that has problems elsewhere: its driver stands for itself."""

Place = tuple[int | str, ...]


class SoundPart(NamedTuple):
    """A configuration, or what is sound of it.

    Attributes:
        config: The configuration; without the sections that have problems, if there are any; None if nothing
            is sound.
        problems: The problems.
        loggers: Loggers with problems elsewhere than in their driver and its options, which a configuration
            cannot hold without their channels: these two, by name.
    """

    config: Config | None
    problems: list[Problem]
    loggers: Mapping[str, tuple[str, Mapping[str, Any]]] = MappingProxyType({})


def load_sound_part(path: Path) -> SoundPart:
    """Load a configuration file as far as it is valid.

    Raises:
        ConfigError: It cannot be read, is not valid YAML, or has no keys.
    """
    document = read_document(path)
    try:
        return SoundPart(validated(document, path), [])
    except ValidationError as error:
        problems = problems_of(error, path)
        wrong = [details["loc"] for details in error.errors()]
    sound = _sound(document, wrong)
    loose = {
        name: (one["driver"], one.get("options", {}))
        for name, one in sound.get("loggers", {}).items()
        if not one.keys() - set(_OF_DRIVER)
    }
    sound["loggers"] = {name: one for name, one in sound.get("loggers", {}).items() if name not in loose}
    try:
        return SoundPart(validated(sound, path), problems, loose)
    except ValidationError:  # without any device, for instance
        return SoundPart(None, problems, loose)


def _sound(document: Mapping[str, Any], wrong: list[Place]) -> dict[str, Any]:
    """The sections without problems, and the drivers of those devices and loggers that have some."""
    kept: dict[str, Any] = {}
    for key, section in document.items():
        inside = [place[1:] for place in wrong if place[:1] == (key,)]
        if not inside:
            kept[key] = section
        elif key in _DRIVEN and isinstance(section, Mapping):
            driven = {name: _sound_driver(one, name, inside) for name, one in section.items()}
            kept[key] = {name: one for name, one in driven.items() if one}
    return kept


def _sound_driver(section: Any, name: Any, wrong: list[Place]) -> Any:
    """A device or logger if it is sound, else its driver and options if these are."""
    keys = {place[1] if len(place) > 1 else "" for place in wrong if place[:1] == (name,)}
    if not keys:
        return section
    if not isinstance(section, Mapping) or keys & {*_OF_DRIVER, "[key]"}:
        return None
    return {key: section[key] for key in _OF_DRIVER if key in section and key not in keys}
