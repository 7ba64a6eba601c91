"""A study as one JSON document, the source of its report.

The tables of a study, one row for each capture, quantity, group, pair, slope, and what is left out: their
columns with name, unit, type and meaning, and the verdicts on differences and trends.
"""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from grabberd.core.chain.columns import Column, Table, TableSpec, make_table
from grabberd.core.geometry.document_reader import finite
from grabberd_liner.analysis.comparison import Difference
from grabberd_liner.analysis.mixed_model import Contrast
from grabberd_liner.chain.analysis.analysis_document import table_document
from grabberd_liner.chain.analysis.columns import measured, number, text
from grabberd_liner.chain.study.study import DATE, QuantityStudy, Studied, Study, natural

_QUANTITY = (
    text("quantity", "name of the quantity, ending with its unit if it has one"),
    text("unit", "unit of the row's values; 1 for a ratio"),
)
_BASIS = text(
    "basis",
    "what σ is based on, besides its common part: scatter of the captures; own σ, if that is greater; own σ "
    "alone, if there is no scatter to judge by, so that nothing can be tested",
)


def _judged_columns(name: str, meaning: str, what: str) -> tuple[Column, ...]:
    """A value with σ and the common part of that, and what judges it."""
    return (
        measured(name, "", meaning),
        number(f"sigma_common_{name}", "", f"part of sigma_{name} that more captures do not reduce"),
        number("low", "", f"lower end of the 95 % interval of the {what}"),
        number("high", "", f"upper end of the 95 % interval of the {what}"),
        number("dof", "", "degrees of freedom of σ (Welch–Satterthwaite); empty without scatter"),
    )


_TEST = (
    number("t", "1", "value by its σ"),
    number("p", "1", "probability of a value at least as far from 0 if it were 0"),
)

TABLES = {
    "quantities": TableSpec(
        "Quantities compared: a row for each",
        _QUANTITY,
        (
            text("title", "what it is called"),
            text("definition", "its definition"),
            number("captures", "", "captures that have it"),
            text("paired", "yes if groups were compared within the blocks, else no"),
            number("between_sigma", "", "standard deviation between the blocks, beyond that within them"),
            number("within_sigma", "", "standard deviation of the replicates within groups and blocks"),
            number("chi2", "1", "sum of the captures' squared deviations, weighted by their own σ"),
            number("chi2_dof", "", "its expected value if captures differ by their own σ alone"),
            number("chi2_p", "1", "probability of a greater one if they do"),
            text("verdict", "differ if any pair of groups does, else no difference shown; or not tested"),
            text("remarks", "remarks"),
        ),
    ),
    "groups": TableSpec(
        "The groups: a row for each quantity and group",
        (*_QUANTITY, text("group", "name of the group")),
        (
            number("captures", "", "captures of the group that have the quantity"),
            number("replicates", "", "number of independent values after averaging by unit"),
            *_judged_columns("mean", "mean of the group", "mean"),
            _BASIS,
        ),
    ),
    "comparison": TableSpec(
        "Comparison of groups: a row for each quantity and pair",
        (
            *_QUANTITY,
            text("first", "name of a group"),
            text("second", "name of another group"),
        ),
        (
            *_judged_columns("difference", "mean of `second` minus that of `first`", "difference"),
            *_TEST,
            number("adjusted_p", "1", "p adjusted for all pairs of the quantity (Holm)"),
            _BASIS,
            text("verdict", "differ if adjusted_p < .05, else no difference shown; or not tested"),
        ),
    ),
    "trend": TableSpec(
        "The trend: a row for each quantity and group, and one for the slope that all groups share",
        (
            *_QUANTITY,
            text("group", "name of the group; empty for the slope that all share"),
            text("over", "what the trend runs over"),
        ),
        (
            *_judged_columns("slope", "change of the quantity per unit of `over`", "slope"),
            *_TEST,
            _BASIS,
            text("verdict", "changes if p < .05, else no change shown; or not tested"),
        ),
    ),
    "left_out": TableSpec(
        "Omissions: a row for each capture, or quantity of a capture, that was left out",
        (
            text("capture", "id of the capture, or the file"),
            text("quantity", "name of the quantity; empty where the whole capture is left out"),
        ),
        (text("reason", "why"),),
    ),
}


def captures_spec(labels: Iterable[str], quantities: Sequence[tuple[str, str, str]]) -> TableSpec:
    """Specification of the table `captures`.

    Args:
        labels: keys of labels.
        quantities: name, unit and title of each.
    """
    return TableSpec(
        "The captures: a row for each",
        (text("capture", "id of the capture"),),
        (
            text("captured_utc", "its start"),
            text("device", "name of its device"),
            text("verdict", "complete or incomplete"),
            text("group", "name of its group"),
            text("analysis", "number of its newest analysis, or the folder that it is in"),
            text("analysed_utc", "when that was made"),
            text("liner_shared", "the liner: captures of the same one share the common part of σ"),
            *(text(f"label_{name}", f"its label {name}") for name in labels),
            *(column for one in quantities for column in _quantity_columns(*one)),
        ),
    )


def _quantity_columns(name: str, unit: str, title: str) -> tuple[Column, Column]:
    common = number(f"sigma_common_{name}", unit, f"part of sigma_{name} that captures of a liner share")
    return measured(name, unit, title), common


CERTAIN = 0.05
"""Probability below which a difference is believed."""
DIFFER, SAME, CHANGES, STEADY = "differ", "no difference shown", "changes", "no change shown"
UNTESTED = "not tested"
BY_SCATTER, BY_OWN, BY_OWN_ALONE = "scatter", "own σ", "own σ alone"


def basis(found: Contrast) -> str:
    """Origin of the σ of a result: the scatter, or the captures' own σ."""
    if not math.isfinite(found.dof):
        return BY_OWN_ALONE
    return BY_OWN if found.by_sigma else BY_SCATTER


def difference_verdict(difference: Difference) -> str:
    """Verdict on two groups."""
    if not math.isfinite(difference.adjusted_p):
        return UNTESTED
    return DIFFER if difference.adjusted_p < CERTAIN else SAME


def slope_verdict(slope: Contrast) -> str:
    """Verdict on a trend."""
    if not math.isfinite(slope.p):
        return UNTESTED
    return CHANGES if slope.p < CERTAIN else STEADY


def whole_verdict(verdicts: list[str]) -> str:
    """Verdict on a quantity by those on its pairs; empty if there are none."""
    return next((one for one in (DIFFER, SAME, UNTESTED) if one in verdicts), "")


StudyTables = Mapping[str, Table]
"""Tables by name: captures, and those of `TABLES`."""
Row = Mapping[str, Any]
"""Values by column name; of a measured column the pair of value and σ."""


def tables(study: Study) -> StudyTables:
    """All tables of a study; one without results has no rows."""
    rows: dict[str, list[Row]] = {
        "quantities": [_quantity_row(one) for one in study.quantities],
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


def _quantity_row(studied: QuantityStudy) -> Row:
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
