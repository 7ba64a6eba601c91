"""The states of a device, and which may follow which. Nothing else."""

from grabberd.documents.states import DeviceState

__all__ = ["TRANSITIONS", "DeviceState", "may_follow"]

_S = DeviceState
_STREAMING = frozenset({_S.NO_SIGNAL, _S.READY, _S.CAPTURING})
_TROUBLED = frozenset({_S.ABSENT, _S.RECOVERING, _S.FAILED})

TRANSITIONS: dict[DeviceState, frozenset[DeviceState]] = {
    _S.OPENING: _STREAMING | _TROUBLED | {_S.ENDED},
    **{state: (_STREAMING - {state}) | _TROUBLED | {_S.ENDED} for state in _STREAMING},
    **{state: (_TROUBLED - {state}) | {_S.OPENING, _S.ENDED} for state in _TROUBLED},
    _S.ENDED: frozenset({_S.OPENING}),
}
"""From trouble the way back leads through `opening`: the device is open, its first field still to come.

`absent` and `failed` are tried again by themselves; `recovering` is being helped. `ended` is a recording that
has been played to its end; a real grabber never gets there.
"""


def may_follow(current: DeviceState, following: DeviceState) -> bool:
    """Whether `following` may come after `current`; staying is always allowed."""
    return following is current or following in TRANSITIONS[current]
