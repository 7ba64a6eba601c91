"""Lines out of pieces."""

from hypothesis import given
from hypothesis import strategies as st

from grabberd_loggers.lines import LONGEST, LineBuffer


@given(
    st.lists(st.integers(0, 999), min_size=1),
    st.lists(st.integers(1, 7), min_size=1),
    st.sampled_from("\r\n"),
)
def test_lines_are_the_same_however_they_are_cut(numbers: list[int], cuts: list[int], end: str) -> None:
    data = "".join(f"{number}{end}" for number in numbers).encode()
    buffer, found, place = LineBuffer(), [], 0
    while place < len(data):
        step = cuts[place % len(cuts)]
        lines, overlong = buffer.feed(data[place : place + step])
        found += lines
        assert overlong == 0
        place += step
    assert found == [str(number) for number in numbers]


def test_a_piece_waits_for_its_end() -> None:
    buffer = LineBuffer()
    assert buffer.feed(b"12") == ([], 0)
    assert buffer.feed(b"3\r\n4") == (["123"], 0)
    assert buffer.feed(b"5\n") == (["45"], 0)


def test_bytes_that_are_no_text_are_replaced() -> None:
    assert LineBuffer().feed(b"\xff1\n") == (["\ufffd1"], 0)


def test_a_line_without_an_end_is_dropped_once_and_the_next_one_read() -> None:
    buffer = LineBuffer()
    assert buffer.feed(b"x" * (LONGEST + 1)) == ([], 1)
    assert buffer.feed(b"x" * (LONGEST + 1)) == ([], 0)
    assert buffer.feed(b"x\n7\n") == (["7"], 0)


def test_a_line_that_is_too_long_at_once_is_dropped() -> None:
    assert LineBuffer().feed(b"x" * (LONGEST + 1) + b"\n7\n") == (["7"], 1)
