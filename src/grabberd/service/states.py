"""The states of a device, and which may follow which. Nothing else."""

from enum import StrEnum


class DeviceState(StrEnum):
    """What an operator needs to know of a grabber, in a word."""

    ABSENT = "absent"
    OPENING = "opening"
    NO_SIGNAL = "no_signal"
    READY = "ready"
    CAPTURING = "capturing"
    RECOVERING = "recovering"
    FAILED = "failed"
    ENDED = "ended"


_S = DeviceState

TRANSITIONS: dict[DeviceState, frozenset[DeviceState]] = {
    _S.ABSENT: frozenset({_S.OPENING}),
    _S.OPENING: frozenset({_S.ABSENT, _S.READY, _S.NO_SIGNAL, _S.FAILED, _S.CAPTURING}),
    _S.NO_SIGNAL: frozenset({_S.READY, _S.CAPTURING, _S.RECOVERING, _S.ENDED}),
    _S.READY: frozenset({_S.CAPTURING, _S.NO_SIGNAL, _S.RECOVERING, _S.ENDED}),
    _S.CAPTURING: frozenset({_S.READY, _S.NO_SIGNAL, _S.RECOVERING, _S.ENDED}),
    _S.RECOVERING: frozenset({_S.OPENING}),
    _S.FAILED: frozenset({_S.OPENING}),
    _S.ENDED: frozenset({_S.OPENING}),
}
"""`ended` is a recording that has been played to its end; a real grabber never gets there."""


def may_follow(current: DeviceState, following: DeviceState) -> bool:
    """Whether `following` may come after `current`; staying is always allowed."""
    return following is current or following in TRANSITIONS[current]
