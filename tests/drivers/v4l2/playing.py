"""A capture thread before a card in the modelled kernel, and what its account says of the camera's fields."""

from datetime import UTC, datetime, timedelta

from simulated_time import SMALL, NoCaptures, Until

from drivers.v4l2.bench import Bench
from drivers.v4l2.fake_kernel import number_in
from drivers.v4l2.fake_kernel.card import PERIOD_NS
from grabberd.config import RingConfig
from grabberd.core.field import unpack
from grabberd.core.ledger import Ledger, too_high_by
from grabberd.instrument.capture.recorder import Begin, cut
from grabberd.instrument.device.capture_thread import CaptureThread
from grabberd.instrument.device.field_pipeline import FieldPipeline
from grabberd.instrument.device.scheduling import ThreadTimes
from grabberd.instrument.device.status_board import StatusBoard
from grabberd_fake.__main__ import Judged, lies_of
from grabberd_v4l2 import abi


class KernelClock:
    """The modelled kernel's clock, for everything that runs on it."""

    def __init__(self, kernel):
        self._kernel, self._begin_ns = kernel, kernel.time_ns

    def now_ns(self):
        return self._kernel.time_ns

    def utc_now(self):
        return datetime(2026, 1, 1, tzinfo=UTC) + timedelta(microseconds=self.now_ns() / 1000)

    def sleep(self, seconds):
        self._kernel.sleep(max(0.0, seconds))

    @property
    def passed_s(self):
        return (self.now_ns() - self._begin_ns) / 1e9


class Scheduler:
    """Keeps the program from running, and the kernel's account of that.

    Attributes:
        waits_s: how long a call of the program has to wait for a processor, by the time that has passed;
            `waits_at_work_s`: how long its work on a field has to.
        hangs: at what time which call hangs, and for how long.
        stops: from when to when it is stopped, in s; `stopped_at_work`: with a field in its hands, else while
            it waits for one.
        polls_in_vain: after a stop the poll says that nothing has come.
    """

    def __init__(self, clock):
        self._clock = clock
        self._waited_ns = 0
        self.waits_s = lambda _passed_s: 0.0
        self.stops = ()
        self.waits_at_work_s = lambda _passed_s: 0.0
        self.hangs = {}
        self.stopped_at_work = self.polls_in_vain = False

    def thread(self):
        return ThreadTimes(0, self._waited_ns)

    def program_ns(self):
        return 0

    def come_first(self):
        return ""

    def keep_to_share(self, _now_ns):
        return ""

    def hold(self, *, at_work=False):
        """Lets the time pass for which the program does not run; returns whether it was stopped."""
        wait_s = (self.waits_at_work_s if at_work else self.waits_s)(self._clock.passed_s)
        self._waited_ns += round(wait_s * 1e9)
        self._clock.sleep(wait_s)
        stopped = False
        for begin_s, end_s in self.stops if at_work == self.stopped_at_work else ():
            if begin_s <= self._clock.passed_s < end_s:
                self._clock.sleep(end_s - self._clock.passed_s)
                stopped = True
        return stopped

    def hang(self, call):
        """Lets the time pass for which a call does not return."""
        for at_s, (name, seconds) in list(self.hangs.items()):
            if name == call and at_s <= self._clock.passed_s:
                del self.hangs[at_s]
                self._clock.sleep(seconds)


class Play:
    """A stream of the card for some seconds, as the daemon would take it.

    Attributes:
        bench, card, scheduler: to have things go wrong on, before `run`.
        slots: what came, in order, without their pictures; newest: the last picture; camera_numbers: the
            camera's number of each field that came, as its picture has it; ledger: their account.
    """

    def __init__(self, folder, card, **options):
        self.bench = Bench(folder, card, **options)
        self.card, kernel = self.bench.card, self.bench.kernel
        self.clock = KernelClock(kernel)
        self.scheduler = Scheduler(self.clock)
        self._poll = kernel.poll
        self._ioctl = kernel.ioctl
        kernel.poll, kernel.ioctl = self._late_poll, self._late_ioctl
        ring = RingConfig(bits=8, lines="field")
        self._pipeline = FieldPipeline(SMALL.model_copy(update={"ring": ring}))
        self._opened, self._pipeline.opened = self._pipeline.opened, self._without_content_check
        self._work, self._pipeline.take = self._pipeline.take, self._late_work
        self.board = StatusBoard("cup", self.clock)
        self.slots, self.camera_numbers, self.ledger = [], [], Ledger()
        self._count, self.board.count = self.board.count, self._take

    def run(self, seconds):
        """Plays, and returns itself."""
        self._start_ns = self.clock.now_ns()
        captures = NoCaptures(lambda _: None, lambda _: None)
        stopping = Until(self.clock, seconds)
        thread = CaptureThread(
            "cup",
            self.bench.grabber,
            self._pipeline,
            self.board,
            self.clock,
            captures,
            stopping,
            self.scheduler,
        )
        thread.run()
        for slot in self._pipeline.settle():
            self._take(slot)
        return self

    def _without_content_check(self, info, since_ns=None):
        """The model's pictures are no camera's: what is the same in every line looks shifted."""
        change = self._opened(info, since_ns)
        self._pipeline._content = None
        return change

    def _late_poll(self, fd, timeout_s):
        ready = self._poll(fd, timeout_s)
        if self.scheduler.hold() and self.scheduler.polls_in_vain:
            return 0
        return ready or self._poll(fd, 0.0)

    def _late_ioctl(self, fd, request, argument):
        self._ioctl(fd, request, argument)
        self.scheduler.hang(abi.NAMES[request])

    def _late_work(self, *grabbed, **known):
        slots = self._work(*grabbed, **known)
        self.scheduler.hold(at_work=True)
        return slots

    def _take(self, slot):
        self._count(slot)
        self.newest = slot.numbered.packed
        self.slots.append(slot._replace(numbered=None))
        self.camera_numbers.append(number_in(unpack(self.newest).luma))
        self.ledger.enter(slot.n, slot.outcome, slot.reason, slot.lost_before)
        self.ledger.events += slot.rebases

    @property
    def lies(self):
        """What is not as the account says."""
        numbers = self.camera_numbers
        judged = [
            Judged(slot.n, number, slot.time_ns, slot.reason)
            for slot, number in zip(self.slots, numbers, strict=True)
        ]
        too_high = [(event.n, too_high_by(event)) for event in self.ledger.events]
        return list(lies_of(judged, numbers[0], too_high))

    def captured_from(self, begin_s):
        """The account of a capture that begins then, and the camera's number and the time of each field."""
        begin = Begin(self._start_ns + round(begin_s * 1e9), PERIOD_NS)
        ledger, fields, first_n = Ledger(), [], None
        for slot, number in zip(self.slots, self.camera_numbers, strict=True):
            if not fields:
                first_n = begin.first_n(slot)
            if slot.n >= first_n:
                lost = (one._replace(first_n=one.first_n - first_n) for one in cut(slot.lost_before, first_n))
                ledger.enter(slot.n - first_n, slot.outcome, slot.reason, tuple(lost))
                fields.append((number, slot.time_ns))
        return ledger, fields

    @property
    def missing(self):
        """Numbers that the account says are lost."""
        return [n for entry in self.lost for n in range(entry.first_n, entry.end_n)]

    @property
    def lost(self):
        """Entries of fields that never came."""
        return [entry for slot in self.slots for entry in slot.lost_before]

    @property
    def truly_missing(self):
        """Numbers of the camera's fields that did not come, counted from the first."""
        numbers = self.camera_numbers
        return sorted(set(range(numbers[-1] - numbers[0])) - {number - numbers[0] for number in numbers})

    @property
    def uncertain(self):
        """Fields whose number is said to be uncertain."""
        return [slot.n for slot in self.slots if "number uncertain" in (slot.reason or "")]

    @property
    def rebases(self):
        """Kinds of the changes of what numbers and times go by."""
        return [event.kind for event in self.ledger.events]

    @property
    def causes(self):
        """Reasons of the losses without their values."""
        return {entry.reason.partition(" (")[0] for entry in self.lost}
