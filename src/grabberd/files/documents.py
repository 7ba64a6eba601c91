"""Documents read from files: calibrations in JSON, everything else in YAML; limits of a JSON text."""

import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from grabberd.bounded_documents import DEEPEST, LARGEST_DOCUMENT, parse_yaml, read_text
from grabberd.errors import InputError
from grabberd.tables import LARGEST_NUMBER

LARGEST_INTEGER = 1 << 64
"""No number here is larger; times have 63 bits."""


def read_json(text: str) -> Any:
    """The value of a JSON text.

    Raises:
        ValueError: It is no JSON, too large or nested too deeply, or holds numbers or letters that no JSON
            text may hold.
    """
    if not isinstance(text, str):
        raise ValueError(f"a JSON text is {type(text).__name__}")
    if len(text) > LARGEST_DOCUMENT:
        raise ValueError(f"a JSON text has {len(text)} characters, more than {LARGEST_DOCUMENT}")
    try:
        value = json.loads(text)
    except RecursionError:
        raise ValueError("a JSON text is nested too deeply") from None
    check_json(value)
    return value


def check_json(value: Any) -> None:
    """Checks a value, level by level: recursion would end where the text's author wants it to.

    Raises:
        ValueError: See `read_json`.
    """
    level = [value]
    for _ in range(DEEPEST):
        level = [inner for outer in level for inner in _inner(outer)]
        if not level:
            return
    raise ValueError(f"a JSON text is nested in more than {DEEPEST} levels")


def _inner(value: Any) -> list[Any]:
    if isinstance(value, dict):
        return [*value, *value.values()]
    if isinstance(value, list):
        return value
    if isinstance(value, str) and not value.isascii():
        value.encode()  # a lone surrogate, which no answer could hold
    if isinstance(value, float) and not abs(value) <= LARGEST_NUMBER:
        raise ValueError(f"a JSON text holds {value}")
    if isinstance(value, int) and abs(value) > LARGEST_INTEGER:
        raise ValueError("a JSON text holds an integer of more than 64 bits")
    return []


JsonObject = dict[str, Any]
PathLike = str | os.PathLike[str]
_EXAMPLES = "see the examples of calibrations, objects and calibration frames in the folder configs/"


def read_documents(calibration: Path | None, object_model: Path | None) -> JsonObject:
    """The documents in a calibration (JSON) and an object model (YAML) file, None without a file.

    Raises:
        InputError: A file is not valid JSON or YAML.
    """
    return {
        "calibration": None if calibration is None else _read(calibration, read_json),
        "object": None if object_model is None else read_yaml(object_model),
    }


def read_yaml(path: Path) -> JsonObject:
    """The document in a YAML file, such as an object model or a calibration frame.

    Raises:
        InputError: It cannot be read, or has no keys.
    """
    return _read(path, lambda text: parse_yaml(text, fast=True))


def document_of(given: PathLike | Mapping[str, Any]) -> dict[str, Any]:
    """The document in a YAML or JSON file, or the one that is given.

    Raises:
        InputError: The file cannot be read, or has no keys.
    """
    # JSON is YAML as well.
    return dict(given) if isinstance(given, Mapping) else read_yaml(Path(given))


def _read(path: Path, parse: Callable[[str], Any]) -> JsonObject:
    try:
        document = parse(read_text(path))
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}", "check the file's name") from error
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise InputError(f"{path} cannot be read: {reason}", _EXAMPLES) from error
    if document is None:
        raise InputError(f"{path} is empty: it has no keys", _EXAMPLES)
    if not isinstance(document, dict):
        raise InputError(f"{path} has no keys: it is {str(document)[:40]!r}", _EXAMPLES)
    return document
