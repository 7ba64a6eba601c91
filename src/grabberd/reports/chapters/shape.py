"""The wall in four states with its pressure (paper figure 11), and its course over time."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from grabberd.reports.columns import Columns
from grabberd.reports.figures import Curve, Panel, State, curves_svg, maps_svg, model_svg, states_of
from grabberd.reports.markup import Html, absent, element, figure, joined, table
from grabberd.reports.numbers import UNKNOWN, fixed

Document = Mapping[str, Any]

_OF_STATES = (
    ("contact_kpa", "pressure"),
    ("strain1", "strain ε₁"),
    ("kappa1_per_m", "curvature κ₁"),
)
_PRESSURE = (("mean_contact_kpa", "mean"), ("greatest_contact_kpa", "greatest"))
_VACUUM = (("pulsation_vacuum_kpa", "pulsation chamber"), ("liner_vacuum_kpa", "liner"))


def shape(document: Document) -> Html:
    """The model above, the best map that there is below, and the map of σ."""
    states = states_of(document)
    column, title = next(
        (one for one in _OF_STATES if any(state.columns.is_known(one[0]) for state in states)), _OF_STATES[-1]
    )
    named = ", ".join(state.name for state in states)
    above = figure(
        model_svg(states, column, title, f"Model of the wall and map of its {title} in {len(states)} states"),
        f"The wall from beside, coloured with its {title} (above; grey: not determined), and its {title} on "
        f"the target grid (below): {named}. Dots: targets; crosses: nothing is determined there.",
    )
    if column != "contact_kpa":
        said = absent("There is no map of the pressure: see what was not given, and the problems, above.")
        return joined(above, said)
    return joined(above, pressure_sigma(states))


def pressure_sigma(states: Sequence[State]) -> Html:
    """The overpressure with its σ, and where nothing is determined."""
    drawn = figure(
        maps_svg(states, "overpressure_kpa", "overpressure", "Map of the overpressure and of its σ"),
        "Above: pressure on the teat above atmosphere. Below: its σ.",
    )
    return joined(drawn, _not_determined(states))


def _not_determined(states: Sequence[State]) -> Html:
    rows = []
    for state in states:
        known = int(np.isfinite(state.columns.numbers("contact_kpa")).sum())
        lacking = len(state.columns) - known
        rows.append((state.name, str(known), str(lacking), _why(state) if lacking else "all are determined"))
    return table("Targets at which the pressure is determined", ["State", "yes", "no", "Why not"], rows)


def _why(state: State) -> str:
    reasons = Counter(_kind(reason) for reason in state.columns.words("reason") if reason)
    said = "; ".join(f"{reason}: {times}" for reason, times in reasons.items())
    return said or "there is no map of this state: see the problems above"


def _kind(reason: str) -> str:
    """A reason without the values of its place."""
    return re.sub(r" of [\d.e+-]+ kPa| \([^)]*\)", "", reason)


def curves(document: Document) -> Html:
    """Vacuum, movement, sections, area, pressure over time; each with its σ."""
    fields, sections = (Columns(document["tables"][name]) for name in ("fields", "sections"))
    panels = [
        *_panel("vacuum [kPa]", [Curve.of(said, fields, "time_s", name) for name, said in _VACUUM]),
        *_panel("movement [mm]", [Curve.of("target that moves most", fields, "time_s", "movement_mm")]),
        *section_panels(sections, "time_s"),
        *_panel("area [cm²]", [_in_cm2(fields, "time_s")]),
        *_panel("pressure [kPa]", [Curve.of(said, fields, "time_s", name) for name, said in _PRESSURE]),
    ]
    drawn = figure(
        curves_svg(panels, "time [s]", "Curves over time with bands of one σ"),
        "Course over the capture, a value for each field, with bands of ± one σ. Lines break where fields "
        "are missing or nothing is determined. The greatest pressure is that of the target where it is "
        "greatest: noise raises it. The area is that of the part that data support: it jumps where targets "
        "come and go.",
    )
    return joined(drawn, _listed(fields, sections))


def section_panels(sections: Columns, key: str) -> list[Panel]:
    """The distance from the plane at each height, or where there is none the outline's length."""
    for name, said in (("distance_mm", "distance [mm]"), ("length_mm", "outline [mm]")):
        if sections.is_known(name):
            heights = np.unique(sections.numbers("height_mm"))
            return [Panel(said, tuple(_at_height(sections, key, name, height) for height in heights))]
    return []


def _at_height(sections: Columns, key: str, name: str, height: float) -> Curve:
    at = sections.numbers("height_mm") == height
    values = (sections.numbers(key), sections.numbers(name), sections.sigma(name))
    return Curve(f"x = {fixed(float(height), 1)} mm", *(part[at] for part in values))


def _panel(label: str, curves: Sequence[Curve]) -> list[Panel]:
    known = tuple(curve for curve in curves if np.isfinite(curve.value).any())
    return [Panel(label, known)] if known else []


def _in_cm2(columns: Columns, key: str) -> Curve:
    value, sigma = columns.numbers("area_mm2") / 100, columns.sigma("area_mm2") / 100
    return Curve("outer face", columns.numbers(key), value, sigma)


def phase_panels(phases: Columns, sections: Columns) -> list[Panel]:
    """The same over the phase of the mean cycle."""
    return [
        *_panel("vacuum [kPa]", [Curve.of(said, phases, "phase", name) for name, said in _VACUUM]),
        *section_panels(sections, "phase"),
        *_panel("area [cm²]", [_in_cm2(phases, "phase")]),
        *_panel("pressure [kPa]", [Curve.of(said, phases, "phase", name) for name, said in _PRESSURE]),
    ]


def _listed(fields: Columns, sections: Columns) -> Html:
    names = ("movement_mm", "area_mm2", "mean_contact_kpa", "greatest_contact_kpa")
    heads = ["Field", "Time [s]", "Phase", "Movement [mm]", "Area [mm²]", "Mean [kPa]", "Greatest [kPa]"]
    rows = [
        (
            f"{fields.one('n', row):.0f}",
            fixed(fields.one("time_s", row), 3),
            fixed(fields.one("phase", row), 3),
            *(fields.cell(name, row) for name in names),
        )
        for row in range(len(fields))
    ]
    listed = table("Fields (σ in brackets)", heads, rows, class_="dense")
    return element("details", element("summary", f"{len(rows)} fields"), listed) if rows else Html(UNKNOWN)
