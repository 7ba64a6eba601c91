"""A folder of PNG pictures without a manifest as a recording."""

import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

from grabberd.core.field import FieldOrder
from grabberd.errors import DeviceRefused, PictureError
from grabberd_replay.levels import Levels
from grabberd_replay.pictures import Pictures, Splitter, recognise, usual_rate_hz
from grabberd_replay.png import Header, read_png
from grabberd_replay.recording import Batch, Recording

_NUMBER = re.compile(r"^(.*?)(\d+)(\D*)$")


class FolderRecording(Recording):
    """The pictures of a folder in the order of their names, a field every 1 / rate_hz from time zero.

    Raises:
        DeviceRefused: there are no pictures, or their kind or their rate cannot be told.
        PictureError: the first picture cannot be read.
    """

    def __init__(
        self,
        directory: Path,
        pictures: Pictures,
        order: FieldOrder,
        first_parity: int,
        rate_hz: float | None,
        bits: int | None = None,
    ) -> None:
        self._paths = in_order(directory)
        self._header, first = read_png(self._paths[0])
        self._levels = Levels.of(first, bits)
        pictures = recognise(self._paths[0], pictures, self._header.lines, self._header.columns)
        rate_hz = rate_hz or usual_rate_hz(directory, pictures, self._header.lines)
        self._splitter = Splitter(pictures, order, first_parity, rate_hz)
        self.format = self._splitter.format(
            self._header.lines,
            self._header.columns,
            details={**colours_of(self._header), **self._levels.details},
            remarks=self._levels.remarks,
        )

    def batches(self) -> Iterator[Batch]:
        """Fields of one picture at a time."""
        missing = missing_names(self._paths)
        for number, path in enumerate(self._paths):
            if path.name in missing:
                raise _missing(path.parent / missing[path.name], self._header)
            _, samples = read_png(path, self._header)
            yield self._splitter.batch(self._levels.grey(path, samples), number)


def in_order(directory: Path) -> list[Path]:
    """The PNG files of a folder, by name; numbers in names by their value.

    Raises:
        DeviceRefused: there are none.
    """
    paths = [path for path in directory.iterdir() if path.suffix.lower() == ".png"]
    if not paths:
        raise DeviceRefused(
            f"{directory} has no PNG pictures", "give a folder of PNG files or a capture file"
        )
    return sorted(paths, key=lambda path: [_piece(piece) for piece in re.split(r"(\d+)", path.name)])


def _piece(text: str) -> tuple[int, str]:
    return (int(text), text) if text.isdecimal() else (-1, text)


def missing_names(paths: Sequence[Path]) -> dict[str, str]:
    """Gaps in numbered names: for each picture after a gap, the missing name right before it.

    The regular step is the smallest one that occurs. Names without numbers, or with differing texts round
    them, show no gaps.
    """
    matches = [_NUMBER.match(path.name) for path in paths]
    found = [match.groups() for match in matches if match]
    if len(found) < len(paths) or len({(before, after) for before, _, after in found}) != 1 or len(paths) < 3:
        return {}
    numbers = [int(number) for _, number, _ in found]
    step = min(later - earlier for earlier, later in pairwise(numbers))
    pairs = zip(found, numbers, found[1:], numbers[1:], strict=False)
    return {
        "".join(later): f"{before}{number + step:0{len(digits)}d}{after}"
        for (before, digits, after), number, later, next_number in pairs
        if next_number - number > step > 0
    }


def _missing(path: Path, header: Header) -> PictureError:
    return PictureError(
        f"{path} is missing; expected {header}, since the pictures before and after it are numbered",
        "put it back, or number the pictures without gaps; what came before it is kept",
    )


def colours_of(header: Header) -> dict[str, str]:
    """Stream detail for pictures whose grey values were computed from colours."""
    return {"colours": "converted to luma by Rec. 601"} if header.coloured else {}
