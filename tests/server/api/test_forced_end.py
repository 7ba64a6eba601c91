"""A process that was told to end has ended some time later, whatever its threads do."""

import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

from running import PATIENCE_S

from grabberd.server.api.serving import EX_TEMPFAIL, LEFT_S, ForcedEnd

STUCK = """
import signal, sys, threading, time
from grabberd.server.api.serving import ForcedEnd
from grabberd.work.child import Limits
from grabberd.work.process import Process

if __name__ == "__main__":
    child = Process(Limits(), end_with_parent=True)
    threading.Thread(target=child.call, args=("time:sleep", 3600)).start()
    threading.Thread(target=time.sleep, args=(3600,)).start()
    end = ForcedEnd(left_s=0.05)
    end.start()
    signal.signal(signal.SIGTERM, lambda *_: end.signal_received())
    print(child.pid, flush=True)
    while True:
        time.sleep(1)
"""


def test_it_comes_some_time_after_it_was_told() -> None:
    ended = threading.Event()
    end = ForcedEnd(left_s=0.01, end=ended.set)
    end.start()
    end.signal_received()
    end.signal_received()
    assert ended.wait(PATIENCE_S)


def test_it_does_not_come_unless_it_was_told() -> None:
    ended = threading.Event()
    end = ForcedEnd(left_s=0.0, end=ended.set)
    end.start()
    end.close()
    assert not ended.is_set()


def test_systemd_waits_for_longer() -> None:
    unit = Path(__file__).parents[3] / "systemd" / "grabberd.service"
    [waits] = [line for line in unit.read_text().splitlines() if line.startswith("TimeoutStopSec=")]
    assert LEFT_S < 10 < int(waits.partition("=")[2])


def test_a_process_ends_that_waits_for_threads_and_children() -> None:
    process = subprocess.Popen([sys.executable, "-c", STUCK], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None
    child = int(process.stdout.readline())
    process.send_signal(signal.SIGTERM)
    _, told = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == EX_TEMPFAIL
    assert b"ended by force" in told
    until_s = time.monotonic() + PATIENCE_S
    while is_alive(child):  # it was killed; the kernel ends it when it comes to it
        assert time.monotonic() < until_s
        time.sleep(0.01)


def is_alive(pid: int) -> bool:
    """Whether a process runs; one that has ended and whose parent is gone may be left as a zombie."""
    try:
        with open(f"/proc/{pid}/stat") as stat:
            return stat.read().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False
