"""Clients of the daemon: an operator at work, a page that looks, a researcher with jobs."""

import random
import traceback
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

from tests.proofs.world.daemon import Gone, WorldJob
from tests.proofs.world.record import Asked, Job, Span

from grabberd.errors import GrabberdError
from grabberd.instrument.capture.capture_request import CaptureRequest

if TYPE_CHECKING:
    from tests.proofs.world.world import World

T = TypeVar("T")
MOST_KEPT = 60
ENDED = ("sealed", "damaged", "unreadable")


class Client:
    """Asks, and keeps what it was told."""

    def __init__(self, world: "World", draw: random.Random) -> None:
        self.world, self.draw = world, draw
        self.record, self.now_ns = world.record, lambda: world.computer.now_ns

    def ask(self, what: Callable[[], T], *, may_refuse: bool = False) -> T | None:
        """The answer; None if there is none, or a refusal, which is noted unless there may be a reason."""
        if self.world.daemon.service is None:
            return None
        try:
            return self.world.daemon.call(what)
        except Gone:
            return None
        except GrabberdError as error:
            if not may_refuse:
                self.record.refusals.append((self.now_ns(), f"{type(error).__name__}: {error.message}"))
            return None
        except Exception as error:
            self.record.lies.append(
                f"a client got {error!r}: {''.join(traceback.format_exception(error)[-4:])}"
            )
            return None

    def pause(self, least_s: float, most_s: float) -> None:
        self.world.computer.sleep(self.draw.uniform(least_s, most_s))

    @property
    def service(self):  # type: ignore[no-untyped-def]
        return self.world.daemon.service


class Operator(Client):
    """Starts, triggers, stops, annotates and deletes captures, one after the other."""

    def run(self) -> None:
        while not self.world.is_calm:
            self.pause(0.2, 3.0)
            started = self._start()
            if started is None:
                continue
            self._wait(started)
            self._annotate(started)
            kept = [name for name, one in self.record.captures.items() if not one.deleted]
            if self.draw.random() < 0.2 or len(kept) > MOST_KEPT:
                self._delete(self.draw.choice(kept[: -MOST_KEPT // 2] or kept))

    def _start(self) -> str | None:
        draw, service = self.draw, self.service
        device = draw.choice(list(self.world.cameras))
        fields, before = draw.choice((None, None, 25, 100, 400)), draw.choice((0, 0, 10, 25))
        request = CaptureRequest(
            fields=fields, pre_trigger_fields=before, bits=draw.choice((None, None, 8)), lines="field"
        )
        asked_ns = self.now_ns()
        if draw.random() < 0.25:
            return self._trigger(device, request)
        found = self.ask(lambda: service.capture_control.start(device, request))
        return None if found is None else self._started(found.id, device, request, asked_ns)

    def _trigger(self, device: str, request: CaptureRequest) -> str | None:
        service = self.service
        armed = self.ask(lambda: service.capture_control.arm(device, request))
        if armed is None:
            return None
        self.pause(0.1, 3.0)
        asked_ns, service = self.now_ns(), self.service
        if self.ask(lambda: service.capture_control.trigger(armed.id) or True):
            return self._started(armed.id, device, request, asked_ns)
        self.ask(lambda: service.capture_control.stop(armed.id))
        return None

    def _started(self, capture_id: str, device: str, request: CaptureRequest, asked_ns: int) -> str:
        span = Span(asked_ns, self.now_ns())
        if capture_id in self.record.captures:
            self.record.lies.append(f"two captures have the id {capture_id}")
        self.record.captures[capture_id] = Asked(device, span, request.fields, request.pre_trigger_fields)
        return capture_id

    def _wait(self, capture_id: str) -> None:
        asked = self.record.captures[capture_id]
        self.pause(1.0, 15.0)
        if asked.fields is None or self.draw.random() < 0.2:
            self._stop(capture_id)
        until_ns = self.now_ns() + 30 * 10**9
        while self.now_ns() < until_ns and not self.world.is_calm:
            service = self.service
            found = self.ask(lambda service=service: service.archive.document(capture_id))
            if found is not None and found.state in ENDED:
                if found.state == "sealed":
                    asked.sealed_ns = self.now_ns()
                return
            self.pause(0.3, 1.0)

    def _stop(self, capture_id: str) -> None:
        asked_ns, service = self.now_ns(), self.service
        may_have_ended = self.record.captures[capture_id].fields is not None
        done = self.ask(lambda: service.capture_control.stop(capture_id) or True, may_refuse=may_have_ended)
        self.record.captures[capture_id].stopped = Span(asked_ns, self.now_ns() if done else None)

    def _annotate(self, capture_id: str) -> None:
        asked, note, pinned = (
            self.record.captures[capture_id],
            f"{self.draw.random()}",
            self.draw.random() < 0.3,
        )
        asked.notes.append(note)
        asked.pins.append(pinned)
        service = self.service
        if self.ask(lambda: service.annotations.annotate(capture_id, note=note, pinned=pinned) or True):
            asked.notes, asked.pins = [note], [pinned]

    def _delete(self, capture_id: str) -> None:
        if self.record.captures[capture_id].deleted:
            return
        self.world.before_deletion(capture_id)
        self.record.captures[capture_id].deleted = True
        service = self.service
        # It may be pinned, or a job may read it.
        self.ask(lambda: service.annotations.delete(capture_id), may_refuse=True)


class Page(Client):
    """Looks at the state and at the list, and remembers what it was shown."""

    def run(self) -> None:
        rounds = 0
        while True:
            self.world.computer.sleep(0.5)
            rounds += 1
            service = self.service
            state = self.ask(lambda service=service: service.state())
            if state is None:
                continue
            now_ns = self.now_ns()
            seen = [f"device {one.state.value}" for one in state.devices.values()]
            seen += [f"logger {one.state.value}" for one in state.loggers.values()]
            seen += [f"fault {one.cause_code.value}" for one in state.faults]
            if state.storage.problem:
                seen.append("storage problem")
            self.record.states += [(now_ns, one) for one in seen]
            if rounds % 10 == 0:
                self.ask(lambda service=service: service.archive.documents())
                self.world.look_at_files()


class Researcher(Client):
    """Submits jobs on what is sealed, and cancels some."""

    def run(self) -> None:
        while True:
            self.pause(1.0, 6.0)
            sealed = [name for name, one in self.record.captures.items() if one.sealed_ns and not one.deleted]
            if sealed and not self.world.is_calm:
                self._submit(self.draw.choice(sealed))
            self._look()

    def _submit(self, capture_id: str) -> None:
        service, spec = self.service, WorldJob(subject=capture_id, seconds=self.draw.uniform(0.2, 4.0))
        asked_utc_s = self.world.computer.utc_now().timestamp()
        job = self.ask(lambda: service.jobs.submit(spec))
        if job is None:
            return
        kept = self.world.job(job.id)
        if kept.submitted_ns:
            self.record.lies.append(f"two jobs have the id {job.id}")
        kept.submitted_ns = self.now_ns()
        kept.submitted_utc_s = min(asked_utc_s, self.world.computer.utc_now().timestamp())
        if self.draw.random() < 0.2:
            self.pause(0.0, 3.0)
            kept.cancelled, service = True, self.service
            self.ask(lambda: service.jobs.cancel(job.id))

    def _look(self) -> None:
        for name, job in self.record.jobs.items():
            if job.ended is None and job.submitted_ns:
                self._see(name, job)

    def _see(self, name: str, job: Job) -> None:
        service = self.service
        found = self.ask(lambda: service.jobs.get(name))
        if found is not None and found.state.value in ("done", "failed", "cancelled"):
            job.ended = (found.state.value, self.now_ns())
