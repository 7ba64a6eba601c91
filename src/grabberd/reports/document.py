"""The documents that reports are drawn from: their checks, and their JSON."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from grabberd.errors import InputError


class ReportForm(NamedTuple):
    """The form of the documents that a kind of report is drawn from.

    Attributes:
        schema: Name of their schema.
        needed: Parts that every report of this kind needs.
        command: The command that makes them.
    """

    schema: str
    needed: Sequence[str]
    command: str


CALIBRATION = ReportForm(
    "grabberd/calibration-report/1", ("id", "created_utc", "result", "views"), "calibrate … --report FILE"
)


def document_json(document: Mapping[str, Any]) -> str:
    """Write a document as JSON: one line for each part, keys sorted, so that equal documents are equal text.

    Raises:
        InputError: a number is not finite; the message names its key.
    """
    _check_finite(document)
    parts = (f"{_dumped(key)}: {_dumped(document[key])}" for key in sorted(document))
    return "{\n" + ",\n".join(parts) + "\n}\n"


def check_document(document: Mapping[str, Any], form: ReportForm) -> None:
    """Check that a report can be drawn from a document.

    Raises:
        InputError: it has another schema, lacks a part that every report of its kind needs, or has a number
            that is not finite.
    """
    hint = f"make the report again: grabberd {form.command}"
    if document.get("schema") != form.schema:
        raise InputError(f"the report's schema must be {form.schema!r}, not {document.get('schema')!r}", hint)
    if missing := [key for key in form.needed if not document.get(key)]:
        kind = form.schema.split("/")[1].replace("-", " ")
        raise InputError(f"the {kind} has no {', '.join(missing)}", hint)
    _check_finite(document)


def _check_finite(document: Mapping[str, Any]) -> None:
    if (where := next(_not_finite(document, ""), None)) is not None:
        raise InputError(
            f"the report's {where} is not a finite number", "write null for a value that is not known"
        )


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
