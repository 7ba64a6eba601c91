"""System calls on fake cards."""

import errno
from pathlib import Path

from drivers.v4l2.fake_kernel.card import Card
from drivers.v4l2.fake_kernel.queue import DEQUEUED, DONE, QUEUED, FakePages, refusal
from grabberd_v4l2 import abi
from grabberd_v4l2.node import POLL_ERR, POLL_HUP, POLL_IN, POLL_PRI

FLAGS = {DEQUEUED: 0, QUEUED: abi.BUF_FLAG_QUEUED, DONE: abi.BUF_FLAG_DONE}


class FakeKernel:
    """Answers as a kernel would that has these cards under these nodes.

    Attributes:
        time_ns: its clock, which jumps to whatever is waited for.
        calls: names of all calls in order.
        refuse_call: number of a call (`open`, `mmap` and all ioctls count) that is refused; refuse_with: how.
    """

    def __init__(self):
        self.time_ns = 77_000_000_000
        self.cards: dict[Path, Card] = {}
        self.calls = []
        self.refuse_call, self.refuse_with = None, errno.EIO
        self.descriptors = {}
        self.pages = []
        self._timeline = []

    def add(self, path, card):
        """A card under a node."""
        self.cards[Path(path)] = card
        return card

    def at(self, time_ns, action):
        """Has something happen at a time, also in the middle of a wait."""
        self._timeline.append((time_ns, action))
        self._timeline.sort(key=lambda entry: entry[0])

    def after(self, seconds, action):
        """Has something happen in a while."""
        self.at(self.time_ns + round(seconds * 1e9), action)

    @property
    def mapped(self):
        """Buffers of all cards that are mapped."""
        return sum(card.queue.mapped for card in self.cards.values())

    # ---- the calls

    def open(self, path):
        self._called("open")
        card = self.cards.get(Path(path))
        if card is None:
            raise refusal(errno.ENOENT)
        self._scripted(card, "open")
        if not card.plugged:
            raise refusal(errno.ENODEV)
        fd = max(self.descriptors, default=100) + 1
        self.descriptors[fd] = card
        return fd

    def close(self, fd):
        card = self.descriptors.pop(fd)
        if card not in self.descriptors.values():
            card.queue.stop()
            card.subscribed.clear()
            card.events.clear()
            if not card.queue.mapped:
                card.queue.memories = []

    def ioctl(self, fd, request, argument):
        name = abi.NAMES[request]
        self._called(name)
        card = self.descriptors[fd]
        if not card.plugged:
            raise refusal(errno.ENODEV)
        self._pass_to(self.time_ns)
        self._scripted(card, name)
        getattr(self, f"_{name.lower()}")(card, argument)

    def mmap(self, fd, length, offset):
        self._called("mmap")
        card = self.descriptors[fd]
        self._scripted(card, "mmap")
        memory = card.queue.memory(offset // 4096)
        assert length == memory.bytes.size
        self.pages.append(FakePages(memory))
        return self.pages[-1]

    def poll(self, fd, timeout_s):
        deadline_ns = self.time_ns + round(timeout_s * 1e9)
        card = self.descriptors[fd]
        while not (ready := self._ready(card)) and self.time_ns < deadline_ns:
            self._pass_to(min(self._next_ns(), deadline_ns))
        return ready

    def now_ns(self):
        return self.time_ns

    def sleep(self, seconds):
        self._pass_to(self.time_ns + round(seconds * 1e9))

    # ---- time

    def _pass_to(self, time_ns):
        while (next_ns := self._next_ns()) <= time_ns:
            self.time_ns = max(self.time_ns, next_ns)
            while self._timeline and self._timeline[0][0] <= self.time_ns:
                self._timeline.pop(0)[1]()
            for card in self.cards.values():
                if (card.due_ns() or float("inf")) <= self.time_ns:
                    card.deliver()
        self.time_ns = max(self.time_ns, time_ns)

    def _next_ns(self):
        due = [card.due_ns() for card in self.cards.values()]
        times = [time_ns for time_ns in due if time_ns is not None]
        return min([*times, *(entry[0] for entry in self._timeline[:1])], default=float("inf"))

    def _ready(self, card):
        self._pass_to(self.time_ns)
        if not card.plugged:
            return POLL_ERR | POLL_HUP | POLL_PRI
        ready = POLL_PRI if card.events else 0
        if not card.queue.streaming or card.queue.failed:
            return ready | POLL_ERR
        return ready | (POLL_IN if card.queue.done or card.idle_wakes else 0)

    # ---- refusals

    def _called(self, name):
        self.calls.append(name)
        if self.refuse_call == len(self.calls):
            raise refusal(self.refuse_with)

    def _scripted(self, card, name):
        number = card.answers[name].popleft() if card.answers[name] else 0
        if number:
            if (name, number) == ("DQBUF", errno.EIO) and card.eio_takes and card.queue.done:
                card.queue.done.popleft().state = DEQUEUED
            raise refusal(number)

    # ---- what cards answer

    def _querycap(self, card, asked):
        asked.driver, asked.card, asked.bus_info = (
            text.encode() for text in (card.driver, card.card, card.bus_info)
        )
        asked.capabilities = abi.CAP_DEVICE_CAPS | abi.CAP_VIDEO_CAPTURE | abi.CAP_STREAMING
        asked.device_caps = card.caps

    def _enuminput(self, card, asked):
        if asked.index >= len(card.sockets):
            raise refusal(errno.EINVAL)
        name, asked.type = card.sockets[asked.index]
        asked.name = name.encode()
        for bits in card.standards.values() if name != "HDMI" else ():
            asked.std |= bits
        asked.status = card.status if asked.index == card.input else 0

    def _g_input(self, card, asked):
        asked.value = card.input

    def _s_input(self, card, asked):
        card.set_input(asked.value)

    def _enum_framesizes(self, card, asked):
        card.tell_size(asked)

    def _enum_frameintervals(self, card, asked):
        card.tell_interval(asked)

    def _g_parm(self, card, asked):
        card.tell_parm(asked.parm.capture)

    def _s_parm(self, card, asked):
        card.set_parm(asked.parm.capture)
        card.tell_parm(asked.parm.capture)

    def _enumstd(self, card, asked):
        if asked.index >= len(card.standards):
            raise refusal(errno.EINVAL if card.standards else errno.ENODATA)
        name, asked.id = list(card.standards.items())[asked.index]
        asked.name = name.encode()

    def _g_std(self, card, asked):
        if not card.standards:
            raise refusal(errno.ENODATA)
        asked.value = card.standard

    def _s_std(self, card, asked):
        card.set_standard(asked.value)

    def _querystd(self, card, asked):
        if not card.standards:
            raise refusal(errno.ENODATA)
        asked.value = card.seen_standard()

    def _enum_fmt(self, card, asked):
        if asked.index >= len(card.formats):
            raise refusal(errno.EINVAL)
        asked.pixelformat = abi.fourcc(card.formats[asked.index])

    def _g_fmt(self, card, asked):
        asked.fmt.pix = card.pix

    def _s_fmt(self, card, asked):
        pix = asked.fmt.pix
        card.set_format(pix.width, pix.height, abi.fourcc_name(pix.pixelformat), pix.field)
        asked.fmt.pix = card.pix

    def _try_fmt(self, card, asked):
        pix = asked.fmt.pix
        asked.fmt.pix = card.granted(pix.width, pix.height, abi.fourcc_name(pix.pixelformat), pix.field)

    def _reqbufs(self, card, asked):
        if asked.count:
            asked.count = min(max(asked.count, card.fewest_buffers), card.most_buffers)
        card.queue.request(asked.count, -(-card.pix.sizeimage // 4096) * 4096)

    def _querybuf(self, card, asked):
        memory = card.queue.memory(asked.index)
        asked.length, asked.m.offset, asked.flags = memory.bytes.size, 4096 * asked.index, FLAGS[memory.state]

    def _qbuf(self, card, asked):
        card.queue.queue(asked.index)

    def _dqbuf(self, card, asked):
        if card.idle_wakes:
            card.idle_wakes -= 1
            raise refusal(errno.EAGAIN)
        memory = card.queue.dequeue()
        for name in ("bytesused", "flags", "field", "timestamp", "sequence"):
            setattr(asked, name, getattr(memory.filled, name))
        asked.index = card.queue.memories.index(memory)

    def _streamon(self, card, asked):
        assert asked.value == abi.CAPTURE
        card.start(self.time_ns)

    def _streamoff(self, card, asked):
        assert asked.value == abi.CAPTURE
        card.queue.stop()

    def _subscribe_event(self, card, asked):
        card.subscribed.add(asked.type)

    def _dqevent(self, card, asked):
        if not card.events:
            raise refusal(errno.ENOENT)
        asked.type = card.events.popleft()
