"""A video file as a recording."""

from collections.abc import Iterator
from pathlib import Path

from grabberd.acquisition import NTSC_HZ, PAL_HZ, FieldOrder
from grabberd.errors import PictureError
from grabberd_replay.containers import Container
from grabberd_replay.decoder import Decoder, Header, Picture
from grabberd_replay.pictures import Pictures, Splitter, recognise, usual_rate_hz
from grabberd_replay.recording import Batch, Recording

_GRABBED_SIZES = ((720, 576), (720, 288), (720, 480), (720, 240))
_MOST_PICTURES = 1 << 30
# Codecs that return the pixels they were given; all others displace edges, and so targets.
_LOSSLESS = ("FFV1", "HFYU", "FFVH", "MPNG", "ULY0", "ULY2", "ULRA", "ULRG", "LAGS", "MAGY", "ZLIB")


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
        order: FieldOrder,
        first_parity: int,
        rate_hz: float | None,
    ) -> None:
        self._path = path
        self._decoder = Decoder(path)
        header = self._decoder.header
        self._pictures_per_s = header.pictures_per_s
        self._expected = header.pictures if header.pictures_per_s else 0
        # Without a count in the container FFmpeg estimates one from its length: a second of slack.
        self._may_lack = 0 if container.counts else round(header.pictures_per_s or 0)
        pictures = recognise(path, pictures, header.lines, header.columns)
        own_hz = rate_hz or _rate_hz(path, pictures, header)
        self._splitter = Splitter(pictures, order, first_parity, own_hz)
        self.format = self._splitter.format(
            header.lines,
            header.columns,
            details={
                "container": container.name,
                "codec": _codec(self._decoder),
                "luma": self._decoder.luma,
            },
            remarks=tuple(_remarks(self._decoder, self._splitter)),
        )

    def batches(self) -> Iterator[Batch]:
        """Fields of one picture at a time.

        Raises:
            PictureError: the video ends before its header says, changes its size, or has no constant rate.
        """
        number = -1
        for number, luma in self._numbered():
            yield self._splitter.batch(luma, number)
        if number + 1 < self._expected - self._may_lack:
            raise PictureError(
                f"{self._path} ends after {number + 1} of {self._expected} pictures: it is truncated, or the "
                "next one cannot be decoded",
                "copy it again; what came before it is kept",
            )

    def _numbered(self) -> Iterator[tuple[int, Picture]]:
        """Pictures with their number: time since the first picture, in steps of the rate."""
        begin_s: float | None = None
        last = -1
        for time_s, luma in self._decoder.pictures():
            begin_s = time_s if begin_s is None else begin_s
            number = self._number(time_s - begin_s, last)
            if number >= _MOST_PICTURES:
                raise PictureError(
                    f"{self._path}: a picture is {time_s:.0f} s after the start, as no recording is",
                    "its times are damaged: convert it once more; what came before it is kept",
                )
            if number <= last:
                raise PictureError(
                    f"{self._path}: the picture at {time_s:.3f} s comes too soon for "
                    f"{self._pictures_per_s:g} pictures a second",
                    "its rate varies: convert it to a constant rate; what came before it is kept",
                )
            yield number, luma
            last = number

    def _number(self, since_s: float, last: int) -> int:
        """Number of a picture; one without a time of its own, which reads as zero, follows the last."""
        if self._pictures_per_s is None or (since_s <= 0.0 and last >= 0):
            return last + 1
        return round(since_s * self._pictures_per_s)


def _codec(decoder: Decoder) -> str:
    return "uncompressed" if decoder.uncompressed else decoder.header.codec or "unknown"


def _rate_hz(path: Path, pictures: Pictures, header: Header) -> float:
    """Fields a second by the container, or else by the standard."""
    if header.pictures_per_s:
        return header.pictures_per_s * pictures.fields
    return usual_rate_hz(path, pictures, header.lines)


def _remarks(decoder: Decoder, splitter: Splitter) -> Iterator[str]:
    """Remarks on a video that did not come from a grabber or a progressive camera as it is."""
    header, codec = decoder.header, _codec(decoder)
    if not decoder.uncompressed and codec.upper() not in _LOSSLESS:
        yield (
            f"Its codec {codec} is usually lossy: targets are displaced by more than their sigma "
            "says. Record uncompressed, or with FFV1 or HuffYUV."
        )
    if splitter.pictures is Pictures.PROGRESSIVE:
        return
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
