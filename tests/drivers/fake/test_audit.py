"""A capture is compared with the numbers in its pictures: what is wrong and not declared is a lie."""

from grabberd_fake.__main__ import Judged, lies_of
from grabberd_fake.faults import PERIOD_NS


def field(n: int, camera_n: int, late_ns: int = 0, reason: str | None = None) -> Judged:
    return Judged(n, camera_n, camera_n * PERIOD_NS + late_ns, reason)


def test_a_field_that_is_entered_elsewhere_is_a_lie() -> None:
    (lie,) = lies_of([field(0, 100), field(1, 101), field(2, 104)], 100)
    assert lie == "field 2 is the camera's 104, 2 places from where it is entered"


def test_a_number_that_is_said_to_be_uncertain_by_as_much_is_none() -> None:
    doubtful = field(2, 104, reason="number uncertain by up to 2")
    assert list(lies_of([field(0, 100), field(1, 101), doubtful], 100)) == []
    assert len(list(lies_of([field(0, 100), field(1, 102), doubtful], 100))) == 1


def test_a_capture_that_begins_elsewhere_than_asked_for_is_a_lie() -> None:
    assert list(lies_of([field(0, 101)], 100)) == []
    assert len(list(lies_of([field(0, 102)], 100))) == 1


def test_a_time_that_is_off_by_a_whole_field_is_a_lie() -> None:
    (lie,) = lies_of([field(0, 100, late_ns=PERIOD_NS + 1_000_000)], 100)
    assert "-21 ms" in lie


def test_where_times_are_not_those_of_a_clock_only_the_order_is_judged() -> None:
    assert list(lies_of([field(0, 7, late_ns=10**12), field(1, 8)], None)) == []
    assert len(list(lies_of([field(0, 7), field(1, 9)], None))) == 1


def test_a_doubt_excuses_no_field_after_it() -> None:
    fields = [field(0, 100), field(1, 103, reason="number uncertain by up to 2"), field(2, 104)]
    assert list(lies_of(fields, 100)) == ["field 2 is the camera's 104, 2 places from where it is entered"]


def test_numbers_that_are_said_to_be_off_are_judged_by_that() -> None:
    fields = [field(0, 100), field(1, 101), field(5, 102), field(6, 103)]
    assert len(list(lies_of(fields, 100))) == 2
    assert list(lies_of(fields, 100, [(5, 3)])) == []
    assert len(list(lies_of(fields, 100, [(6, 3)]))) == 1
