"""A page's view of a capture: points and channels thinned out, and stretches of it for its replay.

A page that plays fifty fields a second cannot ask for each, and a second of points as JSON is half a
megabyte, which it would have to read number by number. docs/reference/replay.md has both byte for byte.
"""

import struct
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.content import PointArrays
from grabberd.archive.capture.digests import END
from grabberd.archive.capture.meta import SEALED
from grabberd.archive.capture.reader import CaptureReader, Opened
from grabberd.archive.capture.reading_groups import RecordedChannel
from grabberd.archive.capture.recorded_channels import verdict_on
from grabberd.archive.capture.rows import RecordedField
from grabberd.archive.export.field_pictures import picture_png
from grabberd.archive.export.points_columns import sigma_mm
from grabberd.core.channels.account import AnomalyCount, ChannelAccount
from grabberd.core.ledger import Outcome
from grabberd.core.reconstruction.points import Points
from grabberd.documents.channels import CaptureChannelsDocument
from grabberd.documents.points_frame import FieldPoints, PointsDocument

AXES = "xyz"
MOST_READINGS = 800_000
"""Readings of all channels together."""
_END = b"]}"
"""End of the JSON of a document that ends with its list of fields."""


@dataclass(frozen=True, slots=True)
class PointsQuery:
    """Selection of points.

    Attributes:
        run: number of the run; None: the newest.
        first_n: number of the first field; `end_n`: number after the last one.
        every: only fields whose number is a multiple of it; an odd one keeps both parities.
        most: `every` is raised until no more points than this are left.
        targets: ids of the targets; empty: all.
    """

    run: int | None = None
    first_n: int = 0
    end_n: int = END
    every: int = 1
    most: int = 20_000
    targets: Collection[int] = ()


def points_json(path: Path, query: PointsQuery, opened: Opened = CaptureReader) -> bytearray:
    """The points of a run as the JSON of a `PointsDocument`, written field by field.

    Written at once, two million numbers would keep the interpreter from every other thread for as long, and
    joined from parts they would take three times their 50 MB of memory.

    Args:
        path: The capture.
        query: What is asked for.
        opened: Opens the capture.

    Raises:
        CaptureFileError, NotFound: no such file or run.
    """
    with opened(path) as reader:
        run = reader.run_number(query.run)
        every = _every(reader, run, query)
        head = PointsDocument(capture=reader.meta.id, run=run, every=every, fields=[])
        document = bytearray(head.model_dump_json().encode().removesuffix(_END))
        for number, one in enumerate(_fields(reader, run, every, query)):
            document += b"," if number else b""
            document += one.model_dump_json().encode()
        document += _END
        return document


def _fields(reader: CaptureReader, run: int, every: int, query: PointsQuery) -> Iterator[FieldPoints]:
    first_ns = reader.first_time_ns or 0
    for n, time_ns, points in reader.timed_points(run, query.first_n, query.end_n, every):
        # Not validated: the columns come straight from arrays of known types, and pydantic would look at each
        # of up to two million numbers.
        yield FieldPoints.model_construct(
            n=n, time_s=(time_ns - first_ns) / 1e9, **point_columns(_of_targets(points, query.targets))
        )


def _every(reader: CaptureReader, run: int, query: PointsQuery) -> int:
    """Raised by what is too much until it fits, or one field is left; targets that are not wanted count."""
    every = query.every
    while (count := reader.point_count(run, query.first_n, query.end_n, every)) > query.most:
        if every > max(query.first_n, _last_n(reader, query)):
            break
        every *= -(-count // query.most)
    return every


def _last_n(reader: CaptureReader, query: PointsQuery) -> int:
    return min(query.end_n, reader.end_n)


def _of_targets(points: Points, targets: Collection[int]) -> Points:
    return points.select(np.isin(points.target, list(targets))) if targets else points


def point_columns(points: Points) -> dict[str, Any]:
    """The points of one field, by the columns' names in `PointColumns`."""
    return {
        "target": points.target.tolist(),
        **_axes("{}_mm", points.xyz_mm),
        **_axes("sigma_{}_mm", sigma_mm(points.covariance_mm2)),
        **_axes("calibration_sigma_{}_mm", sigma_mm(points.calibration_covariance_mm2)),
        "residual_px": points.residual_px.tolist(),
    }


def _axes(name: str, values: NDArray[np.float64]) -> dict[str, list[float]]:
    return {name.format(axis): values[:, i].tolist() for i, axis in enumerate(AXES)}


def channels_json(path: Path, most: int, opened: Opened = CaptureReader) -> bytes:
    """The JSON of a `CaptureChannelsDocument`.

    Args:
        path: The capture.
        most: Readings of a channel; of more, every second, third and so on is taken.
        opened: Opens the capture.

    Raises:
        CaptureFileError: No such file, or its channels are damaged.
    """
    with opened(path) as reader:
        account, begin_ns, channels = reader.channels.account, reader.first_time_ns or 0, reader.channels.all
        accounts = {one.name: one for one in account.channels} if account else {}
        known = {
            "capture": reader.meta.id,
            **verdict_on(account, sealed=reader.meta.state == SEALED),
            "anomalies": [_counted(one, begin_ns) for one in (account.anomalies if account else ())],
            "channels": [
                {
                    **_described(one, accounts.get(one.name), begin_ns),
                    **_thinned_out(reader, one, begin_ns, min(most, MOST_READINGS // len(channels))),
                }
                for one in channels
            ],
        }
    return CaptureChannelsDocument.model_validate(known).model_dump_json().encode()


def _counted(anomaly: AnomalyCount, begin_ns: int) -> dict[str, Any]:
    known = anomaly._asdict()
    first_ns = known.pop("time_ns")
    return {**known, "first_s": (first_ns - begin_ns) / 1e9}


def _described(channel: RecordedChannel, account: ChannelAccount | None, begin_ns: int) -> dict[str, Any]:
    gaps = account.gaps if account else ()
    return {
        "name": channel.name,
        "quantity": channel.quantity,
        "logger": channel.logger,
        "calibration": channel.calibration._asdict(),
        "gap_count": account.gap_count if account else 0,
        "gap_s": account.gap_ns / 1e9 if account else 0.0,
        "gaps": [
            {
                "first_s": (one.first_ns - begin_ns) / 1e9,
                "last_s": (one.last_ns - begin_ns) / 1e9,
                "reason": one.reason,
            }
            for one in gaps
        ],
    }


def _thinned_out(reader: CaptureReader, channel: RecordedChannel, begin_ns: int, most: int) -> dict[str, Any]:
    """Every k-th reading; what is left out is decoded and forgotten group by group."""
    count = reader.channels.count(channel)
    every = max(-(-count // most), 1)
    passed, time_s, values, datings, sigma_ns = 0, [np.empty(0)], [np.empty(0)], {}, 0
    for group in reader.channels.groups(channel):
        taken = slice(-passed % every, None, every)
        passed += len(group.time_ns)
        time_s.append((group.time_ns[taken] - begin_ns) / 1e9)
        values.append(channel.calibration.kpa(group.value[taken]))
        datings[group.dating] = True
        sigma_ns = max(sigma_ns, group.time_sigma_ns)
    shown = np.concatenate(values).round(4).tolist()
    is_vacuum = channel.quantity.is_vacuum
    return {
        "datings": list(datings),
        "sigma_time_s": sigma_ns / 1e9 if passed else None,
        "readings": count,
        "time_s": np.concatenate(time_s).round(6).tolist(),
        "kpa": shown if is_vacuum else [],
        "level": [] if is_vacuum else shown,
    }


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
