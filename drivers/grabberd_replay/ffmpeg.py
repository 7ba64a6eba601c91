"""A video file read by FFmpeg's own programs, where they are installed.

`ffprobe` tells the order of its fields; OpenCV says nothing of fields, and what it returns for pictures that
are coded as interlaced is no picture. `ffmpeg` writes grey values as they were coded through a pipe, and says
of every picture its time and size before it writes it. One picture at a time is held; `ffmpeg` waits until it
is taken. Both run as processes of their own, and nothing of them is linked.
"""

import json
import os
import re
import selectors
import shutil
import subprocess
from collections import Counter, deque
from collections.abc import Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from grabberd.core.field import FieldOrder
from grabberd.errors import DeviceRefused, PictureError
from grabberd_replay.decoder import INSTALL, STORED_BITS, Header, Samples, check_size, from_colours

# Only the containers that the first bytes have been compared with; a playlist names other files.
_SAFE = (
    "-protocol_whitelist",
    "file",
    "-format_whitelist",
    "avi,mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,yuv4mpegpipe,mpeg,mpegvideo,mpegts,nut,dv,mjpeg",
)
_LOOKED_AT = 25
"""Pictures whose marks are read: a codec may mark single ones as progressive among interlaced ones."""
_LONGEST_S = 60.0
_PASSTHROUGH_SINCE = (5, 1)
_ENTRIES = (
    "stream=codec_name,width,height,pix_fmt,field_order,r_frame_rate,avg_frame_rate,nb_frames,duration"
    ":stream_side_data=rotation:frame=interlaced_frame,top_field_first:format=duration,format_name"
)
_ORDERS = {"progressive": FieldOrder.PROGRESSIVE, "t": FieldOrder.TOP_FIRST, "b": FieldOrder.BOTTOM_FIRST}
_BITS = 8
_LOST_IN_NUT = "rgb555le"
_LUMA_FIRST = ("yuv", "gray", "nv", "uyvy", "yuyv", "yvyu", "p0", "p2", "p4", "ya")
"""Beginnings of the names of pixel formats that have a luma of their own."""


class Probe(NamedTuple):
    """Properties of a video stream.

    Attributes:
        program: path of `ffmpeg`.
        every_picture: options by which it neither repeats nor drops a picture.
        header: its size, rate and number of pictures; codec and pixel format by FFmpeg's names.
        order: order of the fields by the marks of pictures and stream; None if they say nothing.
        turned: degrees by which pictures are to be turned, which is not done.
    """

    program: str
    every_picture: tuple[str, str]
    header: Header
    order: FieldOrder | None
    turned: int = 0

    @property
    def has_luma(self) -> bool:
        """True if grey values need not be computed from colours."""
        return self.header.pixels.startswith(_LUMA_FIRST)

    @property
    def bits(self) -> int:
        """Bits of a sample."""
        found = re.search(r"(\d+)[lb]e$", self.header.pixels)
        return int(found[1]) if found else 8


def probe(path: Path) -> Probe | None:
    """Properties of a video; None if FFmpeg is not installed, or does not know what the file contains."""
    program, asked = shutil.which("ffmpeg"), shutil.which("ffprobe")
    if program is None or asked is None:
        return None
    options = ["-v", "quiet", *_SAFE, "-select_streams", "v:0", "-read_intervals", f"%+#{_LOOKED_AT}"]
    command = [asked, *options, "-show_program_version", "-show_entries", _ENTRIES, "-of", "json"]
    try:
        done = subprocess.run(  # noqa: S603 - FFmpeg's own program, and a file that has been looked at
            [*command, f"file:{path.absolute()}"],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=_LONGEST_S,
            check=False,
        )
        told: dict[str, Any] = json.loads(done.stdout)
    except (OSError, subprocess.TimeoutExpired, ValueError):
        return None
    stream: dict[str, Any] = next(iter(told.get("streams", ())), {})
    if not {"codec_name", "width", "height", "pix_fmt"} <= set(stream):
        return None
    rate = _rate(stream)
    return Probe(
        program=program,
        every_picture=(_passthrough(told), "passthrough"),
        header=Header(
            lines=int(stream["height"]),
            columns=int(stream["width"]),
            pictures_per_s=rate,
            pictures=_count(stream, told, rate),
            codec=str(stream["codec_name"]),
            pixels=str(stream["pix_fmt"]),
        ),
        order=_order(stream, told.get("frames", ())),
        turned=_turned(stream),
    )


def _order(stream: dict[str, Any], frames: Sequence[dict[str, Any]]) -> FieldOrder | None:
    """Order by the pictures' own marks, which every codec sets alike, or else by the container's."""
    marked = Counter(one.get("top_field_first") for one in frames if one.get("interlaced_frame"))
    if marked:
        return FieldOrder.TOP_FIRST if marked.most_common(1)[0][0] else FieldOrder.BOTTOM_FIRST
    told = str(stream.get("field_order", ""))
    return _ORDERS.get(told, _ORDERS.get(told[:1]))


def _turned(stream: dict[str, Any]) -> int:
    for side in stream.get("side_data_list", ()):
        if "rotation" in side:
            return -int(side["rotation"]) % 360
    return 0


def _rate(stream: dict[str, Any]) -> float | None:
    for name in ("avg_frame_rate", "r_frame_rate"):
        try:
            rate = float(Fraction(stream[name]))
        except (KeyError, ValueError, ZeroDivisionError):
            continue
        if 1.0 <= rate <= 1000.0:
            return rate
    return None


def _count(stream: dict[str, Any], told: dict[str, Any], rate: float | None) -> int:
    """Number of pictures by the container, or about as many as its length has room for.

    An MP4 that was cut without coding it anew counts pictures before the cut that are not shown.
    """
    length = stream.get("duration") or told.get("format", {}).get("duration")
    try:
        count = int(stream["nb_frames"])
        if length and "mov" in told["format"]["format_name"]:
            count = min(count, round(float(length) * float(Fraction(stream["r_frame_rate"]))))
        return max(0, count)
    except (KeyError, ValueError, ZeroDivisionError):
        pass
    try:
        return max(0, round(float(length or 0) * (rate or 0)))
    except ValueError:
        return 0


def _passthrough(told: dict[str, Any]) -> str:
    """Name of the option for the times of pictures, which has changed."""
    version = str(told.get("program_version", {}).get("version", ""))
    found = re.match(r"n?(\d+)\.(\d+)", version)
    old = found is not None and (int(found[1]), int(found[2])) < _PASSTHROUGH_SINCE
    return "-vsync" if old else "-fps_mode"


_SHOWN = re.compile(rb"\[info\] n: *\d+ pts: *\S+ pts_time: *(\S+) .*? s:(\d+)x(\d+) ")
_OPENED = re.compile(rb"\[info\] Input #0, ")
"""The end of its look at the beginning of the file: errors before it are said again where they belong."""
_OF_CONTAINER = frozenset(_SAFE[-1].split(",")) - {"mjpeg"}  # which is a codec's name too
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

    time_s: float | None
    columns: int
    lines: int
    fault: str

    @property
    def at(self) -> str:
        """Its time, for a message."""
        return "an unknown time" if self.time_s is None else f"{self.time_s:.3f}"


class PipedDecoder:
    """A video file that is opened by `ffmpeg`.

    Attributes:
        header: properties of the video.
        order: order of the fields, as its own marks have it.
        fault: error that ended it before its end, in the words of `ffmpeg`.
        bits: significant bits of samples of 16; None where the pictures themselves have to show them.
        turned: degrees by which pictures are to be turned, which is not done.
        uncompressed: True if they are stored as they are.

    Raises:
        DeviceRefused: `ffmpeg` cannot be started, or pictures are too large.
        PictureError: no picture can be read.
    """

    def __init__(self, path: Path, probe: Probe) -> None:
        self._path, self._probe = path, probe
        self.order, self.fault, self.turned = probe.order, "", probe.turned
        self.header = probe.header
        self.uncompressed = probe.header.codec == "rawvideo"
        self.bits = probe.bits if _BITS < probe.bits < STORED_BITS else None
        check_size(path, self.header)
        if self.uncompressed and self.header.pixels == _LOST_IN_NUT:
            raise DeviceRefused(
                f"{path}: its uncompressed pictures are called {_LOST_IN_NUT}, as NUT calls all that it has "
                "no name for (P010, P016, NV16, NV24): what they are cannot be known",
                "record them again as gray10le, gray16le or nv12, or with FFV1",
            )
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
            return f"computed from the colours of {self.header.pixels!r} by Rec. 601"
        return "as it stands in the file" if self.uncompressed else "as it was coded"

    def pictures(self) -> Generator[tuple[float | None, Samples], None, None]:
        """Time in s and samples of every picture; `fault` tells why there are no more.

        Raises:
            PictureError: a picture is damaged, or its size differs from the first one's.
        """
        self.fault = ""
        with _running(self._command, self._path) as pipe:
            while (raw := pipe.picture(self._bytes)) is not None:
                shown = pipe.announced()
                if shown.fault:
                    raise PictureError(
                        f"{self._path}: the picture at {shown.at} s is damaged ({shown.fault})",
                        "copy it again, or cut the video there; what came before it is kept",
                    )
                if (shown.lines, shown.columns) != (self.header.lines, self.header.columns):
                    raise PictureError(
                        f"{self._path}: the picture at {shown.at} s has {shown.columns}x{shown.lines}"
                        f" pixels, expected {self.header} like the first",
                        "cut the video there; what came before it is kept",
                    )
                yield shown.time_s, self._samples(raw)
            self.fault = pipe.end()

    def _samples(self, raw: bytearray) -> Samples:
        shape = self.header.lines, self.header.columns
        if not self._probe.has_luma:
            return from_colours(np.frombuffer(raw, np.uint8).reshape(*shape, 3))
        return np.frombuffer(raw, "<u2" if self._deep else np.uint8).reshape(shape)

    @property
    def _bytes(self) -> int:
        samples = 1 if self._probe.has_luma else 3
        return self.header.lines * self.header.columns * samples * (2 if self._deep else 1)

    @property
    def _deep(self) -> bool:
        return self._probe.has_luma and self._probe.bits > _BITS

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
        return [self._probe.program, *options, *_SAFE, "-i", f"file:{self._path.absolute()}", *output, *form]


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
            seconds = None if time == b"NOPTS" else float(time)
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
    with process:  # at its end it is waited for, and its streams are closed
        pipe = _Pipe(process, path)
        try:
            yield pipe
        finally:
            pipe.close()
            process.kill()
