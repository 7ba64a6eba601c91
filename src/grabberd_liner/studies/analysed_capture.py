"""An analysed capture as a study takes it: from the record of an analysis, or from its report."""

import hashlib
import json
import math
from collections.abc import Iterable, Mapping
from typing import Any

from pydantic import ValidationError

from grabberd.documents.named_types import JsonObject
from grabberd_liner.analyses.documents import AnalysisRow, QuantityDocument, TableDocument
from grabberd_liner.analyses.pressure_method import is_outdated
from grabberd_liner.analyses.store import DOCUMENT
from grabberd_liner.chain.study.studied import Found, LeftOut, Meaning, Studied

_AGAIN = "analyse it again"
OUTDATED = f"its pressures were found in the earlier, wrong way: {_AGAIN}"
WITHOUT = f"its analysis is of a version that had no quantities: {_AGAIN}"
_SCHEMA = "grabberd/analysis-report/1"
_LINER = "liner"
_LONGEST = 200


def of_record(capture: Studied, row: AnalysisRow) -> Studied | LeftOut:
    """A capture of an archive with its newest analysis.

    Args:
        capture: What is known of it without its analysis.
        row: The analysis as it is listed.
    """
    if row.problem is not None:
        return LeftOut(capture.id, "", f"its analysis {row.analysis} is damaged: {row.problem}")
    if row.outdated_pressure:
        return LeftOut(capture.id, "", OUTDATED)
    if not row.quantities:
        return LeftOut(capture.id, "", WITHOUT)
    return capture._replace(
        liner=liner_of([one.model_dump() for one in row.profiles], capture.labels, row.inputs),
        analysis=str(row.analysis),
        analysed_utc=row.created_utc or "",
        found={one.name: _found(one) for one in row.quantities},
    )


def of_report(document: Any, where: str) -> Studied | LeftOut:
    """A capture by the report of its analysis.

    Args:
        document: Content of `report.json`.
        where: The folder that it is in.
    """
    if not isinstance(document, Mapping) or document.get("schema") != _SCHEMA:
        return LeftOut(where, "", f"its {DOCUMENT} is no report of an analysis")
    try:
        return _of_report(document, where)
    except (ValidationError, ValueError, KeyError, TypeError, AttributeError) as error:
        said = " ".join(str(error).split())[:_LONGEST]
        return LeftOut(where, "", f"its {DOCUMENT} is damaged: {type(error).__name__}: {said}")


def _of_report(document: Mapping[str, Any], where: str) -> Studied | LeftOut:
    about, capture_id = document["about"], str(document["id"])
    labels = {str(key): str(value) for key, value in (about.get("labels") or {}).items()}
    has_pressure = any(
        one["name"] == "mean_contact_kpa" and any(v is not None for v in one["values"])
        for one in document["tables"]["fields"]["columns"]
    )
    if is_outdated(document.get("pressure_method"), has_pressure):
        return LeftOut(capture_id, "", f"{OUTDATED} ({where})")
    if "quantities" not in document["tables"]:
        return LeftOut(capture_id, "", f"{WITHOUT} ({where})")
    rows = _rows(TableDocument.model_validate(document["tables"]["quantities"]))
    ledger = about.get("ledger")
    return Studied(
        capture_id,
        str(about["captured_utc"]),
        str(about.get("device") or ""),
        "" if ledger is None else "incomplete" if ledger["lacking"] else "complete",
        labels,
        liner_of(about.get("profiles") or [], labels, document["inputs"]["given"]),
        where,
        str(document["created_utc"]),
        {str(row["name"]): _of_row(row) for row in rows},
        _meanings(rows),
    )


def meanings_of(document: Any) -> dict[str, Meaning]:
    """Titles and definitions of quantities from the report of an analysis; none if it has no such table."""
    try:
        return _meanings(_rows(TableDocument.model_validate(document["tables"]["quantities"])))
    except (ValidationError, ValueError, KeyError, TypeError):
        return {}


def _meanings(rows: Iterable[Mapping[str, Any]]) -> dict[str, Meaning]:
    return {str(row["name"]): Meaning(str(row["title"]), str(row["definition"])) for row in rows}


def liner_of(profiles: Iterable[Mapping[str, Any]], labels: Mapping[str, str], inputs: JsonObject) -> str:
    """The liner of an analysis: the version of its profile, else its label, else what its material is."""
    for one in profiles:
        if one["kind"] == _LINER:
            return f"{one['name']}, version {one['version']}"
    if labels.get(_LINER):
        return labels[_LINER]
    if material := inputs.get("material"):
        text = json.dumps(material, sort_keys=True, ensure_ascii=False)
        return f"material {hashlib.sha256(text.encode()).hexdigest()[:8]}"
    return ""


def _rows(table: TableDocument) -> list[dict[str, float | str | None]]:
    names = [column.name for column in table.columns]
    values = zip(*(column.values for column in table.columns), strict=True)
    return [dict(zip(names, row, strict=True)) for row in values]


def _of_row(row: Mapping[str, float | str | None]) -> Found:
    common = row.get("sigma_common")
    return Found(
        str(row["unit"]),
        _number(row["value"]),
        _number(row["sigma_value"]),
        None if common is None else _number(common),
        str(row["reason"]),
    )


def _found(one: QuantityDocument) -> Found:
    return Found(one.unit, _number(one.value), _number(one.sigma), one.sigma_common, one.reason)


def _number(value: float | str | None) -> float:
    return math.nan if value is None else float(value)
