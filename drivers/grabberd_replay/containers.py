"""Kind of a video file, told by its first bytes and never by its name.

FFmpeg opens much more than videos (text as a picture of it, playlists that name other files): only what is
listed here is given to it.
"""

import re
from pathlib import Path
from typing import NamedTuple

from grabberd.errors import DeviceRefused


class Container(NamedTuple):
    """A kind of video file.

    Attributes:
        name: as people call it.
        head: what such a file begins with.
        counts: its head says how many pictures there are, unless whoever wrote it was cut off.
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
    Container("NUT", re.compile(rb"nut/multimedia container")),
)

KINDS = ", ".join(container.name for container in CONTAINERS)

_HEAD_BYTES = 189


def container_of(path: Path) -> Container | None:
    """The kind of video that a file begins like; None if it is none of them.

    Raises:
        DeviceRefused: it cannot be read at all.
    """
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD_BYTES)
    except OSError as error:
        raise DeviceRefused(
            f"{path} cannot be read: {error.strerror}", "correct the file's permissions"
        ) from error
    return next((container for container in CONTAINERS if container.head.match(head)), None)
