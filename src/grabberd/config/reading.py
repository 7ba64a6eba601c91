"""Loading of the configuration from YAML, with every problem explained."""

import difflib
from collections import Counter
from collections.abc import Hashable, Mapping
from pathlib import Path
from types import NoneType
from typing import Any, get_args

import yaml
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from grabberd.bounded_documents import parse_yaml, read_text
from grabberd.config.daemon import Config
from grabberd.errors import ConfigError, Problem


def load_config(path: Path) -> Config:
    """Load and validate a YAML configuration file.

    Raises:
        ConfigError: lists every problem in the file.
    """
    document = _read_yaml(path)
    try:
        return Config.model_validate(document, context={"directory": path.resolve().parent})
    except ValidationError as error:
        problems = [_problem(path, details) for details in error.errors()]
        raise ConfigError(problems) from None


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


def _read_yaml(path: Path) -> object:
    try:
        return parse_yaml(read_text(path), _StrictLoader)
    except OSError as error:
        raise ConfigError([Problem(str(path), "(file)", error.strerror or str(error))]) from None
    except ValueError as error:
        raise ConfigError([Problem(str(path), "(file)", str(error))]) from None


class _StrictLoader(yaml.SafeLoader):
    """YAML loader that refuses duplicate keys, of which plain YAML silently keeps the last."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        keys = [self.construct_object(key, deep=True) for key, _ in node.value]
        mapping = super().construct_mapping(node, deep)  # refuses keys that cannot be counted
        for key, times in Counter(keys).items():
            if times > 1:
                raise yaml.constructor.ConstructorError(
                    None, None, f"the key {key!r} is given twice", node.start_mark
                )
        return mapping


def _problem(path: Path, details: ErrorDetails) -> Problem:
    key = ".".join(str(part) for part in details["loc"]) or "(file)"
    return Problem(str(path), key, _explain(details))


def _explain(details: ErrorDetails) -> str:
    key = str(details["loc"][-1]) if details["loc"] else ""
    if details["type"] == "extra_forbidden":
        return f"unknown key{_did_you_mean(key, details['loc'])}"
    message = details["msg"].removeprefix("Value error, ")
    if isinstance(details["input"], Mapping | list):
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
