"""The course of the wall's width of each capture, made when it is sealed or first asked for, and kept."""

import logging
from collections import deque

from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.export.width_course import width_course_text
from grabberd.archive.state.index_entries import IndexEntry, check_widths
from grabberd.errors import GrabberdError

log = logging.getLogger(__name__)


class WidthCourses:
    """Keeps them in the index.

    Args:
        archive: The captures.
    """

    def __init__(self, archive: Archive) -> None:
        self._archive = archive
        self._sealed: deque[str] = deque()

    def of(self, capture_id: str) -> list[float | None]:
        """Widths of a sealed capture in mm, ten a second from its middle; none where there are no points.

        Raises:
            NotFound: No capture has that id.
            Conflict: It is not sealed.
            CaptureFileError: It cannot be read.
            StorageError: It cannot be read now.
        """
        path = self._archive.sealed_path(capture_id)
        entry = self._archive.index.get(capture_id)
        if not entry.widths:
            entry = entry._replace(widths=width_course_text(path))
            self._keep(entry)
        return check_widths(entry.widths)

    def sealed(self, capture_id: str) -> None:
        """Takes note of a capture that is sealed: the next look makes its course."""
        self._sealed.append(capture_id)

    def look(self) -> None:
        """Makes the courses of the captures that have been sealed; called once a second."""
        while self._sealed:
            try:
                self.of(self._sealed.popleft())
            except GrabberdError as error:  # deleted meanwhile, or damaged: whoever asks for it is told
                log.info("a capture has no course of its width: %s", error.message)

    def _keep(self, entry: IndexEntry) -> None:
        try:
            self._archive.index.keep_widths(entry, entry.widths)
        except GrabberdError as error:  # a full disk: it is made again for the next one who asks
            log.info("the widths of capture %s are not kept: %s", entry.id, error.message)
