"""How far the pressure can be trusted: the free wall, what σ is made of, how much could not be determined."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from grabberd.reports.chapters.analysis_head import touches_at_once
from grabberd.reports.columns import Columns
from grabberd.reports.markup import Html, absent, joined, paragraph, table
from grabberd.reports.numbers import fixed, significant

Document = Mapping[str, Any]

_LIMIT = 3.0
_MISFIT = 1.5


def pressure(document: Document) -> Html:
    """Self-checks, field by field summed up."""
    fields = Columns(document["tables"]["fields"])
    if not fields.is_known("mean_contact_kpa"):
        return absent(
            "The pressure was determined in no field: see what was not given, and the problems, above."
        )
    return joined(_misfit(fields), _free(fields), _shares(document), _touch(document))


def _misfit(fields: Columns) -> Html:
    misfit = float(np.nanmedian(fields.numbers("misfit")))
    said = (
        f"The points' departures from the surface are {significant(misfit, 2)} times as large, squared, as "
        "their σ lets expect (median of all fields; about 1 where the σ are right)."
    )
    if misfit <= _MISFIT:
        return paragraph(said)
    return paragraph(
        f"{said} So the σ of the points, and all that follow from them, are too small by about "
        f"{significant(misfit**0.5, 2)}: calibrate the rig anew, and look at its mirrors; what a calibration "
        "has wrong is alike in all fields, and no averaging takes it away."
    )


def _free(fields: Columns) -> Html:
    residual, sigma = fields.numbers("free_residual_kpa"), fields.sigma("free_residual_kpa")
    known = np.isfinite(residual)
    if not known.any():
        return absent(
            "No rows were named where the wall is free, so the pressure could not be checked there."
        )
    left, spread = residual[known], sigma[known]
    outside = int((np.abs(left) > _LIMIT * spread).sum())
    verdict = f"{outside} of {len(left)} fields disagree by more than {_LIMIT:.0f} σ"
    return paragraph(
        f"Where the wall is free the pressure ought to be zero: {fixed(float(left.mean()), 2)} kPa are left "
        f"on average, with a median σ of {fixed(float(np.median(spread)), 2)} kPa; "
        f"{verdict if outside else 'inputs and model agree'}."
    )


def _shares(document: Document) -> Html:
    rows = []
    for state in document["states"]:
        columns = Columns(state["targets"])
        own, whole = columns.numbers("points_sigma_kpa"), columns.sigma("contact_kpa")
        known = np.isfinite(whole)
        if known.any():
            common = np.sqrt(np.maximum(whole[known] ** 2 - own[known] ** 2, 0.0))
            parts = (own[known], common, whole[known])
            rows.append((state["name"], *(fixed(float(np.median(part)), 2) for part in parts)))
    heads = ["State", "from the points", "from vacuum, clock and material", "together"]
    return table("What the σ of the pressure is made of: medians over the targets [kPa]", heads, rows)


def _touch(document: Document) -> Html:
    summary = Columns(document["tables"]["summary"])
    touch = summary.one("touch_n")
    if touch is None:
        return absent("No first touch was found: in no two fields on end does a pressure exceed three σ.")
    began = f"Pressure begins in field {touch:.0f}"
    if touches_at_once(document):
        began = f"There is pressure already in the first field, {touch:.0f}, so where it begins was not seen"
    return paragraph(
        f"{began}; the column since_touch_kpa counts from there, and is free of "
        "what vacuum, clock and material put into all fields alike."
    )
