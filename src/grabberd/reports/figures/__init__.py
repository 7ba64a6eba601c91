"""The figures of a report, each drawn from one part of its document as SVG inside the page's own text.

Matplotlib is imported only while something is drawn, and without its global state of figures.
"""

from grabberd.reports.figures.drawing import field_svg as field_svg
from grabberd.reports.figures.drawing import require_matplotlib as require_matplotlib
from grabberd.reports.figures.drawing import residuals_svg as residuals_svg
from grabberd.reports.figures.geometry import geometry_svg as geometry_svg
from grabberd.reports.figures.statistics import correlation_svg as correlation_svg
from grabberd.reports.figures.statistics import distribution_svg as distribution_svg
from grabberd.reports.figures.statistics import has_samples as has_samples
from grabberd.reports.figures.statistics import validation_svg as validation_svg
from grabberd.reports.figures.statistics import validity_svg as validity_svg
from grabberd.reports.figures.statistics import volume_svg as volume_svg
