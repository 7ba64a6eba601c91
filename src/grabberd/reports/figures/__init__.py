"""The pictures of a report, each drawn from one part of its document as SVG in the page's own text.

Matplotlib is imported only while something is drawn, without its global state of figures.
"""

from grabberd.reports.figures.correlation import correlation_svg
from grabberd.reports.figures.distribution import distribution_svg
from grabberd.reports.figures.drawing import require_matplotlib
from grabberd.reports.figures.field import field_svg
from grabberd.reports.figures.geometry import geometry_svg
from grabberd.reports.figures.residuals import residuals_svg
from grabberd.reports.figures.validation import validation_svg
from grabberd.reports.figures.volume import volume_svg

__all__ = [
    "correlation_svg",
    "distribution_svg",
    "field_svg",
    "geometry_svg",
    "require_matplotlib",
    "residuals_svg",
    "validation_svg",
    "volume_svg",
]
