"""What the model leaves: residuals in the picture, their distribution, blunders, and the list of all."""

from collections.abc import Mapping
from typing import Any

from grabberd.reports.figures import distribution_svg, residuals_svg
from grabberd.reports.figures.distribution import has_samples
from grabberd.reports.markup import Html, absent, element, figure, joined, paragraph, table
from grabberd.reports.numbers import count, fixed, probability, significant

Document = Mapping[str, Any]

_NONE = "The residuals of the image points are not recorded."


def residuals(document: Document) -> Html:
    """Vectors, blunders, distribution."""
    rows = document.get("residuals")
    if not rows:
        return absent(_NONE)
    vectors = figure(
        residuals_svg(document),
        "Residuals (observed minus computed) at their places in the picture, enlarged as its scale says. "
        "Rings with the target's number mark blunders.",
    )
    return joined(vectors, _blunders(document), _distribution(document))


def residual_list(document: Document) -> Html:
    """Every image point, folded away."""
    rows = document.get("residuals")
    if not rows:
        return absent(_NONE)
    heads = [
        "View", "Target", "x", "y", "dx", "dy", "σx", "σy", "rx", "ry", "τx", "τy", "Fields",
    ]  # fmt: skip
    caption = "Image points: place, residual and σ [px], redundancy r, standardised residual τ"
    listed = table(caption, heads, [_listed(row) for row in rows], class_="dense")
    summary = element("summary", f"{len(rows)} image points (unfold before printing to have them on paper)")
    return element("details", summary, listed)


def _listed(row: Mapping[str, Any]) -> list[object]:
    return [
        row["view"], count(row["target"]),
        fixed(row["x_px"], 3), fixed(row["y_px"], 3), fixed(row["dx_px"], 4), fixed(row["dy_px"], 4),
        fixed(row.get("sigma_x_px"), 4), fixed(row.get("sigma_y_px"), 4),
        fixed(row.get("redundancy_x"), 3), fixed(row.get("redundancy_y"), 3),
        fixed(row.get("tau_x"), 2), fixed(row.get("tau_y"), 2), count(row.get("fields")),
    ]  # fmt: skip


def _blunders(document: Document) -> Html:
    blunders = document.get("blunders")
    if blunders is None:
        return absent("Blunders were not sought.")
    if not blunders:
        return paragraph("No image coordinate exceeds the critical value of Pope's τ.")
    kept = {(row["view"], row["target"]) for row in document["residuals"]}
    rows = [
        (row["view"], count(row["target"]), row["axis"], significant(row.get("residual_px")),
         fixed(row.get("tau"), 2), fixed(row.get("critical"), 2),
         "kept" if (row["view"], row["target"]) in kept else "left out")
        for row in blunders
    ]  # fmt: skip
    heads = ["View", "Target", "Axis", "Residual [px]", "τ", "Critical τ", "Image point"]
    return table("Blunders, found one at a time", heads, rows)


def _distribution(document: Document) -> Html:
    if not has_samples(document["residuals"]):
        return absent("The residuals were not standardised, so their distribution is not shown.")
    drawn = figure(
        distribution_svg(document),
        "Distribution of the standardised residuals τ, x and y together: counted beside the normal curve, "
        "and ordered over what a normal distribution would have given.",
    )
    return joined(drawn, _normality(document))


def _normality(document: Document) -> Html:
    tested = document.get("normality")
    if not tested:
        return absent("The residuals were not tested for normality.")
    rows = [
        (row["view"], count(row.get("count")), fixed(row.get("skewness"), 2),
         fixed(row.get("excess_kurtosis"), 2), row.get("test", ""), significant(row.get("statistic")),
         probability(row.get("p")))
        for row in tested
    ]  # fmt: skip
    heads = ["View", "Coordinates", "Skewness", "Excess kurtosis", "Test", "Statistic", "p"]
    return table("Normality of the residuals", heads, rows)
