"""Kind of a video file, recognised by its first bytes and never by its name.

FFmpeg opens much more than videos (text as a picture of it, playlists that name other files): only the
containers listed here are passed to it.
"""

import os
import re
from pathlib import Path
from typing import NamedTuple

from grabberd.errors import DeviceRefused
from grabberd.files.held_files import hold


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
