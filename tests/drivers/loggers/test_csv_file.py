"""A CSV file that another program appends to."""

import codecs
import os
from pathlib import Path

import pytest

from grabberd.errors import DeviceAbsent, DeviceLost, DeviceRefused, StreamFailed
from grabberd.testing import ManualClock
from grabberd_loggers.csv_file import ROTATED, TRUNCATED, CsvLogger
from grabberd_loggers.line_logger import OVERLONG

HEADER = "time_s,p1 [kPa]\n"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "log.csv"
    path.write_text(f"{HEADER}0.00,40\n0.01,41\n")
    return path


def append(file: Path, text: str) -> None:
    with file.open("a") as end:
        end.write(text)


def test_only_what_is_written_from_now_on_is_read(file: Path) -> None:
    logger = CsvLogger(path=str(file))
    assert logger.open().channels == ("p1",)
    assert len(logger.read(0.0).time_ns) == 0
    append(file, "0.02,42\n0.03,43\n")
    assert logger.read(1.0).values.tolist() == [[42.0], [43.0]]
    logger.close()


def test_a_line_that_has_begun_is_read_once_it_is_complete(file: Path) -> None:
    append(file, "0.02,4")
    logger = CsvLogger(path=str(file))
    logger.open()
    append(file, "2\n")
    assert logger.read(1.0).values.tolist() == [[42.0]]
    logger.close()


def test_a_file_without_a_header_is_read_by_the_columns_of_the_options(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("1;2\n")
    logger = CsvLogger(path=str(path), columns=["p1 [mbar]", "p2 [mbar]"])
    assert logger.open().units == ("mbar", "mbar")
    append(path, "419,2;3\n")
    assert logger.read(1.0).values.tolist() == [[419.2, 3.0]]
    logger.close()


HEADS = {
    "quoted": '"time_s";"p1 [kPa]"\n',
    "row names with an empty head": '"";"time_s";"p1 [kPa]"\n',
    "row names without a head": '"time_s";"p1 [kPa]"\n',
    "units below": "time;p1\ns;kPa\n",
    "comments and words before": "# logger 7 [kPa]\nBarn 2; left\n\ntime_s;p1 [kPa]\n",
    "separator before": "sep=;\ntime_s;p1 [kPa]\n",
    "separators at the end": "time_s;p1 [kPa];\n",
}


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-be"])
@pytest.mark.parametrize("head", HEADS)
@pytest.mark.parametrize("rows_before", [0, 1, 9000])
def test_heads_rows_and_encodings_are_those_of_any_table(
    tmp_path: Path, head: str, encoding: str, rows_before: int
) -> None:
    form = {"row names": '"7";{};{}\r\n', "separators at the end": "{};{};\r\n"}.get(
        "row names" if head.startswith("row names") else head, "{};{}\r\n"
    )
    path = tmp_path / "log.csv"
    mark = codecs.BOM_UTF16_BE if encoding == "utf-16-be" else b""
    before = mark + (HEADS[head] + form.format("0,00", "40,5") * rows_before).encode(encoding)
    codec = {"utf-16": "utf-16-le", "utf-8-sig": "utf-8"}.get(encoding, encoding)
    line = form.format("0,01", "41,5").encode(codec)
    path.write_bytes(before + line[:3])  # half a letter of UTF-16
    logger = CsvLogger(path=str(path))
    info = logger.open()
    assert (info.channels, info.units) == (("p1",), ("kPa",))
    with path.open("ab") as end:
        end.write(line[3:5])
        end.flush()
        assert len(logger.read(0.0).time_ns) == 0
        end.write(line[5:] + form.format("0,02", "42,5").encode(codec))
    readings = logger.read(1.0)
    assert (readings.values.tolist(), readings.anomalies) == ([[41.5], [42.5]], ())
    logger.close()


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_header_that_comes_after_the_byte_order_mark_is_waited_for(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "log.csv"
    content = "time_s;p1 [kPa]\n0,00;41,5\n".encode(encoding)
    path.write_bytes(content[:2])
    logger = CsvLogger(path=str(path), clock=_Writing(path, content[2:]))
    assert logger.open().channels == ("p1",)
    assert logger.read(0.0).values.tolist() == [[41.5]]
    logger.close()


class _Writing(ManualClock):
    """A clock in whose first wait the rest of the file is written, in two pieces."""

    def __init__(self, path: Path, rest: bytes) -> None:
        super().__init__()
        self._path, self._pieces = path, [rest[:10], rest[10:]]

    def sleep(self, seconds: float) -> None:
        super().sleep(seconds)
        if self._pieces:
            with self._path.open("ab") as end:
                end.write(self._pieces.pop(0))


def test_units_that_contradict_the_header_end_the_stream(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time_s;p1_kpa\ns;mbar\n")
    with pytest.raises(StreamFailed, match="p1_kpa is in kPa, by the line below in mbar"):
        CsvLogger(path=str(path)).open()


def test_a_new_file_in_the_place_of_the_old_one_is_followed(file: Path) -> None:
    logger = CsvLogger(path=str(file))
    logger.open()
    append(file, "0.02,42\n0.0")  # its last line will never be complete
    file.rename(file.with_suffix(".1"))
    file.write_text(f"{HEADER}0.03,43\n")
    values, reasons = [], []
    for _ in range(3):
        readings = logger.read(0.0)
        values += readings.values[:, 0].tolist()
        reasons += [anomaly.reason for anomaly in readings.anomalies]
    assert values == [42.0, 43.0]
    assert reasons[:2] == [ROTATED, OVERLONG], "the line that has no end is counted"
    logger.close()


def test_a_truncated_file_is_read_from_its_start(file: Path) -> None:
    logger = CsvLogger(path=str(file))
    logger.open()
    file.write_text(HEADER)
    readings = logger.read(0.0)
    assert readings.anomalies[0].reason == TRUNCATED
    append(file, "0.02,42\n")
    assert logger.read(1.0).values.tolist() == [[42.0]]
    logger.close()


def test_a_new_file_with_other_columns_ends_the_stream(file: Path) -> None:
    logger = CsvLogger(path=str(file))
    logger.open()
    file.unlink()
    file.write_text("time_s,p1 [mbar]\n")
    with pytest.raises(StreamFailed, match="announces other columns"):
        logger.read(0.0)
    logger.close()


def test_a_file_that_is_gone_for_seconds_is_lost(file: Path) -> None:
    clock = ManualClock()
    logger = CsvLogger(path=str(file), clock=clock)
    logger.open()
    file.unlink()
    assert len(logger.read(0.0).time_ns) == 0
    clock.sleep(3)
    with pytest.raises(DeviceLost, match="is gone"):
        logger.read(0.0)
    logger.close()


def test_a_file_that_is_not_there_may_come_later(tmp_path: Path) -> None:
    with pytest.raises(DeviceAbsent, match="there is no file"):
        CsvLogger(path=str(tmp_path / "log.csv")).open()


def test_a_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DeviceRefused, match="cannot be opened"):
        CsvLogger(path=str(tmp_path)).open()


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_missing_rights_are_told(file: Path) -> None:
    file.chmod(0)
    with pytest.raises(DeviceRefused, match="may not be read"):
        CsvLogger(path=str(file)).open()
