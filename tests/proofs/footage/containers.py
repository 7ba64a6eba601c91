"""The files and folders that a recording comes in, written by OpenCV and FFmpeg."""

import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from proofs.footage.faults import PERIOD_MS, Fault, Frame, Layout, Picture

RATE = round(1000 / PERIOD_MS)
TICKS_HZ = 90_000
H264, FFV1, MJPEG, RAW, PNG = "H.264", "FFV1", "MJPEG", "uncompressed", "PNG"
_MOST_BITS = {H264: 10, FFV1: 16, MJPEG: 8, RAW: 16, PNG: 16}
_ENCODERS = {
    H264: ("-c:v", "libx264", "-preset", "veryfast", "-qp", "0"),
    FFV1: ("-c:v", "ffv1"),
    MJPEG: ("-c:v", "mjpeg", "-q:v", "2"),
    RAW: ("-strict", "-1"),
}


_ORDERS = {Layout.TOP_FIRST: "tff", Layout.BOTTOM_FIRST: "bff", Layout.STACKED: "prog"}


@dataclass(frozen=True, slots=True)
class Container:
    """A kind of file or folder.

    Attributes:
        name: What it is called.
        ending: Of its name; a folder has none.
        codec: How its pictures are coded.
        timed: True if every picture has a time of its own.
        rated: True if it has a rate, at which a missing picture can be left out.
        orders: True if it tells which field is the older.
        turns: True if it may be marked as turned.
        ranges: True if it tells the range of its samples.
        needs_ffmpeg: True if it is not read without the program.
    """

    name: str
    ending: str
    codec: str
    timed: bool = False
    rated: bool = True
    orders: bool = False
    turns: bool = False
    ranges: bool = False
    needs_ffmpeg: bool = False

    @property
    def title(self) -> str:
        """Name and codec."""
        return f"{self.name} ({self.codec})" if self.codec in (H264, FFV1) else self.name

    @property
    def is_lossy(self) -> bool:
        """True if its codec changes pixels."""
        return self.codec == MJPEG

    def lacks(self, fault: Fault) -> str:
        """Why this fault does not exist in it; empty if it does."""
        if fault.needs_times and not self.timed:
            return "no times of its own" if not self.rated else "one rate for all pictures"
        if fault.turned and not self.turns:
            return "no such mark"
        if fault.bits > _MOST_BITS[self.codec]:
            return f"{self.codec} has {_MOST_BITS[self.codec]} bits at most"
        if fault.full_range and not self.ranges:
            return "always of full range" if self.codec in (MJPEG, PNG) else "no such mark"
        return ""

    def options(self, fault: Fault) -> dict[str, str]:
        """What a user has to say of it."""
        untold = fault.layout is Layout.BOTTOM_FIRST and not self.orders
        return {"field_order": "bottom_first"} if untold else {}

    def write(self, folder: Path, frames: Sequence[Frame], fault: Fault) -> Path:
        """Writes a recording into the folder."""
        path = folder / f"clip{self.ending}"
        if self.codec == PNG:
            path.mkdir()
            for one in frames:
                name = f"{12 + one.time_s:.3f}.png" if self.timed else f"{one.number:04d}.png"
                cv2.imwrite(str(path / name), one.picture)
            return path
        lines, columns = frames[0].picture.shape
        form, samples = self._pixels(fault.bits), b"".join(self._samples(one.picture) for one in frames)
        given = ["-f", "rawvideo", "-pix_fmt", form, "-s", f"{columns}x{lines}", "-r", str(RATE), "-i", "-"]
        made = path.with_stem("not-turned") if fault.turned else path
        how = [*self._filters(frames, fault), *_ENCODERS[self.codec], *self._marks(fault)]
        _ffmpeg(*given, *how, made, given=samples)
        if fault.turned:
            _ffmpeg("-i", made, "-c", "copy", "-metadata:s:v:0", f"rotate={360 - fault.turned}", path)
            made.unlink()
        return path

    def _pixels(self, bits: int) -> str:
        if self.codec == FFV1:
            return "gray" if bits == 8 else f"gray{bits}le"
        if self.codec == RAW and bits > 8:
            return f"gray{bits}le"
        return ("yuvj420p" if self.codec == MJPEG else "yuv420p") + ("" if bits == 8 else f"{bits}le")

    def _samples(self, picture: Picture) -> bytes:
        """As FFmpeg takes them: luma as it is, and grey colours, where the codec has any."""
        if self._pixels(8 * picture.itemsize).startswith("gray"):
            return picture.tobytes()
        middle = 128 if picture.dtype == np.uint8 else 512
        return picture.tobytes() + np.full(picture.size // 2, middle, picture.dtype).tobytes()

    def _filters(self, frames: Sequence[Frame], fault: Fault) -> list[str | Path]:
        """Order of the fields, and the times."""
        ticks = [round(one.time_s * TICKS_HZ) for one in frames]
        steps = "".join(f"+gte(N\\,{at})*{later - ticks[at - 1]}" for at, later in enumerate(ticks) if at)
        order = _ORDERS[fault.layout] if self.orders else "prog"
        marked = f"setfield={order},settb=1/{TICKS_HZ},setpts=0{steps}"
        own = ["-enc_time_base", f"1/{TICKS_HZ}"] if self.timed else []
        return ["-vf", marked, "-fps_mode", "passthrough", *own]

    def _marks(self, fault: Fault) -> list[str | Path]:
        marks: list[str | Path] = ["-color_range", "pc"] if fault.full_range else []
        if self.ending in (".mp4", ".mov"):
            marks += ["-video_track_timescale", str(TICKS_HZ)]
        if self.codec == H264 and fault.layout is not Layout.STACKED:
            marks += ["-flags", "+ilme+ildct", "-x264opts", f"{_ORDERS[fault.layout]}=1"]
        return marks


def ffmpeg_grey(path: Path, frames: Sequence[Picture], *encoder: str) -> None:
    """Writes pictures of 8 bits at a steady rate; colour codecs get a grey colour beside the luma."""
    lines, columns = frames[0].shape
    given = b"".join(one.tobytes() + bytes([128]) * (one.size // 2) for one in frames)
    form = "yuvj420p" if "mjpeg" in encoder else "yuv420p"
    shown = ["-f", "rawvideo", "-pix_fmt", form, "-s", f"{columns}x{lines}", "-r", str(RATE), "-i", "-"]
    _ffmpeg(*shown, *encoder, path, given=given)


def _ffmpeg(*options: str | Path, given: bytes = b"") -> None:
    subprocess.run(["ffmpeg", "-v", "error", "-y", *options], input=given, check=True)


CONTAINERS = (
    Container("folder of PNG, counted", "", PNG, rated=False),
    Container("folder of PNG, times in names", "", PNG, timed=True),
    Container("MKV", ".mkv", FFV1, timed=True, ranges=True),
    Container("MP4", ".mp4", H264, timed=True, orders=True, turns=True, ranges=True, needs_ffmpeg=True),
    Container("MOV", ".mov", H264, timed=True, orders=True, turns=True, ranges=True, needs_ffmpeg=True),
    Container("AVI", ".avi", FFV1),
    Container("MPEG-TS", ".ts", H264, timed=True, orders=True, ranges=True, needs_ffmpeg=True),
    Container("MJPEG in AVI", ".avi", MJPEG),
    Container("raw MJPEG", ".mjpeg", MJPEG, rated=False),
    Container("Y4M", ".y4m", RAW, orders=True, ranges=True),
    Container("NUT", ".nut", FFV1, timed=True),
)
