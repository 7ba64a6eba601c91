"""A virtual machine that boots the image and does what it is asked for."""

import json
import os
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from proofs.vm.image import CHECKOUT, RELEASES, Image
from proofs.vm.qmp import Qmp

BOOT_TIMEOUT_S = 600.0
"""Fifteen times what two quiet cores need."""
CALL_TIMEOUT_S = 300.0
_KERNEL_WORDS = (
    "root=/dev/vda rw console=ttyS0 quiet panic=-1 mitigations=off nokaslr edd=off tsc=reliable "
    "no_timer_check audit=0 systemd.show_status=0 rcupdate.rcu_expedited=1"
)


@dataclass(frozen=True)
class Disks:
    """Files that the machine writes for good: they outlive it, as disks outlive a power cut.

    Attributes:
        root: a copy of the image's disk.
        state: /dev/vdb. Both are the host's page cache, which a killed QEMU leaves as it was: what has been
            written survives, flushed or not, and a flush must not wait for the host's disk, for while its
            processor idles a guest's counted time runs ahead.
    """

    root: Path
    state: Path


@dataclass(frozen=True)
class Processor:
    """How QEMU makes the guest's processor and its time.

    Attributes:
        arguments: of QEMU.
        keeps_time: the guest's time follows its own instructions, so the host's load cannot be seen in it,
            and rates can be asserted.
    """

    arguments: tuple[str, ...]
    keeps_time: bool


def counted(shift: int = 1) -> Processor:
    """One processor; an instruction takes 2**shift ns of the guest's time."""
    return Processor(
        ("-accel", "tcg,thread=single", "-icount", f"shift={shift},sleep=off,align=off", "-smp", "1"), True
    )


def concurrent() -> Processor:
    """Two processors, each a thread of the host's; nothing is known of its rates."""
    return Processor(("-accel", "tcg,thread=multi", "-smp", "2"), False)


class GuestError(Exception):
    """What went wrong in the guest: its traceback, or its silence and what its console said last."""


class Machine:
    """Boots in `with`; gone, whatever happens, at its end.

    It has no network, but for a port of the host's loopback that leads to one of its own, if it is
    `forwarded`: (the host's, the guest's). Nothing else goes through, in either direction.

    Args:
        release: Debian's, whose kernel runs.

    Attributes:
        share: a folder that host and guest (there: /share) both write.
        calls: what was called, with the guest's and the host's seconds.
    """

    def __init__(
        self,
        image: Image,
        processor: Processor,
        *,
        release: str = RELEASES[0],
        memory_mb: int = 1024,
        disks: Disks | None = None,
        forwarded: tuple[int, int] | None = None,
    ) -> None:
        self._folder = Path(tempfile.mkdtemp(prefix="grabberd-vm-"))
        self.share = self._folder / "share"
        self.share.mkdir()
        self.processor = processor
        self.calls: list[tuple[str, float, float]] = []
        self._pending = b""
        self._id = 0
        self._disks = disks
        self._forwarded = forwarded
        self._kernel = ("-kernel", str(image.kernel(release)), "-initrd", str(image.initrd(release)))
        self._process = self._launch(image, memory_mb)
        try:
            self._agent = self._connect("agent")
            # QEMU makes its control channel after the other sockets.
            self.qmp = Qmp(self._connect("qmp"))
            self.boot_s = self._boot()
        except BaseException:
            self.stop()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def call(
        self, function: Callable[..., Any], *, timeout_s: float = CALL_TIMEOUT_S, **arguments: Any
    ) -> Any:
        """Runs a function of `proofs.vm.guest` there.

        Args:
            function: by its module and name; its result has to be JSON.
            timeout_s: of the host's time; after that the machine is killed.
            arguments: JSON too.

        Raises:
            GuestError: it raised something, or took too long.
        """
        self._id += 1
        name = f"{function.__module__}:{function.__qualname__}"
        started = time.monotonic()
        request = {"id": self._id, "call": name, "arguments": arguments}
        self._agent.sendall(json.dumps(request).encode() + b"\n")
        answer = self._answer(timeout_s, name)
        self.calls.append((name, answer["guest_s"], time.monotonic() - started))
        if "error" in answer:
            raise GuestError(f"{name}: {answer['error']}\nconsole: {self.console_tail()}")
        return answer["result"]

    def console_tail(self, characters: int = 2000) -> str:
        """What kernel and units said last."""
        return self._console.read_text(errors="replace")[-characters:]

    @property
    def is_alive(self) -> bool:
        """Whether it can be called."""
        return self._process.poll() is None

    def pause(self) -> None:
        """Its time stands still, and it takes none of the host's."""
        if self.is_alive:
            self.qmp.command("stop")

    def resume(self) -> None:
        """It goes on."""
        self.qmp.command("cont")

    def kill(self) -> None:
        """It is gone, as without power; `share` stays until `stop`."""
        self._process.kill()
        self._process.wait()

    def stop(self) -> None:
        """Kills it; nothing in it is worth keeping."""
        self.kill()
        if hasattr(self, "_agent"):
            self._agent.close()
        if hasattr(self, "qmp"):
            self.qmp.close()
        shutil.rmtree(self._folder, ignore_errors=True)

    @property
    def _console(self) -> Path:
        return self._folder / "console.log"

    def _launch(self, image: Image, memory_mb: int) -> "subprocess.Popen[bytes]":
        log = (self._folder / "qemu.log").open("wb")
        with log:
            return subprocess.Popen(
                ["setpriv", "--pdeathsig", "KILL", "qemu-system-x86_64", *self._arguments(image, memory_mb)],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                env={**os.environ, "TMPDIR": str(self._folder)},
            )

    def _arguments(self, image: Image, memory_mb: int) -> list[str]:
        return [
            *("-nodefaults", "-no-user-config", "-display", "none", "-no-reboot", "-machine", "q35"),
            *("-cpu", "Nehalem", "-m", str(memory_mb), *self.processor.arguments),
            *(*self._kernel, "-append", _KERNEL_WORDS),
            *_drives(image, self._disks),
            *_share("checkout", CHECKOUT, readonly=True),
            *_share("share", self.share),
            *("-device", "virtio-rng-pci", "-device", "virtio-serial-pci"),
            *("-chardev", f"socket,id=agent,path={self._folder / 'agent'},server=on,wait=off"),
            *("-device", "virtserialport,chardev=agent,name=grabberd.vm"),
            *("-qmp", f"unix:{self._folder / 'qmp'},server=on,wait=off"),
            *("-serial", f"file:{self._console}"),
            *("-device", "qemu-xhci,id=xhci", "-device", "usb-tablet,id=tablet,bus=xhci.0,port=1"),
            *_network(self._forwarded),
        ]

    def _connect(self, name: str) -> socket.socket:
        until = time.monotonic() + 20.0
        while True:
            try:
                connection = socket.socket(socket.AF_UNIX)
                connection.connect(str(self._folder / name))
                return connection
            except OSError:
                connection.close()
                if self._process.poll() is not None or time.monotonic() > until:
                    raise GuestError(f"QEMU does not start: {self._qemu_log()}") from None
                time.sleep(0.05)

    def _boot(self) -> float:
        started = time.monotonic()
        self._answer(BOOT_TIMEOUT_S, "boot")
        return time.monotonic() - started

    def _answer(self, timeout_s: float, what: str) -> Mapping[str, Any]:
        until = time.monotonic() + timeout_s
        while b"\n" not in self._pending:
            self._agent.settimeout(max(0.001, until - time.monotonic()))
            try:
                received = self._agent.recv(1 << 20)
            except TimeoutError:
                said = f"{self._who_ran()}\nconsole: {self.console_tail()}"
                self.stop()
                raise GuestError(f"{what}: no answer within {timeout_s:.0f} s; {said}") from None
            if not received:
                raise GuestError(f"{what}: the machine went away; {self._qemu_log()} {self.console_tail()}")
            self._pending += received
        line, _, self._pending = self._pending.partition(b"\n")
        answer: Mapping[str, Any] = json.loads(line)
        return answer

    def _who_ran(self) -> str:
        """Tells a guest that hangs from a host that is busy with something else."""
        listed = subprocess.run(
            ["ps", "-eo", "pid,times,pcpu,class,comm", "--sort=-pcpu"],
            capture_output=True,
            text=True,
            check=False,
        ).stdout.splitlines()
        loads = " ".join(f"{load:.1f}" for load in os.getloadavg())
        return f"QEMU is process {self._process.pid}, load {loads}; busiest:\n" + "\n".join(listed[:6])

    def _qemu_log(self) -> str:
        return (self._folder / "qemu.log").read_text(errors="replace")[-1000:]


def _drives(image: Image, disks: Disks | None) -> tuple[str, ...]:
    if disks is None:
        return _drive("root", image.disk, "snapshot=on,cache=unsafe")
    return (*_drive("root", disks.root, "cache=unsafe"), *_drive("state", disks.state, "cache=unsafe"))


def _drive(name: str, file: Path, how: str) -> tuple[str, ...]:
    drive = f"file={file},if=none,id={name},format=raw,{how}"
    return ("-drive", drive, "-device", f"virtio-blk-pci,drive={name}")


def _network(forwarded: tuple[int, int] | None) -> tuple[str, ...]:
    if forwarded is None:
        return ()
    host, guest = forwarded
    user = f"user,id=network,restrict=on,hostfwd=tcp:127.0.0.1:{host}-:{guest}"
    return ("-netdev", user, "-device", "virtio-net-pci,netdev=network,romfile=")


def _share(name: str, folder: Path, readonly: bool = False) -> tuple[str, ...]:
    rights = "on" if readonly else "off"
    filesystem = f"local,id={name},path={folder},security_model=none,readonly={rights},multidevs=remap"
    return ("-fsdev", filesystem, "-device", f"virtio-9p-pci,fsdev={name},mount_tag={name}")
