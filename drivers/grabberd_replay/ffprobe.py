"""Properties of a video as FFmpeg's own program tells them, above all the order of its fields.

OpenCV says nothing of fields, and what it returns for pictures that are coded as interlaced is no picture. So
such videos are read by the programs `ffprobe` and `ffmpeg`, where they are installed. They run as processes
of their own, and nothing of them is linked.
"""

import json
import re
import shutil
import subprocess
from collections import Counter
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

from grabberd.core.field import FieldOrder

INSTALL = "install FFmpeg: sudo apt-get install ffmpeg"
# Only the containers that the first bytes have been compared with; a playlist names other files.
SAFE = (
    "-protocol_whitelist",
    "file",
    "-format_whitelist",
    "avi,mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,yuv4mpegpipe,mpeg,mpegvideo,mpegts,nut,dv",
)
_LOOKED_AT = 25
"""Pictures whose marks are read: a codec may mark single ones as progressive among interlaced ones."""
_LONGEST_S = 60.0
_PASSTHROUGH_SINCE = (5, 1)
_ENTRIES = (
    "stream=codec_name,width,height,pix_fmt,field_order,r_frame_rate,avg_frame_rate,nb_frames,duration"
    ":frame=interlaced_frame,top_field_first:format=duration"
)
_ORDERS = {"progressive": FieldOrder.PROGRESSIVE, "t": FieldOrder.TOP_FIRST, "b": FieldOrder.BOTTOM_FIRST}
_LUMA_FIRST = ("yuv", "gray", "nv", "uyvy", "yuyv", "yvyu", "p0", "p2", "p4", "ya")
"""Beginnings of the names of pixel formats that have a luma of their own."""


class Probe(NamedTuple):
    """Properties of a video stream.

    Attributes:
        program: path of `ffmpeg`.
        every_picture: options by which it neither repeats nor drops a picture.
        codec: name of the codec.
        lines, columns: size of a picture.
        pixels: name of the pixel format.
        pictures_per_s: picture rate; None if missing or impossible.
        pictures: number of pictures; 0 if missing.
        order: order of the fields by the marks of pictures and stream; None if they say nothing.
    """

    program: str
    every_picture: tuple[str, str]
    codec: str
    lines: int
    columns: int
    pixels: str
    pictures_per_s: float | None
    pictures: int
    order: FieldOrder | None

    @property
    def has_luma(self) -> bool:
        """True if grey values need not be computed from colours."""
        return self.pixels.startswith(_LUMA_FIRST)

    @property
    def bits(self) -> int:
        """Bits of a sample."""
        found = re.search(r"(\d+)[lb]e$", self.pixels)
        return int(found[1]) if found else 8


def probe(path: Path) -> Probe | None:
    """Properties of a video; None if FFmpeg is not installed, or does not know what the file contains."""
    program, asked = shutil.which("ffmpeg"), shutil.which("ffprobe")
    if program is None or asked is None:
        return None
    options = ["-v", "quiet", *SAFE, "-select_streams", "v:0", "-read_intervals", f"%+#{_LOOKED_AT}"]
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
        codec=str(stream["codec_name"]),
        lines=int(stream["height"]),
        columns=int(stream["width"]),
        pixels=str(stream["pix_fmt"]),
        pictures_per_s=rate,
        pictures=_count(stream, told, rate),
        order=_order(stream, told.get("frames", ())),
    )


def _order(stream: dict[str, Any], frames: Sequence[dict[str, Any]]) -> FieldOrder | None:
    """Order by the pictures' own marks, which every codec sets alike, or else by the container's."""
    marked = Counter(one.get("top_field_first") for one in frames if one.get("interlaced_frame"))
    if marked:
        return FieldOrder.TOP_FIRST if marked.most_common(1)[0][0] else FieldOrder.BOTTOM_FIRST
    told = str(stream.get("field_order", ""))
    return _ORDERS.get(told, _ORDERS.get(told[:1]))


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
    """Number of pictures by the container, or about as many as its length has room for."""
    try:
        return max(0, int(stream["nb_frames"]))
    except (KeyError, ValueError):
        pass
    length = stream.get("duration") or told.get("format", {}).get("duration")
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
