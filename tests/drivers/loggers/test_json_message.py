"""JSON of sensors: values by their keys on any level, times in ISO 8601, and reasons that name the keys."""

import math

import pytest

from grabberd_loggers.lines import NOT_A_NUMBER, OTHER_CELLS, Column, Line, LineFormat
from grabberd_loggers.mqtt_topic import NOT_JSON, OTHER_KEYS, OTHER_UNIT, Unusable, cells_of

TASMOTA = '{"Time":"2026-03-01T10:00:00","BMP280":{"Temperature":20.1,"Pressure":602.1},"PressureUnit":"hPa"}'


def read(text: str, *columns: str) -> Line | str:
    line_format = LineFormat.of_columns(columns)
    return line_format.read(";".join(cells_of(text, line_format.columns)))


def refused(text: str, *columns: str) -> Unusable:
    with pytest.raises(Unusable) as caught:
        cells_of(text, [Column.of(column) for column in columns])
    return caught.value


def test_a_dotted_name_leads_to_a_value_on_another_level() -> None:
    assert read(TASMOTA, "BMP280.Pressure [hPa]") == Line(None, (602.1,))


def test_a_number_leads_into_a_list() -> None:
    text = '{"sensors": [{"p": 1.5}, {"p": 2.5}], "raw": [3, 4]}'
    assert read(text, "sensors.1.p [kPa]", "raw.0") == Line(None, (2.5, 3.0))


def test_a_key_may_have_a_dot_of_its_own() -> None:
    assert read('{"vacuum.p1": 41.5}', "vacuum.p1") == Line(None, (41.5,))


def test_a_name_that_is_only_the_end_of_a_key_is_refused_with_the_whole_key() -> None:
    one = refused(TASMOTA, "Pressure [hPa]")
    assert (one.reason, one.example) == (
        OTHER_KEYS,
        "the message's keys are Time, BMP280.Temperature, BMP280.Pressure, PressureUnit; "
        "Pressure is not among them; write BMP280.Pressure",
    )
    assert refused(TASMOTA, "BMP280.Temperature", "Pressure").reason == OTHER_KEYS


def test_a_message_without_any_of_the_columns_is_refused_with_its_keys() -> None:
    one = refused('{"state": "online", "Time": 1}', "Time", "p1", "p2")
    assert one.example == "the message's keys are state, Time; p1, p2 are not among them"
    assert refused("{}", "p1").example == "the message has no keys"
    assert len(refused('{"' + "x" * 4000 + '": 1}', "p1").example) < 400


@pytest.mark.parametrize(("stated", "column"), [("hPa", "hPa"), ("mbar", "hPa"), ("HPA", "hPa")])
def test_a_unit_that_the_message_states_may_be_that_of_the_column(stated: str, column: str) -> None:
    assert read(TASMOTA.replace('"hPa"', f'"{stated}"'), f"BMP280.Pressure [{column}]") == Line(
        None, (602.1,)
    )


def test_another_unit_than_that_of_the_column_is_refused_with_both() -> None:
    one = refused(TASMOTA.replace('"hPa"', '"mmHg"'), "BMP280.Pressure [hPa]")
    assert (one.reason, one.example) == (
        OTHER_UNIT,
        "the message says BMP280.Pressure is in mmHg, the column hPa",
    )


def test_a_key_that_is_missing_beside_others_is_no_reading_of_that_channel() -> None:
    line = read('{"time_ms": 1, "p1": 41.9}', "time_ms", "p1", "p2")
    assert str(line) == "Line(time_ns=1000000, values=(41.9, nan))"


@pytest.mark.parametrize(
    ("value", "number"),
    [('"602.1"', 602.1), ('"602,1"', 602.1), ("1e-7", 1e-7), ("null", None), ("NaN", None), ('""', None)],
)
def test_numbers_may_be_texts_and_nothing_is_no_reading(value: str, number: float | None) -> None:
    line = read(f'{{"p1": {value}}}', "p1")
    assert isinstance(line, Line)
    assert line.values == (number,) if number is not None else math.isnan(line.values[0])


@pytest.mark.parametrize(
    ("value", "cell"),
    [
        ("true", "p1=true"),
        ("Infinity", "inf"),
        ("{}", "p1={}"),
        ('"not available; 3"', "p1=not_available__3"),
        ('"1_0"', "p1=1_0"),
        ("9" * 400, "9" * 400),
    ],
)
def test_what_is_not_a_number_stands_with_its_key_in_one_cell(value: str, cell: str) -> None:
    assert cells_of(f'{{"p1": {value}}}', [Column.of("p1")]) == [cell]
    assert read(f'{{"p1": {value}}}', "p1") == NOT_A_NUMBER


@pytest.mark.parametrize(
    ("time", "cell"),
    [
        ("2026-03-01T10:00:00", "1772359200"),
        ("2026-03-01 10:00", "1772359200"),
        ("2026-03-01T10:00:00Z", "1772359200"),
        ("2026-03-01T11:00:00.250+01:00", "1772359200.250"),
        ("2026-03-01T10:00:00,123456789Z", "1772359200.123456789"),
        ("1772359200.5", "1772359200.5"),
        ("2026-02-30T10:00:00", "Time=2026-02-30T10:00:00"),
        ("ten o'clock", "Time=ten_o'clock"),
    ],
)
def test_a_time_may_be_in_iso_8601_with_the_decimals_that_it_has(time: str, cell: str) -> None:
    columns = [Column.of("Time"), Column.of("p1")]
    assert cells_of(f'{{"Time": "{time}", "p1": 1}}', columns) == [cell, "1"]


def test_a_time_in_iso_8601_is_not_one_in_milliseconds() -> None:
    assert read('{"time_ms": "2026-03-01T10:00:00", "p1": 1}', "time_ms", "p1") == NOT_A_NUMBER


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "Expecting property name"),
        ('{"p1": 1, "p1": 2}', "the key p1 is given twice"),
        ('{"a.b": 1, "a": {"b": 2}}', "the key a.b is given twice"),
        ('{"a":' * 41 + "1" + "}" * 41, "nested in more than 40 levels"),
        ("[" * 3000, "Expecting value|nested in more than 40 levels"),
        ('{"p1": ' + "9" * 4400 + "}", "4300 digits"),
    ],
)
def test_what_is_not_valid_json_has_a_reason(text: str, said: str) -> None:
    one = refused(text, "p1")
    assert one.reason == NOT_JSON
    assert any(words in one.example for words in said.split("|"))


def test_a_list_has_as_many_values_as_there_are_columns() -> None:
    assert read("[1, null]", "p1", "p2").values[0] == 1.0
    one = refused("[1]", "p1", "p2")
    assert (one.reason, one.example) == (OTHER_CELLS, "1 value for 2 columns: [1]")
    assert refused("[]", "p1").reason == OTHER_CELLS
