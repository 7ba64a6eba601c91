"""Whatever goes wrong, the account of fields is true, or says by how much it may be off."""

import pytest

from grabberd_fake.audit import Judged, lies_of
from grabberd_fake.faults import PERIOD_NS

from .cases import Case
from .judging import judged, judged_case

SEEDS = range(12)


@pytest.mark.parametrize("seed", SEEDS)
def test_no_account_lies(seed: int) -> None:
    assert judged(seed).lies == ()


@pytest.mark.parametrize("counts", ["fields", "nothing"])
@pytest.mark.parametrize("order", ["alternate", "top_first"])
@pytest.mark.parametrize("freezes", [1, 2])
@pytest.mark.parametrize("freeze_s", [0.6, 6.0])
def test_a_capture_after_a_freeze_is_complete_with_its_numbers_and_times(
    freeze_s: float, freezes: int, order: str, counts: str
) -> None:
    driver = {"order": order, "stamps": "exposure", "counts": counts, "jitter_ms": 2.0}
    begins_s = [1.0 + (freeze_s + 1.0) * i for i in range(freezes)]
    over_s = begins_s[-1] + freeze_s + 1.0
    case = Case(
        seed=3,
        kinds=("program frozen",),
        driver=driver,
        buffers=16,
        faults=[{"kind": "freeze", "at_s": at_s, "duration_s": freeze_s} for at_s in begins_s],
        start_s=over_s,
        stop_s=over_s + 3.0,
        pre_fields=10,
        fields=None,
    )
    found = judged_case(case)
    assert found.lies == ()
    assert found.complete
    assert found.found.judged == found.found.fields >= 150


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


@pytest.mark.parametrize("mean_ms", [30, 60])
@pytest.mark.parametrize("counts", ["fields", "nothing"])
@pytest.mark.parametrize("order", ["alternate", "top_first"])
def test_stamps_of_arrivals_on_a_busy_computer_are_accounted_for(
    order: str, counts: str, mean_ms: int
) -> None:
    """A queue that drains looks like losses; that as many were not lost is told when it is known."""
    case = Case(
        seed=mean_ms,
        kinds=("computer busy",),
        driver={"order": order, "stamps": "arrival", "counts": counts, "jitter_ms": 2.0},
        buffers=16,
        faults=[{"kind": "busy", "at_s": 3.0, "duration_s": 3.0, "mean_ms": mean_ms}],
        start_s=2.0,
        stop_s=8.0,
        pre_fields=0,
        fields=None,
    )
    assert judged_case(case).lies == ()
