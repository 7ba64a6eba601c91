"""Publishes devices' states and captures' summaries to an MQTT broker.

It has a thread and an event loop of its own: a broker that is away, slow or stuck delays nothing else.

Summaries of captures that the broker has not taken yet are kept on disk until it has.
"""

import asyncio
import contextlib
import logging
import random
import threading
import time
from collections.abc import Callable

from grabberd import __version__
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.schema import SUFFIX
from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.state.state_database import Outbox
from grabberd.core.field import PAL_HZ
from grabberd.documents.document import JsonObject
from grabberd.documents.mqtt import OnlineMessage
from grabberd.documents.state import MqttDocument, StateDocument
from grabberd.errors import CaptureFileError, GrabberdError, NotFound, NotReady, StorageError
from grabberd.runtime import UtcClock, iso_utc
from grabberd_mqtt.broker import Broker, Connection
from grabberd_mqtt.home_assistant import Announcements
from grabberd_mqtt.messages import (
    CAPTURE,
    LAST_CAPTURE,
    ONLINE,
    STATE,
    Message,
    Topics,
    capture_summary,
    device_state,
    device_topics,
)

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


log = logging.getLogger(__name__)

TICK_S = 0.5
COLLECT_EVERY_S = 60.0
"""Captures that end are announced; this tries again what failed, e.g. while the disk was full."""
FIRST_WAIT_S, LONGEST_WAIT_S = 1.0, 60.0
IN_A_ROW = 50
"""Maximum number of summaries before states are published again: after days offline thousands wait."""
END_S = 5.0
"""Time to disconnect: more than the farewell takes, and a stuck broker must not hold up the daemon's end."""


class Publisher:
    """Publishes states as they change, and each capture's summary until the broker has taken it.

    Args:
        broker: The broker.
        topics: Topics of the barn.
        state: Returns the state of the service.
        summaries: The summaries that wait for the broker.
        clock: Dates the messages.
        every_s: Minimum time between two states of a device.
        announcements: By which other programs discover the devices.
    """

    def __init__(
        self,
        broker: Broker,
        topics: Topics,
        state: Callable[[], StateDocument],
        summaries: SummaryQueue,
        clock: UtcClock,
        every_s: float,
        announcements: Announcements,
    ) -> None:
        self.summaries = summaries
        self._broker = broker
        self._topics = topics
        self._state = state
        self._clock = clock
        self._every_s = every_s
        self._announcements = announcements
        self._unannounced: str | None = None
        self._capture_ended = threading.Event()
        self._connected = False
        self._since_utc = iso_utc(clock.utc_now())
        self._problem: str | None = None
        self._wait_s = FIRST_WAIT_S
        self._stopping = False
        self._loop: asyncio.AbstractEventLoop | None = None
        self._task: asyncio.Task[None] | None = None
        self._thread = threading.Thread(target=self._run, name="mqtt", daemon=True)

    def start(self) -> None:
        """Starts publishing; returns at once, whether or not the broker can be reached.

        Raises:
            StorageError: The state database cannot be used.
        """
        self.summaries.open()
        self._capture_ended.set()
        self._thread.start()

    def capture_ended(self) -> None:
        """Publishes the summary of a capture that has just ended."""
        self._capture_ended.set()

    def stop(self) -> None:
        """Disconnects cleanly, but does not wait for a broker that is stuck."""
        self._stopping = True
        if self._loop is not None and self._task is not None:
            with contextlib.suppress(RuntimeError):  # the loop has ended already
                self._loop.call_soon_threadsafe(self._task.cancel)
        if self._thread.is_alive():
            self._thread.join(END_S)

    def document(self) -> MqttDocument:
        """The connection to the broker, and the captures that wait for it."""
        return MqttDocument(
            connected=self._connected,
            since_utc=self._since_utc,
            problem=self._problem or self._unannounced,
            waiting_captures=self.summaries.waiting + len(self.summaries.remaining),
            acknowledged_captures=self.summaries.acknowledged,
            missed_captures=self.summaries.missed,
        )

    def _run(self) -> None:
        with contextlib.suppress(asyncio.CancelledError):
            asyncio.run(self._work())

    async def _work(self) -> None:
        self._loop, self._task = asyncio.get_running_loop(), asyncio.current_task()
        if self._stopping:  # `stop` came before there was a task to cancel
            return
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._collect())
            tasks.create_task(self._deliver())

    async def _collect(self) -> None:
        """Queues the summaries of captures that end, whether or not the broker can be reached."""
        due_s = time.monotonic()
        while True:
            more = self.summaries.remaining and self.summaries.has_room
            if more or self._capture_ended.is_set() or time.monotonic() >= due_s:
                self._capture_ended.clear()
                self._collect_now()
                due_s = time.monotonic() + COLLECT_EVERY_S
            await asyncio.sleep(TICK_S)

    def _collect_now(self) -> None:
        try:
            self.summaries.collect()
        except GrabberdError as error:
            self._report(error)
        except Exception:
            log.exception("summaries for MQTT cannot be made at the moment")

    async def _deliver(self) -> None:
        """Connects and publishes; after a failure tries again, doubling the wait up to a minute."""
        while True:
            try:
                async with self._broker.connected(self._online(False)) as connection:
                    await connection.publish(self._dated(self._online(True)))
                    self._set_connected(True)
                    await connection.during(self._publish(connection))
            except (NotReady, StorageError) as error:
                self._report(error)
            except Exception as error:
                log.exception("MQTT: unexpected failure; connecting again")
                self._problem = str(error)
            finally:
                self._set_connected(False)
            # Spread, so that a herd's barns do not all come back in the same second.
            await asyncio.sleep(self._wait_s * random.uniform(0.5, 1.0))  # noqa: S311 - no secret
            self._wait_s = min(2 * self._wait_s, LONGEST_WAIT_S)

    async def _publish(self, connection: Connection) -> None:
        published: dict[str, Message] = {}
        await self._announce(connection)
        due_s = time.monotonic()
        while True:
            if time.monotonic() >= due_s:
                await self._publish_states(connection, published)
                due_s = time.monotonic() + self._every_s
            await self._publish_summaries(connection)
            self._problem, self._wait_s = None, FIRST_WAIT_S
            if not self.summaries.waiting:
                await asyncio.sleep(TICK_S)

    async def _announce(self, connection: Connection) -> None:
        """Announces the devices; a broker that refuses them still receives states and captures."""
        self._unannounced = None
        try:
            for message in self._announcements.due():
                await connection.publish(message)
        except NotReady as error:
            log.warning("MQTT: %s; %s", error.message, error.hint)
            self._unannounced = error.message

    async def _publish_states(self, connection: Connection, published: dict[str, Message]) -> None:
        state = self._state()
        for name, device in state.devices.items():
            messages = [self._topics.message(STATE, device_state(device, state.storage), device=name)]
            for topic, message_of in device_topics():
                if (document := message_of(device)) is not None:
                    messages.append(self._topics.message(topic, document, device=name))
            if self._announcements.any and (latest := self.summaries.latest(name)) is not None:
                messages.append(self._topics.message(LAST_CAPTURE, latest, device=name))
            for message in messages:
                if published.get(message.topic) != message:
                    await connection.publish(self._dated(message))
                    published[message.topic] = message

    async def _publish_summaries(self, connection: Connection) -> None:
        # Removed only once acknowledged: a connection that breaks may repeat a summary, but loses none.
        for _ in range(min(self.summaries.waiting, IN_A_ROW)):
            first = self.summaries.first()
            if first is None:
                return
            capture_id, summary = first
            await connection.publish(self._topics.message(CAPTURE, summary))
            self.summaries.acknowledge(capture_id)

    def _online(self, online: bool) -> Message:
        return self._topics.message(ONLINE, OnlineMessage(online=online, version=__version__))

    def _dated(self, message: Message) -> Message:
        content = message.content or {}
        return message._replace(content={**content, "utc": iso_utc(self._clock.utc_now())})

    def _set_connected(self, connected: bool) -> None:
        if connected == self._connected:
            return
        self._connected, self._since_utc = connected, iso_utc(self._clock.utc_now())
        if connected:
            log.info("MQTT: connected; %d summaries wait", self.summaries.waiting)

    def _report(self, error: GrabberdError) -> None:
        """Logs a failure, once for each cause in a row."""
        if error.message != self._problem:
            log.warning("MQTT: %s; %s", error.message, error.hint)
        self._problem = error.message
