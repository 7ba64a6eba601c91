"""Which captures a broker has still to be told of, kept on disk until it has taken them."""

import logging

from grabberd.documents.named_types import JsonObject
from grabberd.errors import CaptureFileError, NotFound
from grabberd.service.archive.archive import Archive
from grabberd.service.mqtt.messages import capture_summary
from grabberd.storage import CaptureReader
from grabberd.storage.capture.schema import SUFFIX
from grabberd.storage.state.outbox import Outbox

log = logging.getLogger(__name__)

NOMINAL_RATE_HZ = 50.0
AT_ONCE = 100
"""So many summaries are made before others have their turn."""


class SummaryQueue:
    """Every capture that has ended gets into the outbox once, whatever happened since it ended.

    A full outbox takes no more; captures that have to stay out get in as soon as there is room. Only one that
    is deleted before that is missed: the log names it, and it is counted.

    Args:
        archive: the captures.
        outbox: where summaries wait.
        limit: so many wait at most.

    Attributes:
        waiting: how many summaries are in the outbox, not acknowledged.
        acknowledged: how many have been, since the start.
        left: captures that have ended and are not in the outbox yet.
        missed: how many were deleted before anybody was told of them, since the start.
    """

    def __init__(self, archive: Archive, outbox: Outbox, limit: int) -> None:
        self.waiting = 0
        self.acknowledged = 0
        self.left: frozenset[str] = frozenset()
        self.missed = 0
        self._archive = archive
        self._outbox = outbox
        self._limit = limit
        self._full = False
        self._gone: set[str] = set()

    def open(self) -> None:
        """Takes up what waited when the daemon ended.

        Raises:
            StorageError: the state cannot be used.
        """
        self._outbox.open()
        self.waiting = self._outbox.waiting()

    def look(self) -> None:
        """Enters captures that have ended since, some at a time.

        Raises:
            StorageError: index or state cannot be used.
        """
        files = self._files()
        entered = self._outbox.entered()
        self._note_missed(self.left - set(files) - entered)
        new = sorted(set(files) - entered)
        room = max(self._limit - self._outbox.waiting(), 0)
        now = new[: min(room, AT_ONCE)]
        for capture_id in now:
            self._enter(capture_id, files[capture_id])
        self.left = frozenset(new[len(now) :])
        self._note_full(len(new) > room)
        self._outbox.forget(entered - set(files))
        self.waiting = self._outbox.waiting()

    @property
    def has_room(self) -> bool:
        """Whether another capture can be entered."""
        return self.waiting < self._limit

    def first(self) -> tuple[str, JsonObject] | None:
        """The oldest capture that waits, by its id, and its summary; None where none does.

        Raises:
            StorageError: the state cannot be read.
        """
        return self._outbox.first()

    def acknowledge(self, capture_id: str) -> None:
        """A summary has been taken.

        Raises:
            StorageError: the state cannot be written: it will be sent again.
        """
        self._outbox.acknowledge(capture_id)
        self.acknowledged += 1
        self.waiting = self._outbox.waiting()

    def _files(self) -> dict[str, str]:
        """Of all captures that have ended, by their ids."""
        entries = self._archive.index.list()
        return {one.id: one.file for one in entries if one.file.endswith(SUFFIX) and one.id not in self._gone}

    def _enter(self, capture_id: str, file: str) -> None:
        try:
            document = self._archive.document(capture_id)
        except NotFound:  # deleted at this moment, or by hand
            self._gone.add(capture_id)
            self._note_missed(frozenset({capture_id}))
            return
        site, rate_hz, calibration_id = self._of_the_file(file)
        summary = capture_summary(
            document, file=file, site=site, rate_hz=rate_hz, calibration_id=calibration_id
        )
        self._outbox.enter(capture_id, summary.model_dump(mode="json"))

    def _of_the_file(self, file: str) -> tuple[dict[str, str], float, str | None]:
        try:
            with CaptureReader(self._archive.directory / file) as reader:
                calibration = reader.runs[-1].made_with.get("calibration") if reader.runs else None
                return dict(reader.meta.site), reader.meta.rate_hz, calibration and calibration.get("id")
        except (CaptureFileError, OSError):  # its summary says that it is damaged
            return {}, NOMINAL_RATE_HZ, None

    def _note_full(self, full: bool) -> None:
        if full and not self._full:
            log.warning(
                "%d summaries wait for the MQTT broker, and no more are kept (mqtt.queue_captures);"
                " those of later captures are made when there is room",
                self._limit,
            )
        self._full = full

    def _note_missed(self, captures: frozenset[str]) -> None:
        self.missed += len(captures)
        for capture_id in sorted(captures):
            log.error("capture %s was deleted before its summary could be kept for MQTT", capture_id)
