"""What a driver's own count says of the steps from field to field."""

_WRAP = 2**32


class SequenceSteps:
    """Turns a driver's `sequence` into steps of fields.

    Where fields come one a buffer, some drivers give both fields of a frame the same number and some count
    each. It is learnt from the fields: until then, and after a restart of the count, there is no answer.

    Args:
        alternate: fields come one a buffer, so either numbering may be met; otherwise fields are counted.
    """

    def __init__(self, alternate: bool) -> None:
        self._alternate = alternate
        self._newer: int | None = None
        self._single_steps = 0
        self._last: tuple[int, int] | None = None

    def forget(self) -> None:
        """The count may begin anew; how it counts is remembered."""
        self._last = None

    def step(self, sequence: int | None, parity: int) -> int | None:
        """Fields from the last one to this one by the driver's count, or None where it does not tell."""
        last, self._last = self._last, None if sequence is None else (sequence, parity)
        if sequence is None or last is None:
            return None
        self._learn(sequence - last[0], parity)
        step = (self._index(sequence, parity) - self._index(*last)) % self._modulus
        return step if self._known and 0 < step < self._modulus // 2 else None

    @property
    def _known(self) -> bool:
        return not self._alternate or self._newer is not None or self._single_steps >= 2

    @property
    def _modulus(self) -> int:
        return _WRAP if self._newer is None else 2 * _WRAP

    def _learn(self, difference: int, parity: int) -> None:
        if self._alternate and difference == 0:
            self._newer = parity
        self._single_steps = self._single_steps + 1 if difference == 1 else 0 if self._single_steps < 2 else 2

    def _index(self, sequence: int, parity: int) -> int:
        return sequence if self._newer is None else 2 * sequence + (parity == self._newer)
