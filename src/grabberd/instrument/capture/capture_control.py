"""Capture control: start, arm, trigger and stop captures, of one device or of several together."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from datetime import datetime, timedelta

from grabberd.archive.capture.schema import part_path
from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.state.state_database import AnnotationStore
from grabberd.documents.captures import CaptureDocument, CaptureGroup, GroupDocument
from grabberd.documents.requests import CaptureRequest
from grabberd.errors import Conflict, NotFound
from grabberd.instrument.capture import capture_start
from grabberd.instrument.capture.capture_request import ArmedCapture, NewCapture
from grabberd.instrument.capture.capture_start import CaptureStart
from grabberd.instrument.capture.device_captures import CurrentCaptures, of_device
from grabberd.instrument.capture.recording import Recording
from grabberd.runtime import UtcClock

STOPPED = "stopped by the operator"


class CaptureControl:
    """Starts, arms, triggers and stops captures of all devices.

    The captures of a group are named after the group and their device: GROUP-DEVICE.

    Args:
        current: The captures of each device.
        archive: The captures on disk.
        annotations: Notes, labels and pins; those of a disarmed capture are deleted with it.
        clock: Source of time.
    """

    def __init__(
        self,
        current: CurrentCaptures,
        archive: Archive,
        annotations: AnnotationStore,
        clock: UtcClock,
    ) -> None:
        self._current = current
        self._archive = archive
        self._annotations = annotations
        self._clock = clock

    def start(self, device: str | None, request: CaptureRequest) -> CaptureDocument:
        """Starts a capture and returns its document.

        Args:
            device: Name of the device; may be None where there is only one.
            request: Options of the capture.

        Raises:
            NotFound: There is no such device.
            CaptureRunning, NotReady, InputError, CalibrationMismatch, StorageError: See
                `capture_start.start`.
        """
        single = self._single(device, request)
        capture_start.start([single], self._current)
        return single.recording.document

    def arm(self, device: str | None, request: CaptureRequest) -> CaptureDocument:
        """Arms a capture, whose `fields` count from its trigger, and returns its document.

        Args:
            device: Name of the device; may be None where there is only one.
            request: Options of the capture.

        Raises:
            NotFound: There is no such device.
            CaptureRunning, NotReady, InputError, CalibrationMismatch: See `capture_start.arm`.
        """
        single = self._single(device, request)
        return capture_start.arm([single])[0].document

    def start_group(self, requests: Mapping[str, CaptureRequest]) -> str:
        """Starts captures of several devices at the same moment, and returns the group's id.

        Raises:
            GroupRefused: Some of them cannot start, so none does.
            NotFound: There is no such device.
            StorageError: The disk has no room for all of them.
        """
        group, starts = self._group(requests)
        capture_start.start(starts, self._current)
        return group.id

    def arm_group(self, requests: Mapping[str, CaptureRequest]) -> str:
        """Arms captures of several devices for one trigger, and returns the group's id.

        Raises:
            GroupRefused, NotFound: As `start_group`.
        """
        group, starts = self._group(requests)
        capture_start.arm(starts)
        return group.id

    def trigger(self, capture_id: str) -> None:
        """Starts an armed capture, and with it all others of its group.

        Raises:
            NotFound: There is no such capture.
            Conflict, NotReady, CalibrationMismatch, StorageError, GroupRefused: See `capture_start.trigger`.
        """
        armed = next((one for one in self._current.armed() if one.id == capture_id), None)
        if armed is None:
            self._archive.document(capture_id)
            raise Conflict(f"capture {capture_id} is not armed", "it was triggered or has ended already")
        self._trigger([armed] if armed.group is None else self._current.of_group(armed.group.id)[0])

    def trigger_group(self, group_id: str) -> None:
        """Starts the armed captures of a group at the same moment.

        Raises:
            NotFound: There is no such group.
            Conflict, NotReady, CalibrationMismatch, StorageError, GroupRefused: See `capture_start.trigger`.
        """
        armed, _ = self._current.of_group(group_id)
        if not armed:
            self.captures_of(group_id)
            raise Conflict(f"group {group_id} is not armed", "it was triggered or has ended already")
        self._trigger(armed)

    def stop(self, capture_id: str) -> None:
        """Stops a running capture; an armed one is discarded.

        Raises:
            NotFound: There is no such capture.
            Conflict: It is not running.
        """
        armed = [one for one in self._current.armed() if one.id == capture_id]
        recordings = [one for one in self._current.recordings() if one.id == capture_id]
        if not armed and not recordings:
            self._archive.index.get(capture_id)
            raise Conflict(f"capture {capture_id} is not running", "it has ended already")
        self._stop(armed, recordings)

    def stop_group(self, group_id: str) -> None:
        """Stops the captures of a group at the same moment; armed ones are discarded.

        Raises:
            NotFound: There is no such group.
            Conflict: None of its captures is running.
        """
        armed, recordings = self._current.of_group(group_id)
        if not armed and not recordings:
            self.captures_of(group_id)
            raise Conflict(f"no capture of group {group_id} is running", "they have ended already")
        self._stop(armed, recordings)

    def group_document(self, group_id: str) -> CaptureGroup:
        """A group with its captures; deleted ones are left out.

        Raises:
            NotFound: There is no such group.
        """
        captures = self.captures_of(group_id)
        group = captures[0].group
        assert group is not None, "captures_of finds members of the group alone"
        return CaptureGroup(**group.model_dump(), captures=captures)

    def captures_of(self, group_id: str) -> list[CaptureDocument]:
        """The captures of a group; deleted ones are left out.

        Raises:
            NotFound: There is no such group.
        """
        armed = [one.id for one in self._current.armed(group_id)]
        recordings = [one.id for one in self._current.recordings(group_id)]
        ended = [entry.id for entry in self._archive.index.with_prefix(f"{group_id}-")]
        found = list(self._documents(dict.fromkeys((*armed, *recordings, *ended))))
        captures = [one for one in found if one.group is not None and one.group.id == group_id]
        if not captures:
            raise NotFound(f"no group {group_id!r}", "GET /api/v1/captures says of which group a capture is")
        return sorted(captures, key=lambda one: one.id)

    def _documents(self, capture_ids: Iterable[str]) -> Iterator[CaptureDocument]:
        for capture_id in capture_ids:
            with suppress(NotFound):  # deleted or disarmed just now
                yield self._archive.document(capture_id)

    def _single(self, device: str | None, request: CaptureRequest) -> CaptureStart:
        chosen = of_device(self._current.devices, device)
        request = request.of_rate(chosen.pipeline.rate_hz)
        return self._capture_start(chosen.name, f"{self._stamp()}-{chosen.name}", request)

    def _group(self, requests: Mapping[str, CaptureRequest]) -> tuple[GroupDocument, list[CaptureStart]]:
        rates_hz = {name: of_device(self._current.devices, name).pipeline.rate_hz for name in requests}
        group = _group_of(self._stamp(), requests)
        starts = [
            self._capture_start(name, f"{group.id}-{name}", request.of_rate(rates_hz[name]), group)
            for name, request in requests.items()
        ]
        return group, starts

    def _capture_start(
        self,
        device: str,
        capture_id: str,
        request: CaptureRequest,
        group: GroupDocument | None = None,
        armed_utc: str | None = None,
    ) -> CaptureStart:
        # First: nothing may be recorded into a folder that has replaced the right one.
        self._archive.check()
        part = part_path(self._archive.directory, capture_id)
        new = NewCapture(capture_id, request, part, group, armed_utc)
        return CaptureStart(self._current.devices[device], new)

    def _trigger(self, armed: list[ArmedCapture]) -> None:
        # If other captures of the group were disarmed, the file names the remaining ones.
        devices = [one.document.device for one in armed]
        starts = [
            self._capture_start(
                one.document.device,
                one.id,
                one.request,
                one.group and _group_of(one.group.id, devices),
                one.document.created_utc,
            )
            for one in armed
        ]
        capture_start.trigger(starts, self._current)

    def _stop(self, armed: list[ArmedCapture], recordings: list[Recording]) -> None:
        for recording in recordings:
            recording.stop(STOPPED)
        for one in armed:
            self._current.devices[one.document.device].disarm(one.id)
            self._annotations.remove(one.id)

    def _stamp(self) -> str:
        """The present time as an id that no other current group has."""
        moment = self._clock.utc_now()
        while self._current.armed(_stamped(moment)) or self._current.recordings(_stamped(moment)):
            moment += timedelta(milliseconds=1)
        return _stamped(moment)


def _group_of(group_id: str, devices: Iterable[str]) -> GroupDocument:
    """A group that has not started yet."""
    return GroupDocument(id=group_id, devices=list(devices), start_utc=None, start_ns=None)


def _stamped(moment: datetime) -> str:
    return f"{moment:%Y%m%dT%H%M%S}{moment.microsecond // 1000:03d}Z"
