"""Emulated grabbers and cameras on the guest's USB: plugged in, spoken to, taken away.

Nothing here needs the program: what it makes of them is in `grabbers`.
"""

import atexit
import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from proofs.vm.guest.shell import run, wait_for

PATIENCE_S = 120.0
MODULES = {"usbtv": "usbtv", "stk1160": "stk1160", "uvc": "uvcvideo"}
"""By the kind of a device, without the format of its pictures."""


class Grabber:
    """An emulated device, in a process of its own."""

    def __init__(self, kind: str, port: int) -> None:
        command = [sys.executable, "-m", "proofs.vm.usb", kind, str(port)]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        atexit.register(self.end)

    def __call__(self, *words: Any) -> Any:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(words) + "\n")
        self._process.stdin.flush()
        return json.loads(self._process.stdout.readline())

    def end(self) -> None:
        """Its process ends; what it had plugged in is gone."""
        self._process.kill()
        self._process.wait()


plugged: dict[str, Grabber] = {}
"""By kind."""
_alike: list[Grabber] = []


def plug_in(kind: str) -> dict[str, Any]:
    """Plugs one in; says what the kernel makes of it."""
    run(f"modprobe -a vhci-hcd {MODULES[family(kind)]}")
    grabber = plugged[kind] = Grabber(kind, 0)
    grabber("in")
    seconds = wait_for(nodes, PATIENCE_S)
    run("udevadm settle")
    return {
        "seconds": seconds,
        "nodes": nodes(),
        "kernel": [line for line in run("dmesg").splitlines() if kind in line or "BOGUS" in line][-8:],
    }


def plug_in_alike(kind: str, ports: Sequence[int]) -> None:
    """Plugs several of a kind into these ports, one after the other."""
    run(f"modprobe -a vhci-hcd {MODULES[kind]}")
    for count, port in enumerate(ports, 1):
        _alike.append(Grabber(kind, port))
        _alike[-1]("in")
        wait_for(lambda: len(nodes()) == count, PATIENCE_S)  # noqa: B023 - waited for at once
        run("udevadm settle")


def unplug_alike() -> None:
    """Takes all of them away."""
    while _alike:
        grabber = _alike.pop()
        grabber("out")
        grabber.end()
    wait_for(lambda: not nodes(), PATIENCE_S)


def unplug(kind: str) -> None:
    """Takes it away."""
    grabber = plugged.pop(kind)
    grabber("out")
    grabber.end()
    wait_for(lambda: not nodes(), PATIENCE_S)


def family(kind: str) -> str:
    """Its kind without the format of its pictures."""
    return kind.partition(",")[0]


def nodes() -> list[str]:
    """Video nodes that are there."""
    return sorted(str(path) for path in Path("/dev").glob("video*"))
