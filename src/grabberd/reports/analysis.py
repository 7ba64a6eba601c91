"""The analysis report: one HTML page that needs nothing beside it."""

from collections.abc import Callable, Mapping
from typing import Any

from grabberd.reports.chapters.analysis_head import analysis_head
from grabberd.reports.chapters.analysis_inputs import inputs
from grabberd.reports.chapters.analysis_method import columns, method
from grabberd.reports.chapters.mean_cycle import mean_cycle
from grabberd.reports.chapters.pressure import pressure
from grabberd.reports.chapters.pulsation import pulsation
from grabberd.reports.chapters.shape import curves, shape
from grabberd.reports.chapters.wall import wall
from grabberd.reports.document import check_analysis
from grabberd.reports.figures import require_matplotlib
from grabberd.reports.markup import Html
from grabberd.reports.page import page

ANALYSIS_CHAPTERS: tuple[tuple[str, Callable[[Mapping[str, Any]], Html]], ...] = (
    ("The wall and its pressure", shape),
    ("Course over time", curves),
    ("Pulsation", pulsation),
    ("Mean cycle", mean_cycle),
    ("Curvature, strain, tension", wall),
    ("Pressure: how far it can be trusted", pressure),
    ("Inputs and where they come from", inputs),
    ("How it was computed", method),
    ("Columns", columns),
)


def analysis_html(document: Mapping[str, Any]) -> str:
    """The report of an analysis as one self-contained page, the same text for the same document.

    Args:
        document: "grabberd/analysis-report/1"; what was not found is said to be missing, and why.

    Raises:
        InputError: the document is of another schema, lacks what every report has, or has a number that is
            not finite.
        ExtraMissing: matplotlib is not installed.
    """
    check_analysis(document)
    require_matplotlib()
    title = f"Analysis report {document['id']}"
    return page(title, document, analysis_head(document), ANALYSIS_CHAPTERS)
