"""What becomes of the simulated grabber's faults, in simulated time: how soon noticed, how soon back.

The clock moves only while somebody waits, so the times are what the program itself adds; the computer's own
comes on top.
"""

from typing import Any

import pytest
from simulated_time import Run, SimulatedClock

from grabberd.core.ledger import Outcome
from grabberd.documents.enums import DeviceState
from grabberd.errors import GrabberdError
from grabberd_fake import FakeGrabber

S = DeviceState
NOTICED_S = 1.0
BACK_S = 3.0


def run(end_s: float, *faults: dict[str, Any]) -> Run:
    clock = SimulatedClock()
    grabber = FakeGrabber(clock=clock, scene="blank", faults=list(faults))
    return Run(grabber, clock, end_s)


@pytest.mark.parametrize("away_s", [0.1, 0.5, 1.3, 5.0, 61.7, 3600.0])
def test_an_unplugged_grabber_is_missed_at_once_and_back_within_a_second_of_its_return(away_s: float) -> None:
    one = run(away_s + 3.0, {"kind": "unplug", "at_s": 1.0, "back_after_s": away_s})
    assert one.first(S.RECOVERING) - 1.0 < 0.1
    assert one.first(S.READY, after_s=1.05) - (1.0 + away_s) < 1.2
    assert one.recoveries.get("restart") is None
    assert one.recoveries.get("reset") is None


@pytest.mark.parametrize(
    ("until", "taken"),
    [
        ("restart", {"restart": 1}),
        ("reopen", {"restart": 1, "reopen": 1}),
        ("reset", {"restart": 1, "reopen": 1, "reset": 1}),
    ],
)
@pytest.mark.parametrize("kind", ["stall", "fail"])
def test_a_grabber_that_delivers_no_more_is_helped_no_harder_than_it_needs(
    kind: str, until: str, taken: dict[str, int]
) -> None:
    one = run(6.0, {"kind": kind, "at_s": 1.0, "until": until})
    noticed_s = one.first(S.RECOVERING)
    assert noticed_s - 1.0 < NOTICED_S
    assert one.first(S.READY, after_s=noticed_s) - 1.0 < BACK_S
    assert one.recoveries == taken
    (gap,) = one.lost
    assert gap.reason in ("no field for 0.8 s", "the simulated grabber's stream has failed")


def test_a_stall_that_ends_by_itself_is_over_with_the_restart() -> None:
    one = run(6.0, {"kind": "stall", "at_s": 1.0, "duration_s": 1.5})
    assert one.first(S.RECOVERING) - 1.0 < NOTICED_S
    assert one.first(S.READY, after_s=1.1) - 2.5 < 0.2
    assert one.board.now.outcomes[Outcome.LOST] == pytest.approx(75, abs=3)


@pytest.mark.slow
def test_a_grabber_that_nothing_helps_has_failed_and_is_back_when_it_delivers_again() -> None:
    one = run(92.0, {"kind": "stall", "at_s": 1.0, "duration_s": 70.0})
    assert one.first(S.FAILED) < 6.0
    assert one.first(S.READY, after_s=1.1) - 71.0 < 31.0
    assert one.states[-1] is S.READY
    assert one.recoveries["reset"] == 2


def test_one_that_stalls_after_a_few_fields_each_time_climbs_on() -> None:
    stalls = [{"kind": "stall", "at_s": 1.0 + 2 * n, "duration_s": 100, "until": "restart"} for n in range(8)]
    assert run(20.0, *stalls).recoveries["reset"] == 1


def test_one_that_stalls_now_and_then_is_only_restarted() -> None:
    stalls = [{"kind": "stall", "at_s": 12.0 * n, "until": "restart"} for n in (1, 2)]
    assert run(26.0, *stalls).recoveries == {"restart": 2}


@pytest.mark.parametrize(("why", "hint"), [("busy", "end that program"), ("rights", "group")])
def test_a_refused_grabber_has_failed_with_a_hint_until_it_may_be_opened(why: str, hint: str) -> None:
    one = run(
        20.0,
        {"kind": "unplug", "at_s": 1.0, "back_after_s": 1.0},
        {"kind": "refuse", "at_s": 1.9, "duration_s": 4.0, "why": why},
    )
    assert S.FAILED in one.states
    failed = next(seen for seen in one.seen if seen.state is S.FAILED)
    assert failed.cause
    assert "refused" in failed.cause
    assert hint in str(failed.hint)
    assert one.states[-1] is S.READY
    assert one.first(S.READY, after_s=2.0) - 5.9 < BACK_S


def test_rights_that_come_a_moment_after_the_device_cost_less_than_a_second() -> None:
    one = run(
        8.0,
        {"kind": "unplug", "at_s": 1.0, "back_after_s": 2.0},
        {"kind": "refuse", "at_s": 2.9, "duration_s": 0.5},
    )
    assert one.first(S.READY, after_s=2.0) - 3.4 < 1.0


def test_another_standard_is_other_pictures_and_so_is_the_old_one_when_it_returns() -> None:
    one = run(14.0, {"kind": "standard", "at_s": 1.0, "duration_s": 11.0})
    assert ["NTSC" in error.message.split("not")[0] for error in one.ended] == [True, False]
    assert one.recoveries == {"restart": 2, "reopen": 2}
    assert one.states[-1] is S.READY


def test_captures_are_told_of_each_interruption_with_its_error() -> None:
    told: list[GrabberdError] = []
    clock = SimulatedClock()
    faults = [{"kind": "stall", "at_s": 1.0, "until": "restart"}]
    Run(FakeGrabber(clock=clock, scene="blank", faults=faults), clock, 4.0, told.append)
    assert [error.message for error in told] == ["no field for 0.8 s"]


def test_the_first_reason_is_what_the_fields_are_lost_for() -> None:
    one = run(
        6.0,
        {"kind": "stall", "at_s": 1.0, "duration_s": 1.0},
        {"kind": "unplug", "at_s": 2.0, "back_after_s": 2.0},
    )
    (gap,) = one.lost
    assert gap.reason == "no field for 0.8 s"
    assert gap.count == pytest.approx(3 * 50, abs=60)


def test_the_first_field_after_a_signal_that_was_away_is_received() -> None:
    faults = [{"kind": "no_signal", "at_field": 60, "duration_s": 0.7}]
    clock = SimulatedClock()
    one = Run(FakeGrabber(clock=clock, scene="blank", faults=faults), clock, 4.0)
    absent = [slot.n for slot in one.taken if slot.outcome is Outcome.NO_SIGNAL]
    assert absent == list(range(60, 95))
