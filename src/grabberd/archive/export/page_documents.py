"""Points and channels of a capture as documents, thinned out to what a page can draw."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.checked_rows import END
from grabberd.archive.capture.meta import SEALED
from grabberd.archive.capture.reader import CaptureReader, Opened
from grabberd.archive.capture.reading_groups import RecordedChannel
from grabberd.archive.capture.recorded_channels import verdict_on
from grabberd.archive.export.points_columns import sigma_mm
from grabberd.core.channels.account import AnomalyCount, ChannelAccount
from grabberd.core.reconstruction.points import Points
from grabberd.documents.channels import CaptureChannelsDocument
from grabberd.documents.points import FieldPoints, PointsDocument

AXES = "xyz"
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
    return min(query.end_n, reader.ledger.end_n or 0)


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
        account, begin_ns = reader.channels.account, reader.first_time_ns or 0
        accounts = {one.name: one for one in account.channels} if account else {}
        known = {
            "capture": reader.meta.id,
            **verdict_on(account, sealed=reader.meta.state == SEALED),
            "anomalies": [_counted(one, begin_ns) for one in (account.anomalies if account else ())],
            "channels": [
                {
                    **_described(one, accounts.get(one.name), begin_ns),
                    **_thinned_out(reader, one, begin_ns, most),
                }
                for one in reader.channels.all
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
