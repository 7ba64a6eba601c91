"""Which parameters stayed in the model, which went and why, and how the rest depend on each other."""

from collections.abc import Mapping, Sequence
from typing import Any

from grabberd.reports.chapters.head import alpha
from grabberd.reports.figures import correlation_svg
from grabberd.reports.markup import Html, absent, element, figure, joined, paragraph, table
from grabberd.reports.names import spelled, unknown
from grabberd.reports.numbers import count, fixed, probability, significant

Document = Mapping[str, Any]

_STRONG = 0.95
_MANY = 36


def tests(document: Document) -> Html:
    """The protocol of the F tests."""
    rows = document.get("tests")
    if not rows:
        return absent("No parameter was tested for significance.")
    heads = ["Round", "Test", "Parameters", "F", "q", "r", "p", "Effect [px]", "Decision"]
    level = spelled(alpha(document))
    return joined(
        paragraph(_outcome(document)),
        table("Protocol of the F tests", heads, [_test(row) for row in rows], class_=_size(rows)),
        paragraph(
            "F = (ΔΩ/q) / (Ω/r): by how much the weighted sum of squares Ω grows without the q parameters, "
            "beside the variance of the larger model with r degrees of freedom. In each round the least "
            f"significant group goes if its p is above α = {level}, and the rest is adjusted anew. Effect: "
            "by how much the parameters move an image point, at most."
        ),
    )


def correlations(document: Document) -> Html:
    """The matrix as a picture, and what is strongly correlated as a table."""
    unknowns = document.get("unknowns")
    if not unknowns or not unknowns.get("names") or not unknowns.get("correlation"):
        return absent("The correlations of the unknowns are not recorded.")
    drawn = correlation_svg(unknowns)
    caption = (
        f"Correlations of the {len(unknowns['names'])} unknowns, left and right by colour, those of a lens "
        f"shared by both in black. A dot marks |ρ| > {_STRONG}."
    )
    return joined(figure(drawn, caption), _strong(unknowns))


def _size(rows: Sequence[object]) -> str | None:
    return "dense" if len(rows) > _MANY else None


def _outcome(document: Document) -> str:
    dropped = document.get("dropped")
    if not dropped:
        return "Every tested parameter is significant and stayed in the model."
    return f"Dropped from the model: {', '.join(map(unknown, dropped))}."


def _test(row: Mapping[str, Any]) -> list[object]:
    decision = element("strong", "dropped") if row.get("dropped") else "kept"
    return [
        count(row.get("round")), row.get("kind", ""), ", ".join(map(unknown, row.get("parameters") or [])),
        significant(row.get("statistic")), count(row.get("q")), count(row.get("freedom")),
        probability(row.get("p")), significant(row.get("effect_px"), 2), decision,
    ]  # fmt: skip


def _strong(unknowns: Mapping[str, Any]) -> Html:
    names, matrix = unknowns["names"], unknowns["correlation"]
    pairs = [
        (matrix[row][column], names[column], names[row])
        for row in range(len(names))
        for column in range(row)
        if matrix[row][column] is not None and abs(matrix[row][column]) > _STRONG
    ]
    if not pairs:
        return paragraph(f"No two unknowns are correlated by more than {_STRONG}.")
    pairs.sort(key=lambda pair: -abs(pair[0]))
    rows = [(unknown(first), unknown(second), fixed(rho, 3)) for rho, first, second in pairs]
    return joined(
        table(f"Unknowns correlated by more than {_STRONG}", ["Unknown", "and", "ρ"], rows),
        paragraph(
            "Such correlations are normal where a view is half a picture with the principal point at its "
            "edge (x₀, y₀ and b₇ with the angles, f with the distance, b₄ with b₅), and harmless inside the "
            "calibration frame's volume: what one parameter has too much of, the other takes back. The "
            "calibration is to be judged by the propagated σ of X, Y and Z."
        ),
    )
