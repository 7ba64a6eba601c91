"""The summaries of captures that the broker has not taken yet, kept on disk until it has."""

import logging

from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.schema import SUFFIX
from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.state.state_database import Outbox
from grabberd.core.field import PAL_HZ
from grabberd.documents.document import JsonObject
from grabberd.errors import CaptureFileError, NotFound
from grabberd_mqtt.messages import capture_summary

log = logging.getLogger(__name__)

AT_ONCE = 100
"""Maximum number of summaries made in one go: each opens a capture file, and publishing waits meanwhile."""


class SummaryQueue:
    """Enters every capture that has ended into the outbox, once.

    What is new is found by comparing the outbox with the index of captures, not by events: so a capture that
    a crash cut, or that was made before there was a broker, is entered like any other. A full outbox takes no
    more until there is room; only a capture that is deleted before that is missed, logged and counted.

    Args:
        archive: The captures.
        outbox: Store of the summaries.
        limit: Maximum number of summaries that wait.

    Attributes:
        waiting: Number of summaries in the outbox that are not acknowledged.
        acknowledged: Number of summaries acknowledged since the start.
        remaining: Captures that have ended and are not in the outbox yet.
        missed: Number of captures deleted before they were entered, since the start.
    """

    def __init__(self, archive: Archive, outbox: Outbox, limit: int) -> None:
        self.waiting = 0
        self.acknowledged = 0
        self.remaining: frozenset[str] = frozenset()
        self.missed = 0
        self._archive = archive
        self._outbox = outbox
        self._limit = limit
        self._full = False
        self._deleted: set[str] = set()
        self._newest: dict[str, tuple[str, str]] = {}
        self._latest: dict[str, JsonObject] = {}

    def open(self) -> None:
        """Restores what waited when the daemon ended.

        Raises:
            StorageError: The state database cannot be used.
        """
        self._outbox.open()
        self.waiting = self._outbox.waiting()

    def collect(self) -> None:
        """Enters captures that have ended since the last call, at most `AT_ONCE`.

        Raises:
            StorageError: The index or the state database cannot be used.
        """
        files = self._files()
        entered = self._outbox.entered()
        # What remained after the last call and has no file any more has been deleted since.
        self._note_missed(self.remaining - set(files) - entered)
        new = sorted(set(files) - entered)
        room = max(self._limit - self._outbox.waiting(), 0)
        now = new[: min(room, AT_ONCE)]
        for capture_id in now:
            self._enter(capture_id, files[capture_id])
        self.remaining = frozenset(new[len(now) :])
        self._note_full(len(new) > room)
        # Without this, the ids of deleted captures would accumulate for ever.
        self._outbox.forget(entered - set(files))
        self.waiting = self._outbox.waiting()

    def latest(self, device: str) -> JsonObject | None:
        """The summary of the device's capture that ended last; None if there is none, or it was deleted.

        Raises:
            StorageError: The capture cannot be read.
        """
        newest = self._newest.get(device)
        if newest is None:
            return None
        capture_id, file = newest
        if self._latest.get(device, {}).get("capture_id") != capture_id:
            try:
                self._latest[device] = self._summary(capture_id, file)
            except NotFound:
                return None
        return self._latest[device]

    @property
    def has_room(self) -> bool:
        """True if another capture can be entered."""
        return self.waiting < self._limit

    def first(self) -> tuple[str, JsonObject] | None:
        """Returns id and summary of the oldest capture that waits, or None.

        Raises:
            StorageError: The state database cannot be read.
        """
        return self._outbox.first()

    def acknowledge(self, capture_id: str) -> None:
        """Removes a summary that the broker has taken.

        Raises:
            StorageError: The state database cannot be written; the summary will be sent again.
        """
        self._outbox.acknowledge(capture_id)
        self.acknowledged += 1
        self.waiting = self._outbox.waiting()

    def _files(self) -> dict[str, str]:
        """Returns the files of all captures that have ended, by id, and notes each device's newest."""
        listed = (one for one in self._archive.index.list() if one.id not in self._deleted)
        entries = [one for one in listed if one.file.endswith(SUFFIX)]
        ordered = sorted(entries, key=lambda one: one.created_utc)
        self._newest = {one.device: (one.id, one.file) for one in ordered}
        return {one.id: one.file for one in entries}

    def _enter(self, capture_id: str, file: str) -> None:
        try:
            summary = self._summary(capture_id, file)
        except NotFound:  # deleted since the index was read, or by hand
            self._deleted.add(capture_id)
            self._note_missed(frozenset({capture_id}))
            return
        self._outbox.enter(capture_id, summary)

    def _summary(self, capture_id: str, file: str) -> JsonObject:
        document = self._archive.document(capture_id)
        site, rate_hz, calibration_id = self._file_facts(file)
        summary = capture_summary(
            document, file=file, site=site, rate_hz=rate_hz, calibration_id=calibration_id
        )
        return summary.model_dump(mode="json")

    def _file_facts(self, file: str) -> tuple[dict[str, str], float, str | None]:
        try:
            with CaptureReader(self._archive.directory / file) as reader:
                calibration = reader.runs[-1].made_with.get("calibration") if reader.runs else None
                return dict(reader.meta.site), reader.meta.rate_hz, calibration and calibration.get("id")
        except (CaptureFileError, OSError):  # the document already says that it is damaged; any rate will do
            return {}, PAL_HZ, None

    def _note_full(self, full: bool) -> None:
        if full and not self._full:
            log.warning(
                "%d summaries wait for the MQTT broker, and no more are kept (mqtt.queue_captures);"
                " those of later captures follow when there is room",
                self._limit,
            )
        self._full = full

    def _note_missed(self, captures: frozenset[str]) -> None:
        self.missed += len(captures)
        for capture_id in sorted(captures):
            log.error("capture %s was deleted before its summary could be kept for MQTT", capture_id)
