"""Runs a command under what a unit forbids the kernel to do for it: its system calls, memory, sockets.

usage: sandbox.py UNIT COMMAND...

The filters are built from the unit file as systemd builds them, with libseccomp, so that the program meets
them without a systemd that runs. What the unit does with the file system and devices is not here.
"""

import ctypes
import errno
import mmap
import os
import socket
import subprocess
import sys
from functools import cache
from pathlib import Path

ALLOW = 0x7FFF0000
EQUAL, MASKED_EQUAL = 4, 7
SHM_EXEC = 0o100000
CLONE_NAMESPACES = 0x7E020080


class _Comparison(ctypes.Structure):
    _fields_ = (
        ("argument", ctypes.c_uint),
        ("operator", ctypes.c_int),
        ("a", ctypes.c_uint64),
        ("b", ctypes.c_uint64),
    )


def refuse(number: int) -> int:
    """Libseccomp's action: the call fails with this errno."""
    return 0x00050000 | number


class Filter:
    """One filter of the kernel's; exact calls of libseccomp, each checked."""

    library = ctypes.CDLL("libseccomp.so.2")
    library.seccomp_init.restype = ctypes.c_void_p

    def __init__(self, action: int) -> None:
        self._filter = ctypes.c_void_p(self.library.seccomp_init(ctypes.c_uint32(action)))

    def add(self, action: int, call: str, *comparisons: tuple[int, int, int, int]) -> None:
        number = self.library.seccomp_syscall_resolve_name(call.encode())
        if number < 0:  # another architecture's
            return
        array = (_Comparison * len(comparisons))(*comparisons)
        code = self.library.seccomp_rule_add_array(
            self._filter, ctypes.c_uint32(action), number, len(comparisons), array
        )
        if code != 0:
            raise OSError(-code, call)

    def load(self) -> None:
        if code := self.library.seccomp_load(self._filter):
            raise OSError(-code, "seccomp_load")


def settings_of(*files: Path) -> dict[str, list[str]]:
    """Section [Service] of a unit and its drop-ins: every key with its values, in order."""
    found: dict[str, list[str]] = {}
    for file in files:
        section = ""
        for line in file.read_text().splitlines():
            if line.startswith("["):
                section = line
            elif section == "[Service]" and line and not line.startswith("#"):
                key, _, value = line.partition("=")
                found[key] = [*found.get(key, []), value] if value else []
    return found


@cache
def calls_in(name: str) -> frozenset[str]:
    """A call, or all calls of a set such as @system-service."""
    if not name.startswith("@"):
        return frozenset({name})
    command = ["systemd-analyze", "syscall-filter", name]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()[1:]
    words = [line.strip() for line in lines if line.strip() and not line.strip().startswith("#")]
    return frozenset().union(*map(calls_in, words))


def allowed_calls(settings: dict[str, list[str]]) -> frozenset[str]:
    """The calls that SystemCallFilter= lets through."""
    allowed = calls_in("@default")
    for value in settings["SystemCallFilter"]:
        named = frozenset().union(*map(calls_in, value.removeprefix("~").split()))
        allowed = allowed - named if value.startswith("~") else allowed | named
    return allowed


def restrict_calls(settings: dict[str, list[str]]) -> None:
    one = Filter(refuse(getattr(errno, settings["SystemCallErrorNumber"][-1])))
    for call in sorted(allowed_calls(settings)):
        one.add(ALLOW, call)
    one.load()


def deny_write_execute() -> None:
    one = Filter(ALLOW)
    both = mmap.PROT_WRITE | mmap.PROT_EXEC
    one.add(refuse(errno.EPERM), "mmap", (2, MASKED_EQUAL, both, both))
    for call in ("mprotect", "pkey_mprotect"):
        one.add(refuse(errno.EPERM), call, (2, MASKED_EQUAL, mmap.PROT_EXEC, mmap.PROT_EXEC))
    one.add(refuse(errno.EPERM), "shmat", (2, MASKED_EQUAL, SHM_EXEC, SHM_EXEC))
    one.load()


def restrict_families(names: list[str]) -> None:
    allowed = {int(getattr(socket, name)) for name in names}
    one = Filter(ALLOW)
    for family in set(range(64)) - allowed:
        one.add(refuse(errno.EAFNOSUPPORT), "socket", (0, EQUAL, family, 0))
    one.load()


def restrict_namespaces() -> None:
    one = Filter(ALLOW)
    one.add(refuse(errno.EPERM), "setns")
    for bit in (1 << n for n in range(32) if CLONE_NAMESPACES & 1 << n):
        for call in ("clone", "unshare"):
            one.add(refuse(errno.EPERM), call, (0, MASKED_EQUAL, bit, bit))
    one.load()


def restrict(settings: dict[str, list[str]]) -> None:
    """Takes from this process, for good, what the unit forbids."""
    is_set = {key for key, values in settings.items() if values[-1:] == ["yes"]}
    if "MemoryDenyWriteExecute" in is_set:
        deny_write_execute()
    if "RestrictNamespaces" in is_set:
        restrict_namespaces()
    restrict_families(" ".join(settings["RestrictAddressFamilies"]).split())
    restrict_calls(settings)


if __name__ == "__main__":
    files, command = sys.argv[1].split(":"), sys.argv[2:]
    restrict(settings_of(*map(Path, files)))
    os.execvp(command[0], command)
