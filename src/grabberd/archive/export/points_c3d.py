"""The points of a run as C3D: a frame for each field, lost ones included, and a marker for each target.

The capture's channels are analog channels, which C3D knows only at a multiple of the rate of the frames.
"""

from collections.abc import Generator, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd import __version__
from grabberd.archive.capture.digests import Damage
from grabberd.archive.export.c3d_file import (
    NO_ANALOG,
    Analog,
    Markers,
    c3d_frames,
    c3d_head,
    c3d_padding,
    c3d_scale_mm,
)
from grabberd.archive.export.channel_samples import ChannelSamples, channel_samples
from grabberd.archive.export.point_grid import GridTargets, PointGrid, position_sigma_mm
from grabberd.archive.export.points_export import points_about, points_file
from grabberd.archive.export.read_back import c3d_check
from grabberd.errors import NotFound

FRAMES_AT_ONCE = 500
"""Frames in memory at once: a gap of days is made of empty ones."""

_LONGEST_LABEL = 32


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
        markers = _markers(grid)._replace(analog=_analog(samples))
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


_Place = tuple[int, int | None, int | None]
"""Id of a target, and its row and column on the target grid where they are known."""


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


def _analog(samples: ChannelSamples | None) -> Analog:
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
