"""The table of states."""

import pytest

from grabberd.service.device.device_state import TRANSITIONS, DeviceState, may_follow


def test_every_state_has_a_row_and_a_way_out() -> None:
    assert set(TRANSITIONS) == set(DeviceState)
    assert all(TRANSITIONS[state] for state in DeviceState)


@pytest.mark.parametrize("state", DeviceState)
def test_every_state_can_get_to_ready(state: DeviceState) -> None:
    reached, before = {state}, set()
    while reached != before:
        before = set(reached)
        reached |= {after for one in before for after in TRANSITIONS[one]}
    assert DeviceState.READY in reached


@pytest.mark.parametrize("state", DeviceState)
def test_staying_is_always_allowed(state: DeviceState) -> None:
    assert may_follow(state, state)


def test_a_device_is_not_ready_before_it_was_opened() -> None:
    assert not may_follow(DeviceState.ABSENT, DeviceState.READY)
    assert not may_follow(DeviceState.RECOVERING, DeviceState.CAPTURING)


@pytest.mark.parametrize("state", [DeviceState.ABSENT, DeviceState.RECOVERING, DeviceState.FAILED])
def test_from_trouble_the_way_to_the_stream_leads_through_opening(state: DeviceState) -> None:
    streaming = {DeviceState.NO_SIGNAL, DeviceState.READY, DeviceState.CAPTURING}
    assert DeviceState.OPENING in TRANSITIONS[state]
    assert not streaming & TRANSITIONS[state]


@pytest.mark.parametrize("state", [one for one in DeviceState if one is not DeviceState.ENDED])
def test_every_state_but_the_end_can_come_to_trouble(state: DeviceState) -> None:
    for trouble in (DeviceState.ABSENT, DeviceState.RECOVERING, DeviceState.FAILED):
        assert may_follow(state, trouble)
