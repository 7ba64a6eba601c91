"""Where to look for what has cost a field."""

import pytest

from grabberd.core.ledger import NO_SIGNAL, LossCause, Outcome, cause_of_loss
from grabberd.instrument.acquisition import Standstill


@pytest.mark.parametrize(
    ("outcome", "reason", "cause"),
    [
        ("lost", Standstill(10**9, 10**9, 0).reason, "computer"),
        ("lost", Standstill(10**9, 0, 0).reason, "computer"),
        ("lost", "time gap", "cable"),
        ("lost", "sequence gap", "cable"),
        ("damaged", "short: 12 of 415 bytes", "cable"),
        ("damaged", "shifted by 40 px from line 28", "content"),
        ("damaged", "repeated", "content"),
        ("damaged", "number uncertain by up to 2", "unknown"),
        ("no_signal", NO_SIGNAL, "camera"),
        ("no_signal", "no signal: snow", "camera"),
        ("lost", "unplugged", "device"),
        ("lost", "no field for 0.8 s", "device"),
        ("overrun", "ring overrun", "computer"),
        ("overrun", "disk too slow", "disk"),
        ("lost", "the program ended while it was recording; unknown, at most 7", "computer"),
    ],
)
def test_every_reason_has_its_cause(outcome: str, reason: str, cause: str) -> None:
    assert cause_of_loss(Outcome(outcome), reason) is LossCause(cause)


def test_a_good_field_has_none() -> None:
    with pytest.raises(KeyError):
        cause_of_loss(Outcome.RECEIVED, "time predicted (late timestamp)")
