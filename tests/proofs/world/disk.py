"""What a crash leaves of a folder: the disk below a world.

Everything that the process writes below the folder is logged by a preloaded library (`disk_log.c`). At a
crash the folder is made anew: after a kill, with all that was written; after a power cut, with what was
synchronised, and of the rest some: of each file a random part of its writes, each of them whole, missing, or
torn between sectors of 512 bytes; of the names as many changes, in their order, as the draw gives. What is
30 simulated seconds old is on the disk.

Not simulated: sectors that are themselves torn or altered, writes that are reordered within a file before an
fsync that returned, disks that lie about fsync, mapped memory.
"""

import ctypes
import os
import random
import shutil
import struct
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from enum import IntEnum
from pathlib import Path
from typing import NamedTuple

SOURCE = Path(__file__).with_name("disk_log.c")
SECTOR = 512
_HEAD = struct.Struct("<iqqii")


class Kind(IntEnum):
    """Of a record."""

    WRITE = 0
    TRUNCATE = 1
    SYNC = 2
    SYNC_FAILED = 3
    CREATE = 4
    RENAME = 5
    UNLINK = 6
    LINK = 7
    MKDIR = 8
    RMDIR = 9
    SYNC_NAMES = 10


class Refusal(IntEnum):
    """What the disk refuses."""

    NOTHING = 0
    WRITES = 1
    SYNCS = 2
    READS = 4
    GROWTH = 8


def library() -> Path:
    """The compiled library that a world is started with (`LD_PRELOAD`)."""
    built = Path(__file__).parents[3] / "build" / "world" / "disk_log.so"
    if not built.exists() or built.stat().st_mtime < SOURCE.stat().st_mtime:
        built.parent.mkdir(parents=True, exist_ok=True)
        part = built.with_suffix(f".{os.getpid()}")
        subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-w", "-o", part, SOURCE, "-ldl"], check=True)
        part.rename(built)
    return built


class _Record(NamedTuple):
    kind: int
    inode: int
    place: int
    data: bytes
    more: bytes
    file: "_File | None" = None


class _File:
    """A file on the disk, and what was written into it since it was synchronised: (place, data), or
    (size, None) where it was cut or extended.
    """

    __slots__ = ("content", "mode", "pending")

    def __init__(self, content: bytes = b"", mode: int = 0o644) -> None:
        self.content = bytearray(content)
        self.mode = mode
        self.pending: list[tuple[int, bytes | None]] = []

    def sync(self) -> None:
        """All of it is on the disk."""
        for place, data in self.pending:
            _apply(self.content, place, data)
        self.pending.clear()

    def after_a_cut(self, draw: random.Random) -> bytes:
        """What a power cut leaves of it."""
        left = bytearray(self.content)
        kept = draw.choice((0.0, 0.5, 0.9, 1.0))
        for place, data in self.pending:
            if data is None:
                if draw.random() < kept:
                    _apply(left, place, None)
                continue
            for begin in range(0, len(data), SECTOR):
                if draw.random() < kept:
                    _apply(left, place + begin, data[begin : begin + SECTOR])
        return bytes(left)


def _apply(content: bytearray, place: int, data: bytes | None) -> None:
    end = place if data is None else place + len(data)
    if end > len(content):
        content.extend(bytes(end - len(content)))
    if data is None:
        del content[place:]
    else:
        content[place:end] = data


Names = dict[str, _File | None]
"""Files by their paths; None: a folder."""


class Disk:
    """The folder of a world, from `begin` to `end`.

    Attributes:
        folder: Its path.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._library = ctypes.CDLL(None)
        self._library.disk_records.restype = ctypes.c_void_p
        self._library.disk_commits.restype = ctypes.c_int64
        self._utc_ns = ctypes.c_int64.in_dll(self._library, "utc_ns")
        self._names: Names = {}
        self._inodes: dict[int, _File] = {}
        self._pending: list[_Record] = []

    def begin(self, draw: random.Random) -> None:
        """Logs from now on."""
        self._draw = draw
        self._names, self._inodes, self._pending = {}, {}, []
        for path in sorted(self.folder.rglob("*")):
            if path.is_dir():
                self._names[str(path)] = None
            else:
                file = _File(path.read_bytes(), path.stat().st_mode & 0o7777)
                self._names[str(path)] = self._inodes[path.stat().st_ino] = file
        self._library.disk_begin(str(self.folder).encode())

    def end(self) -> None:
        """Logs no more."""
        self._library.disk_end()

    @property
    def commits(self) -> int:
        """Number of points at which a crash leaves something else before than after."""
        return int(self._library.disk_commits())

    def at(self, utc_ns: int) -> None:
        """The time that files are stamped with."""
        self._utc_ns.value = utc_ns

    def crash_at(self, commit: int) -> None:
        """Has the world crash at that commit from the begin; -1: at none."""
        self._library.disk_crash_at(ctypes.c_int64(commit))

    def crash(self) -> None:
        """Nothing that is written from now on is on the disk."""
        self._library.disk_crash()

    @property
    def has_crashed(self) -> bool:
        """True until `restart`."""
        return bool(self._library.disk_crashed())

    def refuse(self, what: int, error: int = 0, after: int = 0) -> None:
        """Refuses, with an error number, after so many more operations."""
        self._library.disk_refuse(what, error, after)

    @contextmanager
    def sparing(self) -> Iterator[None]:
        """Refuses nothing while the block lasts, in which the world itself reads."""
        self._library.disk_spare(1)
        yield
        self._library.disk_spare(0)

    def age(self) -> None:
        """What was written is on the disk by now."""
        self._read()
        for file in self._inodes.values():
            file.sync()
        self._sync_names()

    def restart(self, *, power_cut: bool) -> None:
        """Makes the folder what a crash has left; nobody has it open any more."""
        self._read()
        names = dict(self._names)
        count = self._draw.randint(0, len(self._pending)) if power_cut else len(self._pending)
        for record in self._pending[:count]:
            self._change(names, record)
        self.end()
        shutil.rmtree(self.folder)
        self.folder.mkdir()
        for path, file in names.items():
            if file is None:
                Path(path).mkdir(exist_ok=True)
        for path, file in names.items():
            if file is not None:
                self._make(Path(path), file, power_cut=power_cut)
        self.begin(self._draw)

    def _make(self, path: Path, file: _File, *, power_cut: bool) -> None:
        if power_cut:
            content = file.after_a_cut(self._draw)
        else:
            file.sync()
            content = bytes(file.content)
        path.write_bytes(content)
        path.chmod(file.mode)
        os.utime(path, ns=(self._utc_ns.value, self._utc_ns.value))

    def _read(self) -> None:
        """Takes in what was logged."""
        for record in self._records():
            if record.kind >= Kind.CREATE:
                self._note(record)
            elif (file := self._inodes.get(record.inode)) is not None:
                _note(file, record)

    def _note(self, record: _Record) -> None:
        if record.kind == Kind.SYNC_NAMES:
            self._sync_names()
            return
        if record.kind == Kind.CREATE:
            self._inodes[record.inode] = made = _File(mode=record.place)
            record = record._replace(file=made)
        self._pending.append(record)

    def _sync_names(self) -> None:
        for record in self._pending:
            self._change(self._names, record)
        self._pending.clear()

    def _records(self) -> Iterator[_Record]:
        length = ctypes.c_int64()
        start = self._library.disk_records(ctypes.byref(length))
        content = ctypes.string_at(start, length.value) if length.value else b""
        self._library.disk_forget()
        place = 0
        while place < len(content):
            kind, inode, at, one, two = _HEAD.unpack_from(content, place)
            place += _HEAD.size
            data, more = content[place : place + one], content[place + one : place + one + two]
            yield _Record(kind, inode, at, data, more)
            place += one + two

    @staticmethod
    def _change(names: Names, record: _Record) -> None:
        path, kind = record.data.decode(), record.kind
        if kind == Kind.CREATE:
            names[path] = record.file
        elif kind == Kind.MKDIR:
            names[path] = None
        elif kind in (Kind.UNLINK, Kind.RMDIR):
            names.pop(path, None)
        elif kind == Kind.LINK:
            names[record.more.decode()] = names[path]
        else:
            _rename(names, path, record.more.decode())


def _note(file: _File, record: _Record) -> None:
    if record.kind == Kind.WRITE:
        file.pending.append((record.place, record.data))
    elif record.kind == Kind.TRUNCATE:
        file.pending.append((record.place, None))
    elif record.kind == Kind.SYNC:
        file.sync()
    else:
        file.pending.clear()  # the kernel takes the pages for clean, and forgets them


def _rename(names: Names, old: str, new: str) -> None:
    moved = {path: file for path, file in names.items() if path == old or path.startswith(f"{old}/")}
    for path in moved:
        del names[path]
    names.update({new + path[len(old) :]: file for path, file in moved.items()})
