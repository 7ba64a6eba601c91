"""Channels of a capture as CSV and Parquet: streams and files, half a second at a time."""

import json
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import IO

from grabberd.archive.capture.digests import Damage
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.export.channel_columns import CHANNEL_COLUMNS, channel_rows
from grabberd.archive.export.csv_file import csv_text
from grabberd.archive.export.parquet_file import write_parquet
from grabberd.archive.export.read_back import csv_check, parquet_check
from grabberd.core.chain.columns import ROWS_AT_ONCE, Rows, joined
from grabberd.files.checked_file import checked_file

_NAMES = [column.name for column in CHANNEL_COLUMNS]


def channels_csv(path: Path) -> Generator[str, None, None]:
    """Text of a CSV file; only a header for a capture without channels.

    Raises:
        CaptureFileError: No such file, or its channels are damaged; told before the first text.
    """
    with CaptureReader(path) as reader:
        for channel in reader.channels.all:
            for _ in reader.channels.groups(channel):
                pass  # whoever sends them could not take back what was sent before the damage
    return _csv(path)


def _csv(path: Path) -> Generator[str, None, None]:
    with CaptureReader(path) as reader:
        yield from csv_text(CHANNEL_COLUMNS, channel_rows(reader))


def export_channels(path: Path, directory: Path, suffix: str, left_out: list[Damage] | None = None) -> int:
    """Writes `channels.csv` or `channels.parquet` into a folder, if the capture has channels.

    Args:
        path: The capture.
        directory: An existing folder.
        suffix: "csv" or "parquet".
        left_out: Takes up damaged readings, which are left out; None: they are an error.

    Returns:
        Number of readings.

    Raises:
        CaptureFileError: They are damaged, and are not to be left out.
        StorageError: The file cannot be written.
        ExtraMissing: pyarrow is not installed.
    """
    with CaptureReader(path, left_out) as reader:
        if not reader.channels.all:
            return 0
        rows = 0
        check = (csv_check if suffix == "csv" else parquet_check)(_NAMES, lambda: rows)
        with checked_file(directory / f"channels.{suffix}", check) as file:
            rows = _write_csv(reader, file) if suffix == "csv" else _write_parquet(reader, file)
        return rows


def _write_csv(reader: CaptureReader, file: IO[bytes]) -> int:
    rows = -1  # the head
    for text in csv_text(CHANNEL_COLUMNS, channel_rows(reader)):
        file.write(text.encode())
        rows += text.count("\n")
    return rows


def _write_parquet(reader: CaptureReader, file: IO[bytes]) -> int:
    calibrations = {one.name: one.calibration._asdict() for one in reader.channels.all}
    about = {"capture": reader.meta.id, "calibrations": calibrations}
    metadata = {"grabberd": json.dumps(about, ensure_ascii=False)}
    return write_parquet(file, CHANNEL_COLUMNS, _parts(channel_rows(reader)), metadata)


def _parts(groups: Iterator[Rows]) -> Iterator[Rows]:
    """Groups joined until they have some thousand rows."""
    some: list[Rows] = []
    for rows in groups:
        some.append(rows)
        if sum(len(one["time_s"]) for one in some) >= ROWS_AT_ONCE:
            yield joined(CHANNEL_COLUMNS, some)
            some = []
    if some:
        yield joined(CHANNEL_COLUMNS, some)
