"""The lines that loggers send: headers, numbers, and what is neither."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grabberd.tables import Column
from grabberd_loggers.lines import NO_TIME, NOT_A_NUMBER, OTHER_CELLS, Line, LineFormat

TWO = LineFormat.of_columns(["time_ms", "p1 [kPa]", "p2 [kPa]"])


@pytest.mark.parametrize(
    ("header", "columns"),
    [
        ("time_ms,p1 [kPa],p2 [mbar]", [("time_ms", "ms"), ("p1", "kPa"), ("p2", "mbar")]),
        ("time_s; p1_mbar; p2_mbar", [("time_s", "s"), ("p1_mbar", "mbar"), ("p2_mbar", "mbar")]),
        ("time (us)\tp1 (V)", [("time", "us"), ("p1", "V")]),
        ("# p1 [kPa] ", [("p1", "kPa")]),
        ("#p1_kpa p2_kpa", [("p1_kpa", "kPa"), ("p2_kpa", "kPa")]),
        ("time_s,pulsation_vacuum_kpa", [("time_s", "s"), ("pulsation_vacuum_kpa", "kPa")]),
        ("time_ms,vacuum", [("time_ms", "ms"), ("vacuum", None)]),
    ],
)
def test_a_header_names_columns_and_units(header: str, columns: list[tuple[str, str | None]]) -> None:
    found = LineFormat.of_header(header)
    assert found is not None
    assert found.columns == tuple(Column(*column) for column in columns)


@pytest.mark.parametrize("line", ["1.0,2.0", "# Vacuum logger 1.2", "ready", "p1,p2", ""])
def test_other_lines_are_no_header(line: str) -> None:
    assert LineFormat.of_header(line) is None


@pytest.mark.parametrize(
    ("header", "says"),
    [
        ("time_ms,p1,p1", "p1 is given twice"),
        ("time_ms", "no column is measured"),
        ("time_ms,time_s,p1", "more than one column is the time"),
        ("time_ms,3p", "cannot be the name"),
        ("time [min],p1", "the time's unit"),
        ("time_ms," + ",".join(f"p{i}" for i in range(70)), "more than 64"),
    ],
)
def test_a_header_that_cannot_be_used_says_why(header: str, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        LineFormat.of_header(header)


@pytest.mark.parametrize(
    "line",
    [
        "12005,41.93,0.02",
        "12005;41,93;0,02",
        "12005\t41,93\t0.02",
        "12005 41.93 0.02",
        "12005 , 41.93 , 2e-2",
    ],
)
def test_cells_are_separated_by_what_the_line_has(line: str) -> None:
    assert TWO.read(line) == Line(12_005_000_000, (41.93, 0.02))


def test_a_header_settles_the_separator() -> None:
    found = LineFormat.of_header("time_ms;p1 [kPa]")
    assert found is not None
    assert found.read("12,5;41,9") == Line(12_500_000, (41.9,))


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("12005,41.93", OTHER_CELLS),
        ("12005,41.93,0.02,7", OTHER_CELLS),
        ("12005,41.93,0.0x", NOT_A_NUMBER),
        ("12005,inf,0.02", NOT_A_NUMBER),
        ("12005,1_000,0.02", NOT_A_NUMBER),
        (",41.93,0.02", NO_TIME),
        ("\ufffd\ufffd", OTHER_CELLS),
    ],
)
def test_nonsense_has_a_reason(line: str, reason: str) -> None:
    assert TWO.read(line) == reason


@pytest.mark.parametrize("cell", ["", "-", "nan", "NaN"])
def test_a_channel_may_have_no_reading(cell: str) -> None:
    line = TWO.read(f"12005,{cell},0.02")
    assert isinstance(line, Line)
    assert math.isnan(line.values[0])


def test_an_ignored_column_may_hold_anything() -> None:
    found = LineFormat.of_columns(["-", "p1 [kPa]"])
    assert found.read("14:33:01,41.9") == Line(None, (41.9,))
    assert [column.name for column in found.channels] == ["p1"]


@pytest.mark.parametrize(("line", "step_ns"), [("12005,1,2", 1e6), ("12005.25,1,2", 1e4)])
def test_decimals_tell_the_step_of_the_loggers_time(line: str, step_ns: float) -> None:
    assert TWO.time_step_ns(line) == pytest.approx(step_ns)


@given(st.text(max_size=80))
def test_any_text_is_a_line_or_has_a_reason(text: str) -> None:
    assert isinstance(TWO.read(text), Line | str)


@given(st.text(max_size=80))
def test_any_text_is_a_header_or_none_or_refused(text: str) -> None:
    try:
        found = LineFormat.of_header(text)
    except ValueError:
        return
    assert found is None or found.channels
