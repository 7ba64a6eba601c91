"""When measuring gives way to capturing."""

import pytest

from grabberd.instrument.device.field_pipeline import BEHIND_NS, CALM_NS, SPARE_S, Shedding

NOW_NS = 10**12


def test_nothing_gives_way_while_fields_are_taken_as_they_come() -> None:
    shedding = Shedding()
    shedding.saw(BEHIND_NS - 1, NOW_NS)
    assert shedding.pause_s(NOW_NS) == 0.0


def test_fields_are_measured_with_pauses_until_all_has_been_calm_for_a_second() -> None:
    shedding = Shedding()
    shedding.saw(BEHIND_NS, NOW_NS)
    shedding.saw(0, NOW_NS + CALM_NS // 2)
    assert shedding.pause_s(NOW_NS + CALM_NS - 1) == SPARE_S
    assert shedding.pause_s(NOW_NS + CALM_NS) == 0.0


@pytest.mark.parametrize("again_ns", [1, CALM_NS // 2])
def test_who_is_behind_again_gets_another_second(again_ns: int) -> None:
    shedding = Shedding()
    shedding.saw(BEHIND_NS, NOW_NS)
    shedding.saw(BEHIND_NS, NOW_NS + again_ns)
    assert shedding.pause_s(NOW_NS + CALM_NS) == SPARE_S
