"""The report of a guided test, on one page: the values that its template cannot take from the document."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from grabberd.reports.document import ReportForm, check_document
from grabberd.reports.figures import require_matplotlib
from grabberd.reports.notation import measured
from grabberd_liner.reports.environment import environment

Document = Mapping[str, Any]
LINER_TEST = ReportForm(
    "grabberd/liner-test/1", ("kind", "created_utc", "captures", "checks"), "test … --out DIR"
)

_TITLES = {
    "reference": "Reference state",
    "ramp": "Ramp without a teat",
    "milking": "Milking",
    "artificial-teat": "Artificial teat with known pressure",
    "overpressure": "Overpressure in two ways",
    "wear": "Wear over milkings",
}
_VERDICTS = {
    "passed": "The test has passed",
    "failed": "The test has failed",
    "not certain": "The test decides nothing for certain",
    "not checked": "Nothing could be checked",
}


class CheckRow(NamedTuple):
    """A check: value with ± σ and unit, empty without a numeric result."""

    title: str
    verdict: str
    value: str
    limit: str
    said: str


class QuantityRow(NamedTuple):
    """A quantity: value with ± σ and unit."""

    title: str
    value: str
    verdict: str


def liner_test_html(document: Document) -> str:
    """Write the report of a test as one self-contained page of A4, the same text for the same document.

    Args:
        document: "grabberd/liner-test/1".

    Raises:
        InputError: the document has another schema, lacks what every test has, or has a number that is not
            finite.
        ExtraMissing: matplotlib is not installed.
    """
    check_document(document, LINER_TEST)
    require_matplotlib()
    return environment().render("liner_test.html.jinja", document, **values(document))


def values(document: Document) -> dict[str, Any]:
    """Prepare the values of the template; its own comment describes them."""
    failed = [one["title"] for one in document["checks"] if one["verdict"] == "failed"]
    uncertain = [one["title"] for one in document["checks"] if one["verdict"] == "not certain"]
    return {
        "title": _TITLES[document["kind"]],
        "verdict": _VERDICTS[document["verdict"]],
        "because": failed or uncertain,
        "checks": _checks(document["checks"]),
        "quantities": [_quantity(one) for one in document["quantities"] if one["value"] is not None],
        "figures": _figures(document["curves"]),
        "used": sorted({_named(use) for one in document["captures"] for use in one["profiles"]}),
    }


def with_sigma(value: float | None, sigma: float | None, unit: str) -> str:
    """Write a value with ± σ and its unit; empty where there is none."""
    if value is None:
        return ""
    unit = "" if unit == "1" else unit
    written = measured(value, sigma)
    return f"{written.value} ± {written.sigma} {unit}".strip() if sigma else f"{value:.4g} {unit}".strip()


def _checks(checks: Sequence[Mapping[str, Any]]) -> list[CheckRow]:
    """All checks; what several have in common is said once."""
    rows: list[CheckRow] = []
    for row in map(_check, checks):
        said = {before.said for before in rows}
        rows.append(row._replace(said="") if row.said in said else row)
    return rows


def _check(one: Mapping[str, Any]) -> CheckRow:
    said = " ".join(f"{text[0].upper()}{text[1:]}." for text in (one["reason"], one["remedy"]) if text)
    value = with_sigma(one["value"], one["sigma"], one["unit"])
    return CheckRow(one["title"], one["verdict"], value, one["limit"], said)


def _quantity(one: Mapping[str, Any]) -> QuantityRow:
    value = with_sigma(one["value"], one["sigma"], one["unit"])
    return QuantityRow(one["title"], value, one["verdict"])


def _figures(curves: Sequence[Mapping[str, Any]]) -> list[list[Mapping[str, Any]]]:
    """Curves that share their axes, figure by figure; two fit on the page."""
    figures: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for one in curves:
        figures.setdefault((one["x_title"], one["y_title"]), []).append(one)
    return list(figures.values())[:2]


def _named(use: Mapping[str, Any]) -> str:
    return f"{use['kind']} {use['name']}, version {use['version']}"
