"""A study as one JSON document, the source of its report."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from grabberd.core.geometry.document_reader import finite
from grabberd_liner.analysis.comparison import Difference
from grabberd_liner.analysis.mixed_model import Contrast
from grabberd_liner.chain.analysis.analysis_document import table_document
from grabberd_liner.chain.study.study import DATE, QuantityStudy, Study
from grabberd_liner.chain.study.tables import StudyTables, difference_verdict, slope_verdict, whole_verdict

SCHEMA = "grabberd/study/1"


def study_document(study: Study, tables: StudyTables, about: Mapping[str, Any]) -> dict[str, Any]:
    """The document: question, results, remarks, values of every capture by quantity, and the tables.

    Args:
        study: the study.
        tables: its tables.
        about: origin of the study: created_utc, version, select.
    """
    return {
        "schema": SCHEMA,
        **about,
        "question": {**study.question._asdict(), "quantities": list(study.question.quantities)},
        "over_unit": study.question.over_unit,
        "over_label": _over_label(study),
        "groups": list(study.groups),
        "captures": len(study.captures),
        "remarks": list(study.remarks),
        "quantities": [_quantity(study, one) for one in study.quantities],
        "left_out": _left_out(study),
        "tables": {name: table_document(table) for name, table in tables.items()},
    }


def _quantity(study: Study, studied: QuantityStudy) -> dict[str, Any]:
    """A quantity as the report tells and draws it."""
    compared, trend = studied.comparison, studied.trend
    differences = [_difference(one) for one in compared.differences]
    return {
        "name": studied.name,
        "title": studied.meaning.title,
        "definition": studied.meaning.definition,
        "unit": studied.unit,
        "verdict": whole_verdict([one["verdict"] for one in differences]),
        "remarks": list(studied.remarks),
        "groups": list(studied.groups),
        "values": {
            "capture": [study.captures[row].id for row in studied.captures],
            "group": list(studied.group),
            "place": [finite(one - study.origin) for one in studied.place],
            "value": studied.observed.value.tolist(),
            "sigma": [finite(one) for one in _sigma(studied)],
        },
        "means": [_result(one) for one in compared.means],
        "differences": differences,
        "trend": trend and {**_result(trend.common), "verdict": slope_verdict(trend.common)},
        "slopes": trend and [one and _result(one) for one in trend.slopes],
    }


def _over_label(study: Study) -> str:
    if study.question.over != DATE:
        return study.question.over or ""
    return f"days from {study.captures[0].captured_utc[:10]}" if study.captures else "days"


def _sigma(studied: QuantityStudy) -> Sequence[float]:
    shared = np.sum(np.square(studied.observed.shared), axis=1)
    return np.sqrt(np.square(studied.observed.own) + shared).tolist()


def _difference(one: Difference) -> dict[str, Any]:
    """Two groups, by index; p is that for all pairs."""
    p = finite(one.adjusted_p)
    verdict = difference_verdict(one)
    return {**_result(one.found), "first": one.first, "second": one.second, "p": p, "verdict": verdict}


def _result(found: Contrast) -> dict[str, float | None]:
    names = ("value", "sigma", "common", "half_width", "dof", "p")
    return {name: finite(getattr(found, name)) for name in names}


def _left_out(study: Study) -> list[dict[str, Any]]:
    """Captures that are left out, and quantities without a value counted by reason."""
    whole = [one._asdict() | {"count": 1} for one in study.left_out if not one.quantity]
    counted = Counter((one.quantity, one.reason) for one in study.left_out if one.quantity)
    parts = [
        {"capture": "", "quantity": quantity, "reason": reason, "count": count}
        for (quantity, reason), count in counted.items()
    ]
    return [*whole, *parts]
