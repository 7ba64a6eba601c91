"""The pulsation: length, rate and ratio, the phases by wall and vacuum, and how much cycles differ."""

from collections.abc import Mapping
from typing import Any

from grabberd.reports.columns import Columns
from grabberd.reports.markup import Html, absent, element, facts, joined, paragraph, table
from grabberd.reports.numbers import UNKNOWN, fixed

Document = Mapping[str, Any]

_PHASES = (("a", "opening"), ("b", "open"), ("c", "closing"), ("d", "closed"))


def pulsation(document: Document) -> Html:
    """What was found of the cycle."""
    summary = Columns(document["tables"]["summary"])
    if not summary.is_known("period_s"):
        return absent("No pulsation was found: see the problems above.")
    cycles = Columns(document["tables"]["cycles"])
    return joined(_found(summary), _phases(summary), _by_cycle(cycles), _gaps(document))


def _found(summary: Columns) -> Html:
    return facts(
        "The mean cycle",
        [
            ("Length", summary.said("period_s")),
            ("Rate", summary.said("rate_per_min")),
            ("Standard deviation of the cycles' lengths", summary.said("period_spread_s", 6)),
            ("Standard deviation of the cycles' strokes, by the mean one", summary.said("stroke_spread", 4)),
            ("Departure of the movement from the mean cycle (r.m.s.)", summary.said("residual_mm", 4)),
            ("What it would be by the points' σ alone", summary.said("expected_mm", 4)),
        ],
    )


def _phases(summary: Columns) -> Html:
    period = summary.one("period_s")
    rows = []
    for letter, name in _PHASES:
        cells = [
            cell for defined in ("wall", "iso") for cell in _phase(summary, f"{defined}_{letter}_s", period)
        ]
        rows.append((f"{letter}, {name}", *cells))
    ratio = [summary.cell("wall_ratio", 0), UNKNOWN, summary.cell("iso_ratio", 0), UNKNOWN]
    heads = ["Phase", "Wall [s]", "share", "ISO 5707 [s]", "share"]
    listed = table(
        "Phases by the wall's movement and by the vacuum (σ in brackets)",
        heads,
        [*rows, ("ratio (a + b) / cycle", *ratio)],
    )
    said = paragraph(
        "Wall phases: 10 and 90 % of the stroke part them. ISO's: 4 kPa above atmosphere and 4 kPa below the "
        "greatest vacuum. The wall follows the vacuum late, so the two are not alike."
    )
    missing = (
        []
        if summary.is_known("iso_a_s")
        else [absent("The vacuum is not known as a curve, so there are no phases by ISO's definition.")]
    )
    return joined(listed, said, *missing)


def _phase(summary: Columns, name: str, period: float | None) -> tuple[str, str]:
    value = summary.one(name)
    share = None if value is None or not period else value / period
    return summary.cell(name, 0), fixed(share, 3)


def _by_cycle(cycles: Columns) -> Html:
    if not len(cycles):
        return absent("The capture holds no whole cycle that could be compared with the mean one.")
    rows = [
        (str(row + 1), cycles.cell("start_s", row), cycles.cell("stroke", row)) for row in range(len(cycles))
    ]
    heads = ["Cycle", "Begins [s]", "Stroke by the mean one"]
    listed = table("Cycle by cycle (σ in brackets)", heads, rows)
    return element("details", element("summary", f"{len(rows)} whole cycle{'s' * (len(rows) > 1)}"), listed)


def _gaps(document: Document) -> Html:
    gaps = Columns(document["tables"]["gaps"])
    if not len(gaps):
        return paragraph("No field is missing between the first and the last.")
    rows = [
        [f"{gaps.one(name, row):.0f}" for name in ("after_n", "until_n", "missing")]
        for row in range(len(gaps))
    ]
    return table("Fields without points; none was filled in", ["After field", "Until field", "Missing"], rows)
