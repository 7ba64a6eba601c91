"""Tells an MQTT broker how the devices are and what has been captured, and takes nothing from it.

In a thread and an event loop of its own: a broker that is away, slow or stuck costs nobody else anything.
"""

import asyncio
import contextlib
import logging
import random
import threading
import time
from collections.abc import Callable

from grabberd import __version__
from grabberd.documents.mqtt import OnlineMessage
from grabberd.documents.state import MqttDocument, StateDocument
from grabberd.errors import GrabberdError, NotReady, StorageError
from grabberd.service.clock import Clock, iso_utc
from grabberd.service.mqtt.broker import Broker, Connection
from grabberd.service.mqtt.messages import CAPTURE, ONLINE, STATE, Message, Topics, device_state
from grabberd.service.mqtt.summary_queue import SummaryQueue

log = logging.getLogger(__name__)

TICK_S = 0.5
LOOK_EVERY_S = 60.0
FIRST_WAIT_S, LONGEST_WAIT_S = 1.0, 60.0
IN_A_ROW = 50
"""So many summaries go out before the devices' states have their turn."""
END_S = 5.0


class Publisher:
    """Publishes states as they change, and each capture's summary until the broker has taken it.

    Args:
        broker: who is told.
        topics: where.
        state: gives the service's state.
        outgoing: the summaries.
        clock: says when.
        every_s: a device's state goes out no more often.
    """

    def __init__(
        self,
        broker: Broker,
        topics: Topics,
        state: Callable[[], StateDocument],
        outgoing: SummaryQueue,
        clock: Clock,
        every_s: float,
    ) -> None:
        self.outgoing = outgoing
        self._broker = broker
        self._topics = topics
        self._state = state
        self._clock = clock
        self._every_s = every_s
        self._noticed = threading.Event()
        self._connected = False
        self._since_utc = iso_utc(clock.utc_now())
        self._problem: str | None = None
        self._wait_s = FIRST_WAIT_S
        self._stopping = False
        self._loop: asyncio.AbstractEventLoop | None = None
        self._task: asyncio.Task[None] | None = None
        self._thread = threading.Thread(target=self._run, name="mqtt", daemon=True)

    def start(self) -> None:
        """Begins; returns at once, wherever the broker is.

        Raises:
            StorageError: the state cannot be used.
        """
        self.outgoing.open()
        self._noticed.set()
        self._thread.start()

    def notice(self) -> None:
        """A capture has ended."""
        self._noticed.set()

    def stop(self) -> None:
        """Disconnects cleanly, without waiting for a broker that is stuck."""
        self._stopping = True
        if self._loop is not None and self._task is not None:
            with contextlib.suppress(RuntimeError):  # it has ended
                self._loop.call_soon_threadsafe(self._task.cancel)
        if self._thread.is_alive():
            self._thread.join(END_S)

    def document(self) -> MqttDocument:
        """The connection to the broker, and the captures that wait for it."""
        return MqttDocument(
            connected=self._connected,
            since_utc=self._since_utc,
            problem=self._problem,
            waiting_captures=self.outgoing.waiting + len(self.outgoing.left),
            acknowledged_captures=self.outgoing.acknowledged,
            missed_captures=self.outgoing.missed,
        )

    def _run(self) -> None:
        with contextlib.suppress(asyncio.CancelledError):
            asyncio.run(self._work())

    async def _work(self) -> None:
        self._loop, self._task = asyncio.get_running_loop(), asyncio.current_task()
        if self._stopping:  # before there was a task that could be told
            return
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._collect())
            tasks.create_task(self._deliver())

    async def _collect(self) -> None:
        """Has the captures that end kept, whether or not there is a broker."""
        due_s = time.monotonic()
        while True:
            more = self.outgoing.left and self.outgoing.has_room
            if more or self._noticed.is_set() or time.monotonic() >= due_s:
                self._noticed.clear()
                self._look()
                due_s = time.monotonic() + LOOK_EVERY_S
            await asyncio.sleep(TICK_S)

    def _look(self) -> None:
        try:
            self.outgoing.look()
        except GrabberdError as error:
            self._say(error)
        except Exception:
            log.exception("summaries for MQTT cannot be made at this moment")

    async def _deliver(self) -> None:
        """Connects again and again, more and more seldom."""
        while True:
            try:
                async with self._broker.connected(self._online(False)) as connection:
                    await connection.publish(self._dated(self._online(True)))
                    self._enter(True)
                    await connection.during(self._publish(connection))
            except (NotReady, StorageError) as error:
                self._say(error)
            except Exception as error:
                log.exception("MQTT is given up for the moment")
                self._problem = str(error)
            finally:
                self._enter(False)
            await asyncio.sleep(self._wait_s * random.uniform(0.5, 1.0))  # noqa: S311 - barns come back apart
            self._wait_s = min(2 * self._wait_s, LONGEST_WAIT_S)

    async def _publish(self, connection: Connection) -> None:
        told: dict[str, Message] = {}
        due_s = time.monotonic()
        while True:
            if time.monotonic() >= due_s:
                await self._tell_states(connection, told)
                due_s = time.monotonic() + self._every_s
            await self._tell_captures(connection)
            self._went_well()
            if not self.outgoing.waiting:
                await asyncio.sleep(TICK_S)

    async def _tell_states(self, connection: Connection, told: dict[str, Message]) -> None:
        state = self._state()
        for name, device in state.devices.items():
            message = self._topics.message(STATE, device_state(device, state.storage), device=name)
            if told.get(name) != message:
                await connection.publish(self._dated(message))
                told[name] = message

    async def _tell_captures(self, connection: Connection) -> None:
        for _ in range(min(self.outgoing.waiting, IN_A_ROW)):
            first = self.outgoing.first()
            if first is None:
                return
            capture_id, summary = first
            await connection.publish(self._topics.message(CAPTURE, summary))
            self.outgoing.acknowledge(capture_id)

    def _online(self, online: bool) -> Message:
        return self._topics.message(ONLINE, OnlineMessage(online=online, version=__version__))

    def _dated(self, message: Message) -> Message:
        return message._replace(content={**message.content, "utc": iso_utc(self._clock.utc_now())})

    def _enter(self, connected: bool) -> None:
        if connected == self._connected:
            return
        self._connected, self._since_utc = connected, iso_utc(self._clock.utc_now())
        if connected:
            log.info("MQTT: connected; %d summaries wait", self.outgoing.waiting)

    def _went_well(self) -> None:
        self._problem, self._wait_s = None, FIRST_WAIT_S

    def _say(self, error: GrabberdError) -> None:
        """Once for each cause in a row."""
        if error.message != self._problem:
            log.warning("MQTT: %s; %s", error.message, error.hint)
        self._problem = error.message
