"""The pictures of a report, each drawn from one part of its document as SVG in the page's own text.

Matplotlib is imported only while something is drawn, without its global state of figures.
"""

from grabberd.reports.figures.correlation import correlation_svg
from grabberd.reports.figures.curves import Curve, Panel, curves_svg
from grabberd.reports.figures.distribution import distribution_svg
from grabberd.reports.figures.drawing import require_matplotlib
from grabberd.reports.figures.field import field_svg
from grabberd.reports.figures.geometry import geometry_svg
from grabberd.reports.figures.residuals import residuals_svg
from grabberd.reports.figures.states import State, maps_svg, model_svg, states_of
from grabberd.reports.figures.validation import validation_svg
from grabberd.reports.figures.volume import volume_svg

__all__ = [
    "Curve",
    "Panel",
    "State",
    "correlation_svg",
    "curves_svg",
    "distribution_svg",
    "field_svg",
    "geometry_svg",
    "maps_svg",
    "model_svg",
    "require_matplotlib",
    "residuals_svg",
    "states_of",
    "validation_svg",
    "volume_svg",
]
