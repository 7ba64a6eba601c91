"""The figures of a report, each drawn from one part of its document as SVG inside the page's own text.

Matplotlib is imported only while something is drawn, and without its global state of figures.
"""

from grabberd.reports.figures.drawing import require_matplotlib
from grabberd.reports.figures.geometry import geometry_svg
from grabberd.reports.figures.statistics import (
    correlation_svg,
    distribution_svg,
    has_samples,
    validation_svg,
    volume_svg,
)
from grabberd.reports.figures.vectors import field_svg, residuals_svg

__all__ = [
    "correlation_svg",
    "distribution_svg",
    "field_svg",
    "geometry_svg",
    "has_samples",
    "require_matplotlib",
    "residuals_svg",
    "validation_svg",
    "volume_svg",
]
