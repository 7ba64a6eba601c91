"""Channels of a capture as a document, thinned out to what a page can draw."""

from pathlib import Path
from typing import Any

import numpy as np

from grabberd.archive.capture.channels.reading_groups import RecordedChannel
from grabberd.archive.capture.meta import SEALED
from grabberd.archive.capture.reader import CaptureReader, Opened
from grabberd.core.channels.account import Account, AnomalyCount, ChannelAccount
from grabberd.documents.channels import CaptureChannelsDocument


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
            **_verdict(account, sealed=reader.meta.state == SEALED),
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


def _verdict(account: Account | None, *, sealed: bool) -> dict[str, Any]:
    if account is None:
        return {"verdict": None, "in_words": "no channels were recorded"}
    if not sealed:
        return {"verdict": None, "in_words": "being recorded"}
    return {"verdict": account.verdict, "in_words": account.in_words}


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
