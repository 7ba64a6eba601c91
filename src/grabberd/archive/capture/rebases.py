"""Rebases of a capture among its metadata, as the key `rebases` of `extra`."""

from collections.abc import Mapping, Sequence
from typing import Any

from grabberd.core.ledger import LedgerEvent, Rebase

KEY = "rebases"


def with_rebases(extra: Mapping[str, Any], events: Sequence[LedgerEvent]) -> Mapping[str, Any]:
    """The same metadata with these events."""
    return {**extra, KEY: [event._asdict() for event in events]} if events else extra


def rebases_in(extra: Mapping[str, Any]) -> list[LedgerEvent]:
    """The events in a capture's metadata; none in files of earlier versions.

    Raises:
        ValueError: They are damaged.
    """
    return [_event(one) for one in extra.get(KEY, ())]


def _event(stored: Any) -> LedgerEvent:
    match stored:
        case {"n": int(n), "kind": str(kind), "reason": str(reason)}:
            return LedgerEvent(n, Rebase(kind), reason)
    raise ValueError(f"a rebase is {stored!r}")
