"""Captures as they are ordered: of one device, or of several group_start."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from datetime import datetime, timedelta

from grabberd.documents.captures import CaptureDocument, CaptureGroup
from grabberd.errors import Conflict, NotFound
from grabberd.service.archive.archive import Archive
from grabberd.service.capture import group_start
from grabberd.service.capture.armed_capture import ArmedCapture
from grabberd.service.capture.capture_group import Group
from grabberd.service.capture.capture_request import Planned
from grabberd.service.capture.disk_guard import DiskGuard
from grabberd.service.capture.group_start import Member
from grabberd.service.capture.recorder import CaptureRequest
from grabberd.service.capture.recording import Recording
from grabberd.service.clock import Clock
from grabberd.service.device.instrument import Instrument
from grabberd.storage.state.annotation_store import AnnotationStore

STOPPED = "stopped by the operator"


class CaptureControl:
    """Begins and ends captures of all instruments.

    A group's captures are called by its id and their device: GROUP-DEVICE.
    """

    def __init__(
        self,
        instruments: Mapping[str, Instrument],
        archive: Archive,
        annotations: AnnotationStore,
        disk: DiskGuard,
        clock: Clock,
    ) -> None:
        self._instruments = instruments
        self._archive = archive
        self._annotations = annotations
        self._disk = disk
        self._clock = clock

    def start(self, instrument: Instrument, request: CaptureRequest) -> str:
        """Starts a capture and returns its id.

        Raises:
            CaptureRunning, NotReady, InputError, CalibrationMismatch, StorageError: see `group_start.start`.
        """
        member = self._planned(instrument, f"{self._stamp()}-{instrument.name}", request)
        self._start([member])
        return member.planned.id

    def arm(self, instrument: Instrument, request: CaptureRequest) -> str:
        """Arms a capture, whose `fields` count from its trigger on, and returns its id.

        Raises:
            CaptureRunning, NotReady, InputError, CalibrationMismatch: see `group_start.arm`.
        """
        member = self._planned(instrument, f"{self._stamp()}-{instrument.name}", request)
        group_start.arm([member], self._clock)
        return member.planned.id

    def start_group(self, requests: Mapping[str, CaptureRequest]) -> str:
        """Starts captures of several devices at the same moment, and returns the group's id.

        Raises:
            GroupRefused: not all of them can begin, so none does.
            NotFound: there is no such device; StorageError: the disk has no room for all of them.
        """
        group_id, members = self._group(requests)
        self._start(members)
        return group_id

    def arm_group(self, requests: Mapping[str, CaptureRequest]) -> str:
        """Arms captures of several devices for one trigger, and returns the group's id.

        Raises:
            GroupRefused, NotFound: as `start_group`.
        """
        group_id, members = self._group(requests)
        group_start.arm(members, self._clock)
        return group_id

    def trigger(self, capture_id: str) -> None:
        """Has an armed capture begin, and with it all others of its group.

        Raises:
            NotFound: there is none of that id.
            Conflict, NotReady, CalibrationMismatch, StorageError, GroupRefused: see `group_start.trigger`.
        """
        waiting = next((one for one in self._waiting() if one.id == capture_id), None)
        if waiting is None:
            self._archive.document(capture_id)
            raise Conflict(f"capture {capture_id} is not armed", "it was triggered or has ended already")
        self._trigger([waiting] if waiting.group is None else self._waiting(waiting.group.id))

    def trigger_group(self, group_id: str) -> None:
        """Has the armed captures of a group begin at the same moment.

        Raises:
            NotFound: there is no such group.
            Conflict, NotReady, CalibrationMismatch, StorageError, GroupRefused: see `group_start.trigger`.
        """
        waiting = self._waiting(group_id)
        if not waiting:
            self.captures_of(group_id)
            raise Conflict(f"group {group_id} is not armed", "it was triggered or has ended already")
        self._trigger(waiting)

    def stop(self, capture_id: str) -> None:
        """Ends the recording of a running capture; of an armed one nothing is left.

        Raises:
            NotFound: there is none of that id.
            Conflict: it is not running.
        """
        waiting = [one for one in self._waiting() if one.id == capture_id]
        sessions = [one for one in self._sessions() if one.id == capture_id]
        if not waiting and not sessions:
            self._archive.index.get(capture_id)
            raise Conflict(f"capture {capture_id} is not running", "it has ended already")
        self._stop(waiting, sessions)

    def stop_group(self, group_id: str) -> None:
        """Ends the recordings of a group at the same moment; of an armed one nothing is left.

        Raises:
            NotFound: there is no such group.
            Conflict: none of its captures is running.
        """
        waiting, sessions = self._waiting(group_id), self._sessions(group_id)
        if not waiting and not sessions:
            self.captures_of(group_id)
            raise Conflict(f"no capture of group {group_id} is running", "they have ended already")
        self._stop(waiting, sessions)

    def group_document(self, group_id: str) -> CaptureGroup:
        """A group with its captures; deleted ones are left out.

        Raises:
            NotFound: there is no such group.
        """
        captures = self.captures_of(group_id)
        group = captures[0].group
        assert group is not None, "captures_of finds members of the group alone"
        return CaptureGroup(**group.model_dump(), captures=captures)

    def captures_of(self, group_id: str) -> list[CaptureDocument]:
        """The captures of a group; deleted ones are left out.

        Raises:
            NotFound: there is no such group.
        """
        going_on = [one.id for one in self._waiting(group_id)] + [one.id for one in self._sessions(group_id)]
        ended = [entry.id for entry in self._archive.index.beginning_with(f"{group_id}-")]
        found = list(self._documents(dict.fromkeys((*going_on, *ended))))
        captures = [one for one in found if one.group is not None and one.group.id == group_id]
        if not captures:
            raise NotFound(f"no group {group_id!r}", "GET /api/v1/captures says of which group a capture is")
        return sorted(captures, key=lambda one: one.id)

    def _documents(self, capture_ids: Iterable[str]) -> Iterator[CaptureDocument]:
        for capture_id in capture_ids:
            with suppress(NotFound):  # deleted or disarmed just now
                yield self._archive.document(capture_id)

    def _group(self, requests: Mapping[str, CaptureRequest]) -> tuple[str, list[Member]]:
        unknown = [name for name in requests if name not in self._instruments]
        if unknown:
            raise NotFound(
                f"no device {', '.join(map(repr, unknown))}", f"name some of: {', '.join(self._instruments)}"
            )
        group = Group(self._stamp(), tuple(requests))
        members = [
            self._planned(self._instruments[name], f"{group.id}-{name}", request, group)
            for name, request in requests.items()
        ]
        return group.id, members

    def _planned(
        self,
        instrument: Instrument,
        capture_id: str,
        request: CaptureRequest,
        group: Group | None = None,
        armed_utc: str | None = None,
    ) -> Member:
        part = self._archive.part_of(capture_id)
        return Member(instrument.beginning, Planned(capture_id, request, part, group, armed_utc))

    def _start(self, members: Sequence[Member]) -> None:
        group_start.start(members, self._check_room, self._clock)

    def _trigger(self, waiting: Sequence[ArmedCapture]) -> None:
        devices = tuple(one.device for one in waiting)
        members = [
            self._planned(
                self._instruments[one.device],
                one.id,
                one.request,
                one.group and Group(one.group.id, devices),
                one.armed_utc,
            )
            for one in waiting
        ]
        group_start.trigger(members, self._check_room, self._clock)

    def _stop(self, waiting: Sequence[ArmedCapture], sessions: Sequence[Recording]) -> None:
        for session in sessions:
            session.stop(STOPPED)
        for one in waiting:
            self._instruments[one.device].beginning.disarm(one.id)
            self._annotations.remove(one.id)

    def _check_room(self, bytes_per_s: float, duration_s: float | None) -> None:
        """Beside what other devices are writing."""
        others = sum(one.bytes_per_s for one in self._instruments.values() if one.running is not None)
        self._disk.check_fits(self._archive.directory, bytes_per_s + others, duration_s)

    def _stamp(self) -> str:
        """Of this moment; no two groups that are going on have the same."""
        moment = self._clock.utc_now()
        while self._waiting(_stamped(moment)) or self._sessions(_stamped(moment)):
            moment += timedelta(milliseconds=1)
        return _stamped(moment)

    def _waiting(self, group_id: str | None = None) -> list[ArmedCapture]:
        """The captures that are armed, of a group or all of them."""
        waiting = [one.waiting for one in self._instruments.values() if one.waiting is not None]
        return [one for one in waiting if group_id is None or (one.group and one.group.id == group_id)]

    def _sessions(self, group_id: str | None = None) -> list[Recording]:
        """The captures that are being recorded or sealed, of a group or all of them."""
        sessions = [one.session for one in self._instruments.values()]
        going_on = [one for one in sessions if one is not None and not one.is_sealed]
        return [one for one in going_on if group_id is None or (one.group and one.group.id == group_id)]


def _stamped(moment: datetime) -> str:
    return f"{moment:%Y%m%dT%H%M%S}{moment.microsecond // 1000:03d}Z"
