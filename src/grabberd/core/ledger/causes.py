"""Causes: where to look for what has cost a field, by the reason in the ledger."""

from enum import StrEnum

from grabberd.core.ledger.ledger import NO_SIGNAL, UNACCOUNTED, UNCERTAIN, Outcome


class LossCause(StrEnum):
    """Place to look at."""

    COMPUTER = "computer"
    """The computer was busy, or the program was stopped or ended: it took no fields in time."""
    CABLE = "cable"
    """Bus or cable: the program asked in time for fields that did not come, or came in part."""
    CAMERA = "camera"
    """The camera or its signal."""
    CONTENT = "content"
    """The picture shows what nobody told: lines shifted, stale or repeated."""
    DEVICE = "device"
    """The grabber was gone, or had stopped, or its driver did not return from a call."""
    DISK = "disk"
    UNKNOWN = "unknown"


_BY_REASON = (
    ("computer busy", LossCause.COMPUTER),
    ("program stopped", LossCause.COMPUTER),
    ("driver hung", LossCause.DEVICE),
    ("the program ended", LossCause.COMPUTER),
    ("ring overrun", LossCause.COMPUTER),
    ("disk too slow", LossCause.DISK),
    ("not written to disk", LossCause.DISK),
    ("time gap", LossCause.CABLE),
    ("sequence gap", LossCause.CABLE),
    ("repeated parity", LossCause.CABLE),
    ("the driver flags an error", LossCause.CABLE),
    ("short:", LossCause.CABLE),
    ("parity contradicts time", LossCause.CAMERA),
    (UNCERTAIN, LossCause.UNKNOWN),
    ("nothing came", LossCause.UNKNOWN),
    (NO_SIGNAL, LossCause.CAMERA),
    (UNACCOUNTED, LossCause.UNKNOWN),
)
_BY_OUTCOME = {
    Outcome.LOST: LossCause.DEVICE,
    Outcome.DAMAGED: LossCause.CONTENT,
    Outcome.NO_SIGNAL: LossCause.CAMERA,
    Outcome.OVERRUN: LossCause.COMPUTER,
}
"""Of all other reasons: those of lost fields are the drivers' own words, those of damaged ones come from the
checks of the content."""


def cause_of_loss(outcome: Outcome, reason: str) -> LossCause:
    """Cause of an entry of the ledger.

    Raises:
        KeyError: The outcome is `received`.
    """
    return next((cause for words, cause in _BY_REASON if reason.startswith(words)), _BY_OUTCOME[outcome])
