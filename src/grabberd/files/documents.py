"""Documents that people write and programs read: calibrations in JSON, everything else in YAML."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from grabberd.bounded_documents import parse_yaml, read_text
from grabberd.errors import InputError
from grabberd.files.json_value import read_json

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
