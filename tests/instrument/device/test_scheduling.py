"""Whether the capture thread took its fields in time, and what kept it from that."""

import errno
import os
import subprocess
import sys
import threading
import time

import pytest
from slots import ManualClock

from grabberd.errors import DeviceRefused
from grabberd.instrument.acquisition import Standstill
from grabberd.instrument.acquisition.numbering.standstill import StandstillOfDriver
from grabberd.instrument.device.scheduling import KernelAccount, Scheduling, ThreadTimes

TIMEOUT_S = 0.05
POLICY = "import os; print(os.sched_getscheduler(0))"


class Account:
    """An account that the test keeps."""

    def __init__(self) -> None:
        self.ran_s = self.waited_s = self.program_s = 0.0
        self.known = True

    def thread(self) -> ThreadTimes | None:
        return ThreadTimes(round(self.ran_s * 1e9), round(self.waited_s * 1e9)) if self.known else None

    def program_ns(self) -> int:
        return round(self.program_s * 1e9)


class Thread:
    """A capture thread whose time goes where the test says."""

    def __init__(self) -> None:
        self.clock, self.account = ManualClock(), Account()
        self.called_s = 0.0
        self.scheduling = Scheduling(self.clock, self.account, lambda: round(self.called_s * 1e9))
        self.scheduling.excuse()

    def spend(
        self,
        seconds: float,
        *,
        waits: bool = False,
        runs: bool = False,
        others: bool = False,
        calls: bool = False,
    ) -> None:
        self.called_s += seconds * calls
        self.clock.advance(seconds)
        self.account.waited_s += seconds * waits
        self.account.ran_s += seconds * runs
        self.account.program_s += seconds * (runs or others)

    def request(
        self, idle_s: float = 0.0, fields: int = 1, *, empty: bool | None = None, **late: float
    ) -> Standstill | None:
        """Asks for a field, which is there unless it is waited for; `waits_s`, `stops_s`: what happens
        besides.
        """
        self.scheduling.asks()
        self.spend(idle_s)
        self.spend(late.get("waits_s", 0.0), waits=True)
        self.spend(late.get("stops_s", 0.0))
        self.spend(late.get("runs_s", 0.0), runs=True)
        self.spend(late.get("calls_s", 0.0), calls=True)
        found_empty = idle_s > 0 if empty is None else empty
        return self.scheduling.came(self.clock.now_ns(), TIMEOUT_S, fields, found_empty=found_empty)


def test_a_thread_that_waits_for_the_camera_stands_still_never() -> None:
    thread = Thread()
    for _ in range(100):
        assert thread.request(idle_s=0.018) is None
        thread.spend(0.002, runs=True)


@pytest.mark.parametrize("rate_hz", [25, 60, 120])
def test_what_counts_as_late_is_half_of_a_field_at_the_cameras_rate(rate_hz: float) -> None:
    thread = Thread()
    thread.scheduling.paced(rate_hz)
    for late_s in (0.4 / rate_hz, 0.6 / rate_hz):
        thread.request(idle_s=0.9 / rate_hz)
        assert (thread.request(idle_s=0.1 / rate_hz, waits_s=late_s) is None) == (late_s * rate_hz < 0.5)


@pytest.mark.parametrize("rate_hz", [25, 120])
def test_fields_taken_one_after_another_make_up_for_their_own_time(rate_hz: float) -> None:
    thread = Thread()
    thread.scheduling.paced(rate_hz)
    thread.request(idle_s=0.9 / rate_hz)
    thread.spend(3 / rate_hz)
    found = [thread.request(idle_s=0, empty=False) for _ in range(4)]
    assert found[0]
    assert found[0].time_ns == pytest.approx(2e9 / rate_hz, abs=1e3)


def test_a_field_that_does_not_come_is_no_standstill() -> None:
    thread = Thread()
    assert [thread.request(idle_s=TIMEOUT_S) for _ in range(20)] == [None] * 20


@pytest.mark.parametrize("where", ["in the request", "between two"])
def test_waiting_for_a_processor_is_told_with_its_time(where: str) -> None:
    thread = Thread()
    thread.request(idle_s=0.018)
    if where == "between two":
        thread.spend(1.2, waits=True)
        found = thread.request()
    else:
        found = thread.request(idle_s=0.01, waits_s=1.2)
    assert found
    assert found.time_ns == pytest.approx(1.2e9, abs=2.1e7)
    assert not found.is_stop
    assert found.reason == "computer busy (waited 1.2 s for a processor)"


def test_a_wait_within_the_time_out_is_told_as_well() -> None:
    thread = Thread()
    found = thread.request(waits_s=0.04)
    assert found == Standstill(40_000_000, 40_000_000, 0, ended_ns=thread.clock.now_ns())


@pytest.mark.parametrize("where", ["in the request", "between two"])
def test_a_pause_after_which_nothing_waits_may_be_one_of_the_driver_as_well(where: str) -> None:
    thread = Thread()
    thread.request(idle_s=0.018)
    if where == "between two":
        thread.spend(0.3)
        thread.request(idle_s=TIMEOUT_S, fields=0)
    else:
        thread.request(idle_s=TIMEOUT_S, stops_s=0.25, fields=0)
    found = thread.request(idle_s=0.012)
    assert isinstance(found, StandstillOfDriver)
    assert found.is_stop
    assert found.time_ns == pytest.approx(0.28e9, abs=1e6)
    assert thread.request(idle_s=0.02) is None


def test_a_pause_that_fills_the_buffers_is_none_of_the_driver() -> None:
    thread = Thread()
    thread.request(idle_s=0.018)
    thread.spend(0.3)
    found = thread.request(empty=False)
    assert found
    assert not isinstance(found, StandstillOfDriver)


def test_a_stop_with_a_field_in_hand_is_told_like_any_other() -> None:
    thread = Thread()
    thread.request(idle_s=0.018)
    thread.spend(0.6)  # the field has come, and its buffer is not given back yet
    found = thread.request()
    assert found
    assert found.time_ns == pytest.approx(0.6e9, abs=2.1e7)
    assert found.is_stop


def test_a_stop_is_told_though_the_interpreter_has_to_be_waited_for_afterwards() -> None:
    thread = Thread()
    thread.request(idle_s=0.018)
    thread.spend(0.6)
    found = thread.request(idle_s=0.008, empty=False)
    assert found
    assert found.time_ns == pytest.approx(0.6e9, abs=2.1e7)


def test_a_stop_in_a_request_that_brings_nothing_is_told_again_with_the_next_field() -> None:
    thread = Thread()
    thread.request(idle_s=0.018)
    assert thread.request(stops_s=0.6, fields=0)
    found = thread.request()
    assert found
    assert found.is_stop
    assert found.time_ns == pytest.approx(0.6e9, abs=2.1e7)
    assert thread.request() is None


def test_a_wait_for_the_interpreter_on_a_busy_computer_is_no_sign_of_empty_buffers() -> None:
    thread = Thread()
    thread.request(idle_s=0.02)
    found = [thread.request(waits_s=0.03, idle_s=0.03, empty=False) for _ in range(10)]
    assert found[-1]
    assert found[-1].time_ns == pytest.approx(0.4e9, abs=2.1e7)
    assert found[-1].reason == "computer busy (waited 0.3 s for a processor)"


def test_delays_that_are_made_up_for_do_not_add_up() -> None:
    thread = Thread()
    thread.request(idle_s=0.02)
    for _ in range(100):
        found = thread.request(waits_s=0.03)
        thread.request(waits_s=0.005)
        thread.request(waits_s=0.005)
        assert found is None or found.time_ns <= 30_000_000


def test_a_cable_that_loses_every_other_field_is_no_standstill() -> None:
    thread = Thread()
    for _ in range(100):
        assert thread.request(idle_s=0.038) is None
        thread.spend(0.002, runs=True)


def test_a_silent_camera_is_no_standstill_on_a_busy_computer_either() -> None:
    thread = Thread()
    found = [thread.request(waits_s=0.015, idle_s=TIMEOUT_S - 0.015, fields=0) for _ in range(100)]
    assert max(one.time_ns for one in found if one) <= 15_000_000


def test_a_stop_is_forgotten_when_the_buffers_are_found_empty() -> None:
    thread = Thread()
    thread.request(idle_s=0.018)
    assert thread.request(stops_s=0.6, fields=0)
    assert thread.request(idle_s=TIMEOUT_S, fields=0) is None
    assert thread.request(idle_s=0.018) is None


def test_a_stop_that_just_fills_the_buffers_is_told_with_all_its_time() -> None:
    found = Thread().request(idle_s=0.01, stops_s=0.34)
    assert found
    assert found.time_ns == pytest.approx(0.34e9, abs=2.1e7)


def test_work_that_takes_most_of_a_fields_time_keeps_pace() -> None:
    thread = Thread()
    for _ in range(100):
        assert thread.request(idle_s=0.003) is None
        thread.spend(0.017, runs=True)


def test_work_that_takes_longer_than_a_field_falls_behind_by_what_is_too_much() -> None:
    thread = Thread()
    thread.request(idle_s=0.02)
    for _ in range(10):
        thread.spend(0.01, runs=True)
        thread.spend(0.03, waits=True)
        found = thread.request()
    assert found
    assert found.time_ns == pytest.approx(0.2e9, abs=1e6)
    assert found.reason == "computer busy (waited 0.3 s for a processor)"


def test_a_frames_two_fields_may_take_the_time_of_both() -> None:
    thread = Thread()
    for _ in range(20):
        assert thread.request(idle_s=0.003, fields=2) is None
        thread.spend(0.037, runs=True)


@pytest.mark.parametrize("where", ["in the request", "between two"])
def test_a_driver_that_hangs_in_a_call_is_told_from_a_stopped_program(where: str) -> None:
    thread = Thread()
    thread.request(idle_s=0.018)
    if where == "between two":
        thread.spend(1.2, calls=True)
        found = thread.request()
    else:
        found = thread.request(calls_s=1.2)
    assert found
    assert (found.is_hang, found.is_stop) == (True, False)
    assert found.reason == "driver hung (a call took 1.2 s)"


def test_a_call_that_only_waits_for_a_processor_does_not_hang() -> None:
    thread = Thread()
    thread.request(idle_s=0.018)
    thread.called_s += 1.2
    found = thread.request(waits_s=1.2)
    assert found
    assert not found.is_hang
    assert found.reason == "computer busy (waited 1.2 s for a processor)"


@pytest.mark.parametrize("where", ["in the request", "between two"])
def test_a_program_that_was_stopped_is_told_from_a_busy_computer(where: str) -> None:
    thread = Thread()
    thread.request(idle_s=0.018)
    if where == "between two":
        thread.spend(12.0)
        found = thread.request()
    else:
        found = thread.request(stops_s=12.0)
    assert found
    assert found.is_stop
    assert found.reason in {"program stopped (for 12.0 s)", "program stopped (for 11.9 s)"}


def test_the_program_itself_may_be_what_keeps_the_computer_busy() -> None:
    thread = Thread()
    thread.spend(0.8, others=True)
    found = thread.request()
    assert found
    assert found.reason == "computer busy (the program itself, for 0.8 s)"


def test_short_delays_add_up_while_the_buffers_are_never_empty() -> None:
    thread = Thread()
    thread.request(idle_s=0.02)
    found = [thread.request(waits_s=0.03) for _ in range(10)]
    # Each has brought a field, and with it that field's own time.
    assert [round(one.time_ns / 1e6) for one in found if one] == [10 * n for n in range(1, 11)]
    assert thread.request(idle_s=0.01) is None
    again = thread.request(waits_s=0.03)
    assert again
    assert again.time_ns == pytest.approx(10e6, abs=1e6)


def test_a_field_that_takes_long_to_draw_has_not_been_waited_for() -> None:
    thread = Thread()
    thread.request(idle_s=0.02)
    found = [thread.request(runs_s=0.02, waits_s=0.02) for _ in range(5)]
    assert found[-1]
    assert found[-1].time_ns == pytest.approx(0.1e9, abs=1e6)


def test_a_pause_that_nobody_minds_is_excused() -> None:
    thread = Thread()
    thread.spend(100.0)
    thread.scheduling.excuse()
    assert thread.request() is None


def test_without_an_account_only_the_time_is_told() -> None:
    thread = Thread()
    thread.account.known = False
    thread.spend(1.0)
    found = thread.request()
    assert found
    assert (found.waited_ns, found.is_stop) == (None, False)
    assert found.reason == "computer busy (took no fields for 1.0 s)"


def test_this_computers_kernel_keeps_an_account_of_this_thread() -> None:
    account = KernelAccount()
    before = account.thread()
    if before is None:
        pytest.skip("this kernel has no schedstat")
    end = time.thread_time_ns() + 20_000_000
    while time.thread_time_ns() < end:
        pass
    after = account.thread()
    assert after
    assert after.ran_ns - before.ran_ns > 10_000_000
    assert after.waited_ns >= before.waited_ns
    account.close()
    assert account.thread() is None


def _words(account: KernelAccount) -> str:
    try:
        return account.come_first()
    except DeviceRefused as refusal:
        return f"{refusal.message}; {refusal.hint}"


def _come_first() -> tuple[str, int, int]:
    """How a thread runs that asked to come first, by words and by the kernel; and a process of its own."""
    found: list[tuple[str, int, int]] = []

    def ask() -> None:
        words, policy = _words(KernelAccount()), os.sched_getscheduler(0)
        child = subprocess.run([sys.executable, "-c", POLICY], capture_output=True, check=True)
        found.append((words, policy, int(child.stdout)))

    thread = threading.Thread(target=ask)
    thread.start()
    thread.join()
    return found[0]


def test_a_thread_that_asks_for_real_time_has_it_or_says_why_not() -> None:
    words, policy, _ = _come_first()
    if "not taken in real time" in words:
        assert policy == os.SCHED_OTHER
        assert "LimitRTPRIO=1" in words
    else:
        assert words.startswith("in real time")
        assert policy & ~os.SCHED_RESET_ON_FORK == os.SCHED_RR


def test_one_that_may_not_come_first_says_what_would_permit_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with pytest.raises(DeviceRefused, match="some may be lost while others run") as refused:
        KernelAccount().come_first()
    assert "Operation not permitted" in refused.value.message
    assert "'LimitRTPRIO=1' in the unit" in refused.value.hint
    assert "'ulimit -r 1'" in refused.value.hint
    assert KernelAccount().keep_to_share(1) == ""


def test_real_time_is_for_that_thread_alone() -> None:
    _, _, of_its_process = _come_first()
    assert of_its_process == os.sched_getscheduler(0) == os.SCHED_OTHER


@pytest.mark.parametrize("greedy", [False, True], ids=["a modest thread", "a greedy thread"])
def test_real_time_ends_for_a_thread_that_takes_most_of_a_processor(greedy: bool) -> None:
    found: list[tuple[str, str, int]] = []

    def run() -> None:
        account = KernelAccount()
        how = _words(account)
        assert account.keep_to_share(time.monotonic_ns()) == ""
        end_s = time.thread_time() + 0.2
        while greedy and time.thread_time() < end_s:
            pass
        if not greedy:
            time.sleep(0.2)
        found.append((how, account.keep_to_share(time.monotonic_ns()), os.sched_getscheduler(0)))

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    ((how, said, policy),) = found
    if "not taken in real time" in how:
        assert (said, policy) == ("", os.SCHED_OTHER)
    elif greedy:
        assert said.startswith("no longer in real time")
        assert policy == os.SCHED_OTHER
    else:
        assert said == ""
        assert policy & ~os.SCHED_RESET_ON_FORK == os.SCHED_RR
