"""A folder of pictures as a source: in the order, and with the numbers or times, that their names have."""

from collections.abc import Generator
from pathlib import Path

from grabberd.core.field import FieldOrder
from grabberd_replay.footage import Shown
from grabberd_replay.names import Names
from grabberd_replay.picture_file import SUFFIXES, read_picture

_LOSSY = (
    "Its pictures are JPEG, which is lossy: targets are displaced by more than their sigma says. Record PNG "
    "or TIFF."
)


class FolderSource:
    """The pictures of a folder.

    Raises:
        DeviceRefused: there are none, or their names contradict one another.
        PictureError: the first picture cannot be read.
    """

    rate_hz: float | None = None
    bits: int | None = None
    marked: FieldOrder | None = None
    expected = 0
    fault = ""

    def __init__(self, directory: Path) -> None:
        self.path = directory
        self._names = Names.of(directory)
        first = self._names.paths[0]
        self._header, _ = read_picture(first)
        self.lines, self.columns = self._header.lines, self._header.columns
        self.details = self._header.details
        lossy = (_LOSSY,) if SUFFIXES[first.suffix.lower()] == "JPEG" else ()
        self.remarks = (*self._names.remarks, *lossy)

    def pictures(self) -> Generator[Shown, None, None]:
        """The pictures, each read when it is its turn.

        Raises:
            PictureError: one is missing, damaged, or unlike the first.
        """
        names = self._names
        for at, path in enumerate(names.paths):
            _, samples = read_picture(path, self._header)
            time_s = names.times_s[at] if names.times_s else None
            yield Shown(str(path), samples, time_s, names.numbers[at] if names.numbers else None)
