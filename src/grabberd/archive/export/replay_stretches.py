"""Stretches of a capture for its replay: some fields' points, or their pictures, as one binary message.

A page that plays fifty fields a second cannot ask for each, and a second of points as JSON is half a
megabyte, which it would have to read number by number. docs/reference/replay.md has both byte for byte.
"""

import struct
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.content import PointArrays
from grabberd.archive.capture.reader import CaptureReader, Opened
from grabberd.archive.capture.rows import RecordedField
from grabberd.archive.export.field_pictures import picture_png
from grabberd.archive.export.points_columns import sigma_mm
from grabberd.core.ledger import Outcome

VERSION = 1
MOST_POINT_FIELDS = 250
"""Fields of a stretch of points: five seconds, a megabyte of a hundred targets."""
MOST_PICTURES = 50
"""Fields of a stretch of pictures: eight bits of a second are some eight megabytes."""
POINTS_MAGIC, PICTURES_MAGIC = b"GRRP", b"GRRF"
POINTS_HEADER = struct.Struct("<4sHHQIIQ")
"""Magic, version, its own size, first field, number of fields, number of points, run."""
PICTURES_HEADER = struct.Struct("<4sHHQII")
"""Magic, version, its own size, first field, number of pictures, nothing."""
PICTURE = struct.Struct("<IIHHBxxx")
"""Of each: number from the first field on, bytes of its PNG, y0, y_step, outcome."""
OUTCOMES = (Outcome.RECEIVED, Outcome.DAMAGED, Outcome.NO_SIGNAL)
"""Outcomes of fields that are in the file, as they are numbered in a message."""


class Stretch(NamedTuple):
    """Consecutive fields of a capture.

    Attributes:
        first_n: Number of the first field.
        end_n: Number after the last one.
    """

    first_n: int
    end_n: int


def replay_points(path: Path, run: int | None, stretch: Stretch, opened: Opened = CaptureReader) -> bytes:
    """The points of a stretch, columns of all its fields together, the widest numbers first.

    Args:
        path: The capture.
        run: Number of the run; None: the newest.
        stretch: The fields; those without points are left out.
        opened: Opens the capture.

    Raises:
        CaptureFileError, NotFound: No such file or run.
    """
    with opened(path) as reader:
        number = reader.run_number(run)
        begin_ns = reader.first_time_ns or 0
        groups = list(reader.point_arrays(number, stretch.first_n, stretch.end_n))
    columns = [_point_columns(group, stretch.first_n, begin_ns) for group in groups]
    fields, points = sum(len(one.n) for one in groups), sum(len(one.points) for one in groups)
    header = POINTS_HEADER.pack(
        POINTS_MAGIC, VERSION, POINTS_HEADER.size, stretch.first_n, fields, points, number
    )
    return header + b"".join(column.tobytes() for parts in zip(*columns, strict=True) for column in parts)


def _point_columns(group: PointArrays, first_n: int, begin_ns: int) -> tuple[NDArray[np.generic], ...]:
    """Columns of the fields, then of the points; every width is a multiple of four, so all are aligned."""
    points = group.points
    sigma = np.sqrt((sigma_mm(points.covariance_mm2) ** 2).sum(axis=1))
    return (
        ((group.time_ns - begin_ns) / 1e9).astype("<f8"),
        (group.n - first_n).astype("<u4"),
        group.counts.astype("<u4"),
        points.target.astype("<u4"),
        points.xyz_mm.astype("<f4"),
        sigma.astype("<f4"),
        points.residual_px.astype("<f4"),
        points.image_px.reshape(-1, 4).astype("<f4"),
    )


def replay_pictures(path: Path, stretch: Stretch, opened: Opened = CaptureReader) -> bytes:
    """The pictures of a stretch as PNG, each with its place in the frame and what became of its field.

    Args:
        path: The capture.
        stretch: The fields; those that are not in the file are left out.
        opened: Opens the capture.

    Raises:
        CaptureFileError: No such file.
    """
    with opened(path) as reader:
        fields = [(field, picture_png(field)) for field in reader.fields(*stretch)]
    header = PICTURES_HEADER.pack(
        PICTURES_MAGIC, VERSION, PICTURES_HEADER.size, stretch.first_n, len(fields), 0
    )
    places = (_place(field, len(png), stretch.first_n) for field, png in fields)
    return b"".join((header, *places, *(png for _, png in fields)))


def _place(field: RecordedField, length: int, first_n: int) -> bytes:
    n, packed = field.numbered.n, field.numbered.packed
    return PICTURE.pack(n - first_n, length, packed.y0, packed.y_step, OUTCOMES.index(field.outcome))
