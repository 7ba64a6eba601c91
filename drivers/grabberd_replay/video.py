"""A video file as a recording; its container is recognised by the first bytes and never by its name.

FFmpeg opens much more than videos (text as a picture of it, playlists that name other files): only the
containers listed here are passed to it.
"""

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from grabberd.core.field import NTSC_HZ, PAL_HZ, FieldOrder
from grabberd.errors import DeviceRefused, PictureError
from grabberd.files.held_files import hold
from grabberd_replay.decoder import INSTALL, Decoder, Header, Picture
from grabberd_replay.ffmpeg import PipedDecoder, probe
from grabberd_replay.recording import Batch, Pictures, Recording, Splitter, recognise, usual_rate_hz


class Container(NamedTuple):
    """A kind of video file.

    Attributes:
        name: common name.
        head: pattern of the file's first bytes.
        counts: True if its header has the number of pictures, unless its writer was cut off.
    """

    name: str
    head: re.Pattern[bytes]
    counts: bool = False


CONTAINERS = (
    Container("AVI", re.compile(rb"RIFF....AVI ", re.DOTALL), counts=True),
    Container(
        "MP4 or QuickTime", re.compile(rb"....(ftyp|moov|mdat|wide|free|skip)", re.DOTALL), counts=True
    ),
    Container("Matroska", re.compile(rb"\x1a\x45\xdf\xa3")),
    Container("YUV4MPEG", re.compile(rb"YUV4MPEG2 ")),
    Container("MPEG", re.compile(rb"\x00\x00\x01[\xba\xb3]|\x47.{187}\x47", re.DOTALL)),
    Container("DV", re.compile(rb"\x1f\x07\x00[\x3f\xbf]")),
    Container("NUT", re.compile(rb"nut/multimedia container")),
)

KINDS = ", ".join(container.name for container in CONTAINERS)

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


_GRABBED_SIZES = ((720, 576), (720, 288), (720, 480), (720, 240))
_MOST_PICTURES = 1 << 30
# Codecs that return the pixels they were given, as OpenCV and as FFmpeg call them; all others displace edges,
# and so targets.
_LOSSLESS = frozenset(
    {
        *("FFV1", "HFYU", "FFVH", "MPNG", "ULY0", "ULY2", "ULRA", "ULRG", "LAGS", "MAGY", "ZLIB"),
        *("HUFFYUV", "FFVHUFF", "PNG", "UTVIDEO", "LAGARITH", "MAGICYUV", "RAWVIDEO", "V210", "QTRLE"),
    }
)
_OFF_STEP = 0.3
"""Share of a period by which a picture may miss the time that the rate gives it."""
_TICK_S = 0.001
"""Step of the coarsest times: Matroska's."""


Decoding = Decoder | PipedDecoder
"""A video that is decoded picture by picture: by OpenCV, or by the program `ffmpeg`."""


def decoding(path: Path) -> Decoding:
    """Opens a video: coded ones by `ffmpeg` where it is installed, all others by OpenCV.

    Raises:
        DeviceRefused: the file has no readable video.
        PictureError: no picture can be read.
    """
    known = probe(path)
    if known is None or known.header.codec == "rawvideo":
        return Decoder(path, known.order if known else None)
    return PipedDecoder(path, known)


class VideoRecording(Recording):
    """The pictures of a video at their own times; gaps in the recording remain gaps.

    Raises:
        DeviceRefused: there is no readable video, or the pictures' kind cannot be told from their height.
        PictureError: no picture can be read.
    """

    def __init__(
        self,
        path: Path,
        container: Container,
        pictures: Pictures,
        order: FieldOrder | None,
        first_parity: int,
        rate_hz: float | None,
    ) -> None:
        self._path = path
        self._decoder = decoding(path)
        header, marked = self._decoder.header, self._decoder.order
        self._pictures_per_s = header.pictures_per_s
        self._expected = header.pictures if header.pictures_per_s else 0
        # Without a count in the container FFmpeg estimates one from its length: a second of slack.
        self._may_lack = 0 if container.counts else round(header.pictures_per_s or 0)
        interlaced = marked in (FieldOrder.TOP_FIRST, FieldOrder.BOTTOM_FIRST)
        pictures = recognise(path, pictures, header.lines, header.columns, interlaced=interlaced)
        own_hz = rate_hz or _rate_hz(path, pictures, header)
        usual = marked if interlaced and marked else FieldOrder.TOP_FIRST
        self._splitter = Splitter(pictures, order or usual, first_parity, own_hz)
        self.format = self._splitter.format(
            header.lines,
            header.columns,
            details={
                "container": container.name,
                "codec": _codec(self._decoder),
                "luma": self._decoder.luma,
                **({"marked": str(marked)} if marked else {}),
            },
            remarks=tuple(_remarks(self._decoder, self._splitter)),
        )

    def batches(self) -> Iterator[Batch]:
        """Fields of one picture at a time.

        Raises:
            PictureError: the video ends before its header says, changes its size, or has no constant rate, or
                a picture is damaged.
        """
        number = -1
        for number, luma in self._numbered():
            yield self._splitter.batch(luma, number)
        fault = self._decoder.fault
        if number + 1 < self._expected - self._may_lack or fault:
            of = f" of {self._expected}" if self._expected else ""
            raise PictureError(
                f"{self._path} ends after {number + 1}{of} pictures: it is truncated, or the "
                f"next one cannot be decoded{f' ({fault})' if fault else ''}",
                "copy it again; what came before it is kept",
            )

    def _numbered(self) -> Iterator[tuple[int, Picture]]:
        """Pictures with their number: time since the first picture, in steps of the rate."""
        begin_s: float | None = None
        last = -1
        for time_s, luma in self._decoder.pictures():
            begin_s = time_s if begin_s is None else begin_s
            number = self._number(time_s - begin_s, last)
            self._check_number(number, last, time_s, time_s - begin_s)
            yield number, luma
            last = number

    def _number(self, since_s: float, last: int) -> int:
        """Number of a picture; one without a time of its own, which reads as zero, follows the last."""
        if self._pictures_per_s is None or (since_s <= 0.0 and last >= 0):
            return last + 1
        return round(since_s * self._pictures_per_s)

    def _check_number(self, number: int, last: int, time_s: float, since_s: float) -> None:
        """Check that a picture was taken in one of the steps of a constant rate, after the last one.

        Raises:
            PictureError: it was not.
        """
        if number >= _MOST_PICTURES:
            raise PictureError(
                f"{self._path}: a picture is {time_s:.0f} s after the start, as no recording is",
                "its times are damaged: convert it once more; what came before it is kept",
            )
        rate = self._pictures_per_s or 0.0
        off = abs(since_s * rate - number) if rate and since_s > 0.0 else 0.0
        if number <= last or off > _OFF_STEP + _TICK_S * rate:
            how = "comes too soon" if number <= last else f"is {off:.2f} periods off its time"
            raise PictureError(
                f"{self._path}: the picture at {time_s:.3f} s {how} for {rate:g} pictures a second: its rate "
                "varies",
                "record at a constant rate; if the camera's was constant and only the file's times are "
                "wrong, export its pictures to a folder and give rate_hz; what came before it is kept",
            )


def _codec(decoder: Decoding) -> str:
    return "uncompressed" if decoder.uncompressed else decoder.header.codec or "unknown"


def _rate_hz(path: Path, pictures: Pictures, header: Header) -> float:
    """Fields a second by the container, or else by the standard."""
    if header.pictures_per_s:
        return header.pictures_per_s * pictures.fields
    return usual_rate_hz(path, pictures, header.lines)


def _remarks(decoder: Decoding, splitter: Splitter) -> Iterator[str]:
    """Remarks on a video that did not come from a grabber or a progressive camera as it is."""
    codec = _codec(decoder)
    if not decoder.uncompressed and codec.upper() not in _LOSSLESS:
        yield (
            f"Its codec {codec} is usually lossy: targets are displaced by more than their sigma "
            "says. Record uncompressed, or with FFV1 or HuffYUV."
        )
    if not decoder.uncompressed and isinstance(decoder, Decoder):
        yield f"Damaged pictures of it go unnoticed, since OpenCV conceals them: {INSTALL}."
    if splitter.pictures is Pictures.PROGRESSIVE:
        return
    yield from _of_fields(decoder, splitter)


def _of_fields(decoder: Decoding, splitter: Splitter) -> Iterator[str]:
    header, marked = decoder.header, decoder.order
    if splitter.pictures is Pictures.FRAMES and marked is FieldOrder.PROGRESSIVE:
        yield (
            "It is marked as progressive, but has the size of interlaced frames and is played as such; "
            "recorders often forget the mark: 'grabberd inspect' tells by what moves, 'pictures' decides."
        )
    if splitter.pictures is Pictures.FRAMES and marked not in (None, FieldOrder.PROGRESSIVE, splitter.order):
        yield f"It is marked as {marked}, but played as {splitter.order}, as the option 'field_order' asks."
    if (header.columns, header.lines) not in _GRABBED_SIZES:
        yield (
            f"Its size {header} is that of no grabber (720x576, 720x480, or half the lines): if it was "
            "scaled, lines of both fields are mixed, and no option separates them."
        )
    if all(abs(splitter.rate_hz - usual) > 0.01 * usual for usual in (PAL_HZ, NTSC_HZ)):
        yield (
            f"It has {splitter.rate_hz:g} fields a second where PAL has {PAL_HZ:g} and NTSC {NTSC_HZ:.2f}: "
            "correct a wrong rate with rate_hz; pictures are 'progressive' if they have no fields, and "
            "'doubled' if each was interpolated from a field."
        )
