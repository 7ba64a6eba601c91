"""The document of a page of captures."""

from collections.abc import Callable, Iterable

from grabberd.archive.catalogue.capture_list import CapturePage
from grabberd.archive.state.capture_catalogue import Count, Facets
from grabberd.archive.state.capture_query import Position
from grabberd.documents.capture_library import CaptureList, FacetsDocument, FacetValue


def list_document(page: CapturePage, cursor: Callable[[Position | None], str | None]) -> CaptureList:
    """A page as a document.

    Args:
        page: The page.
        cursor: Returns the cursor of a position.
    """
    return CaptureList(
        captures=page.captures,
        next=cursor(page.after),
        total=page.total,
        in_all=page.in_all,
        facets=None if page.facets is None else _facets(page.facets),
        widths_mm=page.widths_mm,
    )


def _facets(found: Facets) -> FacetsDocument:
    return FacetsDocument(
        **{name: _values(counts) for name, counts in found.of.items()},
        days=_values(found.days),
        labels={name: _values(counts) for name, counts in found.labels.items()},
    )


def _values(counts: Iterable[Count]) -> list[FacetValue]:
    return [FacetValue(value=value, count=count) for value, count in counts]
