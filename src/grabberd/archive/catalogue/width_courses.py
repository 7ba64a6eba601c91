"""A short curve of the wall's width for each capture, by which captures can be recognised in a list.

It is computed when the capture is sealed or first requested, and stored in the index.
"""

import json
import logging
from collections import deque
from pathlib import Path

from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.export.point_grid import known_model
from grabberd.archive.state.index_entries import IndexEntry, check_widths
from grabberd.core.reconstruction.section_width import SectionWidth, section_widths
from grabberd.errors import GrabberdError, NotFound

log = logging.getLogger(__name__)
SPAN_S = 6.0
"""Length of the curve, taken from the middle of the capture: several pulsations."""
MOST = 60
"""Maximum number of widths."""
_EVERY = 5
"""Fields per width; odd, so that both parities are used."""


class WidthCourses:
    """Computes the curves and stores them in the index.

    Args:
        archive: The captures.
    """

    def __init__(self, archive: Archive) -> None:
        self._archive = archive
        self._sealed: deque[str] = deque()

    def of(self, capture_id: str) -> list[float | None]:
        """Widths of a sealed capture in mm, ten a second, from its middle; empty without points.

        Raises:
            NotFound: No capture has that id.
            Conflict: The capture is not sealed.
            CaptureFileError: The file is damaged.
            StorageError: The file cannot be read now.
        """
        path = self._archive.sealed_path(capture_id)
        entry = self._archive.index.get(capture_id)
        if not entry.widths:
            entry = entry._replace(widths=json.dumps(width_course(path)))
            self._keep(entry)
        return check_widths(entry.widths)

    def sealed(self, capture_id: str) -> None:
        """Queues a sealed capture: the next `look` computes its curve."""
        self._sealed.append(capture_id)

    def look(self) -> None:
        """Computes the curves of queued captures; called once a second."""
        while self._sealed:
            try:
                self.of(self._sealed.popleft())
            except GrabberdError as error:  # deleted or damaged: a request for the capture will report it
                log.info("a capture has no course of its width: %s", error.message)

    def _keep(self, entry: IndexEntry) -> None:
        try:
            self._archive.index.keep_widths(entry, entry.widths)
        except GrabberdError as error:  # a full disk: the curve is computed again for the next request
            log.info("the widths of capture %s are not kept: %s", entry.id, error.message)


def width_course(path: Path) -> list[float | None]:
    """Widths in mm between the outermost visible facing targets, ten a second; empty without points.

    Raises:
        CaptureFileError: The file cannot be read.
    """
    with CaptureReader(path) as reader:
        try:
            run = reader.run(None)
        except NotFound:
            return []
        model = known_model(run)
        if model is None:
            return []
        first_n = reader.first_n or 0
        fields = round(SPAN_S * reader.meta.rate_hz)
        middle = first_n + max(0, reader.field_span - fields) // 2
        begin = middle - middle % _EVERY
        timed = reader.timed_points(run.run, begin, begin + fields, _EVERY)
        found = {n: section_widths(points, model) for n, _, points in timed}
    numbers = range(begin, begin + fields, _EVERY)
    return _best([found.get(n, []) for n in numbers if n <= max(found, default=-1)][:MOST])


def _best(fields: list[list[SectionWidth]]) -> list[float | None]:
    """Widths of the pair that is visible in most fields, the outermost if there are several."""
    pairs = list(dict.fromkeys(one.targets for widths in fields for one in widths))
    courses = [[_of(widths, pair) for widths in fields] for pair in pairs]
    seen = [sum(width is not None for width in course) for course in courses]
    return courses[seen.index(max(seen))] if any(seen) else []


def _of(widths: list[SectionWidth], pair: tuple[int, int]) -> float | None:
    return next((round(one.width_mm, 2) for one in widths if one.targets == pair and one.width_mm), None)
