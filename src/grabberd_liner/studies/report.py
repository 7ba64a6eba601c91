"""The report of a study: its results in sentences, and the values that its template cannot take from the
document.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from grabberd.reports.document import ReportForm, check_document
from grabberd.reports.figures import require_matplotlib
from grabberd.reports.notation import (
    DASH,
    common_exponent,
    measured,
    p_value,
    power_of_ten,
    probability,
    significant,
)
from grabberd_liner.reports.columns import Columns
from grabberd_liner.reports.environment import environment
from grabberd_liner.reports.figures.groups import PANELS

Quantity = Mapping[str, Any]
"""A quantity in the document of a study."""
Result = Mapping[str, Any]
"""A mean, difference or slope: value, sigma, common, p and verdict."""

MOSTLY_COMMON = "σ is mostly common."
_MOST_PAIRS = 3
_MOSTLY = 0.5
"""Share of the variance from which on the common part is what limits a result."""


def answer(quantity: Quantity) -> str:
    """The result of comparing a quantity's groups."""
    pairs = quantity["differences"]
    if not pairs:
        return _means(quantity)
    certain = [one for one in pairs if one["verdict"] == "differ"]
    if certain:
        certain.sort(key=lambda one: -abs(one["value"]))
        told = "; ".join(_pair(quantity, one) for one in certain[:_MOST_PAIRS])
        more = f"; and {len(certain) - _MOST_PAIRS} more pairs differ" if len(certain) > _MOST_PAIRS else ""
        return f"{told}{more}.{_limit(certain)}"
    greatest = max(pairs, key=lambda one: abs(one["value"]))
    before = "At most, " if len(pairs) > 1 else ""
    if greatest["p"] is None:
        return f"{before}{_pair(quantity, greatest)}, by the captures' own σ alone."
    return f"{before}{_pair(quantity, greatest)}.{_limit([greatest])}"


def trend_answer(quantity: Quantity, per: str) -> str:
    """The result of a quantity's trend, all groups together."""
    slope = quantity["trend"]
    if slope is None:
        return "No group has captures at two different places."
    told = _value(slope, f"{_unit(quantity)} per {per}".strip())
    if slope["p"] is None:
        return f"{told}, by the captures' own σ alone."
    return f"{told}, {p_value(slope['p'])}.{_limit([slope])}"


def _means(quantity: Quantity) -> str:
    """The mean of the only group."""
    group = quantity["values"]["group"]
    counted = "one capture" if len(group) == 1 else f"mean of {len(group)} captures"
    return f"{_value(quantity['means'][0], _unit(quantity))}, {counted}."


def _pair(quantity: Quantity, one: Result) -> str:
    """Difference of two groups, as the greater above the lesser."""
    low, high = (quantity["groups"][one[key]] for key in ("first", "second"))
    if one["value"] < 0:
        low, high = high, low
    p = "" if one["p"] is None else f", {p_value(one['p'])}"
    return f"{high} is {_value({**one, 'value': abs(one['value'])}, _unit(quantity))} above {low}{p}"


def _value(one: Result, unit: str) -> str:
    value, sigma = one["value"], one["sigma"]
    if not sigma:
        return f"{significant(value)} {unit}".strip()
    exponent = common_exponent([value, sigma])
    both = "{} ± {}".format(*measured(value, sigma, exponent))
    return f"{f'({both}) × {power_of_ten(exponent)}' if exponent else both} {unit}".strip()


def _limit(results: Sequence[Result]) -> str:
    """Words for a result that the common part of σ limits; empty for others."""
    if not any(one["sigma"] and (one["common"] / one["sigma"]) ** 2 > _MOSTLY for one in results):
        return ""
    return f" {MOSTLY_COMMON}"


def _unit(quantity: Quantity) -> str:
    return "" if quantity["unit"] == "1" else str(quantity["unit"])


Document = Mapping[str, Any]
STUDY = ReportForm("grabberd/study/1", ("created_utc", "question", "tables"), "study … --out DIR")
_MOST_NAMES = 3
_SHORT = {"no difference shown": "not shown", "no change shown": "not shown"}
_MANY = 1000
"""Degrees of freedom from which on σ is as good as known."""
_IN_A_TABLE = 5
"""Quantities beside each other in a table of captures."""


class JudgedRow(NamedTuple):
    """A mean, difference or slope as text; parts that are not known are dashes."""

    quantity: str
    of: str
    value: str
    common: str
    interval: str
    dof: str
    p: str
    basis: str
    verdict: str


class Captures(NamedTuple):
    """Some quantities of all captures: heads with units, and the cells of each."""

    columns: Sequence[tuple[str, Sequence[str]]]


def study_html(document: Document) -> str:
    """Write the report of a study as one self-contained page, the same text for the same document.

    Args:
        document: "grabberd/study/1".

    Raises:
        InputError: the document has another schema, lacks what every report has, or has a number that is not
            finite.
        ExtraMissing: matplotlib is not installed.
    """
    check_document(document, STUDY)
    require_matplotlib()
    return environment().render("study.html.jinja", document, **values(document))


def values(document: Document) -> dict[str, Any]:
    """Prepare the values of the template; its own comment describes them."""
    tables = {name: Columns(table) for name, table in document["tables"].items()}
    titles = {one["name"]: one["title"] for one in document["quantities"]}
    trends = [one for one in document["quantities"] if one["slopes"] is not None]
    answers = [answer(one) for one in document["quantities"]]
    trend_answers = [trend_answer(one, document["over_unit"]) for one in document["quantities"]]
    return {
        "answers": answers,
        "trend_answers": trend_answers,
        "is_limited": any(MOSTLY_COMMON in one for one in answers + trend_answers),
        "remarks": remarks(document),
        "figures": _parts(document["quantities"], PANELS),
        "trend_figures": _parts(trends, PANELS),
        "means": _judged(tables["groups"], "mean", titles),
        "differences": _judged(tables["comparison"], "difference", titles),
        "slopes": _judged(tables["trend"], "slope", titles),
        "scatter": _scatter(tables["quantities"]),
        "captures": [
            _captures(tables["captures"], part) for part in _parts(document["quantities"], _IN_A_TABLE)
        ],
        "left_out": document["left_out"],
    }


def remarks(document: Document) -> list[str]:
    """The document's remarks; what is the same of several quantities is said once."""
    titles: dict[str, list[str]] = {}
    for one in document["quantities"]:
        for remark in one["remarks"]:
            titles.setdefault(remark, []).append(one["title"])
    named = {
        remark: ", ".join(of) if len(of) <= _MOST_NAMES else f"{len(of)} quantities"
        for remark, of in titles.items()
    }
    return [*document["remarks"], *(f"{of}: {remark}" for remark, of in named.items())]


def _parts(whole: Sequence[Any], size: int) -> list[Sequence[Any]]:
    return [whole[first : first + size] for first in range(0, len(whole), size)]


def _judged(table: Columns, name: str, titles: Mapping[str, str]) -> list[JudgedRow]:
    return [_judged_row(table, name, titles, row) for row in range(len(table))]


def _judged_row(table: Columns, name: str, titles: Mapping[str, str], row: int) -> JudgedRow:
    unit, quantity = table.words("unit")[row], table.words("quantity")[row]
    value, sigma = table.value(name, row), table.value(f"sigma_{name}", row)
    common, low, high = (table.value(one, row) for one in (f"sigma_common_{name}", "low", "high"))
    decided = "adjusted_p" if name == "difference" else "p"
    verdict = table.words("verdict")
    return JudgedRow(
        f"{titles.get(quantity, quantity)}{'' if unit in ('', '1') else f' [{unit}]'}",
        _of(table, name, row),
        "{} ({})".format(*measured(value, sigma)) if sigma else significant(value),
        measured(common, sigma).value if common and sigma else DASH,
        _interval(low, high, sigma),
        _dof(table.value("dof", row)),
        probability(table.value(decided, row)),
        table.words("basis")[row],
        _SHORT.get(verdict[row], verdict[row]),
    )


def _interval(low: float | None, high: float | None, sigma: float | None) -> str:
    if low is None or high is None:
        return DASH
    return "\u00a0…\u00a0".join(measured(end, sigma).value for end in (low, high))


def _dof(dof: float | None) -> str:
    return "> 1000" if dof is not None and dof > _MANY else significant(dof, 2)


def _of(table: Columns, name: str, row: int) -> str:
    """Subject of a row: a group, two groups, or the groups together."""
    if name == "difference":
        return f"{table.words('second')[row]} − {table.words('first')[row]}"
    return table.words("group")[row] or "all, in common"


def _scatter(table: Columns) -> list[tuple[str, str, str, str]]:
    """Title, standard deviations within and between, and χ² by its freedom, of each quantity."""
    rows = []
    for row, title in enumerate(table.words("title")):
        chi2, dof, p = (table.value(name, row) for name in ("chi2", "chi2_dof", "chi2_p"))
        check = f"{significant(chi2 / dof, 2)} ({p_value(p)})" if chi2 is not None and dof else DASH
        sigmas = [significant(table.value(name, row), 2) for name in ("within_sigma", "between_sigma")]
        rows.append((title, *sigmas, check))
    return rows  # type: ignore[return-value]


def _captures(table: Columns, quantities: Sequence[Document]) -> Captures:
    fixed = [("Capture", table.words("capture")), ("Group", table.words("group"))]
    return Captures(
        [*fixed, *((table.titled(one["name"], one["title"]), table.cells(one["name"])) for one in quantities)]
    )
