"""What the numbers mean: the functional model, the statistics, and where they come from."""

from collections.abc import Mapping
from typing import Any

from grabberd.reports.markup import Html, element, items, joined, paragraph

_MODEL = (
    "x = x₀ − f · [r₁₁(X−X₀) + r₁₂(Y−Y₀) + r₁₃(Z−Z₀)] / [r₃₁(X−X₀) + r₃₂(Y−Y₀) + r₃₃(Z−Z₀)] + dx | (4)",
    "y = y₀ − f · [r₂₁(X−X₀) + r₂₂(Y−Y₀) + r₂₃(Z−Z₀)] / [r₃₁(X−X₀) + r₃₂(Y−Y₀) + r₃₃(Z−Z₀)] + dy | (5)",
    "dx = −b₁x + b₂y + x(b₃r² + b₄r⁴ + b₅r⁶) + b₆(r² + 2x²) + 2b₇xy − b₈xy² | (6)",
    "dy = +b₁y + b₂x + y(b₃r² + b₄r⁴ + b₅r⁶) + 2b₆xy + b₇(r² + 2y²) − b₉x²y | (7)",
)
_STATISTICS = (
    "σ₀² = Ω / r, Ω the sum of squares of all residuals over their given σ, r the degrees of freedom; σ₀ is "
    "1 where the given σ are true.",
    "Redundancy rᵢ = 1 − (A·Q·Aᵀ)ᵢᵢ of an observation: the share of its error that its residual shows.",
    "Standardised residual τᵢ = vᵢ / (σ₀ σᵢ √rᵢ). With σ₀ estimated from the same residuals it has Pope's τ "
    "distribution, whose quantile is the critical value; one blunder is sought at a time.",
    "F = (ΔΩ/q) / (Ω/r) tests whether q parameters are zero; Ω and r are the larger model's.",
    "Point covariance = pointing and line jitter + J·C·Jᵀ, C the covariance of the calibration. The first is "
    "new in every field, the second is common to all.",
)
_SOURCES = (
    "I. Maalen-Johansen: Close-range videometry. Design and calibration of a mono-camera system for dynamic "
    "purposes. Equations (4) to (7), here with b₁ as an affinity and b₈, b₉ apart.",
    "E. Kilpelä: Compensation of systematic errors of image and model coordinates. 1981. The additional "
    "parameters.",
    "A. J. Pope: The statistics of residuals and the detection of outliers. 1976. The τ test.",
)


def definitions(_document: Mapping[str, Any]) -> Html:
    """Equations, statistics, conventions, sources."""
    return joined(
        element("h3", "Functional model"),
        element("div", *map(_equation, _MODEL), class_="equations"),
        paragraph(
            "x, y are sensor coordinates in mm reduced to the principal point, x to the right and y up; "
            "r² = x² + y²; R = Rκ·Rφ·Rω, the camera looks along −z, and handedness −1 is diag(−1, 1, 1)·R. "
            "X, Y, Z are the object's frame, right-handed, in mm, given by the calibration frame. "
            "b₁ affinity, b₂ lack of orthogonality, b₃ to b₅ radial, b₆ and b₇ decentering, b₈ and b₉ mirror "
            "distortion. The distortion is added to the ideal point."
        ),
        element("h3", "Statistics"),
        items(_STATISTICS),
        element("h3", "Picture"),
        paragraph(
            "Frame pixels: columns to the right, frame lines down, the centre of the top left pixel is "
            "(0, 0). The views are the halves of one picture."
        ),
        element("h3", "Sources"),
        items(_SOURCES),
    )


def _equation(line: str) -> Html:
    terms, number = line.rsplit(" | ", maxsplit=1)
    return paragraph(element("span", terms), element("span", number))


def signature() -> Html:
    """The lines to be signed on."""
    lines = (element("div", element("span", said), class_="line") for said in ("Name", "Date", "Signature"))
    return element("footer", *lines, class_="signature")
