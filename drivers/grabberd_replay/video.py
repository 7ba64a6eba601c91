"""A video file as a source of pictures; its container is recognised by the first bytes and never by its name.

FFmpeg opens much more than videos (text as a picture of it, playlists that name other files): only the
containers listed here are passed to it.
"""

import os
import re
from collections.abc import Generator, Iterator
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

from grabberd.errors import DeviceRefused
from grabberd.files.disk import hold
from grabberd_replay.decoder import INSTALL, Decoder
from grabberd_replay.ffmpeg import PipedDecoder, probe
from grabberd_replay.footage import Shown


class Container(NamedTuple):
    """A kind of video file.

    Attributes:
        name: common name.
        head: pattern of the file's first bytes.
        counts: True if its header has the number of pictures, unless its writer was cut off.
        timed: False if pictures have no times, which a reader then makes up.
        rated: False if nothing tells their rate, which a reader then makes up as well.
    """

    name: str
    head: re.Pattern[bytes]
    counts: bool = False
    timed: bool = True
    rated: bool = True


_BARE = " without a container"

CONTAINERS = (
    Container("AVI", re.compile(rb"RIFF....AVI ", re.DOTALL), counts=True),
    Container(
        "MP4 or QuickTime", re.compile(rb"....(ftyp|moov|mdat|wide|free|skip)", re.DOTALL), counts=True
    ),
    Container("Matroska", re.compile(rb"\x1a\x45\xdf\xa3")),
    Container("YUV4MPEG", re.compile(rb"YUV4MPEG2 "), timed=False),
    Container("MPEG", re.compile(rb"\x00\x00\x01\xba|\x47.{187}\x47", re.DOTALL)),
    Container(f"MPEG{_BARE}", re.compile(rb"\x00\x00\x01\xb3"), timed=False),
    Container(f"MJPEG{_BARE}", re.compile(rb"\xff\xd8\xff"), timed=False, rated=False),
    Container("DV", re.compile(rb"\x1f\x07\x00[\x3f\xbf]"), timed=False),
    Container("NUT", re.compile(rb"nut/multimedia container")),
)

KINDS = ", ".join(dict.fromkeys(one.name.removesuffix(_BARE) for one in CONTAINERS))

# An MPEG transport stream has no magic number, but a sync byte in every packet of 188 bytes: it takes two.
_HEAD_BYTES = 189


def container_of(path: Path) -> Container | None:
    """The container of a file by its first bytes; None if it is no known one.

    Raises:
        DeviceRefused: the file cannot be read.
    """
    try:
        # It may be a capture that this program is writing or reading.
        with hold(path.resolve()) as held:
            head = os.pread(held.descriptor, _HEAD_BYTES, 0)
    except OSError as error:
        raise DeviceRefused(
            f"{path} cannot be read: {error.strerror}", "correct the file's permissions"
        ) from error
    return next((container for container in CONTAINERS if container.head.match(head)), None)


# Codecs that return the pixels they were given, as OpenCV and as FFmpeg call them; all others displace edges,
# and so targets.
_LOSSLESS = frozenset(
    {
        *("FFV1", "HFYU", "FFVH", "MPNG", "ULY0", "ULY2", "ULRA", "ULRG", "LAGS", "MAGY", "ZLIB"),
        *("HUFFYUV", "FFVHUFF", "PNG", "UTVIDEO", "LAGARITH", "MAGICYUV", "RAWVIDEO", "V210", "QTRLE"),
    }
)
Decoding = Decoder | PipedDecoder
"""A video that is decoded picture by picture: by OpenCV, or by the program `ffmpeg`."""


def decoding(path: Path) -> Decoding:
    """Opens a video: by `ffmpeg` where it is installed, else by OpenCV.

    Raises:
        DeviceRefused: the file has no readable video.
        PictureError: no picture can be read.
    """
    known = probe(path)
    return Decoder(path) if known is None else PipedDecoder(path, known)


class VideoSource:
    """The pictures of a video, with their own times.

    Raises:
        DeviceRefused: there is no readable video.
        PictureError: no picture can be read.
    """

    def __init__(self, path: Path, container: Container) -> None:
        self.path = path
        self._decoder = decoding(path)
        header = self._decoder.header
        self.lines, self.columns = header.lines, header.columns
        self.rate_hz = header.pictures_per_s if container.rated else None
        self.marked = self._decoder.order
        self.bits, self._timed = self._decoder.bits, container.timed
        # Without a count in the container FFmpeg estimates one from its length: a second of slack.
        slack = 0 if container.counts else round(header.pictures_per_s or 0)
        self.expected = max(0, header.pictures - slack) if self.rate_hz else 0
        codec = "uncompressed" if self._decoder.uncompressed else header.codec or "unknown"
        self.details = {
            "container": container.name,
            "codec": codec,
            "luma": self._decoder.luma,
            **({"marked": str(self.marked)} if self.marked else {}),
        }
        self.remarks = tuple(_remarks(self._decoder, codec, container))

    @property
    def fault(self) -> str:
        """Failure that ended the pictures, in the decoder's words; empty if none did."""
        return self._decoder.fault

    def pictures(self) -> Generator[Shown, None, None]:
        """The pictures, each decoded when it is its turn.

        Raises:
            PictureError: one is damaged, or unlike the first.
        """
        with closing(self._decoder.pictures()) as pictures:
            for time_s, samples in pictures:
                name = f"{self.path}, the picture at {time_s or 0.0:.3f} s"
                yield Shown(name, samples, time_s if self._timed else None)


def _remarks(decoder: Decoding, codec: str, container: Container) -> Iterator[str]:
    """Remarks on a video that did not come from a grabber or a progressive camera as it is."""
    if not decoder.uncompressed and codec.upper() not in _LOSSLESS:
        yield (
            f"Its codec {codec} is usually lossy: targets are displaced by more than their sigma "
            "says. Record uncompressed, or with FFV1 or HuffYUV."
        )
    if not decoder.uncompressed and isinstance(decoder, Decoder):
        yield f"Damaged pictures of it go unnoticed, since OpenCV conceals them: {INSTALL}."
    if not container.timed:
        yield f"{container.name} has no times: its pictures are taken for consecutive ones."
    if decoder.turned:
        yield f"Its mark that pictures be turned by {decoder.turned} degrees is not followed."
