"""What a vacuum logger wrote."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from grabberd.errors import InputError
from grabberd_liner.analysis.vacuum.vacuum_log import read_vacuum_log


def text(scale=1.0, head="time_s,pulsation_vacuum_kpa,liner_vacuum_kpa", shift=0.0):
    rows = [
        f"{k * 0.01:.3f},{(42 * (k % 100 < 60) + shift) * scale:.4f},{42 * scale:.4f}" for k in range(300)
    ]
    return "\n".join([head, *rows])


def test_times_and_both_vacuums_are_read() -> None:
    log = read_vacuum_log(text())
    assert (len(log.time_s), log.step_s) == (300, pytest.approx(0.01))
    assert (log.pulsation_kpa.max(), log.liner_kpa.min()) == (42.0, 42.0)
    assert log.gaps_s == []


def test_milliseconds_semicolons_and_decimal_commas_are_read() -> None:
    rows = "\n".join(f"{k * 10};{'42,5' if k % 100 < 60 else '0,1'}" for k in range(200))
    log = read_vacuum_log("\ufefftime_ms;pulsation_vacuum_kpa\r\n" + rows)
    assert_allclose(log.time_s[:3], [0, 0.01, 0.02])
    assert log.pulsation_kpa[0] == 42.5
    assert log.liner_kpa is None


@pytest.mark.parametrize(
    ("head", "row", "said"),
    [
        (
            "time_ms,pulsation_vacuum_kpa",
            "{},42,01",
            "line 2 has 3 cells, the header 2: decimal commas between commas",
        ),
        (
            "time_ms,pulsation_vacuum_kpa,liner_vacuum_kpa",
            "{},42,0,41,9",
            "line 2 has 5 cells, the header 3: decimal commas",
        ),
        ("time_ms,pulsation_vacuum_kpa,liner_vacuum_kpa", "{},42", "line 2 has 2 cells, the header 3"),
        ("time_ms;pulsation_vacuum_kpa", "1,{:03d};42.01", "both '1,000' and '42.01'"),
    ],
)
def test_numbers_that_could_be_others_are_refused(head: str, row: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_vacuum_log("\n".join([head, *(row.format(10 * k) for k in range(60))]))


def test_a_unit_that_is_stated_is_converted_and_never_guessed() -> None:
    rows = "\n".join(f"{k * 10},{425 if k % 100 < 60 else 1}" for k in range(200))
    log = read_vacuum_log(f"time (ms),Pulsation vacuum [mbar]\n{rows}")
    assert (log.step_s, log.pulsation_kpa[0]) == (pytest.approx(0.01), pytest.approx(42.5))
    for head, said in (
        ("time (ms),Pulsation vacuum", "the unit of its column Pulsation vacuum is not stated"),
        ("time (ms),Pulsation vacuum [V]", "the unit of its column Pulsation vacuum is V"),
        ("time [min],pulsation_vacuum_kpa", "the unit of its column time is min"),
    ):
        with pytest.raises(InputError, match=said):
            read_vacuum_log(f"{head}\n{rows}")
    with pytest.raises(InputError, match="the unit of its column liner_vacuum is not stated"):
        read_vacuum_log(text(head="time_s,pulsation_vacuum_kpa,liner_vacuum"))


@pytest.mark.parametrize("form", ["2026-03-01T09:59:59.{:02d}0Z", "2026-03-01 09:59:59,{:02d}"])
def test_dates_with_times_of_day_count_from_the_first(form: str) -> None:
    rows = [f"{form.format(k)};42.0" for k in range(60)]
    log = read_vacuum_log("\n".join(["TIMESTAMP;pulsation_vacuum_kpa", *rows]))
    assert_allclose(log.time_s, np.arange(60) / 100, atol=1e-9)


@pytest.mark.parametrize("moment", ["01.03.2026 10:00:00", "10:00:00.010", "2026-03-01", "1000", ""])
def test_other_dates_and_times_are_refused_by_name(moment: str) -> None:
    rows = ["2026-03-01T10:00:00,42.0", *[f"{moment},42.0"] * 60]
    with pytest.raises(
        InputError, match=f"line 3: time is '{moment}', not a date with a time of day"
    ) as caught:
        read_vacuum_log("\n".join(["time,pulsation_vacuum_kpa", *rows]))
    assert "time_s" in caught.value.hint


def test_times_with_and_without_a_zone_have_no_difference() -> None:
    rows = ["2026-03-01T10:00:00,42.0", "2026-03-01T10:00:00.01Z,42.0"]
    with pytest.raises(
        InputError, match=r"line 3: time is .* and only one of it and the first, .* states its time zone"
    ):
        read_vacuum_log("\n".join(["time,pulsation_vacuum_kpa", *rows]))


def test_empty_cells_at_the_end_of_a_line_are_none() -> None:
    rows = [f"{k * 0.01:.2f},42.0,," for k in range(60)]
    assert len(read_vacuum_log("\n".join(["time_s,pulsation_vacuum_kpa", *rows])).time_s) == 60


@pytest.mark.parametrize(
    ("scale", "unit"),
    [(10.0, "mbar"), (1000.0, "Pa"), (0.2953, "inHg"), (7.5006, "mmHg"), (0.01, "bar")],
)
def test_another_unit_is_named_by_its_magnitude_and_refused(scale: float, unit: str) -> None:
    with pytest.raises(InputError, match="reaches") as caught:
        read_vacuum_log(text(scale))
    assert unit in caught.value.hint


def test_a_log_that_no_logger_wrote_is_refused_by_its_line() -> None:
    with pytest.raises(InputError, match="line 2 is not CSV"):
        read_vacuum_log('time_s,pulsation_vacuum_kpa\n"' + "1" * 200_000)
    with pytest.raises(InputError, match="more than 1000000 rows"):
        read_vacuum_log("time_s,pulsation_vacuum_kpa\n" + "1,2\n" * 1_000_001)
    with pytest.raises(InputError, match="line 301 has 1 cell, the header 3"):
        read_vacuum_log(text().rpartition("\n")[0] + "\n3")


def test_absolute_pressure_is_no_vacuum() -> None:
    with pytest.raises(InputError, match="reaches") as caught:
        read_vacuum_log(text(shift=58.0))
    assert "absolute pressure" in caught.value.hint


def test_pressure_over_atmosphere_is_no_vacuum() -> None:
    with pytest.raises(InputError, match="goes down to -42") as caught:
        read_vacuum_log(text(-1.0))
    assert "sign" in caught.value.hint


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t: t.replace("time_s", "t"), "has no column time_s or time_ms: line 1 names t, pulsation"),
        (
            lambda t: t.replace("pulsation_vacuum_kpa", "vacuum"),
            "has no column pulsation_vacuum_kpa: line 1 names time_s, vacuum",
        ),
        (lambda t: "", "time_ms, pulsation_vacuum_kpa: it is empty"),
        (
            lambda t: t.replace("0.050,42.0000", "0.050,n/a"),
            "line 7: pulsation_vacuum_kpa is 'n/a', not a number",
        ),
        (lambda t: t.replace("0.050,42.0000,42.0000", "0.050"), "line 7 has 1 cell, the header 3"),
        (lambda t: t.replace("\n0.050,", "\n0.030,"), "reading 6 is at 0.03 s"),
        (lambda t: "\n".join(t.splitlines()[:5]), "has 4 readings"),
    ],
)
def test_what_cannot_be_read_is_named(change: object, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_vacuum_log(change(text()))


def test_points_for_thousands_in_milliseconds_are_no_microseconds():
    rows = "".join(f"1.{5 * k:03d};42\n" for k in range(60))
    with pytest.raises(InputError, match=r"5 us apart: .* points for thousands"):
        read_vacuum_log("time_ms;pulsation_vacuum_kpa\n" + rows)
    assert read_vacuum_log("time_s;pulsation_vacuum_kpa\n" + rows).step_s == pytest.approx(0.005)
