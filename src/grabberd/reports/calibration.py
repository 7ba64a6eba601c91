"""The calibration report: one HTML page that needs nothing beside it."""

from collections.abc import Callable, Mapping
from importlib.resources import files
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
from grabberd.reports.markup import Html, element, joined

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
    chapters = [_chapter(number, *chapter, document) for number, chapter in enumerate(CHAPTERS, start=1)]
    body = element("body", element("main", head(document), *chapters, signature()))
    page = element("html", _head(document), body, lang="en")
    return f"<!DOCTYPE html>\n{page}\n"


def _head(document: Mapping[str, Any]) -> Html:
    style = files(__package__).joinpath("style.css").read_text(encoding="utf-8")
    return element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("title", f"Calibration report {document['id']}"),
        element("style", Html(style)),
    )


def _chapter(
    number: int, title: str, content: Callable[[Mapping[str, Any]], Html], document: Mapping[str, Any]
) -> Html:
    return joined("\n", element("section", element("h2", f"{number} {title}"), content(document)))
