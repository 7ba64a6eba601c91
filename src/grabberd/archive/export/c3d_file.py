"""The points of a run as C3D, the format of motion analysis, in single precision.

There is a frame for each field, lost ones included, and a marker for each target. The capture's channels are
analog channels, which C3D knows only at a multiple of the rate of the frames.
The format: https://www.c3d.org/HTML/default.htm
"""

import struct
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd import __version__
from grabberd.archive.capture.digests import Damage
from grabberd.archive.export.channels_export import ChannelSamples, channel_samples
from grabberd.archive.export.point_grid import GridTargets, PointGrid, position_sigma_mm
from grabberd.archive.export.points_export import points_about, points_file
from grabberd.archive.export.read_back import c3d_check
from grabberd.errors import InputError, NotFound

BLOCK = 512
MOST_FRAMES = 1 << 24
"""A longer file has a number of frames that LONG_FRAMES, in single precision, does not hold exactly."""
LONGEST_COUNT = 0xFFFF
"""Of frames in the head, and of markers."""
BOTH_VIEWS = 0b11
"""The mask of the cameras that see a marker."""

_MOST_BLOCKS = 255
_LABELS = 255
"""Entries of an array of labels; those beyond go into LABELS2, LABELS3 and so on."""
_LONGEST_TEXT = 255
_GREATEST_RESIDUAL = 255
_GREATEST_COORDINATE = 32_000
"""Of points as integers, which a program may convert a file to."""
_INTEL = 84
_TEXT, _WORD, _REAL = -1, 2, 4
_HINT = "csv, parquet and mat have room for it"
_Parameter = tuple[str, bytes]
"""Name of a parameter and its type, dimensions, values and description."""
FRAMES_AT_ONCE = 500
"""Frames in memory at once: a gap of days is made of empty ones."""
_LONGEST_LABEL = 32
_Place = tuple[int, int | None, int | None]
"""Id of a target, and its row and column on the target grid where they are known."""


class Analog(NamedTuple):
    """Description of the analog channels: a label, a unit and a few words for each.

    Attributes:
        samples: Samples to each frame.
    """

    labels: Sequence[str]
    units: Sequence[str]
    descriptions: Sequence[str]
    samples: int

    @property
    def words(self) -> int:
        """Numbers of them in a frame."""
        return self.samples * len(self.labels)


NO_ANALOG = Analog((), (), (), 0)


class Markers(NamedTuple):
    """Description of the markers, before the first frame.

    Attributes:
        labels: A label for each.
        descriptions: A few words on each.
        frames: Number of frames.
        rate_hz: Frames a second.
        scale_mm: Unit of residuals, and of coordinates if a program converts them to integers.
        about: Texts of the file's own group of parameters, by name.
        analog: The analog channels beside them.
    """

    labels: Sequence[str]
    descriptions: Sequence[str]
    frames: int
    rate_hz: float
    scale_mm: float
    about: Mapping[str, str]
    analog: Analog = NO_ANALOG

    @property
    def words(self) -> int:
        """Numbers in a frame."""
        return 4 * len(self.labels) + self.analog.words


def c3d_scale_mm(reach_mm: float, sigma_mm: float) -> float:
    """The unit in which the greatest coordinate fits into an integer, and the greatest σ into a residual."""
    return max(reach_mm / _GREATEST_COORDINATE, sigma_mm / _GREATEST_RESIDUAL) or 1e-3


def c3d_head(markers: Markers) -> bytes:
    """The head of a file and its parameters.

    Raises:
        InputError: There are more frames or markers than the format has room for.
    """
    _check_room("frames", markers.frames, MOST_FRAMES)
    _check_room("targets", len(markers.labels), LONGEST_COUNT)
    size = len(_parameters(markers, 0)) + 6
    blocks = -(-size // BLOCK)
    if blocks > _MOST_BLOCKS:
        raise InputError(f"C3D has no room for the labels of {len(markers.labels)} targets", _HINT)
    first = 2 + blocks
    head = struct.pack(
        "<BBHHHHHfHHf",
        *(2, 0x50, len(markers.labels), markers.analog.words, 1, min(markers.frames, LONGEST_COUNT), 0),
        *(-markers.scale_mm, first, markers.analog.samples, markers.rate_hz),
    )
    section = bytes((1, 0x50, blocks, _INTEL)) + _parameters(markers, first)
    return head.ljust(BLOCK, b"\0") + section.ljust(blocks * BLOCK, b"\0")


def c3d_frames(
    xyz_mm: NDArray[np.float64], sigma_mm: NDArray[np.float64], scale_mm: float
) -> NDArray[np.float32]:
    """(K, T, 4) words of K frames from (K, T, 3) positions, NaN where there is none, and their (K, T) σ."""
    found = np.isfinite(xyz_mm).all(axis=2)
    words = np.zeros((*found.shape, 4), "<f4")
    words[found, :3] = xyz_mm[found]
    # A residual of 0 would say that the point was interpolated.
    residual = np.clip(np.rint(sigma_mm[found] / scale_mm), 1, _GREATEST_RESIDUAL)
    words[found, 3] = (BOTH_VIEWS << 8) + residual
    words[~found, 3] = -1.0
    return words


def c3d_padding(markers: Markers) -> bytes:
    """The words after the last frame, up to the end of its block: zeros.

    Where the count in the head has reached its limit, some programs read frames up to the end of the file:
    the words are those of missing markers then.
    """
    count = -markers.frames * markers.words * 4 % BLOCK
    if markers.frames < LONGEST_COUNT:
        return bytes(count)
    frame = struct.pack("<4f", 0.0, 0.0, 0.0, -1.0) * len(markers.labels) + bytes(4 * markers.analog.words)
    return (frame * (count // len(frame) + 1))[:count]


def _check_room(what: str, count: int, most: int) -> None:
    if count > most:
        raise InputError(f"the points have {count} {what}, and C3D has room for {most}", _HINT)


def _parameters(markers: Markers, first_block: int) -> bytes:
    groups = {
        "POINT": _point(markers, first_block),
        "ANALOG": _analog(markers.analog, markers.rate_hz),
        "TRIAL": _trial(markers),
        "GRABBERD": [_text(name, [text]) for name, text in markers.about.items()],
    }
    return b"".join(
        _entry(name, -number, bytes(1))
        + b"".join(_entry(one, number, content) for one, content in parameters)
        for number, (name, parameters) in enumerate(groups.items(), 1)
    )


def _point(markers: Markers, first_block: int) -> list[_Parameter]:
    count = markers.frames
    parameters = [
        _words("USED", len(markers.labels)),
        _real("SCALE", -markers.scale_mm),
        _real("RATE", markers.rate_hz),
        _words("DATA_START", first_block),
        _words("FRAMES", min(count, LONGEST_COUNT)),
        _text("UNITS", ["mm"]),
        # As the left view shows the object: +X runs down the picture, +Y to the right.
        _text("X_SCREEN", ["+Y"]),
        _text("Y_SCREEN", ["-X"]),
    ]
    if count > LONGEST_COUNT:
        parameters.append(_real("LONG_FRAMES", count))
    for name, texts in (("LABELS", markers.labels), ("DESCRIPTIONS", markers.descriptions)):
        for number, first in enumerate(range(0, len(texts), _LABELS), 1):
            some = texts[first : first + _LABELS]
            parameters.append(_text(name if number == 1 else f"{name}{number}", some, is_array=True))
    return parameters


def _analog(analog: Analog, rate_hz: float) -> list[_Parameter]:
    """Programs look for the group even where there is no channel."""
    count = len(analog.labels)
    texts = (("LABELS", analog.labels), ("DESCRIPTIONS", analog.descriptions), ("UNITS", analog.units))
    scale = _content(_REAL, [count], struct.pack(f"<{count}f", *[1.0] * count))
    offset = _content(_WORD, [count], struct.pack(f"<{count}h", *[0] * count))
    return [
        _words("USED", count),
        *(_text(name, some, is_array=True) for name, some in texts),
        _real("GEN_SCALE", 1.0),
        *(("SCALE", scale), ("OFFSET", offset)),
        _real("RATE", analog.samples * rate_hz),
    ]


def _trial(markers: Markers) -> list[_Parameter]:
    """First and last frame in two words each, the lower one first: the way of long files."""
    return [
        _words("ACTUAL_START_FIELD", 1, 0),
        _words("ACTUAL_END_FIELD", markers.frames & 0xFFFF, markers.frames >> 16),
        _real("CAMERA_RATE", markers.rate_hz),
    ]


def _entry(name: str, group: int, content: bytes) -> bytes:
    """A group or parameter; the distance to the next one counts from its own place."""
    return (
        struct.pack("<bb", len(name), group) + name.encode() + struct.pack("<h", len(content) + 2) + content
    )


def _content(kind: int, dimensions: Sequence[int], values: bytes) -> bytes:
    return struct.pack("<bB", kind, len(dimensions)) + bytes(dimensions) + values + bytes(1)


def _words(name: str, *values: int) -> _Parameter:
    dimensions = [len(values)] if len(values) > 1 else []
    return name, _content(_WORD, dimensions, struct.pack(f"<{len(values)}H", *values))


def _real(name: str, value: float) -> _Parameter:
    return name, _content(_REAL, [], struct.pack("<f", value))


def _text(name: str, texts: Iterable[str], is_array: bool = False) -> _Parameter:
    """A text, or an array of texts filled up to the same length with spaces."""
    encoded = [_encoded(text) for text in texts]
    longest = max(map(len, encoded), default=0)
    dimensions = [longest, len(encoded)] if is_array else [longest]
    return name, _content(_TEXT, dimensions, b"".join(one.ljust(longest) for one in encoded))


def _encoded(text: str) -> bytes:
    """UTF-8, at most as long as a text can be, and without half a character at its end."""
    return text.encode()[:_LONGEST_TEXT].decode(errors="ignore").encode()


def points_c3d(
    path: Path, run: int | None = None, left_out: list[Damage] | None = None
) -> Generator[bytes, None, None]:
    """A C3D file as it is made; errors are raised at once, before the first bytes.

    Raises:
        CaptureFileError, NotFound: No such file or run, or it has no points.
        InputError: It has more fields or targets than the format has room for.
    """
    return _c3d(_opened(path, run, left_out))


def export_c3d(
    path: Path, directory: Path, run: int | None = None, left_out: list[Damage] | None = None
) -> int:
    """Writes `points.c3d` and `ledger.csv` into a folder; returns the number of points.

    Raises:
        CaptureFileError, NotFound, InputError, StorageError: See `points_c3d` and `export_csv`.
    """
    opened = _opened(path, run, left_out)
    markers, grid = opened.markers, opened.grid
    check = c3d_check(len(markers.labels), markers.frames, grid.points, markers.analog.words)
    with grid, points_file(path, directory, "points.c3d", check, left_out) as file:
        file.writelines(_c3d(opened))
    return grid.points


class _Opened(NamedTuple):
    """The parts of a file: points, channels, and its head."""

    grid: PointGrid
    samples: ChannelSamples | None
    markers: Markers
    head: bytes


def _opened(path: Path, run: int | None, left_out: list[Damage] | None) -> _Opened:
    grid = PointGrid.open(path, run, left_out)
    try:
        samples = channel_samples(grid.reader, grid.first_n, grid.fields)
        markers = _markers(grid)._replace(analog=_analog_channels(samples))
        return _Opened(grid, samples, markers, c3d_head(markers))
    except Exception:
        grid.reader.close()
        raise


def _markers(grid: PointGrid) -> Markers:
    if not grid.fields or not len(grid.targets):
        hint = "its coverage says why no target was found: grabberd measure, or the capture's page"
        raise NotFound(f"run {grid.run.run} of capture {grid.reader.meta.id} has no points", hint)
    about = points_about(grid.reader, grid.run.run)
    texts = {
        "CAPTURE": about["capture"],
        "CREATED_UTC": about["created_utc"],
        "RUN": str(about["run"]),
        "CALIBRATION": about["calibration"] or "",
        "VERDICT": about["verdict"] or "",
        "FIRST_N": str(grid.first_n),
        "VERSION": __version__,
    }
    return Markers(
        labels=[_label(one) for one in _places(grid.targets)],
        descriptions=[_description(one) for one in _places(grid.targets)],
        frames=grid.fields,
        rate_hz=grid.reader.meta.rate_hz,
        scale_mm=c3d_scale_mm(grid.reach_mm, grid.sigma_mm),
        about={name: text for name, text in texts.items() if text},
    )


def _places(targets: GridTargets) -> Iterator[_Place]:
    columns = targets.target.tolist(), targets.row.tolist(), targets.column.tolist()
    for target, row, column in zip(*columns, strict=True):
        yield (target, None, None) if row != row else (target, int(row), int(column))  # noqa: PLR0124 - NaN


def _label(place: _Place) -> str:
    target, row, column = place
    label = f"T{target:03d}"
    whole = label if row is None else f"{label}_R{row:02d}_C{column:02d}"
    return whole if len(whole) <= _LONGEST_LABEL else label


def _description(place: _Place) -> str:
    target, row, column = place
    return f"target {target}" if row is None else f"target {target}, row {row}, column {column}"


def _analog_channels(samples: ChannelSamples | None) -> Analog:
    if samples is None:
        return NO_ANALOG
    channels = samples.channels
    return Analog(
        labels=[one.name for one in channels],
        units=["kPa" if one.quantity.is_vacuum else one.calibration.unit for one in channels],
        descriptions=[f"{one.quantity}, logger {one.logger}" for one in channels],
        samples=samples.per_field,
    )


def _c3d(opened: _Opened) -> Generator[bytes, None, None]:
    grid, samples, markers, head = opened
    with grid:
        yield head
        done = 0
        for xyz_mm, sigma_mm in _frames(grid):
            words = c3d_frames(xyz_mm, sigma_mm, markers.scale_mm).reshape(len(xyz_mm), -1)
            if samples is not None:
                some = slice(done * samples.per_field, (done + len(words)) * samples.per_field)
                words = np.hstack([words, samples.values[some].reshape(len(words), -1)])
            done += len(words)
            yield words.astype("<f4").tobytes()
        yield c3d_padding(markers)


def _frames(grid: PointGrid) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Positions and σ of some frames at a time, from the first to the last without a gap."""
    done = 0
    for fields, places, rows in grid.parts():
        xyz_mm = np.column_stack([rows[f"{axis}_mm"] for axis in "xyz"])
        sigma_mm = position_sigma_mm(rows)
        # A part may reach over a gap of any length, so it is taken in steps of frames as well.
        for end in _ends(done, int(fields[-1]) + 1 if len(fields) else done):
            chosen = (fields >= done) & (fields < end)
            block = _empty(end - done, len(grid.targets))
            block[0][fields[chosen] - done, places[chosen]] = xyz_mm[chosen]
            block[1][fields[chosen] - done, places[chosen]] = sigma_mm[chosen]
            yield block
            done = end
    for end in _ends(done, grid.fields):
        yield _empty(end - done, len(grid.targets))
        done = end


def _ends(begin: int, end: int) -> Iterator[int]:
    for first in range(begin, end, FRAMES_AT_ONCE):
        yield min(first + FRAMES_AT_ONCE, end)


def _empty(frames: int, targets: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return np.full((frames, targets, 3), np.nan), np.full((frames, targets), np.nan)
