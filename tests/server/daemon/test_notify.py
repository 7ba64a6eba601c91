"""What systemd hears, on sockets that these tests listen on."""

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from simulated_time import SimulatedClock

from grabberd.documents.enums import DeviceState
from grabberd.instrument.device.status_board import Liveness, StatusBoard
from grabberd.server.daemon.systemd import Heartbeat, Notifier

WATCHDOG_S = 30.0


class Ear:
    """Listens as systemd does."""

    def __init__(self, address: str) -> None:
        self._listening = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self._listening.bind(address.replace("@", "\0", 1) if address.startswith("@") else address)
        self.address = address

    def heard(self) -> list[str]:
        words = []
        while True:
            try:
                words.append(self._listening.recv(4096).decode())
            except BlockingIOError:
                return words

    def close(self) -> None:
        self._listening.close()


@contextmanager
def listening(address: str) -> Iterator[Ear]:
    ear = Ear(address)
    yield ear
    ear.close()


@pytest.fixture
def ear(tmp_path: Path) -> Iterator[Ear]:
    with listening(str(tmp_path / "notify")) as one:
        yield one


def environment(ear: Ear, **more: str) -> dict[str, str]:
    return {"NOTIFY_SOCKET": ear.address, "HOME": "/", **more}


@pytest.mark.parametrize("kind", ["file", "abstract"])
def test_it_speaks_to_the_socket_that_is_named(kind: str, tmp_path: Path) -> None:
    address = str(tmp_path / "notify") if kind == "file" else f"@grabberd-test-{os.getpid()}"
    with listening(address) as ear:
        notifier = Notifier.from_environment(environment(ear))
        notifier.ready()
        notifier.alive()
        notifier.stopping()
        assert ear.heard() == ["READY=1", "WATCHDOG=1", "STOPPING=1"]


def test_no_child_can_speak_in_its_name(ear: Ear) -> None:
    left = environment(ear, WATCHDOG_USEC="1000000", WATCHDOG_PID=str(os.getpid()))
    Notifier.from_environment(left)
    assert left == {"HOME": "/"}


def test_nobody_listens_and_nothing_happens(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    Notifier.from_environment({}).ready()
    assert not caplog.records
    Notifier(str(tmp_path / "none")).ready()
    assert "READY cannot be sent" in caplog.text


def test_a_systemd_that_is_busy_does_not_hold_the_daemon_and_is_told_as_soon_as_it_listens(
    ear: Ear, caplog: pytest.LogCaptureFixture
) -> None:
    notifier = Notifier(ear.address)
    while notifier.alive():
        pass
    pulse = Pulse(ear)
    pulse.boards[0].enter(DeviceState.OPENING)
    for _ in range(3):
        pulse.heartbeat.beat(pulse.clock.passed_s)
    assert caplog.text.count("STATUS cannot be sent") == 1
    ear.heard()
    pulse.heartbeat.beat(pulse.clock.passed_s)
    assert ear.heard() == ["STATUS=cup is opening; pen is absent: not opened yet", "WATCHDOG=1"]


def test_the_status_is_one_line_and_said_when_it_changes(ear: Ear) -> None:
    notifier = Notifier(ear.address)
    for words in ("ready", "ready", "lost:\n  no cable\nREADY=1", "ready"):
        notifier.status(words)
    assert ear.heard() == ["STATUS=ready", "STATUS=lost: no cable READY=1", "STATUS=ready"]


@pytest.mark.parametrize(
    ("words", "watchdog_s"),
    [
        ({}, None),
        ({"WATCHDOG_USEC": "30000000"}, 30.0),
        ({"WATCHDOG_USEC": "30000000", "WATCHDOG_PID": str(os.getpid())}, 30.0),
        ({"WATCHDOG_USEC": "30000000", "WATCHDOG_PID": "1"}, None),
        ({"WATCHDOG_USEC": "soon"}, None),
    ],
)
def test_the_watchdogs_time_is_taken_if_it_is_meant_for_this_process(
    words: dict[str, str], watchdog_s: float | None
) -> None:
    assert Notifier.from_environment(dict(words)).watchdog_s == watchdog_s


class Pulse:
    """A heartbeat in simulated time over two devices, and when it was heard to live."""

    def __init__(self, ear: Ear, watchdog_s: float | None = WATCHDOG_S) -> None:
        self.clock = SimulatedClock()
        self.boards = [StatusBoard(name, self.clock) for name in ("cup", "pen")]
        self.heartbeat = Heartbeat(Notifier(ear.address, watchdog_s), Liveness(self.boards))
        self.ear = ear
        self.lived_s: list[float] = []
        self.heard: list[str] = []

    def run(self, seconds: float, frozen: StatusBoard | None = None) -> None:
        end_s = self.clock.passed_s + seconds
        while self.clock.passed_s < end_s:
            for board in self.boards:
                if board is not frozen:
                    board.beat()
            self.heartbeat.beat(self.clock.passed_s)
            words = self.ear.heard()
            self.heard += words
            self.lived_s += [self.clock.passed_s] * words.count("WATCHDOG=1")
            self.clock.sleep(self.heartbeat.every_s)


@settings(max_examples=25)
@given(watchdog_s=st.floats(0.1, 120))
def test_it_lives_at_least_every_half_of_the_watchdogs_time(watchdog_s: float) -> None:
    with listening(f"@grabberd-pulse-{os.getpid()}") as ear:
        pulse = Pulse(ear, watchdog_s)
        pulse.run(3 * watchdog_s)
    gaps = [after - before for before, after in zip(pulse.lived_s, pulse.lived_s[1:], strict=False)]
    assert pulse.lived_s[0] == 0.0
    assert gaps
    assert max(gaps) <= watchdog_s / 2 * (1 + 1e-6)
    assert min(gaps) >= watchdog_s / 8


@pytest.mark.parametrize("device", [0, 1])
def test_one_capture_thread_that_stands_still_is_enough_to_be_restarted(
    ear: Ear, device: int, caplog: pytest.LogCaptureFixture
) -> None:
    pulse = Pulse(ear)
    pulse.run(100.0)
    pulse.run(200.0, frozen=pulse.boards[device])
    assert max(pulse.lived_s) <= 100.0 + WATCHDOG_S / 2
    assert caplog.text.count("has not beaten") == 1
    assert pulse.boards[device].name in caplog.text


def test_a_restart_waits_until_no_other_device_records(ear: Ear) -> None:
    pulse = Pulse(ear)
    recording, frozen = pulse.boards
    for board in pulse.boards:
        for state in (DeviceState.OPENING, DeviceState.READY, DeviceState.CAPTURING):
            board.enter(state)
    pulse.run(200.0, frozen=frozen)
    assert max(pulse.lived_s) > 200.0 - WATCHDOG_S / 2
    recording.enter(DeviceState.READY)
    pulse.run(100.0, frozen=frozen)
    assert max(pulse.lived_s) < 200.0 + WATCHDOG_S / 2, "its own capture does not keep it from that"


def test_a_capture_thread_that_stands_still_for_a_moment_is_forgiven(ear: Ear) -> None:
    pulse = Pulse(ear)
    pulse.run(20.0)
    pulse.run(12.0, frozen=pulse.boards[0])
    pulse.run(100.0)
    assert max(b - a for a, b in zip(pulse.lived_s, pulse.lived_s[1:], strict=False)) <= WATCHDOG_S / 2


def test_where_nobody_watches_only_the_status_is_told(ear: Ear) -> None:
    pulse = Pulse(ear, watchdog_s=None)
    pulse.run(10.0)
    assert pulse.heard == ["STATUS=cup is absent: not opened yet; pen is absent: not opened yet"]
    pulse.boards[0].enter(DeviceState.OPENING)
    pulse.run(10.0)
    assert pulse.heard[1:] == ["STATUS=cup is opening; pen is absent: not opened yet"]
