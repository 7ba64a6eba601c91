"""The analysis report: the values that its template cannot take from the document as they are."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from grabberd.reports.document import ReportForm, check_document
from grabberd.reports.figures import require_matplotlib
from grabberd.reports.notation import measured
from grabberd_liner.analyses.documents import is_outdated
from grabberd_liner.reports.columns import Columns
from grabberd_liner.reports.environment import environment
from grabberd_liner.reports.figures import State, states_of

Document = Mapping[str, Any]
ANALYSIS = ReportForm(
    "grabberd/analysis-report/1", ("id", "created_utc", "inputs", "tables", "states"), "analyse … --out DIR"
)
Tables = Mapping[str, Columns]


_BEGIN = "<main>"
_CLOSED = ("liner compression, mean", "liner compression, greatest", "teat load")
"""Titles of the quantities that the verdict is about."""


class Peak(NamedTuple):
    """Row of a table in which the mean pressure is greatest; `phase` if it is a table over the mean cycle."""

    table: Columns
    row: int
    field: float | None
    phase: float | None


class Undetermined(NamedTuple):
    """Numbers of a state's targets with and without a pressure, and how often which reason is given."""

    name: str
    known: int
    without: int
    reasons: Sequence[tuple[str, int]]


class QuantityRow(NamedTuple):
    """A quantity of the field: value with ± σ and unit, verdict and reason are empty where there is none."""

    title: str
    value: str
    verdict: str
    reason: str
    definition: str
    source: str


def analysis_html(document: Document) -> str:
    """Write the report of an analysis as one self-contained page, the same text for the same document.

    Args:
        document: "grabberd/analysis-report/1"; the report says what could not be determined, and why.

    Raises:
        InputError: the document has another schema, lacks what every report has, or has a number that is not
            finite.
        ExtraMissing: matplotlib is not installed.
    """
    check_document(document, ANALYSIS)
    require_matplotlib()
    return environment().render("analysis.html.jinja", document, **values(document))


def marked_outdated(page: str) -> str:
    """Put the notice of wrong pressures at the top of a report that was drawn before it was known."""
    notice = environment().render("outdated.html.jinja", {})
    return page.replace(_BEGIN, f"{_BEGIN}\n{notice}", 1)


def values(document: Document) -> dict[str, Any]:
    """Prepare the values of the template; its own comment describes them."""
    # Not at the head: the daemon marks reports, but never draws them.
    from grabberd_liner.chain.analysis.tables import left_out  # noqa: PLC0415

    tables = {name: Columns(table) for name, table in document["tables"].items()}
    states = states_of(document)
    quantities = _quantities(tables.get("quantities"))
    heights = np.unique(tables["phase_sections"].numbers("height_mm")).tolist()
    return {
        "tables": tables,
        "states": states,
        "is_ramp": "ramp" in tables and len(tables["ramp"]) > 0,
        "is_known": lambda name: any(state.columns.is_known(name) for state in states),
        "peak": _peak(tables),
        "outdated": is_outdated(document.get("pressure_method"), _peak(tables) is not None),
        "undetermined": [_undetermined(state) for state in states],
        "start_seen": tables["summary"].value("touch_n") != tables["fields"].value("n"),
        "misfit": _median(tables["fields"], "misfit"),
        "load_misfit": _median(tables["fields"], "load_misfit"),
        "heights": heights,
        "distances": [_distances(tables, height) for height in heights],
        "quantities": quantities,
        "left_out": left_out((one.title, one.reason) for one in quantities),
        "closed_liner": _closed_liner(quantities),
        "has_profile": "phase_profile" in tables and len(tables["phase_profile"]) > 0,
        "cycle_shares": _cycle_shares(tables["summary"]),
        "given": list(_given(document["inputs"]["given"])),
        "all_columns": _all_columns(document),
    }


def _peak(tables: Tables) -> Peak | None:
    """From the mean cycle if there is one, otherwise from the single fields."""
    for name in ("phases", "fields"):
        table = tables[name]
        if table.is_known("mean_contact_kpa"):
            row = int(np.nanargmax(table.numbers("mean_contact_kpa")))
            phase = table.value("phase", row) if name == "phases" else None
            return Peak(table, row, table.value("n", row), phase)
    return None


def _undetermined(state: State) -> Undetermined:
    known = int(np.isfinite(state.columns.numbers("contact_kpa")).sum())
    reasons = Counter(_kind(reason) for reason in state.columns.words("reason") if reason)
    return Undetermined(state.name, known, len(state.columns) - known, list(reasons.items()))


def _kind(reason: str) -> str:
    """A reason without the values of its target, so that equal ones can be counted."""
    return re.sub(r" of [\d.e+-]+ kPa| \([^)]*\)", "", reason)


def _quantities(table: Columns | None) -> list[QuantityRow]:
    """Rows of the table `quantities`; none in a document of an earlier version."""
    if table is None:
        return []
    value, sigma = table.values("value"), table.values("sigma_value")
    shown = [_shown(*one) for one in zip(value, sigma, table.words("unit"), strict=True)]
    texts = [table.words(name) for name in ("verdict", "reason", "definition", "source")]
    return [QuantityRow(*row) for row in zip(table.words("title"), shown, *texts, strict=True)]


def _closed_liner(quantities: Sequence[QuantityRow]) -> list[str]:
    """Compression, its maximum and the load of the closed liner; empty unless all are known."""
    values = {one.title: one.value for one in quantities}
    found = [values.get(title, "") for title in _CLOSED]
    return found if all(found) else []


def _shown(value: float | None, sigma: float | None, unit: str) -> str:
    if value is None or sigma is None:
        return ""
    return "{} ± {} {}".format(*measured(value, sigma), "" if unit == "1" else unit).strip()


def _median(fields: Columns, name: str) -> float | None:
    return fields.spread(name).median if fields.is_known(name) else None


def _distances(tables: Tables, height: float) -> list[str]:
    """Distance at a height for every phase of the mean cycle, as cells."""
    sections = tables["phase_sections"]
    cells = sections.cells("distance_mm")
    rows = zip(sections.values("phase"), sections.values("height_mm"), cells, strict=True)
    at = {phase: cell for phase, section_height, cell in rows if section_height == height}
    return [at.get(phase, "–") for phase in tables["phases"].values("phase")]


def _cycle_shares(summary: Columns) -> dict[str, float]:
    """Share of each phase in the cycle of its own kind, the wall's or the vacuum's."""
    shares: dict[str, float] = {}
    for kind in ("wall", "iso"):
        known = {f"{kind}_{letter}_s": summary.value(f"{kind}_{letter}_s") for letter in "abcd"}
        durations = {name: value for name, value in known.items() if value is not None}
        shares |= {name: value / sum(durations.values()) for name, value in durations.items()}
    return shares


def _given(given: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    """Inputs one by one, nested ones by their path: "material.E_mpa", "sensors 2.offset_s"."""
    for key, value in given.items():
        if isinstance(value, Mapping):
            yield from _given(value, f"{before}{key}.")
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            for index, inner in enumerate(value, start=1):
                yield from _given(inner, f"{before}{key} {index}.")
        else:
            yield f"{before}{key}", value


def _all_columns(document: Document) -> list[Mapping[str, Any]]:
    """Every column once, but for those of σ."""
    first: dict[str, Mapping[str, Any]] = {}
    for table in [*document["tables"].values(), *(state["targets"] for state in document["states"][:1])]:
        for column in table["columns"]:
            first.setdefault(column["name"], column)
    return [column for name, column in first.items() if not name.startswith("sigma_")]
