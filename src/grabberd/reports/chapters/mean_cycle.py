"""The mean cycle: all fields put together by their phase."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from grabberd.reports.chapters.shape import phase_panels
from grabberd.reports.columns import Columns
from grabberd.reports.figures import curves_svg
from grabberd.reports.markup import Html, absent, figure, joined, table
from grabberd.reports.numbers import fixed

Document = Mapping[str, Any]


def mean_cycle(document: Document) -> Html:
    """Curves over the phase, and the same as a table."""
    phases, sections = (Columns(document["tables"][name]) for name in ("phases", "phase_sections"))
    if not len(phases):
        return absent("There is no mean cycle: see the problems above.")
    drawn = figure(
        curves_svg(
            phase_panels(phases, sections),
            "phase of the mean cycle",
            "Curves over the mean cycle with bands of one σ",
            document.get("wall_phases") or (),
        ),
        "The mean cycle from the beginning of wall phase a on, with bands of ± one σ; dashed: where a wall "
        "phase ends.",
    )
    return joined(drawn, _listed(phases, sections))


def _listed(phases: Columns, sections: Columns) -> Html:
    heights = np.unique(sections.numbers("height_mm"))
    heads = [
        "Phase",
        *(f"Distance at {fixed(float(x), 0)} mm [mm]" for x in heights),
        "Area [mm²]",
        "Mean [kPa]",
        "Greatest [kPa]",
    ]
    names = ("area_mm2", "mean_contact_kpa", "greatest_contact_kpa")
    rows = []
    for row in range(len(phases)):
        phase = phases.one("phase", row)
        widths = [_distance(sections, phase, height) for height in heights]
        rows.append((fixed(phase, 3), *widths, *(phases.cell(name, row) for name in names)))
    return table("The mean cycle (σ in brackets)", heads, rows, class_="dense")


def _distance(sections: Columns, phase: float | None, height: float) -> str:
    at = (sections.numbers("phase") == phase) & (sections.numbers("height_mm") == height)
    row = np.flatnonzero(at)
    return sections.cell("distance_mm", int(row[0])) if len(row) else "–"
