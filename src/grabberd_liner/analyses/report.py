"""The analysis report: the values that its template cannot take from the document as they are."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from grabberd.reports.document import ReportForm, check_document
from grabberd.reports.figures import require_matplotlib
from grabberd.reports.notation import fixed, measured
from grabberd_liner.analyses.documents import Outdated, outdated
from grabberd_liner.glued_targets import HEADS, TITLE, glued_targets, note, own_grid
from grabberd_liner.reports.columns import Columns
from grabberd_liner.reports.environment import environment
from grabberd_liner.reports.figures import State, states_of

Document = Mapping[str, Any]
ANALYSIS = ReportForm(
    "grabberd/analysis-report/1", ("id", "created_utc", "inputs", "tables", "states"), "analyse … --out DIR"
)
Tables = Mapping[str, Columns]


_BEGIN = "<main>"
_CLOSED = (
    "liner compression, mean",
    "liner compression, greatest",
    "teat load",
    "liner compression, mean, above atmosphere",
    "liner compression, greatest, above atmosphere",
)
"""Titles of the quantities that the verdict is about."""
_LIMITS = (
    ("bias", "bias_kpa", "bias_low_kpa", "bias_high_kpa"),
    ("lower limit", "lower_kpa", "lower_low_kpa", "lower_high_kpa"),
    ("upper limit", "upper_kpa", "upper_low_kpa", "upper_high_kpa"),
)
"""Lines of Bland and Altman's figure, by the columns of their values and confidence intervals."""
_UNLIKELY = 0.01
_ALONG_MM = 5.0


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


def marked_outdated(page: str, outdated: Outdated) -> str:
    """Put the notice of what is wrong at the top of a report that was drawn before it was known."""
    notice = environment().render("outdated.html.jinja", {}, outdated=outdated)
    return page.replace(_BEGIN, f"{_BEGIN}\n{notice}", 1)


def values(document: Document) -> dict[str, Any]:
    """Prepare the values of the template; its own comment describes them."""
    # Not at the head: the daemon marks reports, but never draws them.
    from grabberd_liner.chain.analysis.quantities import left_out  # noqa: PLC0415

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
        "outdated": outdated(document.get("pressure_method"), _peak(tables) is not None, _names(tables)),
        "undetermined": [_undetermined(state) for state in states],
        "start_seen": tables["summary"].value("touch_n") != tables["fields"].value("n"),
        "misfit": _median(tables["fields"], "misfit"),
        "load_misfit": _median(tables["fields"], "load_misfit"),
        "heights": heights,
        "distances": [_distances(tables, height) for height in heights],
        "quantities": quantities,
        "left_out": left_out((one.title, one.reason) for one in quantities),
        "closed_liner": _closed_liner(quantities),
        "agreement": _agreement(tables),
        "glued": _glued(document["grid"]),
        "has_profile": "phase_profile" in tables and len(tables["phase_profile"]) > 0,
        "cycle_shares": _cycle_shares(tables["summary"]),
        "given": list(_given(document["inputs"]["given"])),
    }


def _names(tables: Tables) -> list[str]:
    return tables["quantities"].words("name") if "quantities" in tables else []


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
    """Compression, its maximum and the load of the closed liner, and the first two above atmosphere."""
    values = {one.title: one.value for one in quantities}
    found = [values.get(title, "") for title in _CLOSED]
    return found if all(found[:3]) else []


def _shown(value: float | None, sigma: float | None, unit: str) -> str:
    if value is None or sigma is None:
        return ""
    return "{} ± {} {}".format(*measured(value, sigma), "" if unit == "1" else unit).strip()


class AgreementPage(NamedTuple):
    """The agreement with another method.

    Attributes:
        table: its row of results; `reason`: why there is none.
        figures: Bland and Altman's, and both methods along the teat, as `tested_svg` takes them.
        limits: bias and limits of agreement, each as cells: name, value, confidence interval.
        scatters: True if the differences scatter more than the σ of both explain.
    """

    table: Columns
    reason: str
    figures: Sequence[Sequence[Mapping[str, Any]]] = ()
    limits: Sequence[tuple[str, str, str]] = ()
    scatters: bool = False


def _agreement(tables: Tables) -> AgreementPage | None:
    """None without another method."""
    table = tables.get("agreement")
    if table is None or not len(table):
        return None
    if reason := table.words("reason")[0]:
        return AgreementPage(table, reason)
    places = tables["agreement_places"]
    both = [places.numbers(f"{name}_kpa") for name in ("map", "other")]
    lines = [(name, [float(table.numbers(key)[0]) for key in keys]) for name, *keys in _LIMITS]
    ends = [float(end(np.mean(both, axis=0))) for end in (np.min, np.max)]
    bland_altman = [
        _curve(
            "points",
            "places",
            np.mean(both, axis=0),
            places.numbers("difference_kpa"),
            places.sigma("difference_kpa"),
        ),
        *(_curve("line", name, ends, [at] * 2, [(high - low) / 2] * 2) for name, (at, low, high) in lines),
    ]
    shown = [(name, fixed(at, 1), f"{fixed(low, 1)} … {fixed(high, 1)}") for name, (at, low, high) in lines]
    scatters = (table.value("p") or 0.0) < _UNLIKELY
    return AgreementPage(table, "", [bland_altman, list(_along(places))], shown, scatters)


def _along(places: Columns) -> Iterator[Mapping[str, Any]]:
    """Both methods along the teat: means over all places within a few millimetres."""
    part = np.round(places.numbers("x_mm") / _ALONG_MM)
    at = np.unique(part)
    for style, name, title in (("line", "map_kpa", "map"), ("points", "other_kpa", "other method")):
        mean, sigma = (
            [float(values[part == one].mean()) for one in at]
            for values in (places.numbers(name), places.sigma(name))
        )
        yield _curve(style, title, at * _ALONG_MM, mean, sigma) | {
            "x_title": "along the teat, x",
            "x_unit": "mm",
            "y_title": "mean round the teat",
        }


def _curve(style: str, title: str, x: Any, y: Any, sigma: Any) -> dict[str, Any]:
    return {
        "style": style,
        "title": title,
        "x": x,
        "y": y,
        "sigma": sigma,
        "x_title": "mean of both methods",
        "x_unit": "kPa",
        "y_title": "map less other method",
        "y_unit": "kPa",
    }


def _glued(grid: Mapping[str, Any]) -> dict[str, Any]:
    """The results that other grids of targets would have, with the analysis' own one marked."""
    own = None
    if "u_mm" in grid and len(rows_mm := np.unique(grid["u_mm"])) > 1:
        own = own_grid(len(set(grid["column"])), float(np.diff(rows_mm).mean()))
    cells = [(*one.cells, "as it is" if one == own else "") for one in glued_targets()]
    return {
        "title": TITLE,
        "columns": list(zip((*HEADS, ""), zip(*cells, strict=True), strict=True)),
        "note": note(),
    }


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
            yield f"{before}{key}", _one_line(value)


def _one_line(value: Any) -> Any:
    """A value, but of a table its first line."""
    lines = value.splitlines() if isinstance(value, str) else []
    return f"{len(lines)} lines, the first of them: {lines[0]}" if len(lines) > 1 else value
