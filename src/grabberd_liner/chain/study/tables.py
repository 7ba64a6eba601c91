"""The tables of a study, one row for each capture, quantity, group, pair, slope, and what is left out."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from grabberd.core.chain.columns import Table, make_table
from grabberd_liner.analysis.study.contrast import Contrast
from grabberd_liner.chain.study.columns import TABLES, captures_spec
from grabberd_liner.chain.study.studied import Studied, natural
from grabberd_liner.chain.study.study import QuantityStudy, Study
from grabberd_liner.chain.study.verdicts import basis, difference_verdict, slope_verdict, whole_verdict

StudyTables = Mapping[str, Table]
"""Tables by name: captures, and those of `TABLES`."""
Row = Mapping[str, Any]
"""Values by column name; of a measured column the pair of value and σ."""


def tables(study: Study) -> StudyTables:
    """All tables of a study; one without results has no rows."""
    rows: dict[str, list[Row]] = {
        "quantities": [_quantity(one) for one in study.quantities],
        "groups": [row for one in study.quantities for row in _groups(one)],
        "comparison": [row for one in study.quantities for row in _pairs(one)],
        "trend": [row for one in study.quantities for row in _slopes(one, study.question.over or "")],
        "left_out": [one._asdict() for one in study.left_out],
    }
    made = {
        name: make_table(name, spec, _columns(rows[name], spec.key + spec.values))
        for name, spec in TABLES.items()
    }
    return {"captures": _captures(study), **made}


def _columns(rows: Sequence[Row], columns: Sequence[Any]) -> dict[str, Any]:
    """Values by column, of rows."""
    values: dict[str, Any] = {}
    for column in columns:
        cells = [row[column.name] for row in rows]
        if column.measured:
            pairs = np.array(cells, np.float64).reshape(-1, 2)
            values[column.name] = (pairs[:, 0], pairs[:, 1])
        else:
            dtype = object if column.dtype == "U" else np.float64
            values[column.name] = np.array(cells, dtype)
    return values


def _captures(study: Study) -> Table:
    labels = natural(name for one in study.captures for name in one.labels)
    quantities = [(one.name, one.unit, one.meaning.title) for one in study.quantities]
    spec = captures_spec(labels, quantities)
    rows = [_capture(study, capture, labels) for capture in study.captures]
    return make_table("captures", spec, _columns(rows, spec.key + spec.values))


def _capture(study: Study, capture: Studied, labels: Sequence[str]) -> Row:
    row: dict[str, Any] = {
        "capture": capture.id,
        "captured_utc": capture.captured_utc,
        "device": capture.device,
        "verdict": capture.verdict,
        "group": "" if study.question.by is None else capture.value_of(study.question.by),
        "analysis": capture.analysis,
        "analysed_utc": capture.analysed_utc,
        "liner_shared": capture.liner,
        **{f"label_{name}": capture.labels.get(name, "") for name in labels},
    }
    for one in study.quantities:
        found = capture.found.get(one.name)
        usable = found is not None and found.unit == one.unit
        value, sigma, common = (
            (found.value, found.sigma, found.common) if found and usable else (math.nan,) * 3
        )
        row[one.name] = (value, sigma)
        row[f"sigma_common_{one.name}"] = math.nan if common is None else common
    return row


def _quantity(studied: QuantityStudy) -> Row:
    compared, check = studied.comparison, studied.comparison.check
    return {
        "quantity": studied.name,
        "unit": studied.unit,
        "title": studied.meaning.title,
        "definition": studied.meaning.definition,
        "captures": len(studied.captures),
        "paired": "yes" if compared.paired else "no",
        "between_sigma": compared.between_sigma,
        "within_sigma": compared.within_sigma,
        "chi2": check.chi2,
        "chi2_dof": check.dof,
        "chi2_p": check.p,
        "verdict": whole_verdict([difference_verdict(one) for one in compared.differences]),
        "remarks": "; ".join(studied.remarks),
    }


def _groups(studied: QuantityStudy) -> list[Row]:
    compared = studied.comparison
    rows = zip(studied.groups, compared.captures, compared.replicates, compared.means, strict=True)
    return [
        {
            "quantity": studied.name,
            "unit": studied.unit,
            "group": group,
            "captures": captures,
            "replicates": replicates,
            **_judged("mean", mean),
        }
        for group, captures, replicates, mean in rows
    ]


def _pairs(studied: QuantityStudy) -> list[Row]:
    return [
        {
            "quantity": studied.name,
            "unit": studied.unit,
            "first": studied.groups[one.first],
            "second": studied.groups[one.second],
            **_judged("difference", one.found),
            "t": one.found.t,
            "p": one.found.p,
            "adjusted_p": one.adjusted_p,
            "verdict": difference_verdict(one),
        }
        for one in studied.comparison.differences
    ]


def _slopes(studied: QuantityStudy, over: str) -> list[Row]:
    if studied.trend is None:
        return []
    named = [
        (group, slope) for group, slope in zip(studied.groups, studied.trend.slopes, strict=True) if slope
    ]
    return [
        {
            "quantity": studied.name,
            "unit": studied.unit,
            "group": group,
            "over": over,
            **_judged("slope", slope),
            "t": slope.t,
            "p": slope.p,
            "verdict": slope_verdict(slope),
        }
        for group, slope in [*named, ("", studied.trend.common)]
    ]


def _judged(name: str, found: Contrast) -> Row:
    half = found.half_width
    return {
        name: (found.value, found.sigma),
        f"sigma_common_{name}": found.common,
        "low": found.value - half,
        "high": found.value + half,
        "dof": found.dof,
        "basis": basis(found),
    }
