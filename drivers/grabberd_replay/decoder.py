"""The pictures of a video file, one after another, by the FFmpeg that is inside OpenCV.

It reads videos where the programs of FFmpeg are not installed, as far as that gives the pixels that they
would: uncompressed pictures directly from the file, decoded ones without their colours, and luma computed
from colours alone. OpenCV converts luma of more than 8 bits, or in other layouts, so those are refused.
"""

import os
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import LARGEST_SIDE_PX, FieldOrder
from grabberd.errors import DeviceRefused, PictureError

Samples = NDArray[np.uint8] | NDArray[np.uint16]
KNOWN_BITS = (8, 10, 12, 14, 16)
STORED_BITS = 16
FROM_COLOURS = "converted to luma by Rec. 601"
_FEWEST_ZERO = 4
"""Lowest bits that are always zero where 12 bits or fewer stand at the upper end."""


def from_colours(picture: Samples) -> Samples:
    """Luma of a picture (lines, columns, 3) of blue, green and red, by Rec. 601; (lines, columns)."""
    luma = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    return np.asarray(luma, np.uint8) if picture.dtype == np.uint8 else np.asarray(luma, np.uint16)


class Levels(NamedTuple):
    """Scale of a recording's samples.

    Attributes:
        bits: significant bits of a sample, which begin at its lowest one: 16 also where these are all zero.
        guessed: True if they follow from the first picture's brightest value.
    """

    bits: int
    guessed: bool = False

    @classmethod
    def of(cls, picture: Samples, bits: int | None = None) -> "Levels":
        """Those of a recording with this first picture, or with so many bits."""
        if picture.dtype == np.uint8:
            return cls(8)
        if bits is not None:
            return cls(bits)
        occurring = int(np.bitwise_or.reduce(picture, axis=None))
        if occurring and occurring & -occurring >= 1 << _FEWEST_ZERO:
            return cls(STORED_BITS)
        found = next(known for known in KNOWN_BITS if occurring < 1 << known)
        return cls(found, guessed=found < STORED_BITS)

    def grey(self, name: object, picture: Samples) -> NDArray[np.uint8]:
        """The upper 8 bits of a picture.

        Raises:
            PictureError: it has values that so many bits cannot have.
        """
        if picture.dtype == np.uint8:
            return picture.astype(np.uint8, copy=False)
        largest, most = int(picture.max()), (1 << self.bits) - 1
        if largest > most:
            origin = ", as many as the first picture has" if self.guessed else ""
            raise PictureError(
                f"{name} has values up to {largest}, expected at most {most} of {self.bits} bits{origin}",
                f"give 'bits', one of {', '.join(map(str, KNOWN_BITS))}; what came before it is kept",
            )
        return (picture >> (self.bits - 8)).astype(np.uint8)

    @property
    def details(self) -> dict[str, str]:
        """Stream detail for pictures that were scaled."""
        return {} if self.bits == 8 else {"samples": f"the upper 8 of {self.bits} bits"}

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remark on a scale that nobody stated."""
        if not self.guessed:
            return ()
        return (
            f"Its pictures are stored with 16 bits a sample; by the values in the first, {self.bits} of them "
            "are significant, of which the upper 8 are used. If the camera has others, say so with 'bits'.",
        )


INSTALL = "install FFmpeg: sudo apt-get install ffmpeg"
Picture = NDArray[np.uint8]

# OpenCV takes options of its FFmpeg from the environment alone, when a file is opened.
_ENVIRONMENT = {
    "OPENCV_FFMPEG_LOGLEVEL": "-8",  # nothing on stderr: errors report all that matters
    "OPENCV_FFMPEG_CAPTURE_OPTIONS": "fflags;discardcorrupt",  # drop incomplete pictures
}
# A second of identical pictures does not come from a camera, whose noise differs from picture to picture.
_STILL_AT_MOST = 25
_LUMA_HINT = "convert it elsewhere: ffmpeg -i {name} -vf extractplanes=y,setfield=prog -c:v ffv1 luma.mkv"


class Layout(NamedTuple):
    """Position of the luma among the bytes of a picture: `first`, then every `step`-th byte."""

    bytes_per_pixel: float
    first: int = 0
    step: int = 1


LAYOUTS = {
    "Y800": Layout(1),
    "I420": Layout(1.5),
    "NV12": Layout(1.5),
    "Y41B": Layout(1.5),
    "Y42B": Layout(2),
    "444P": Layout(3),
    "UYVY": Layout(2, first=1, step=2),
    "YUY2": Layout(2, first=0, step=2),
}
_COLOURS = frozenset(
    {"RGB", "RGB[24]", "BGR", "BGR[24]", "RGBA", "BGRA", "ARGB", "ABGR", "PAL[8]", "RV24", "RV32", "BGR0"}
)
"""Pixel formats without a luma of their own, of 8 bits a colour."""


class Header(NamedTuple):
    """Properties of a video as its header states them.

    Attributes:
        lines, columns: size of a picture.
        pictures_per_s: picture rate; None if missing or impossible.
        pictures: number of pictures; 0 if missing.
        codec: four-letter code of the codec, "" for an uncompressed video.
        pixels: four-letter code of the pixel format.
    """

    lines: int
    columns: int
    pictures_per_s: float | None
    pictures: int
    codec: str
    pixels: str

    def __str__(self) -> str:
        return f"{self.columns}x{self.lines}"


class Way(NamedTuple):
    """A way to obtain grey values: description, OpenCV setting, and conversion of what OpenCV returns."""

    description: str
    setting: tuple[int, float]
    luma: Callable[[Picture], Picture]


class Decoder:
    """An opened video file.

    Attributes:
        header: properties of the video.
        order: None: OpenCV does not tell the order of fields.
        fault: empty: nor why there are no more pictures.
        bits: None: samples have 8.
        turned: degrees by which pictures are to be turned, which is not done.

    Raises:
        DeviceRefused: the file has no readable video, or OpenCV does not deliver its pictures.
        PictureError: no picture can be read.
    """

    fault = ""
    order: FieldOrder | None = None
    bits: int | None = None

    def __init__(self, path: Path) -> None:
        self._path = path
        with _opened(path) as capture:
            self.header = _header(capture)
            self.turned = int(capture.get(cv2.CAP_PROP_ORIENTATION_META)) % 360
        check_size(path, self.header)
        self._way = self._choose()
        self._check_that_pictures_change()

    @property
    def luma(self) -> str:
        """Description of how the grey values are obtained."""
        return self._way.description

    @property
    def uncompressed(self) -> bool:
        """True if pictures are read directly from the file."""
        return self._way.setting[0] == cv2.CAP_PROP_FORMAT

    def pictures(self) -> Generator[tuple[float, Picture], None, None]:
        """Time in s and grey values of every picture, until the first that cannot be read.

        Raises:
            PictureError: a picture's size differs from the first one's.
        """
        for time_s, raw in _read(self._path, self._way.setting):
            luma = self._way.luma(raw)
            if luma.shape != self._shape:
                raise PictureError(
                    f"{self._path}: the picture at {time_s:.3f} s has {luma.size} pixels, "
                    f"expected {self.header} like the first",
                    "cut the video there; what came before it is kept",
                )
            yield time_s, luma

    def _choose(self) -> Way:
        layout = LAYOUTS.get(self.header.pixels)
        if layout and self._stands_in_the_file(layout):
            luma = partial(self._from_packet, layout)
            return Way("as it stands in the file", (cv2.CAP_PROP_FORMAT, -1), luma)
        if layout and layout.step == 1:
            return Way("as it was coded", (cv2.CAP_PROP_CONVERT_RGB, 0), lambda picture: picture)
        if self.header.pixels not in _COLOURS:
            raise DeviceRefused(
                f"{self._path}: OpenCV gives pictures of {self.header.pixels!r} only converted, not as they "
                "are stored",
                f"{INSTALL}, which reads them, or {_LUMA_HINT.format(name=self._path.name)}",
            )
        description = f"computed from the colours of {self.header.pixels!r} by Rec. 601"
        return Way(description, (cv2.CAP_PROP_CONVERT_RGB, 1), _luma)

    def _stands_in_the_file(self, layout: Layout) -> bool:
        if self.header.codec:
            return False
        first = next(_read(self._path, (cv2.CAP_PROP_FORMAT, -1)), None)
        return first is not None and first[1].size == self._pixels * layout.bytes_per_pixel

    def _from_packet(self, layout: Layout, packet: Picture) -> Picture:
        if packet.size != self._pixels * layout.bytes_per_pixel:
            return packet  # the caller reports the wrong size as that of any picture
        last = layout.first + layout.step * self._pixels
        return packet.ravel()[layout.first : last : layout.step].reshape(self._shape)

    @property
    def _shape(self) -> tuple[int, int]:
        return self.header.lines, self.header.columns

    @property
    def _pixels(self) -> int:
        return self.header.lines * self.header.columns

    def _check_that_pictures_change(self) -> None:
        """Check for versions of OpenCV that return stale memory instead of pictures marked as interlaced.

        The only symptom is that the pictures never change, while those of a camera always do.
        """
        pictures = self.pictures()
        first = next(pictures, None)
        if first is None:
            raise PictureError(
                f"{self._path}: no picture of a video of {self.header} can be read",
                "copy it again, or record it again",
            )
        others = islice(pictures, _STILL_AT_MOST - 1)
        if not self.uncompressed and all(np.array_equal(first[1], other) for _, other in others):
            raise DeviceRefused(
                f"{self._path}: its first pictures are identical bit for bit, as happens if OpenCV "
                f"{cv2.__version__} cannot read an interlaced video (codec {self.header.codec})",
                f"{INSTALL}, which reads such videos, or {_LUMA_HINT.format(name=self._path.name)}",
            )


def _luma(picture: Picture) -> Picture:
    return np.asarray(from_colours(picture), np.uint8)


def _header(capture: cv2.VideoCapture) -> Header:
    rate = capture.get(cv2.CAP_PROP_FPS)
    return Header(
        lines=int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT)),
        columns=int(capture.get(cv2.CAP_PROP_FRAME_WIDTH)),
        pictures_per_s=rate if 1.0 <= rate <= 1000.0 else None,
        pictures=max(0, int(capture.get(cv2.CAP_PROP_FRAME_COUNT))),
        codec=_letters(capture.get(cv2.CAP_PROP_FOURCC)),
        pixels=_letters(capture.get(cv2.CAP_PROP_CODEC_PIXEL_FORMAT)),
    )


def check_size(path: Path, header: Header) -> None:
    """Checks that pictures are of a size that can be held.

    Raises:
        DeviceRefused: they are not.
    """
    if not (0 < header.lines <= LARGEST_SIDE_PX and 0 < header.columns <= LARGEST_SIDE_PX):
        raise DeviceRefused(
            f"{path} has pictures of {header}, expected at most {LARGEST_SIDE_PX} pixels each way",
            "record it at the size that the grabber gives",
        )


def _letters(code: float) -> str:
    raw = (int(code) & 0xFFFFFFFF).to_bytes(4, "little").rstrip(b"\0 ")
    return "".join(chr(value) if 32 < value < 127 else f"[{value}]" for value in raw)


def _read(path: Path, setting: tuple[int, float]) -> Iterator[tuple[float, Picture]]:
    with _opened(path) as capture:
        capture.set(*setting)
        while True:
            with _quiet():
                there, picture = capture.read()
            if not there:
                return
            yield capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3, np.asarray(picture, np.uint8)


@contextmanager
def _opened(path: Path) -> Iterator[cv2.VideoCapture]:
    if not cv2.videoio_registry.hasBackend(cv2.CAP_FFMPEG):
        raise DeviceRefused(
            f"{path}: this OpenCV reads no videos, it was built without FFmpeg",
            "install opencv-python-headless with pip, or play a folder of PNG pictures",
        )
    for name, value in _ENVIRONMENT.items():
        os.environ.setdefault(name, value)
    with _quiet():
        settings = [cv2.CAP_PROP_N_THREADS, 1]
        capture = cv2.VideoCapture(str(path.absolute()), cv2.CAP_FFMPEG, settings)
        capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
    try:
        if not capture.isOpened():
            raise DeviceRefused(
                f"{path} has no readable video: it is truncated or damaged, has only sound, or uses a "
                "codec that OpenCV does not know",
                f"copy it again, or {INSTALL}, or {_LUMA_HINT.format(name=path.name)}",
            )
        yield capture
    finally:
        capture.release()


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence OpenCV's messages on stderr."""
    logging: Any = getattr(cv2.utils, "logging", cv2)
    level = logging.getLogLevel()
    logging.setLogLevel(0)
    try:
        yield
    finally:
        logging.setLogLevel(level)
