"""The calibration report: one HTML page that needs nothing beside it."""

from collections.abc import Callable, Mapping
from typing import Any

from grabberd.reports.chapters.accuracy import validation, volume
from grabberd.reports.chapters.head import head
from grabberd.reports.chapters.imaging import distortion, geometry, local_field
from grabberd.reports.chapters.observations import residual_list, residuals
from grabberd.reports.chapters.parameters import comparison, result
from grabberd.reports.chapters.project import identification, project
from grabberd.reports.chapters.significance import correlations, tests
from grabberd.reports.chapters.sources import definitions, signature
from grabberd.reports.document import check_document
from grabberd.reports.figures import require_matplotlib
from grabberd.reports.markup import Html
from grabberd.reports.page import page

CHAPTERS: tuple[tuple[str, Callable[[Mapping[str, Any]], Html]], ...] = (
    ("Project data", project),
    ("Identification of the targets", identification),
    ("Result of the adjustment", result),
    ("Left and right compared", comparison),
    ("Significance of the parameters", tests),
    ("Correlations", correlations),
    ("Residuals", residuals),
    ("Distortion", distortion),
    ("Local residual field", local_field),
    ("Imaging geometry", geometry),
    ("Accuracy in the measuring volume", volume),
    ("Validation by held-out targets", validation),
    ("Image points", residual_list),
    ("Definitions and sources", definitions),
)


def calibration_html(document: Mapping[str, Any]) -> str:
    """The report of a calibration as one self-contained page, the same text for the same document.

    Args:
        document: "grabberd/calibration-report/1"; a part that is null or missing is said to be.

    Raises:
        InputError: the document is of another schema, lacks id, time, result or views, or has a number that
            is not finite.
        ExtraMissing: matplotlib is not installed.
    """
    check_document(document)
    require_matplotlib()
    title = f"Calibration report {document['id']}"
    return page(title, document, head(document), CHAPTERS, signature())
