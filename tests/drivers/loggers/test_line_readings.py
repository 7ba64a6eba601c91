"""Readings out of lines: dated by the logger's time, its rate, or their arrival; nonsense is named."""

import numpy as np
import pytest

from grabberd.core.channels import Dating
from grabberd.core.channels.dating import CLOCK_JUMPED, MISSING
from grabberd.errors import StreamFailed
from grabberd_loggers.lines import HEADER_AGAIN, NOT_A_NUMBER, OTHER_CELLS, REPEATED, LineFormat, LineReadings

HEADER = "time_ms,p1 [kPa]"
MS, START_NS = 1_000_000, 50_000_000_000


def timed() -> LineReadings:
    return LineReadings(LineFormat.of_header(HEADER), None, False)


def say(lines: LineReadings, first: int, count: int, step_ms: int = 10, times: int = 1):
    """Lines of a logger with a reading each `step_ms`; `times` as large numbers."""
    found = []
    for number in range(first, first + count):
        text = f"{number * step_ms * times},{number % 7}"
        found.append(lines.take([text], START_NS + number * step_ms * MS + 2 * MS))
    return found


def reasons(found) -> list[str]:
    return [anomaly.reason for readings in found for anomaly in readings.anomalies]


def test_the_loggers_own_time_dates_its_readings() -> None:
    lines = timed()
    found = say(lines, 0, 300)
    steps = np.diff(np.concatenate([one.time_ns for one in found]))
    assert np.abs(steps - 10 * MS).max() < 1_000
    assert lines.dating is Dating.OWN_CLOCK
    assert reasons(found) == []


def test_a_rate_dates_lines_that_carry_no_time() -> None:
    lines = LineReadings(LineFormat.of_columns(["p1 [kPa]"]), 100.0, False)
    assert lines.dating is Dating.OWN_CLOCK
    jitter = np.random.default_rng(0).exponential(3 * MS, 1000)
    found = [lines.take(["41.9"], START_NS + n * 10 * MS + int(jitter[n])) for n in range(1000)]
    time_ns = np.concatenate([one.time_ns for one in found])
    late = (time_ns - START_NS - np.arange(1000) * 10 * MS) / MS
    assert late[500:].std() < 0.2


def test_lines_that_are_lost_on_the_way_are_counted_by_the_rate() -> None:
    lines = LineReadings(LineFormat.of_columns(["p1 [kPa]"]), 100.0, False)
    arrivals = [n for n in range(3000) if not 1500 <= n < 1503]
    found = [lines.take(["41.9"], START_NS + n * 10 * MS) for n in arrivals]
    (anomaly,) = [anomaly for one in found for anomaly in one.anomalies]
    assert (anomaly.reason, anomaly.lost) == (MISSING, 3)


def test_without_both_they_are_dated_by_their_arrival() -> None:
    lines = LineReadings(LineFormat.of_columns(["p1 [kPa]"]), None, False)
    assert lines.dating is Dating.ARRIVAL
    assert lines.take(["41.9"], START_NS).time_ns.tolist() == [START_NS]


@pytest.mark.parametrize(
    ("text", "reason"), [("12,x", NOT_A_NUMBER), ("12,1,2", OTHER_CELLS), ("!", OTHER_CELLS)]
)
def test_nonsense_is_named_and_the_reading_goes_on(text: str, reason: str) -> None:
    lines = timed()
    say(lines, 0, 20)
    found = lines.take([text, "300,41.9"], START_NS + 302 * MS)
    assert (found.anomalies[0].reason, found.anomalies[0].example) == (reason, text)
    assert found.values.tolist() == [[41.9]]


def test_a_spoilt_line_is_lost_once() -> None:
    by_time = timed()
    found = say(by_time, 0, 50)
    found += [by_time.take(["!"], START_NS + 502 * MS), *say(by_time, 51, 50)]
    by_arrival = LineReadings(LineFormat.of_columns(["p1 [kPa]"]), None, False).take(["41.9", "!"], START_NS)
    for readings in (found, [by_arrival]):
        assert sum(anomaly.lost for one in readings for anomaly in one.anomalies) == 1


def test_comments_say_nothing() -> None:
    found = timed().take(["# warming up", "0,41.9"], START_NS)
    assert (len(found.time_ns), found.anomalies) == (1, ())


def test_a_repeated_line_is_named_and_counts_once() -> None:
    lines = timed()
    say(lines, 0, 20)
    found = lines.take(["200,1.0", "200,1.0", "210,1.0"], START_NS + 212 * MS)
    assert len(found.time_ns) == 2
    assert reasons([found]) == [REPEATED]


def test_missing_lines_are_counted() -> None:
    lines = timed()
    found = say(lines, 0, 50) + say(lines, 54, 50)
    assert [(one.reason, one.lost) for readings in found for one in readings.anomalies] == [(MISSING, 4)]


def test_a_header_that_comes_again_is_named_since_the_logger_has_restarted() -> None:
    lines = timed()
    found = [*say(lines, 0, 500), lines.take([HEADER, "0,41.9"], START_NS + 5100 * MS)]
    assert reasons(found) == [HEADER_AGAIN, CLOCK_JUMPED]


def test_another_unit_in_a_later_header_ends_the_stream() -> None:
    lines = timed()
    with pytest.raises(StreamFailed, match="announces other columns") as caught:
        lines.take(["time_ms,p1 [mbar]"], START_NS)
    assert caught.value.hint


@pytest.mark.parametrize("bits", [16, 32])
def test_a_counter_that_wraps_goes_on(bits: int) -> None:
    lines = timed()
    top = 2**bits
    found = [
        lines.take([f"{(top - 5000 + n * 10) % top},1"], START_NS + n * 10 * MS + 2 * MS) for n in range(1000)
    ]
    assert reasons(found) == []
    assert np.abs(np.diff(np.concatenate([one.time_ns for one in found])) - 10 * MS).max() < 1_000


def test_a_first_line_that_may_have_lost_its_beginning_is_left_out() -> None:
    lines = LineReadings(LineFormat.of_columns(["p1 [kPa]"]), None, begins_anywhere=True)
    found = lines.take(["1.9", "41.9"], START_NS)
    assert found.values.tolist() == [[41.9]]


def test_what_is_shown_of_a_line_is_short_and_printable() -> None:
    (anomaly,) = timed().take(["\x1b[31m" + "x" * 300], START_NS).anomalies
    assert len(anomaly.example) <= 60
    assert anomaly.example.isprintable()


def test_a_wrong_unit_of_time_is_refused() -> None:
    with pytest.raises(StreamFailed, match="times as fast"):
        say(timed(), 0, 2000, times=1000)
