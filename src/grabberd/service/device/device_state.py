"""States of a device, and the transitions between them. Nothing else."""

from grabberd.documents.states import DeviceState

__all__ = ["TRANSITIONS", "DeviceState", "may_follow"]

_S = DeviceState
STREAMING = frozenset({_S.NO_SIGNAL, _S.READY, _S.CAPTURING})
"""The device delivers fields; a capture can be started."""
_TROUBLED = frozenset({_S.ABSENT, _S.RECOVERING, _S.FAILED})

TRANSITIONS: dict[DeviceState, frozenset[DeviceState]] = {
    _S.OPENING: STREAMING | _TROUBLED | {_S.ENDED},
    **{state: (STREAMING - {state}) | _TROUBLED | {_S.ENDED} for state in STREAMING},
    **{state: (_TROUBLED - {state}) | {_S.OPENING, _S.ENDED} for state in _TROUBLED},
    _S.ENDED: frozenset({_S.OPENING}),
}
"""From trouble the way back leads through `opening`: the device is open, its first field still to come.

`absent` and `failed` are retried automatically; `recovering` means that a step of the ladder is being taken.
`ended` is a recording that was played to its end; a real grabber never gets there.
"""


def may_follow(current: DeviceState, following: DeviceState) -> bool:
    """True if `following` may come after `current`; staying is always allowed."""
    return following is current or following in TRANSITIONS[current]
