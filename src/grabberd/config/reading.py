"""Loading of the configuration from YAML, with every problem explained.

Where a configuration has problems, drivers and files of its sound part are checked in the same round.
"""

import difflib
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType, NoneType
from typing import Any, NamedTuple, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from grabberd.bounded_documents import parse_yaml, read_text
from grabberd.config.daemon import Config
from grabberd.errors import WHOLE_FILE, ConfigError, Problem, said

_LEAST = "such as 'devices: {barn: {driver: fake}}'; configs/fake.yaml is an example"


def load_config(path: Path) -> Config:
    """Load and validate a YAML configuration file.

    Raises:
        ConfigError: lists every problem in the file.
    """
    document = read_document(path)
    try:
        return validated(document, path)
    except ValidationError as error:
        raise ConfigError(problems_of(error, path)) from None


def validated(document: object, path: Path) -> Config:
    """Validate what a configuration file says; relative paths start at the file's own folder.

    Raises:
        ValidationError: it is no configuration.
    """
    return Config.model_validate(document, context={"directory": path.resolve().parent})


def problems_of(error: ValidationError, path: Path) -> list[Problem]:
    """The problems of a configuration file, in words."""
    return [_problem(path, details) for details in error.errors()]


def only_device(config: Config, name: str | None, file: Path) -> str:
    """Name of the chosen device: the one named, or the only one.

    Raises:
        ConfigError: There is no device of this name, or several and none is named.
    """
    if name is None and len(config.devices) == 1:
        return next(iter(config.devices))
    if name is not None and name in config.devices:
        return name
    known = ", ".join(config.devices)
    problem = f"no device {name!r}; known: {known}" if name else f"several devices; choose one of: {known}"
    raise ConfigError([Problem(str(file), "devices", problem)])


def read_document(path: Path) -> dict[str, Any]:
    """Read the keys and values of a configuration file.

    Raises:
        ConfigError: It cannot be read, is not valid YAML, or has no keys.
    """
    try:
        document = parse_yaml(read_text(path))
    except IsADirectoryError:
        raise ConfigError([Problem(str(path), WHOLE_FILE, "a folder, not a file")]) from None
    except OSError as error:
        raise ConfigError([Problem(str(path), WHOLE_FILE, error.strerror or str(error))]) from None
    except ValueError as error:
        raise ConfigError([Problem(str(path), WHOLE_FILE, str(error))]) from None
    if document is None:
        words = f"{path.name} is empty: a configuration names at least one device, {_LEAST}"
        raise ConfigError([Problem(str(path), WHOLE_FILE, words)])
    if not isinstance(document, dict):
        words = f"{path.name} has no keys: a configuration is keys and values, {_LEAST}"
        raise ConfigError([Problem(str(path), WHOLE_FILE, words)])
    return document


def _problem(path: Path, details: ErrorDetails) -> Problem:
    key = ".".join(str(part) for part in details["loc"] if part != "[key]") or WHOLE_FILE
    return Problem(str(path), key, _explain(details))


def _explain(details: ErrorDetails) -> str:
    key = str(details["loc"][-1]) if details["loc"] else ""
    if details["type"] == "extra_forbidden":
        return f"unknown key{_did_you_mean(key, details['loc'])}"
    if details["type"] == "missing":
        return "this key is missing"
    if key == "[key]" and details["type"] == "string_pattern_mismatch":
        return f"{details['input']!r} is no name: small letters, digits, '-' and '_', at most 32 characters"
    message = said(details["msg"])
    if isinstance(details["input"], Mapping | list) or repr(details["input"]) in message:
        return message
    return f"{message}, not {details['input']!r}{_unit_advice(key)}"


def _did_you_mean(key: str, location: tuple[int | str, ...]) -> str:
    known = sorted(_known_keys(location))
    near = [name for name in known if name.startswith(key + "_")] or difflib.get_close_matches(
        key, known, n=1
    )
    return f"; did you mean {near[0]}?" if near else f"; known keys: {', '.join(known)}"


def _known_keys(location: tuple[int | str, ...]) -> set[str]:
    """Keys of the section at this location."""
    section: Any = Config
    for part in location[:-1]:
        section = _descend(section, part)
    return set(getattr(section, "model_fields", ()))


def _descend(section: Any, part: int | str) -> Any:
    if isinstance(section, type) and issubclass(section, BaseModel):
        field = section.model_fields.get(str(part))
        return _without_none(field.annotation) if field else None
    arguments = get_args(section)
    return _without_none(arguments[-1]) if arguments else None


def _without_none(section: Any) -> Any:
    """The section type inside an optional annotation."""
    others = [one for one in get_args(section) if one is not NoneType]
    return others[0] if len(others) < len(get_args(section)) else section


UNITS = {"_mm": "millimetres", "_px": "pixels", "_ms": "milliseconds", "_s": "seconds", "_deg": "degrees"}


def _unit_advice(key: str) -> str:
    unit = next((name for suffix, name in UNITS.items() if key.endswith(suffix)), None)
    return f" (this key is in {unit})" if unit else ""


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
