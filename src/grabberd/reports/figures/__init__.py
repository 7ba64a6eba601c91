"""The figures of a report, each drawn from one part of its document as SVG inside the page's own text.

Matplotlib is imported only while something is drawn, and without its global state of figures.
"""

from grabberd.reports.figures.accuracy import validation_svg, volume_svg
from grabberd.reports.figures.correlation import correlation_svg
from grabberd.reports.figures.curves import phase_svg, profile_svg, time_svg
from grabberd.reports.figures.distribution import distribution_svg, has_samples
from grabberd.reports.figures.drawing import require_matplotlib
from grabberd.reports.figures.geometry import geometry_svg
from grabberd.reports.figures.groups import groups_svg, trends_svg
from grabberd.reports.figures.states import State, maps_svg, model_svg, states_of
from grabberd.reports.figures.tested import tested_svg
from grabberd.reports.figures.vectors import field_svg, residuals_svg

__all__ = [
    "State",
    "correlation_svg",
    "distribution_svg",
    "field_svg",
    "geometry_svg",
    "groups_svg",
    "has_samples",
    "maps_svg",
    "model_svg",
    "phase_svg",
    "profile_svg",
    "require_matplotlib",
    "residuals_svg",
    "states_of",
    "tested_svg",
    "time_svg",
    "trends_svg",
    "validation_svg",
    "volume_svg",
]
