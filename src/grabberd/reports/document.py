"""The document that a report is drawn from: checked, and written as JSON."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from grabberd.errors import InputError

SCHEMA = "grabberd/calibration-report/1"
ANALYSIS_SCHEMA = "grabberd/analysis-report/1"

_HINT = "make the report anew: grabberd calibrate … --report FILE"
_ANALYSIS_HINT = "make the report anew: grabberd analyse … --out DIR"


def document_json(document: Mapping[str, Any]) -> str:
    """A document as JSON: a line for each of its parts, keys sorted, so that equal documents are equal text.

    Raises:
        InputError: a number is not finite; the message says where.
    """
    _check_finite(document)
    parts = (f"{_dumped(key)}: {_dumped(document[key])}" for key in sorted(document))
    return "{\n" + ",\n".join(parts) + "\n}\n"


def check_document(document: Mapping[str, Any]) -> None:
    """Whether a calibration report can be drawn from this.

    Raises:
        InputError: it is of another schema, lacks what every report has, or has a number that is none.
    """
    _check(document, SCHEMA, ("id", "created_utc", "result", "views"), _HINT)


def check_analysis(document: Mapping[str, Any]) -> None:
    """Whether an analysis report can be drawn from this.

    Raises:
        InputError: as above.
    """
    needed = ("id", "created_utc", "inputs", "tables", "states")
    _check(document, ANALYSIS_SCHEMA, needed, _ANALYSIS_HINT)


def _check(document: Mapping[str, Any], schema: str, needed: Sequence[str], hint: str) -> None:
    if document.get("schema") != schema:
        raise InputError(f"a report's schema is {schema!r}, this is {document.get('schema')!r}", hint)
    if missing := [key for key in needed if not document.get(key)]:
        raise InputError(f"the {schema.split('/')[1].replace('-', ' ')} has no {', '.join(missing)}", hint)
    _check_finite(document)


def _check_finite(document: Mapping[str, Any]) -> None:
    if (where := next(_not_finite(document, ""), None)) is not None:
        raise InputError(f"the report's {where} is not a finite number", "what is not known is null")


def _not_finite(value: object, where: str) -> Iterator[str]:
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _not_finite(inner, f"{where}.{key}".lstrip("."))
    elif isinstance(value, Sequence) and not isinstance(value, str):
        for index, inner in enumerate(value):
            yield from _not_finite(inner, f"{where}[{index}]")
    elif isinstance(value, float) and not math.isfinite(value):
        yield where


def _dumped(value: object) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False, sort_keys=True, separators=(", ", ": "))
