"""The pictures of a video file, one after another, by the program `ffmpeg` through a pipe.

It writes grey values as they were coded, and says of every picture its time and size before it writes it. One
picture at a time is held; `ffmpeg` waits until it is taken.
"""

import os
import re
import selectors
import subprocess
from collections import deque
from collections.abc import Generator, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import IO, NamedTuple

import cv2
import numpy as np

from grabberd.errors import DeviceRefused, PictureError
from grabberd_replay.decoder import Header, Picture, check_size
from grabberd_replay.ffprobe import INSTALL, SAFE, Probe

_SHOWN = re.compile(rb"\[info\] n: *\d+ pts: *\S+ pts_time: *(\S+) .*? s:(\d+)x(\d+) ")
_OPENED = re.compile(rb"\[info\] Input #0, ")
"""The end of its look at the beginning of the file: errors before it are said again where they belong."""
_OF_CONTAINER = frozenset(SAFE[-1].split(","))
# Concealed damage is only a remark to FFmpeg, but no measurement.
_FAILED = re.compile(
    rb"(?:\[([\w.,]+) @ \w+\] )?\[(?:(?:error|fatal|panic)\] (.*)|\w+\] (.*(?:[Cc]onceal|[Cc]orrupt).*))"
)
_SILENT_S = 60.0
"""Time without a byte after which nothing more is expected."""
_LONGEST_LINE = 1 << 16
_PIECE = 1 << 16
_SAID = 120
"""Characters of an error that are repeated in a message."""


class _Shown(NamedTuple):
    """Announcement of a picture: its time, its size, and the first error that was said before it."""

    time_s: float
    columns: int
    lines: int
    fault: str


class PipedDecoder:
    """A video file that is opened by `ffmpeg`.

    Attributes:
        header: properties of the video.
        order: order of the fields, as its own marks have it.
        fault: error that ended it before its end, in the words of `ffmpeg`.

    Raises:
        DeviceRefused: `ffmpeg` cannot be started, or pictures are too large.
        PictureError: no picture can be read.
    """

    uncompressed = False

    def __init__(self, path: Path, probe: Probe) -> None:
        self._path, self._probe = path, probe
        self.order, self.fault = probe.order, ""
        self.header = Header(
            probe.lines, probe.columns, probe.pictures_per_s, probe.pictures, probe.codec, probe.pixels
        )
        check_size(path, self.header)
        with closing(self.pictures()) as pictures:
            if next(pictures, None) is None:
                raise PictureError(
                    f"{path}: no picture of a video of {self.header} can be read ({self.fault or 'empty'})",
                    "copy it again, or record it again",
                )

    @property
    def luma(self) -> str:
        """Description of how the grey values are obtained."""
        if not self._probe.has_luma:
            return f"computed from the colours of {self._probe.pixels!r} by Rec. 601"
        if self._probe.bits > 8:
            return f"the upper 8 of {self._probe.bits} bits, as it was coded"
        return "as it was coded"

    def pictures(self) -> Generator[tuple[float, Picture], None, None]:
        """Time in s and grey values of every picture; `fault` tells why there are no more.

        Raises:
            PictureError: a picture is damaged, or its size differs from the first one's.
        """
        self.fault = ""
        with _running(self._command, self._path) as pipe:
            while (raw := pipe.picture(self._bytes)) is not None:
                shown = pipe.announced()
                if shown.fault:
                    raise PictureError(
                        f"{self._path}: the picture at {shown.time_s:.3f} s is damaged ({shown.fault})",
                        "copy it again, or cut the video there; what came before it is kept",
                    )
                if (shown.lines, shown.columns) != (self.header.lines, self.header.columns):
                    raise PictureError(
                        f"{self._path}: the picture at {shown.time_s:.3f} s has {shown.columns}x{shown.lines}"
                        f" pixels, expected {self.header} like the first",
                        "cut the video there; what came before it is kept",
                    )
                yield shown.time_s, self._grey(raw)
            self.fault = pipe.end()

    def _grey(self, raw: bytearray) -> Picture:
        shape = self.header.lines, self.header.columns
        if not self._probe.has_luma:
            colours = np.frombuffer(raw, np.uint8).reshape(*shape, 3)
            return np.asarray(cv2.cvtColor(colours, cv2.COLOR_BGR2GRAY), np.uint8)
        if self._probe.bits > 8:
            samples = np.frombuffer(raw, "<u2").reshape(shape)
            return np.asarray(samples >> (self._probe.bits - 8), np.uint8)
        return np.frombuffer(raw, np.uint8).reshape(shape)

    @property
    def _bytes(self) -> int:
        samples = 1 if self._probe.has_luma else 3
        return self.header.lines * self.header.columns * samples * (2 if self._deep else 1)

    @property
    def _deep(self) -> bool:
        return self._probe.has_luma and self._probe.bits > 8

    @property
    def _command(self) -> list[str]:
        planes = "extractplanes=y," if self._probe.has_luma else "format=bgr24,"
        grey = f"gray{self._probe.bits}le" if self._deep else "gray"
        # With one thread an error is said before the picture that it is of.
        options = [
            "-hide_banner",
            "-nostdin",
            "-nostats",
            "-v",
            "level+info",
            "-threads",
            "1",
            "-noautorotate",
        ]
        output = ["-map", "0:v:0", "-vf", f"{planes}showinfo=checksum=0", *self._probe.every_picture]
        form = ["-pix_fmt", grey if self._probe.has_luma else "bgr24", "-f", "rawvideo", "pipe:1"]
        return [self._probe.program, *options, *SAFE, "-i", f"file:{self._path.absolute()}", *output, *form]


class _Pipe:
    """A running `ffmpeg`: pictures from its standard output, what it says of them from the other one."""

    def __init__(self, process: "subprocess.Popen[bytes]", path: Path) -> None:
        assert process.stdout is not None
        assert process.stderr is not None
        self.fault = self._of_container = ""
        self._process, self._path = process, path
        self._out, self._said = process.stdout, process.stderr
        self._line = b""
        self._shown: deque[_Shown] = deque()
        self._open = selectors.DefaultSelector()
        for stream in (self._out, self._said):
            os.set_blocking(stream.fileno(), False)
            self._open.register(stream, selectors.EVENT_READ)

    def close(self) -> None:
        """Closes what watches the streams."""
        self._open.close()

    def picture(self, size: int) -> bytearray | None:
        """The next picture of so many bytes; None at the end.

        Raises:
            PictureError: nothing comes for a long time.
        """
        raw = bytearray(size)
        rest = memoryview(raw)
        while rest and self._open.get_map():
            ready = self._open.select(_SILENT_S)
            if not ready:
                raise PictureError(
                    f"{self._path}: ffmpeg has given nothing for {_SILENT_S:g} s",
                    "copy the file to this computer's own disk; what came before it is kept",
                )
            for key, _ in ready:
                if key.fileobj is self._said:
                    self._listen()
                elif count := os.readv(self._out.fileno(), [rest]):
                    rest = rest[count:]
                else:
                    self._open.unregister(self._out)
        return None if rest else raw

    def announced(self) -> _Shown:
        """The announcement of the picture that was just read: it is written before the picture is.

        Raises:
            PictureError: nothing was said.
        """
        if not self._shown and self._said in {key.fileobj for key in self._open.get_map().values()}:
            self._listen()
        if not self._shown:
            raise PictureError(
                f"{self._path}: this ffmpeg does not say when pictures were taken", f"update it, or {INSTALL}"
            )
        return self._shown.popleft()

    def end(self) -> str:
        """Waits until it has ended, after its last picture; gives what was wrong, or nothing."""
        code = self._process.wait(_SILENT_S)
        return self.fault or self._of_container or (f"ffmpeg ended with code {code}" if code else "")

    def _listen(self) -> None:
        try:
            piece = os.read(self._said.fileno(), _PIECE)
        except BlockingIOError:
            return
        if not piece:
            self._open.unregister(self._said)
        *lines, rest = (self._line + piece).split(b"\n")
        self._line = rest[:_LONGEST_LINE]
        for line in lines:
            self._take(line)

    def _take(self, line: bytes) -> None:
        if found := _SHOWN.search(line):
            time, columns, lines = found.groups()
            seconds = 0.0 if time == b"NOPTS" else float(time)
            self._shown.append(_Shown(seconds, int(columns), int(lines), self.fault))
        elif _OPENED.match(line):
            self.fault = self._of_container = ""
        elif failed := _FAILED.match(line):
            who, *said = (part.decode(errors="replace") for part in failed.groups(b""))
            words = f"{who}: {''.join(said)}".replace(f"file:{self._path.absolute()}", "")
            words = words.strip(": ")[:_SAID]
            # A container is read ahead of its pictures: what is wrong with it tells why they end.
            if _OF_CONTAINER.isdisjoint(who.split(",")):
                self.fault = self.fault or words
            else:
                self._of_container = words


@contextmanager
def _running(command: list[str], path: Path) -> Iterator[_Pipe]:
    """Runs `ffmpeg` while the block lasts; it never outlives it."""
    try:
        process = subprocess.Popen(  # noqa: S603 - FFmpeg's own program, and a file that has been looked at
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, bufsize=0
        )
    except OSError as error:
        raise DeviceRefused(f"{path}: ffmpeg cannot be started: {error.strerror}", INSTALL) from error
    pipe = _Pipe(process, path)
    try:
        yield pipe
    finally:
        pipe.close()
        process.kill()
        process.wait()
        _close(process.stdout, process.stderr)


def _close(*streams: IO[bytes] | None) -> None:
    for stream in streams:
        if stream is not None:
            stream.close()
