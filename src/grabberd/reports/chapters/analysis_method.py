"""What the numbers mean: formulas, σ, sources, and every column."""

from collections.abc import Iterator, Mapping
from typing import Any

from grabberd.reports.markup import Html, element, items, joined, paragraph, table

Document = Mapping[str, Any]

_FORMULAS = (
    "Surface: the object model's shape and a smooth departure from it, by the points and their covariance; "
    "how smooth, by restricted likelihood. What the smoothing may have taken away is part of σ.",
    "Curvature κ₁ ≥ κ₂ of the wall's middle surface: II_h = II − h III, I_h = I − 2h II + h² III, h the "
    "depth below the targets. Without material, of the outer face.",
    "Strain: principal stretch λ − 1 by Green and Lagrange, E = ½ (C − 1), against the reference state.",
    "Tension T of the middle surface by the material's law, with the pre-tension of mounting.",
    "Pressure: p_contact = (p_pulsation − p_liner) + T:κ − ∇∇:M, M = D[(κ − κ₀) + ν …], brought to the inner "
    "face by the ratio of areas. Overpressure: the same above atmosphere.",
    "σ: propagated from the points' covariance, the vacuum's, the clock's and the material's σ. The "
    "calibration's share, common to all fields, is not in it.",
    "Wall phases: 10 and 90 % of the stroke. ISO's phases: 4 kPa above atmosphere and 4 kPa below the "
    "greatest vacuum of the pulsation chamber.",
)
_SOURCES = (
    "I. Maalen-Johansen: Close-range videometry. Design and calibration of a mono-camera system for dynamic "
    "purposes. Sections 3.7 and 3.8, figure 11.",
    "ISO 3918, ISO 5707, ISO 6690: milking machine installations.",
)


def method(_document: Document) -> Html:
    """Formulas and sources."""
    return joined(
        items(_FORMULAS),
        paragraph(
            "The object's frame is right-handed, in mm: x along the liner, y across, z towards the cameras. "
            "Maps have the target grid's rows downwards and its columns to the right."
        ),
        element("h3", "Sources"),
        items(_SOURCES),
    )


def columns(document: Document) -> Html:
    """Every column that stands in the data, once."""
    rows = [(one["name"], one["unit"] or "–", one["meaning"]) for one in _all(document)]
    listed = table("Columns, units and meanings", ["Column", "Unit", "Meaning"], rows, class_="dense")
    return element("details", element("summary", f"{len(rows)} columns"), listed)


def _all(document: Document) -> Iterator[Mapping[str, Any]]:
    known = set()
    tables = [*document["tables"].values(), *(state["targets"] for state in document["states"][:1])]
    for one in (column for each in tables for column in each["columns"]):
        if one["name"] not in known and not one["name"].startswith("sigma_"):
            known.add(one["name"])
            yield one
