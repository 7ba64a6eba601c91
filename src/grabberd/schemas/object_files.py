"""Schemas of the files of objects and calibration frames, from the tables of keys that their readers have."""

from collections.abc import Callable, Mapping

from grabberd.archive.calibrations.calibration_frames import CALIBRATION_FRAME_KEYS
from grabberd.core.reconstruction.object_model import KEYS, TARGET_KEYS, FileKey
from grabberd.documents.requests import CertifiedLength
from grabberd.schemas.forms import Schema, integer, mapping, number, positive, text

_KINDS: Mapping[str, Callable[[], Schema]] = {
    "text": text,
    "number": number,
    "number above 0": positive,
    "number from 0": lambda: number(minimum=0),
    "whole number": integer,
    "whole number from 0": lambda: integer(least=0),
    "`true` or `false`": lambda: {"type": "boolean"},
    "list": lambda: {"type": "array", "minItems": 1, "items": _keys(TARGET_KEYS)},
    "anything": dict,
    "mapping": CertifiedLength.model_json_schema,
}
"""Schemas of the kinds of values that the tables of keys name."""


def object_schema() -> Schema:
    """The schema of an object's file."""
    return _keys(KEYS)


def calibration_frame_schema() -> Schema:
    """The schema of a calibration frame's file."""
    return _keys({**KEYS, **CALIBRATION_FRAME_KEYS})


def _keys(keys: Mapping[str, FileKey]) -> Schema:
    required = tuple(name for name, key in keys.items() if key.default is None)
    return mapping({name: _key(key) for name, key in keys.items()}, required)


def _key(key: FileKey) -> Schema:
    unit = f" [{key.unit}]" if key.unit else ""
    return {**_KINDS[key.kind](), "description": f"{key.meaning}{unit}"}
